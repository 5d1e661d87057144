"""Balls with a checker on them, as glTF files and as the scene that such a file should become; pictures compared."""

from __future__ import annotations

import io
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from gltfs import File

from wgsss import render
from wgsss.scene import Scene, load_scene

Array = np.ndarray[Any, Any]

RADIUS = 0.05  # metres
RED, BLUE = (200, 30, 20), (20, 90, 200)


def ball(radius: float = RADIUS, columns: int = 17, rows: int = 15) -> tuple[Array, Array, Array]:
    """Positions (V, 3), texture coordinates (V, 2) and faces (F, 3) of a sphere whose seam and poles are split.

    By default, texture coordinates are multiples of 1 / 255: bytes hold them without rounding.
    """
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    turn, fall = 2 * np.pi * u, np.pi * v
    points = radius * np.stack([np.cos(turn) * np.sin(fall), np.cos(fall), -np.sin(turn) * np.sin(fall)], axis=-1)
    points[:, -1], points[0], points[-1] = points[:, 0], (0, radius, 0), (0, -radius, 0)
    at = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    lower, upper = np.stack([a, b, c], axis=-1)[:-1], np.stack([a, c, d], axis=-1)[1:]
    faces = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])
    used, faces = np.unique(faces, return_inverse=True)
    return points.reshape(-1, 3)[used], np.stack([u, v], axis=-1).reshape(-1, 2)[used], faces.reshape(-1, 3)


def checker(squares: int = 8, size: int = 64, first: Any = RED, second: Any = BLUE) -> Array:
    """uint8 (size, size, 3)."""
    at = np.arange(size) * squares // size
    odd = (at[:, None] + at) % 2 == 1
    return np.where(odd[..., None], np.array(second, np.uint8), np.array(first, np.uint8))


def encoded(pixels: Array, kind: str = "png", **options: Any) -> bytes:
    """An image file of pixels."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format=kind, **options)
    return file.getvalue()


def texture(file: File, image: bytes | str | None = None, **fields: Any) -> int:
    """A texture of a file: of the encoded bytes of an image, of what a URI names, or a checker."""
    if isinstance(image, str):
        source = file.add("images", uri=image)
    else:
        source = file.add("images", bufferView=file.view(image or encoded(checker())), mimeType="image/png")
    return file.add("textures", source=source, **fields)


def colored(file: File, image: bytes | str | None = None, **info: Any) -> int:
    """A material with a base colour texture; `info` goes with the reference to it."""
    base = {"index": texture(file, image), **info}
    return file.add("materials", pbrMetallicRoughness={"baseColorTexture": base, "metallicFactor": 0})


def ball_primitive(file: File, material: int | None = None, shift: Any = (0, 0, 0), **fields: Any) -> dict[str, Any]:
    """A primitive of a ball; a set of texture coordinates, unless `attributes` has another one or None in its place."""
    points, uvs, faces = ball()
    own = {"TEXCOORD_0": file.rows(uvs, "VEC2"), **fields.pop("attributes", {})}
    attributes = {name: number for name, number in own.items() if number is not None}
    if material is not None:
        fields["material"] = material
    return file.primitive(points + np.asarray(shift), faces, attributes=attributes, **fields)


def checkered(image: bytes | str | None = None, node: dict[str, Any] | None = None, **info: Any) -> File:
    """The file of a ball with a checker, or another image, on it."""
    file = File()
    file.node(mesh=file.mesh(ball_primitive(file, colored(file, image, **info))), **(node or {}))
    return file


def transformed(uvs: Array, offset: Any = (0, 0), rotation: float = 0.0, scale: Any = (1, 1)) -> Array:
    """What KHR_texture_transform makes of coordinates: translation * rotation * scale of (u, v, 1), by hand."""
    cos, sin = math.cos(rotation), math.sin(rotation)
    turn = np.array([[cos, sin], [-sin, cos]])
    return (uvs * scale) @ turn.T + offset


def loaded(file: File, path: Path, **options: Any) -> Scene:
    """A scene of the file, saved in a folder, or under a name; any warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_scene(file.save(path if path.suffix else path / "ball.glb"), **options)


def told(source: File | Path, path: Path | None = None, **options: Any) -> tuple[Scene, list[str]]:
    """A scene of a file, and the warnings that it gave, without the file's name."""
    if isinstance(source, File):
        assert path is not None
        source = source.save(path if path.suffix else path / "ball.glb")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scene = load_scene(source, **options)
    lines = [str(warning.message) for warning in caught]
    assert all("\n" not in line and line.startswith(f"{source.name}: ") for line in lines), lines
    return scene, [line.removeprefix(f"{source.name}: ") for line in lines]


def picture(scene: Scene, method: str = "lambert", size: int = 64, **options: Any) -> Array:
    """What a display shows of a scene, int (H, W, 4)."""
    return render(scene, method, (size, size), **options).display.astype(int)


def difference(first: Scene, second: Scene, method: str = "lambert", size: int = 64, **options: Any) -> int:
    """The largest difference of two pictures, of 255. Raises AssertionError where one shows nothing."""
    a, b = (picture(scene, method, size, **options) for scene in (first, second))
    assert a[..., 3].any() and b[..., 3].any(), "something is seen"
    return int(np.abs(a - b).max())


def differing(first: Scene, second: Scene, over: int = 2, size: int = 64, **options: Any) -> float:
    """The share of pixels whose difference is above so many of 255: outlines and shadows of positions that were
    rounded may be a pixel off."""
    a, b = (picture(scene, size=size, **options) for scene in (first, second))
    assert a[..., 3].any() and b[..., 3].any(), "something is seen"
    return float((np.abs(a - b).max(axis=2) > over).mean())
