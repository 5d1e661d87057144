"""Materials of the built-in scenes whose layers have maps. The maps are made by code.

They are computed by sums, products, square roots and integer random numbers alone, so every processor makes the same
maps. The coefficients are for demonstration: they are so low that single scattering shows the layers (mean free paths
of some mm, against 0.2 mm in skin).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.optics import Layer
from wgsss.scene.layermaps import LayerMaps
from wgsss.scene.material import Maps, Material

Array = npt.NDArray[np.float64]

SIZE = 512  # texels of a side of a map
_ETA = 1.4


@cache
def skin_material() -> Material:
    """Return skin over flesh, with veins of two depths, for maps that are 84 mm wide."""
    mm = 84.0
    near, far = _veins(11, 22, mm, 0.55), _veins(12, 16, mm, 0.9)
    skin = 0.9 + 0.5 * _noise(13, 9)
    near_top, far_top = 0.75 - near, 2.3 - far
    is_near = near > 0.0
    top = np.where(is_near, near_top, np.where(far > 0.0, far_top, skin))
    vein = 2.0 * np.where(is_near, near, far)
    cover = np.minimum(skin, top)
    freckles = 0.72 + 0.28 * _smooth(1.0 - _noise(14, 60) * _noise(15, 23) * 1.6)
    color = np.stack([0.9 + 0.1 * freckles, 0.8 * freckles + 0.2, freckles], axis=2)
    return _material(
        "demonstration skin",
        [
            _layer((0.34, 0.28, 0.24), (0.004, 0.012, 0.02), _thickness(cover)),
            _layer((0.30, 0.24, 0.21), (0.006, 0.03, 0.04), _thickness(top - cover)),
            _layer((0.12, 0.10, 0.13), (0.35, 0.75, 0.45), _thickness(vein)),
            _layer((0.42, 0.30, 0.25), (0.006, 0.035, 0.05), None),
        ],
        colors={0: color},
    )


@cache
def organ_material() -> Material:
    """Return blobs of fat on a thin cover over veins in flesh, for maps that are 100 mm wide and repeat along u."""
    mm = 100.0
    fat = _blobs(21, 70, mm, 7.5, 2.2)
    veins = _veins(23, 22, mm, 0.8)
    cover = np.where(veins > 0.0, 1.1 - veins, 1.1)
    return _material(
        "demonstration organ",
        [
            _layer((0.55, 0.50, 0.36), (0.002, 0.008, 0.05), _thickness(fat)),
            _layer((0.26, 0.13, 0.11), (0.010, 0.09, 0.10), _thickness(cover)),
            _layer((0.12, 0.09, 0.14), (0.25, 0.95, 0.65), _thickness(2.0 * veins)),
            _layer((0.36, 0.17, 0.14), (0.012, 0.11, 0.12), None),
        ],
        colors={3: np.repeat((0.75 + 0.25 * _noise(24, 40))[..., None], 3, axis=2)},
    )


_Pair = tuple[Layer, npt.NDArray[np.uint16] | None]


def _layer(sigma_s: tuple[float, ...], sigma_a: tuple[float, ...], thickness: tuple[float, Any] | None) -> _Pair:
    most, pixels = thickness or (float("inf"), None)
    return Layer(np.array(sigma_a), np.array(sigma_s), _ETA, thickness=most), pixels


def _material(name: str, pairs: Sequence[_Pair], colors: dict[int, Array]) -> Material:
    maps = []
    for number, (_, pixels) in enumerate(pairs):
        color = colors.get(number)
        eight_bits = None if color is None else np.round(255.0 * np.clip(color, 0.0, 1.0)).astype(np.uint8)
        maps.append(LayerMaps(thickness=pixels, color=eight_bits))
    layers = tuple(layer for layer, _ in pairs)
    return Material(name, layers=layers, roughness=0.3, maps=Maps(layers=tuple(maps)))


def _thickness(mm: Array) -> tuple[float, npt.NDArray[np.uint16]]:
    """Return the largest thickness, mm, rounded up to 0.01 mm, and the map (H, W) of its shares."""
    most = float(np.ceil(np.round(mm.max() * 100.0, 6)) / 100.0)
    return most, np.round(np.clip(mm / most, 0.0, 1.0) * 65535.0).astype(np.uint16)


def _smooth(x: Array) -> Array:
    """Return a smooth step from 0 at x = 0 to 1 at x = 1."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def _noise(seed: int, cells: int) -> Array:
    """Return smooth noise (SIZE, SIZE) from 0 to 1 that repeats after `cells` random values along each side."""
    values = np.random.default_rng(seed).random((cells, cells))
    at = (np.arange(SIZE) + 0.5) * (cells / SIZE)
    cell = np.floor(at).astype(int)
    along = _smooth(at - cell)
    following = (cell + 1) % cells
    rows = values[cell] * (1.0 - along)[:, None] + values[following] * along[:, None]
    return rows[:, cell] * (1.0 - along) + rows[:, following] * along


def _blobs(seed: int, count: int, mm: float, radius: float, height: float) -> Array:
    """Return the height (SIZE, SIZE), mm, of overlapping domes at random places, in maps that are `mm` wide and repeat.

    The largest have this `radius` and `height` in mm, the smallest the third of it.
    """
    random = np.random.default_rng(seed)
    at = (np.arange(SIZE) + 0.5) * (mm / SIZE)
    top = np.zeros((SIZE, SIZE))
    for _ in range(count):
        x, y, size = random.random(3)
        size = (1.0 + 2.0 * size * size) / 3.0
        across, down = (np.abs(at - centre * mm) for centre in (x, y))
        across, down = np.minimum(across, mm - across), np.minimum(down, mm - down)
        square = (down * down)[:, None] + across * across
        top = np.maximum(top, height * size * (1.0 - square / (radius * size) ** 2))
    return top


def _veins(seed: int, count: int, mm: float, radius: float) -> Array:
    """Return half the thickness (SIZE, SIZE), mm, of winding tubes that taper, in maps that are `mm` wide and repeat.

    Half the thickness is 0 beside the tubes. They start at random points with a radius up to `radius` mm.
    """
    random = np.random.default_rng(seed)
    half = np.zeros((SIZE, SIZE))
    texel = mm / SIZE
    reach = int(np.ceil(radius / texel)) + 2
    offsets = np.arange(-reach, reach + 1)
    for _ in range(count):
        x, y = random.random(2) * mm
        dx, dy = random.random(2) - 0.5
        thick = radius * (0.55 + 0.45 * random.random())
        steps = int(mm / 2.0 / texel)
        turns = random.random((steps, 2)) - 0.5
        drift = np.zeros(2)
        for step in range(steps):
            drift = 0.97 * drift + 0.06 * turns[step]
            dx, dy = dx + drift[0], dy + drift[1]
            length = np.sqrt(dx * dx + dy * dy)
            dx, dy = dx / length, dy / length
            x, y = x + dx * texel, y + dy * texel
            r = thick * (1.0 - 0.7 * step / steps)
            column, row = int(np.floor(x / texel)), int(np.floor(y / texel))
            across, down = (column + offsets + 0.5) * texel - x, (row + offsets + 0.5) * texel - y
            height = np.sqrt(np.maximum(r * r - down[:, None] * down[:, None] - across * across, 0.0))
            place = np.ix_((row + offsets) % SIZE, (column + offsets) % SIZE)
            half[place] = np.maximum(half[place], height)
    return half
