"""Image files: their content, no partial files, and errors before the work starts."""

from __future__ import annotations

import os
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import OpenEXR
import pytest
from PIL import Image as Picture

from wgsss.errors import InputError, RenderError
from wgsss.output import FORMATS, check_output, replacing, save, save_frames
from wgsss.rendering import Image

WIDTH, HEIGHT = 7, 5  # odd, and not square


@pytest.fixture
def image() -> Image:
    random = np.random.default_rng(1)
    pixels = random.random((HEIGHT, WIDTH, 4), np.float32) * 9
    pixels[..., 3] = 1
    pixels[0] = 0  # a row in which nothing is seen
    display = (random.random((HEIGHT, WIDTH, 4)) * 255).astype(np.uint8)
    display[..., 3] = 255 * pixels[..., 3]
    depth = random.random((HEIGHT, WIDTH, 1), np.float32)
    depth[0] = np.inf
    aovs = {"irradiance": random.random((HEIGHT, WIDTH, 3), np.float32), "depth": depth, "normal": pixels[..., :3] / 9}
    graph: Any = None
    return Image(pixels, display, aovs, {}, "", graph, {"method": "deon07", "adapter": "a driver"})


def test_png_holds_the_image_for_a_display(image: Image, tmp_path: Path) -> None:
    assert save(image, tmp_path / "a.png") == [tmp_path / "a.png"]
    with Picture.open(tmp_path / "a.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), image.display)
        assert picture.text["wgsss.adapter"] == "a driver"  # type: ignore[attr-defined]


def test_exr_holds_linear_channels_layers_and_metadata(image: Image, tmp_path: Path) -> None:
    save(image, tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        found = {name: channel.pixels for name, channel in file.channels().items()}
        header = dict(file.header())
    wanted = {
        "R",
        "G",
        "B",
        "A",
        "irradiance.R",
        "irradiance.G",
        "irradiance.B",
        "depth.Z",
        "normal.X",
        "normal.Y",
        "normal.Z",
    }
    assert set(found) == wanted
    for i, name in enumerate("RGBA"):
        assert found[name].dtype == np.float32
        np.testing.assert_array_equal(found[name], image.pixels[..., i])
    np.testing.assert_array_equal(found["normal.Y"], image.aovs["normal"][..., 1])
    assert found["depth.Z"][0].tolist() == [0] * WIDTH  # no object: coverage is 0 and infinity is not written
    np.testing.assert_array_equal(found["depth.Z"][1:], image.aovs["depth"][1:, :, 0])
    assert header["wgsss.method"] == "deon07"


def test_npy_holds_linear_pixels_and_extra_outputs_are_files_beside_it(image: Image, tmp_path: Path) -> None:
    written = save(image, tmp_path / "a.npy")
    assert written == [tmp_path / name for name in ("a.npy", "a.irradiance.npy", "a.depth.npy", "a.normal.npy")]
    assert set(tmp_path.iterdir()) == set(written)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), image.pixels)
    np.testing.assert_array_equal(np.load(tmp_path / "a.irradiance.npy"), image.aovs["irradiance"])
    assert np.isfinite(np.load(tmp_path / "a.depth.npy")).all()


def test_a_film_has_even_sides_display_colours_and_a_black_background(image: Image, tmp_path: Path) -> None:
    display = np.full((HEIGHT, WIDTH, 4), (200, 90, 40, 255), np.uint8)
    display[:, 4:, 3] = 0
    frame = replace(image, display=display)
    save_frames([frame] * 3, tmp_path / "a.mp4", fps=10)
    frames = imageio_ffmpeg.read_frames(tmp_path / "a.mp4")
    about = next(frames)
    assert (about["size"], about["fps"], about["pix_fmt"].split("(")[0]) == ((8, 6), 10, "yuv420p")
    pictures = [np.frombuffer(frame, np.uint8).reshape(6, 8, 3) for frame in frames]
    assert len(pictures) == 3
    for picture in pictures:
        assert np.abs(picture[1:4, 1].astype(int) - (200, 90, 40)).max() <= 6, picture[2, 1]
        assert picture[1:4, 7].max() <= 6


@pytest.mark.parametrize("name", ["a.PNG", "a.EXR", "a.NPY", "a.Npy", "a.MP4", "a.b.Exr"])
def test_extensions_in_capitals_write_the_same_files(image: Image, tmp_path: Path, name: str) -> None:
    written = save(image, tmp_path / name)
    assert set(tmp_path.iterdir()) == set(written)
    plain = (tmp_path / "plain").with_suffix(Path(name).suffix.lower())
    others = save(image, plain)
    if plain.suffix != ".mp4":
        assert [path.read_bytes() for path in written] == [path.read_bytes() for path in others]
    assert all(path.suffix == Path(name).suffix for path in written)


