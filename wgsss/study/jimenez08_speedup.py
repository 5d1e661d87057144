"""Table 1 of Jimenez & Gutierrez 2008: how much faster a frame is if only the visible surface is diffused.

On a CPU, the gain at large distances is several times that on a GPU. On a CPU, the time of a frame is proportional to
the number of texels, and blurs take most of it. On a GPU, passes and triangles have a cost of their own, which smaller
maps do not reduce. Heads outside the image have no passes here, while the paper clips them triangle by triangle. For a
single near head, where only culling saves time, a CPU gains little, because it processes groups of texels and skips a
group only if all of its texels are dark.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from wgsss.console import progress_bar
from wgsss.folders import created_folder
from wgsss.gpu import default_gpu
from wgsss.output import replacing
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import PerspectiveCamera, Scene
from wgsss.scene.builtin import crowd

FILE = "speedup.json"
DEFAULT_SIZE = (480, 300)
FRAMES = 2
"""Number of frames of each method per cell, in turn. The fastest counts, because other work only slows frames."""

HEADS = (1, 2, 4, 8, 16)
DISTANCES = (2.5, 5.0, 10.0, 20.0, 50.0, 100.0)
PAPER = (
    (1.17, 1.10, 1.39, 1.48, 1.53, 1.61),
    (1.40, 1.10, 1.46, 1.63, 1.88, 1.88),
    (1.66, 1.39, 1.58, 1.89, 2.10, 2.26),
    (1.86, 1.67, 1.95, 2.01, 2.34, 2.59),
    (2.01, 1.90, 2.28, 2.41, 2.50, 2.77),
)
"""The values of the paper, a row for each number of heads. Measured on a GeForce 8800 GTX, 1920 x 1200 pixels, with six
maps of 2048 x 2048 texels."""
UNIT_MM = 100.0
"""Unit of the distances. At 2.5, a head is somewhat larger than the image, so that clipping saves time."""
SPACING_MM = 240.0
"""Distance between the centres of neighbouring heads."""
_FOV = 45.0
_TOWARDS_EYE = (10.0, 12.0)  # azimuth, elevation: degrees


@dataclass(frozen=True)
class Cell:
    """One cell of the table: the frame times of the whole surface (texture+none) and of the visible one (jimenez08)."""

    heads: int
    distance: float
    """From the camera to the centre of the middle head, in UNIT_MM."""
    full_ms: float
    seen_ms: float
    paper: float

    @property
    def speedup(self) -> float:
        return self.full_ms / self.seen_ms


@dataclass(frozen=True)
class Table:
    """The cells, row by row, and the settings under which they were measured."""

    size: tuple[int, int]
    map_size: int
    adapter: str
    clock: str
    cells: tuple[Cell, ...]

    def json(self) -> dict[str, Any]:
        cells = [{**asdict(cell), "speedup": cell.speedup} for cell in self.cells]
        return {**asdict(self), "unit_mm": UNIT_MM, "size": list(self.size), "cells": cells}

    def rows(self) -> list[list[str]]:
        """Return the table as text: a row for each number of heads, with the paper's value in brackets."""
        rows = [["heads", *(f"{distance:g}" for distance in DISTANCES)]]
        for heads in HEADS:
            row = [cell for cell in self.cells if cell.heads == heads]
            rows.append([str(heads), *(f"{cell.speedup:.2f} ({cell.paper:.2f})" for cell in row)])
        return rows


def speedup(
    folder: str | Path, size: tuple[int, int] = DEFAULT_SIZE, *, on_cell: Callable[[Cell], None] = lambda cell: None
) -> Table:
    """Measure all cells, and write them to `speedup.json` in `folder`.

    The ratio of texels to the pixels of `size` (width, height) is about that of the paper. `on_cell` is called with
    each cell when it is done. Raises InputError if the file cannot be written.
    """
    path = Path(folder) / FILE
    with created_folder(path.parent):
        table = _measure(size, on_cell)
        with replacing(path) as (file,):
            file.write_text(json.dumps(table.json(), indent=2) + "\n", encoding="utf-8")
    return table


def _measure(size: tuple[int, int], on_cell: Callable[[Cell], None]) -> Table:
    map_size = 1 << round(math.log2(size[0] * 2048 / 1920))
    cells: list[Cell] = []
    clock = ""
    todo = list(product(enumerate(HEADS), enumerate(DISTANCES)))
    for (row, heads), (column, distance) in progress_bar(todo, unit="cell"):
        scene = view(heads, distance)
        renderers = [
            Renderer(scene, make_method(name, {"map_size": map_size}), size) for name in ("texture+none", "jimenez08")
        ]
        if not cells:  # the first frames include compilation
            first = [renderer.frame() for renderer in renderers]
            clock = first[0].clock
        times = [[sum(renderer.frame().timings.values()) for renderer in renderers] for _ in range(FRAMES)]
        full_ms, seen_ms = np.min(times, axis=0).tolist()
        cells.append(Cell(heads, distance, full_ms, seen_ms, PAPER[row][column]))
        on_cell(cells[-1])
    return Table(size, map_size, default_gpu().name, clock, tuple(cells))


def view(heads: int, distance: float) -> Scene:
    """Return a scene of heads side by side (figure 9), `distance` times UNIT_MM from the camera to the middle one."""
    scene = crowd(copies=heads)
    row = [replace(head, translate=(SPACING_MM * (i - heads // 2), 0, 0)) for i, head in enumerate(scene.objects)]
    azimuth, elevation = _TOWARDS_EYE
    camera = PerspectiveCamera.orbit((0, 0, 0), distance * UNIT_MM, azimuth, elevation, fov=_FOV)
    return replace(scene, objects=tuple(row), camera=camera)
