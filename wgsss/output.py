"""Writing of images to files: PNG and MP4 for a display, EXR and NPY with linear radiance.

A file is written under a temporary name in the same folder and then renamed, so that it appears whole or not at all.
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
from wgsss.folders import naming_path

if TYPE_CHECKING:
    from wgsss.rendering import Image

Array = npt.NDArray[Any]

FORMATS = (".png", ".exr", ".npy", ".mp4")
LINEAR_FORMATS = (".exr", ".npy")
"""The formats that hold linear radiance and the extra outputs."""
DEFAULT_FPS = 25.0

_AXES = {"depth": "Z", "normal": "XYZ"}  # EXR channels of the extra outputs that are not RGB


def check_output(path: str | Path, formats: Sequence[str] = FORMATS) -> Path:
    """Return the path if a file can be written there. To be called before work that takes long.

    Raises InputError if the file extension, in upper or lower case, is not one of `formats`, if the folder is missing,
    or if it cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in formats:
        raise InputError(f"{path}: the file extension must be {' or '.join(formats)}")
    with naming_path(path):
        _check_target(path)
        if not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder '{path.parent}'")
        trial = _temporary(path)  # permissions alone do not decide whether a file can be written
        try:
            trial.touch()
        finally:  # also after an interrupt
            trial.unlink(missing_ok=True)
    return path


@contextmanager
def replacing(*paths: Path) -> Iterator[list[Path]]:
    """Yield temporary files that replace `paths` when the block ends, and are deleted if it fails.

    Raises InputError if the file system refuses to write.
    """
    temporary = [_temporary(path) for path in paths]
    try:
        with naming_path(paths[0]):
            for path in paths:
                _check_target(path)
            yield temporary
            for source, path in zip(temporary, paths, strict=True):
                os.replace(source, path)
    finally:
        for source in temporary:
            source.unlink(missing_ok=True)