@pytest.mark.parametrize("name", ["a.png", "a.PNG", "a.exr", "a.NPY", "a.MP4"])
def test_a_failing_disk_leaves_no_files(
    image: Image, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("wgsss.output.os.replace", full)
    with pytest.raises(InputError, match="No space left"):
        save(image, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_png_can_be_in_a_folder_named_like_an_archive(image: Image, tmp_path: Path) -> None:
    (tmp_path / "a.zip").mkdir()
    save(image, tmp_path / "a.zip" / "a.png")
    assert [path.name for path in (tmp_path / "a.zip").iterdir()] == ["a.png"]


def test_frames_are_numbered_from_one(image: Image, tmp_path: Path) -> None:
    written = save_frames([image] * 2, tmp_path / "a.png")
    assert [path.name for path in written] == ["a.0001.png", "a.0002.png"]
    assert set(tmp_path.iterdir()) == set(written)


@pytest.mark.parametrize("name", ["a.png", "a.exr", "a.npy", "a.mp4"])
@pytest.mark.parametrize("where", ["pixels", "aovs"])
def test_images_with_numbers_that_are_not_finite_are_not_written(
    image: Image, tmp_path: Path, name: str, where: str
) -> None:
    (image.pixels if where == "pixels" else image.aovs["irradiance"])[2, 3, 1] = np.nan
    (tmp_path / name).write_text("before")
    with pytest.raises(RenderError, match="not finite"):
        save(image, tmp_path / name)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["before"]


def test_a_failed_write_keeps_the_old_files(tmp_path: Path) -> None:
    paths = [tmp_path / "a", tmp_path / "b"]
    paths[0].write_text("before")
    with pytest.raises(InputError, match="cannot be written"), replacing(*paths) as (one, two):
        one.write_text("after")
        two.touch()
        raise OSError(28, "No space left on device")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["before"]


def test_a_failed_film_leaves_no_file(image: Image, tmp_path: Path) -> None:
    def frames() -> Any:
        yield image
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        save_frames(frames(), tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("a.jpg", r"a\.jpg: the file extension must be \.png or \.exr or \.npy or \.mp4"),
        ("a", "the file extension must be"),
        ("folder.png", "is a folder"),
        ("nowhere/a.png", "there is no folder '.*nowhere'"),
        ("a" * 300 + ".png", "cannot be written"),
        ("/proc/a.png", "/proc/a.png: cannot be written"),
    ],
)
def test_paths_that_cannot_be_written_are_errors_beforehand(tmp_path: Path, path: str, said: str) -> None:
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match=said):
        check_output(tmp_path / path)
    assert [found.name for found in tmp_path.iterdir()] == ["folder.png"]


def test_an_interrupt_leaves_no_temporary_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(path: Path) -> None:
        open(path, "x").close()
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "touch", interrupted)
    with pytest.raises(KeyboardInterrupt):
        check_output(tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


def test_files_have_the_permissions_of_any_new_file(image: Image, tmp_path: Path) -> None:
    save(image, tmp_path / "a.png")
    subprocess.run(["touch", tmp_path / "b"], check=True)
    assert (tmp_path / "a.png").stat().st_mode == (tmp_path / "b").stat().st_mode


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("kind", ["folder", "fifo", "link to a device"])
def test_a_path_that_is_not_a_regular_file_is_not_replaced(tmp_path: Path, suffix: str, kind: str) -> None:
    path = tmp_path / f"a{suffix}"
    if kind == "folder":
        path.mkdir()
    elif kind == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/null")
    with pytest.raises(InputError, match=r"this is (a folder|not a regular file)$"):
        check_output(path)
    assert list(tmp_path.iterdir()) == [path] and not path.is_file()


def test_a_frame_does_not_replace_a_folder(image: Image, tmp_path: Path) -> None:
    (tmp_path / "a.0002.png").mkdir()
    with pytest.raises(InputError, match=r"0002\.png: this is a folder"):
        save_frames([image, image], tmp_path / "a.png")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.0001.png", "a.0002.png"]


def test_names_may_have_the_greatest_length_of_the_file_system(image: Image, tmp_path: Path) -> None:
    assert save(image, tmp_path / f"{'x' * 251}.png")[0].exists()
    with pytest.raises(InputError, match=r"cannot be written \(File name too long"):
        save(image, tmp_path / f"{'y' * 250}.npy")
    assert [path.name[0] for path in tmp_path.iterdir()] == ["x"]
