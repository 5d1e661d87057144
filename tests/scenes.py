"""Small scenes with light in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wgsss.optics import SumOfGaussians
from wgsss.scene import Material, Mesh, Object, OrthographicCamera, Scene

WHITE = Material(
    "white", gaussians=SumOfGaussians(np.array([0.01]), np.array([[0.9, 0.5, 0.1]])), eta=1.4, roughness=0.5
)
MATTE = replace(WHITE, specular=0.0)
DENSE = Material("dense", sigma_a=(0.5,) * 3, sigma_s_prime=(50.0,) * 3, eta=1.4, roughness=0.5, specular=0.0)
NEED_LAYERS = ("francois06", "oat06")
"""Methods that refuse materials of which only the profile is known."""
ABOVE = OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=20)


def plane(side: float = 40.0, y: float = 0.0, cells: int = 8) -> Mesh:
    """Make a square of `side` mm at height y that faces up, with texture coordinates along its sides."""
    t = np.linspace(-0.5, 0.5, cells + 1)
    x, z = np.meshgrid(t, t)
    positions = np.stack([x * side, np.full_like(x, y), z * side], axis=-1).reshape(-1, 3)
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    faces = np.concatenate([np.stack([a, a + cells + 1, a + 1], 1), np.stack([a + 1, a + cells + 1, a + cells + 2], 1)])
    uvs = np.stack([x + 0.5, z + 0.5], axis=-1).reshape(-1, 2) * 0.98 + 0.01
    return Mesh(positions.astype(np.float32), faces, corner_uvs=uvs[faces].astype(np.float32), name="plane")


def lit(
    *lights: Any, mesh: Mesh | None = None, material: Material = MATTE, camera: Any = ABOVE, extra: tuple = ()
) -> Scene:
    """Make a scene of one object, some lights, and further objects."""
    return Scene("test", (Object(mesh or plane(), material), *extra), lights, camera, tone_map="none")


def drawable(scene: Scene, method: str) -> Scene:
    """Return a scene that a method can draw: one that needs layers gets DENSE in place of materials without them."""
    if method not in NEED_LAYERS:
        return scene
    objects = (replace(o, material=DENSE) if o.material.stack is None else o for o in scene.objects)
    return replace(scene, objects=tuple(objects))


def write_environment(path: Any, pixels: np.ndarray) -> str:
    """Write a latitude-longitude image as OpenEXR, and return its path."""
    import OpenEXR

    channels = {"RGB": np.ascontiguousarray(pixels, np.float32)}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))
    return str(path)
