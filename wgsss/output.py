"""Images to files: PNG and MP4 for a display, EXR and NPY for measuring.

A file appears whole or not at all: it is written under another name in the same folder, then renamed.
"""

from __future__ import annotations

import io
import os
import subprocess
import tempfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from wgsss import __version__
from wgsss.errors import InputError, RenderError

if TYPE_CHECKING:
    from wgsss.rendering import Image

Array = npt.NDArray[Any]

FORMATS = (".png", ".exr", ".npy", ".mp4")
LINEAR_FORMATS = (".exr", ".npy")
"""those that hold linear radiance, and the extra outputs beside it"""
DEFAULT_FPS = 25.0

_AXES = {"depth": "Z", "normal": "XYZ"}  # the EXR channels of extra outputs that are not RGB


def check_output(path: str | Path, formats: Sequence[str] = FORMATS) -> Path:
    """The path, if a file with one of these extensions, in capitals or not, can be written there; to be asked before
    anything that takes long.

    Raises InputError for another extension, a folder that is missing, and a place that cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in formats:
        raise InputError(f"{path}: the file extension must be {' or '.join(formats)}")
    with _told(path):
        _check_place(path)
        if not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder '{path.parent}'")
        trial = _temporary(path)  # permissions do not tell everything, so try
        try:
            trial.touch()
        finally:  # also where an interrupt comes in between
            trial.unlink(missing_ok=True)
    return path


@contextmanager
def replacing(*paths: Path) -> Iterator[list[Path]]:
    """Temporary files to write to, which take the places of `paths` when the block ends and vanish if it fails.

    Raises InputError where the file system refuses.
    """
    temporary = [_temporary(path) for path in paths]
    try:
        with _told(paths[0]):
            for path in paths:
                _check_place(path)
            yield temporary
            for source, path in zip(temporary, paths, strict=True):
                os.replace(source, path)
    finally:
        for source in temporary:
            source.unlink(missing_ok=True)


def _check_place(path: Path) -> None:
    """Raise InputError where a file would take the place of what is none: a folder, a device, a link to one."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: this is {'a folder' if path.is_dir() else 'not a regular file'}")


def _temporary(path: Path) -> Path:
    """A name of its own for this process, as short as any name may need it."""
    return path.with_name(f".{zlib.crc32(os.fsencode(path.name)):08x}.{os.getpid()}{path.suffix}")


@contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None


def save(image: Image, path: str | Path) -> list[Path]:
    """Write an image, and give back the files written.

    The extension says what they hold. `.png`: what a display shows, with coverage in alpha. `.exr`: linear radiance as
    float32 channels R, G, B and A (coverage), and the image's extra outputs as layers (`irradiance.R`, `depth.Z`,
    `normal.X`). `.npy`: the same radiance, float32 (H, W, 4), and beside it `<name>.depth.npy` and so on.
    `.mp4`: a film of this frame. `depth` is 0 where nothing is seen. PNG and EXR carry the image's metadata under
    `wgsss.<key>`.

    Raises InputError where a file cannot be written, and RenderError where a number is not finite: such an image is
    never written.
    """
    path = check_output(path)
    if path.suffix.lower() == ".mp4":
        return [_save_video([image], path, DEFAULT_FPS)]
    return _write(image, path)


def _write(image: Image, path: Path) -> list[Path]:
    """One frame, to a place that was checked."""
    layers = _layers(image)
    if path.suffix.lower() == ".npy":
        paths = [path, *(path.with_name(f"{path.stem}.{name}{path.suffix}") for name in layers)]
        with replacing(*paths) as files:
            for file, values in zip(files, [image.pixels, *layers.values()], strict=True):
                with file.open("wb") as opened:  # to a name that does not end in .npy, such as .NPY, numpy adds it
                    np.save(opened, np.asarray(values, np.float32))
        return paths
    with replacing(path) as (file,):
        (_write_png if path.suffix.lower() == ".png" else _write_exr)(image, layers, file)
    return [path]


def save_frames(images: Iterable[Image], path: str | Path, fps: float = DEFAULT_FPS) -> list[Path]:
    """Write frames as they come: to one `.mp4`, `fps` frames per second, or to `<name>.0001.png` and so on.

    Raises what `save` raises; the frames before it stay, but a film appears whole or not at all.
    """
    path = check_output(path)
    if path.suffix.lower() == ".mp4":
        return [_save_video(images, path, fps)]
    written: list[Path] = []
    for number, image in enumerate(images, start=1):
        written += _write(image, path.with_name(f"{path.stem}.{number:04d}{path.suffix}"))
    return written


