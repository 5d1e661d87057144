"""Closed meshes made by code at any tessellation, in millimetres, y up; each takes about how many vertices it gets.

Parametric shapes take milliseconds; the implicit ones (gyroid, milk, statue, head) import scikit-image when called.
"""

from __future__ import annotations

from collections.abc import Callable

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._capsule import capsule
from wgsss.scene.shapes._ear import ear
from wgsss.scene.shapes._gyroid import gyroid
from wgsss.scene.shapes._head import head
from wgsss.scene.shapes._leaf import leaf
from wgsss.scene.shapes._milk import milk
from wgsss.scene.shapes._slab import slab
from wgsss.scene.shapes._sphere import sphere
from wgsss.scene.shapes._statue import statue

__all__ = ["SHAPES", "capsule", "ear", "gyroid", "head", "leaf", "milk", "slab", "sphere", "statue"]

SHAPES: dict[str, Callable[[int | None], Mesh]] = {
    "slab": lambda vertices: slab(vertices=vertices),
    "sphere": lambda vertices: sphere(vertices=vertices),
    "capsule": lambda vertices: capsule(vertices=vertices),
    "ear": ear,
    "milk": milk,
    "gyroid": gyroid,
    "statue": statue,
    "leaf": leaf,
    "head": head,
}
"""Each shape by its name, at its own size, of a vertex count (None: its default)."""
