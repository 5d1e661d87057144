"""How much faster a frame is for drawing only what is seen (Jimenez & Gutierrez 2008, table 1), in one run.

On a CPU the gains at large distances are several times those of a GPU. There a frame's time is what its texels cost,
most of it in blurs, and a map of a sixteenth of the texels takes a sixteenth; on a GPU passes and triangles have a
price of their own, which small maps do not lower. Heads beside the image have no passes here, while the paper's are
clipped triangle by triangle. Near and alone, where only culling saves, a CPU gains little: it works on groups of
texels, which it spares only where all of them are dark.
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
from wgsss.methods import make_method
from wgsss.output import replacing
from wgsss.rendering import Renderer
from wgsss.scene import PerspectiveCamera, Scene
from wgsss.scene.builtin import crowd

FILE = "speedup.json"
DEFAULT_SIZE = (480, 300)
FRAMES = 2
"""of each kind per cell, in turn; the fastest counts, since what else runs on a machine only slows"""

HEADS = (1, 2, 4, 8, 16)
DISTANCES = (2.5, 5.0, 10.0, 20.0, 50.0, 100.0)
PAPER = (
    (1.17, 1.10, 1.39, 1.48, 1.53, 1.61),
    (1.40, 1.10, 1.46, 1.63, 1.88, 1.88),
    (1.66, 1.39, 1.58, 1.89, 2.10, 2.26),
    (1.86, 1.67, 1.95, 2.01, 2.34, 2.59),
    (2.01, 1.90, 2.28, 2.41, 2.50, 2.77),
)
"""table 1: a GeForce 8800 GTX, 1920 x 1200 pixels, six maps of 2048 x 2048 texels; rows by heads"""
UNIT_MM = 100.0
"""of the distances: from 2.5 a head is somewhat larger than the image, as it must be for clipping to save anything"""
SPACING_MM = 240.0
"""of the heads, from middle to middle"""
_FOV = 45.0
_TOWARDS_EYE = (10.0, 12.0)  # azimuth, elevation: degrees


@dataclass(frozen=True)
class Cell:
    """One cell of the table: `full_ms` by deon07, `seen_ms` by jimenez08."""

    heads: int
    distance: float
    """from the camera to the middle of the middle head, in UNIT_MM"""
    full_ms: float
    seen_ms: float
    paper: float

    @property
    def speedup(self) -> float:
        return self.full_ms / self.seen_ms


@dataclass(frozen=True)
class Table:
    """The cells, row by row, and what they were measured with."""

    size: tuple[int, int]
    map_size: int
    adapter: str
    clock: str
    cells: tuple[Cell, ...]

    def json(self) -> dict[str, Any]:
        cells = [{**asdict(cell), "speedup": cell.speedup} for cell in self.cells]
        return {**asdict(self), "unit_mm": UNIT_MM, "size": list(self.size), "cells": cells}

    def rows(self) -> list[list[str]]:
        """As text: a row for each number of heads, in brackets what the paper has."""
        found = [["heads", *(f"{distance:g}" for distance in DISTANCES)]]
        for heads in HEADS:
            row = [cell for cell in self.cells if cell.heads == heads]
            found.append([str(heads), *(f"{cell.speedup:.2f} ({cell.paper:.2f})" for cell in row)])
        return found


def speedup(
    folder: str | Path, size: tuple[int, int] = DEFAULT_SIZE, *, tell: Callable[[Cell], None] = lambda cell: None
) -> Table:
    """Measure all cells, and write them to `speedup.json` in `folder`.

    Maps have about as many texels to the pixels of `size` (width, height) as the paper's. `tell` is called with each
    cell as it is done. Raises InputError where the file cannot be written.
    """
    path = Path(folder) / FILE
    with created_folder(path.parent):
        table = _measured(size, tell)
        with replacing(path) as (file,):
            file.write_text(json.dumps(table.json(), indent=2) + "\n", encoding="utf-8")
    return table


def _measured(size: tuple[int, int], tell: Callable[[Cell], None]) -> Table:
    map_size = 1 << round(math.log2(size[0] * 2048 / 1920))
    cells: list[Cell] = []
    clock = ""
    todo = list(product(enumerate(HEADS), enumerate(DISTANCES)))
    for (row, heads), (column, distance) in progress_bar(todo, unit="cell"):
        scene = view(heads, distance)
        kinds = [
            Renderer(scene, make_method(name, {"map_size": map_size}), size) for name in ("texture+none", "jimenez08")
        ]
        if not cells:  # the first frames pay for compilation
            first = [renderer.frame() for renderer in kinds]
            clock = first[0].clock
        times = [[sum(renderer.frame().timings.values()) for renderer in kinds] for _ in range(FRAMES)]
        full_ms, seen_ms = np.min(times, axis=0).tolist()
        cells.append(Cell(heads, distance, full_ms, seen_ms, PAPER[row][column]))
        tell(cells[-1])
    return Table(size, map_size, default_gpu().name, clock, tuple(cells))


def view(heads: int, distance: float) -> Scene:
    """The crowd's heads side by side (figure 9), seen from `distance` in UNIT_MM of the middle one."""
    scene = crowd(copies=heads)
    row = [replace(head, translate=(SPACING_MM * (i - heads // 2), 0, 0)) for i, head in enumerate(scene.objects)]
    azimuth, elevation = _TOWARDS_EYE
    camera = PerspectiveCamera.orbit((0, 0, 0), distance * UNIT_MM, azimuth, elevation, fov=_FOV)
    return replace(scene, objects=tuple(row), camera=camera)