def _layers(image: Image) -> dict[str, Array]:
    """The extra outputs, fit to be written. Raises RenderError where one, or the image, is not finite."""
    layers = dict(image.aovs)
    if "depth" in layers:
        layers["depth"] = np.where(image.pixels[..., 3:] > 0, layers["depth"], 0.0)
    for name, values in {"the image": image.pixels, **layers}.items():
        bad = int((~np.isfinite(values)).any(axis=-1).sum())
        if bad:
            raise RenderError(f"{bad} pixels of {name} are not finite numbers; nothing was written")
    return layers


def _labels(image: Image) -> dict[str, str]:
    return {"Software": f"wgsss {__version__}", **{f"wgsss.{key}": value for key, value in image.metadata.items()}}


def _write_png(image: Image, layers: dict[str, Array], file: Path) -> None:
    import imageio.v3 as iio
    from PIL.PngImagePlugin import PngInfo

    text = PngInfo()
    for key, value in _labels(image).items():
        text.add_text(key, value)
    with file.open("wb") as opened:  # imageio looks for archives and addresses in names
        iio.imwrite(opened, np.ascontiguousarray(image.display), extension=".png", plugin="pillow", pnginfo=text)


def _write_exr(image: Image, layers: dict[str, Array], file: Path) -> None:
    import OpenEXR

    channels = {"RGBA": np.ascontiguousarray(image.pixels, np.float32)}
    for name, values in layers.items():
        for i, axis in enumerate(_AXES.get(name, "RGB")):
            channels[f"{name}.{axis}"] = np.ascontiguousarray(values[..., i], np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **_labels(image)}
    try:
        with OpenEXR.File(header, channels) as exr, io.BytesIO() as stream:  # it takes no name that is not text
            exr.write(stream)
            file.write_bytes(stream.getvalue())
    except RuntimeError as error:
        raise OSError(" ".join(str(error).split())) from None


def _save_video(images: Iterable[Image], path: Path, fps: float) -> Path:
    """H.264 with 4:2:0 chroma, which every player reads; black where nothing is seen and beyond an odd edge."""
    encoder: subprocess.Popen[bytes] | None = None
    with replacing(path) as (file,), tempfile.TemporaryFile() as said:
        try:
            for image in images:
                _layers(image)
                picture = _even(image.display)
                encoder = encoder or _encoder(file, picture.shape[1], picture.shape[0], fps, said)
                encoder.stdin.write(picture.tobytes())  # type: ignore[union-attr]
            if encoder is None:
                raise InputError(f"{path}: a film needs at least one frame")
            encoder.stdin.close()  # type: ignore[union-attr]
            failed = encoder.wait() != 0
        except BrokenPipeError:
            failed = True
        finally:
            if encoder is not None and encoder.poll() is None:
                encoder.kill()
                encoder.wait()
        if failed:
            said.seek(0)
            raise OSError(" ".join(said.read().decode(errors="replace").split()) or "ffmpeg failed")
    return path


def _encoder(file: Path, width: int, height: int, fps: float, said: IO[bytes]) -> subprocess.Popen[bytes]:
    """A process that makes a film of the 24-bit RGB frames written to it."""
    import imageio_ffmpeg

    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:.6g}", "-i", "-"]
    # Without these marks players take small films to be BT.601 and show other colours.
    marks = [part for name in ("colorspace", "color_primaries", "color_trc") for part in (f"-{name}", "bt709")]
    target = ["-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p", "-vf", "scale=out_color_matrix=bt709", *marks]
    place = ["-movflags", "+faststart", "-f", "mp4", f"file:{file}"]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", *source, *target, *place]
    # In a session of its own, so that an interrupt from the keyboard reaches only us.
    return subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said, start_new_session=True)


def _even(display: Array) -> Array:
    """uint8 (H, W, 3) with H and W even, from (H, W, 4) with coverage, over black."""
    height, width, _ = display.shape
    picture = np.zeros((height + height % 2, width + width % 2, 3), np.uint8)
    picture[:height, :width] = np.round(display[..., :3] * (display[..., 3:] / 255.0))
    return picture
