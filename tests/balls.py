"""glTF files of a ball with a checker texture, and functions that load scenes and compare their pictures."""

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
    """Return positions (V, 3), texture coordinates (V, 2) and faces (F, 3) of a sphere, split at its seam and poles.

    By default, texture coordinates are multiples of 1 / 255, so that bytes store them exactly.
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
    """Return a checker with squares of two colours: uint8 (size, size, 3)."""
    at = np.arange(size) * squares // size
    odd = (at[:, None] + at) % 2 == 1
    return np.where(odd[..., None], np.array(second, np.uint8), np.array(first, np.uint8))


def encoded(pixels: Array, kind: str = "png", **options: Any) -> bytes:
    """Encode pixels as an image file."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format=kind, **options)
    return file.getvalue()


def texture(file: File, image: bytes | str | None = None, **fields: Any) -> int:
    """Add a texture to a file: an encoded image, the image at a URI, or a checker. Return its index."""
    if isinstance(image, str):
        source = file.add("images", uri=image)
    else:
        source = file.add("images", bufferView=file.view(image or encoded(checker())), mimeType="image/png")
    return file.add("textures", source=source, **fields)


def colored(file: File, image: bytes | str | None = None, **info: Any) -> int:
    """Add a material with a base colour texture. `info` are further fields of the reference to the texture."""
    base = {"index": texture(file, image), **info}
    return file.add("materials", pbrMetallicRoughness={"baseColorTexture": base, "metallicFactor": 0})


def ball_primitive(file: File, material: int | None = None, shift: Any = (0, 0, 0), **fields: Any) -> dict[str, Any]:
    """Make a primitive of a ball. `attributes` may replace TEXCOORD_0, or remove it by None."""
    points, uvs, faces = ball()
    own = {"TEXCOORD_0": file.rows(uvs, "VEC2"), **fields.pop("attributes", {})}
    attributes = {name: number for name, number in own.items() if number is not None}
    if material is not None:
        fields["material"] = material
    return file.primitive(points + np.asarray(shift), faces, attributes=attributes, **fields)


def checkered(image: bytes | str | None = None, node: dict[str, Any] | None = None, **info: Any) -> File:
    """Make a file of a ball with a checker or another image."""
    file = File()
    file.node(mesh=file.mesh(ball_primitive(file, colored(file, image, **info))), **(node or {}))
    return file


def transformed(uvs: Array, offset: Any = (0, 0), rotation: float = 0.0, scale: Any = (1, 1)) -> Array:
    """Apply KHR_texture_transform to coordinates (N, 2): translation * rotation * scale."""
    cos, sin = math.cos(rotation), math.sin(rotation)
    turn = np.array([[cos, sin], [-sin, cos]])
    return (uvs * scale) @ turn.T + offset


def loaded(file: File, path: Path, **options: Any) -> Scene:
    """Save a file in a folder or under a name, and load its scene. Any warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_scene(file.save(path if path.suffix else path / "ball.glb"), **options)


def scene_and_notes(source: File | Path, path: Path | None = None, **options: Any) -> tuple[Scene, list[str]]:
    """Load the scene of a file. Return it with its warnings, without the name of the file."""
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
    """Render a scene for a display: int (H, W, 4), 0 to 255."""
    return render(scene, method, (size, size), **options).display.astype(int)


def difference(first: Scene, second: Scene, method: str = "lambert", size: int = 64, **options: Any) -> int:
    """Return the largest difference of two pictures, 0 to 255. Raises AssertionError if one of them is empty."""
    a, b = (picture(scene, method, size, **options) for scene in (first, second))
    assert a[..., 3].any() and b[..., 3].any(), "both pictures show something"
    return int(np.abs(a - b).max())


def differing(first: Scene, second: Scene, over: int = 2, size: int = 64, **options: Any) -> float:
    """Return the share of pixels whose difference is above `over`, of 255.

    If positions were rounded, outlines and shadows may differ by a pixel.
    """
    a, b = (picture(scene, size=size, **options) for scene in (first, second))
    assert a[..., 3].any() and b[..., 3].any(), "both pictures show something"
    return float((np.abs(a - b).max(axis=2) > over).mean())
