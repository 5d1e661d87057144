"""Layers below the surface of an object as grids of voxels for Mitsuba 3.

The medium of a layered material is `heterogeneous`: sigma_t, in 1/mm, and the albedo are grids over the bounding box of
the object, with the true sigma_s. The phase function is one of Henyey and Greenstein for each distinct g, nested in
`blendphase` with grids of weights. (One function with a mean g would scatter up to 30 % more or less light to the
side.) An interface through a voxel mixes the two layers by their shares of the voxel.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.cache import Arrays, cached
from wgsss.reference.layered_medium import LayeredMedium
from wgsss.reference.world_surface import WorldSurface
from wgsss.scene import Material, Object

Array = npt.NDArray[Any]

VOXELS = 1 << 20
"""Largest number of voxels of an object."""
_PART = 1 << 16  # voxels at the same time


def has_grids(material: Material) -> bool:
    """Return whether the medium of a material is written as grids."""
    return material.layers is not None


def box(thing: Object) -> tuple[Array, Array]:
    """Return the lowest corner and the size of the box of an object's grids, mm: (3,) each."""
    low, high = thing.placed.min(axis=0), thing.placed.max(axis=0)
    margin = 1e-4 * float(np.max(high - low))
    return low - margin, high - low + 2 * margin


def cosines(material: Material) -> list[float]:
    """Return the distinct mean cosines g of a material's layers, each of which has a phase function."""
    return sorted({layer.g for layer in material.layers or ()})


def grid_file(number: int, name: str, channel: int | None = None) -> str:
    """Return the file name of a grid of an object: "sigma_t", "albedo" or "weight.<n>"."""
    return f"{number}.{name}{'' if channel is None else f'.{channel}'}.vol"


def write_grids(number: int, thing: Object, folder: Path, channel: int | None, voxels: int) -> list[Path]:
    """Write the grids of an object with all channels or with one, and return the files."""
    grids = _grids(thing, voxels)
    of = slice(None) if channel is None else slice(channel, channel + 1)
    written = []
    for name in ("sigma_t", "albedo"):
        written.append(_write(folder / grid_file(number, name, channel), grids[name][..., of]))
    total = np.cumsum(grids["scattering"][..., of, :].mean(axis=3), axis=3)
    for n in range(1, total.shape[3]):  # the share of function n among the functions up to n
        weight = (total[..., n] - total[..., n - 1]) / np.maximum(total[..., n], 1e-30)
        written.append(_write(folder / grid_file(number, f"weight.{n}", channel), weight[..., None]))
    return written


def _grids(thing: Object, voxels: int) -> Arrays:
    """Return sigma_t and albedo (Z, Y, X, 3), and sigma_s by channel and distinct g (Z, Y, X, 3, G). Cached."""
    material = thing.material
    medium = LayeredMedium(material)
    key = [thing.mesh, thing.matrix, material.layers, material.maps, voxels]

    def compute() -> Arrays:
        low, size = box(thing)
        voxel = float(np.prod(size) / voxels) ** (1 / 3)
        counts = np.maximum(np.floor(size / voxel), 1).astype(np.int64)
        axes = [low[axis] + (np.arange(counts[axis]) + 0.5) / counts[axis] * size[axis] for axis in range(3)]
        z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
        points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
        surface, distinct = WorldSurface(thing), cosines(material)
        groups = np.array([[layer.g == g for layer in medium.layers] for g in distinct], np.float64)
        sigma_t, scattering = np.zeros((len(points), 3)), np.zeros((len(points), 3, len(distinct)))
        for first in range(0, len(points), _PART):
            some = slice(first, first + _PART)
            depth, uv = surface.closest(points[some])
            above = np.clip(0.5 + (medium.interfaces(uv) - depth[:, None]) / voxel, 0.0, 1.0)
            ends = np.ones((len(depth), 1))
            shares = np.diff(np.concatenate([0.0 * ends, above, ends], axis=1), axis=1)
            at = medium.coefficients(uv)
            sigma_t[some] = np.einsum("nj,njc->nc", shares, at.sigma_t)
            scattering[some] = np.einsum("nj,njc,gj->ncg", shares, at.sigma_s, groups)
        albedo = scattering.sum(axis=2) / np.maximum(sigma_t, 1e-30)
        shape = tuple(counts[::-1])
        return {
            "sigma_t": sigma_t.reshape(*shape, 3).astype(np.float32),
            "albedo": albedo.reshape(*shape, 3).astype(np.float32),
            "scattering": scattering.reshape(*shape, 3, -1).astype(np.float32),
        }

    return cached("grids", key, compute, label=f"voxels of {thing.mesh.name}")


def _write(path: Path, grid: Array) -> Path:
    """Write a grid (Z, Y, X, C) as a binary file of Mitsuba's plugin `gridvolume`."""
    depth, height, width, channels = grid.shape
    head = b"VOL\x03" + np.array([1, width, height, depth, channels], "<i4").tobytes()
    head += np.array([0, 0, 0, 1, 1, 1], "<f4").tobytes()
    path.write_bytes(head + np.ascontiguousarray(grid, "<f4").tobytes())
    return path