def _check_target(path: Path) -> None:
    """Raise InputError if the path exists and is not a regular file, such as a folder or a device."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: this is {'a folder' if path.is_dir() else 'not a regular file'}")


def _temporary(path: Path) -> Path:
    """Return a short temporary name that is unique to this process, also for names of the greatest allowed length."""
    return path.with_name(f".{zlib.crc32(os.fsencode(path.name)):08x}.{os.getpid()}{path.suffix}")


def save(image: Image, path: str | Path) -> list[Path]:
    """Write an image, and return the files written. The file extension selects the content.

    - `.png`: the image for a display, with coverage in alpha.
    - `.exr`: linear radiance as float32 channels R, G, B and A (coverage), and the extra outputs as layers
      (`irradiance.R`, `depth.Z`, `normal.X`).
    - `.npy`: linear radiance and coverage, float32 (H, W, 4). Extra outputs go to `<name>.depth.npy` etc.
    - `.mp4`: a film of this frame.

    `depth` is 0 where no object is seen. PNG and EXR contain the image's metadata under `wgsss.<key>`.

    Raises InputError if a file cannot be written, and RenderError if a number is not finite: such an image is never
    written.
    """
    path = check_output(path)
    if path.suffix.lower() == ".mp4":
        return [_save_video([image], path, DEFAULT_FPS)]
    return _write(image, path)


def _write(image: Image, path: Path) -> list[Path]:
    """Write one frame to a path that was checked."""
    layers = _layers(image)
    if path.suffix.lower() == ".npy":
        paths = [path, *(path.with_name(f"{path.stem}.{name}{path.suffix}") for name in layers)]
        with replacing(*paths) as files:
            for file, values in zip(files, [image.pixels, *layers.values()], strict=True):
                with file.open("wb") as opened:  # numpy would add .npy to a name that ends in .NPY
                    np.save(opened, np.asarray(values, np.float32))
        return paths
    with replacing(path) as (file,):
        (_write_png if path.suffix.lower() == ".png" else _write_exr)(image, layers, file)
    return [path]


def save_frames(images: Iterable[Image], path: str | Path, fps: float = DEFAULT_FPS) -> list[Path]:
    """Write frames as they are rendered, to one `.mp4` of `fps` frames per second or to `<name>.0001.png` etc.

    Raises as `save`. Frames already written stay, but a film appears whole or not at all.
    """
    path = check_output(path)
    if path.suffix.lower() == ".mp4":
        return [_save_video(images, path, fps)]
    written: list[Path] = []
    for number, image in enumerate(images, start=1):
        written += _write(image, path.with_name(f"{path.stem}.{number:04d}{path.suffix}"))
    return written


def _layers(image: Image) -> dict[str, Array]:
    """Return the extra outputs with finite depth. Raises RenderError if an output or the image is not finite."""
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
    with file.open("wb") as opened:  # imageio interprets some names as archives or addresses
        iio.imwrite(opened, np.ascontiguousarray(image.display), extension=".png", plugin="pillow", pnginfo=text)


def _write_exr(image: Image, layers: dict[str, Array], file: Path) -> None:
    import OpenEXR

    channels = {"RGBA": np.ascontiguousarray(image.pixels, np.float32)}
    for name, values in layers.items():
        for i, axis in enumerate(_AXES.get(name, "RGB")):
            channels[f"{name}.{axis}"] = np.ascontiguousarray(values[..., i], np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **_labels(image)}
    try:
        with OpenEXR.File(header, channels) as exr, io.BytesIO() as stream:  # OpenEXR refuses names that are not text
            exr.write(stream)
            file.write_bytes(stream.getvalue())
    except RuntimeError as error:
        raise OSError(" ".join(str(error).split())) from None


def _save_video(images: Iterable[Image], path: Path, fps: float) -> Path:
    """Write a film in H.264 with 4:2:0 chroma, which every player supports. Pixels without an object are black."""
    encoder: subprocess.Popen[bytes] | None = None
    with replacing(path) as (file,), tempfile.TemporaryFile() as messages:
        try:
            for image in images:
                _layers(image)
                picture = _even(image.display)
                encoder = encoder or _encoder(file, picture.shape[1], picture.shape[0], fps, messages)
                encoder.stdin.write(picture.tobytes())  # type: ignore[union-attr]
            if encoder is None:
                raise InputError(f"{path}: a film needs at least one frame")
            encoder.stdin.close()  # type: ignore[union-attr]
            has_failed = encoder.wait() != 0
        except BrokenPipeError:
            has_failed = True
        finally:
            if encoder is not None and encoder.poll() is None:
                encoder.kill()
                encoder.wait()
        if has_failed:
            messages.seek(0)
            raise OSError(" ".join(messages.read().decode(errors="replace").split()) or "ffmpeg failed")
    return path


def _encoder(file: Path, width: int, height: int, fps: float, messages: IO[bytes]) -> subprocess.Popen[bytes]:
    """Start an encoder process that reads 24-bit RGB frames from its standard input."""
    import imageio_ffmpeg

    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:.6g}", "-i", "-"]
    # Without these tags, players assume BT.601 for small films and show wrong colours.
    tags = [part for name in ("colorspace", "color_primaries", "color_trc") for part in (f"-{name}", "bt709")]
    target = ["-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p", "-vf", "scale=out_color_matrix=bt709", *tags]
    container = ["-movflags", "+faststart", "-f", "mp4", f"file:{file}"]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", *source, *target, *container]
    # A separate session, so that an interrupt from the keyboard does not reach the encoder.
    return subprocess.Popen(command, stdin=subprocess.PIPE, stderr=messages, start_new_session=True)


def _even(display: Array) -> Array:
    """Composite an image (H, W, 4) over black, and pad it to even sides: uint8 (H, W, 3)."""
    height, width, _ = display.shape
    picture = np.zeros((height + height % 2, width + width % 2, 3), np.uint8)
    picture[:height, :width] = np.round(display[..., :3] * (display[..., 3:] / 255.0))
    return picture
