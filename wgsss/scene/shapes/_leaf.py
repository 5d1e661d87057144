"""A leaf: a thin closed sheet that is thicker along its veins."""

from __future__ import annotations

import numpy as np

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._rows import fit_spacing, join_rows, vertex_count

_LENGTH = 80.0  # mm, with the stem
_STEM = 9.0  # mm
_HALF_WIDTH = 19.0  # mm, of the blade
_BLADE = 0.35  # mm, thickness between the veins
_STEM_RADIUS = 0.8  # mm
_VEIN_SPACING = 8.0  # mm along the midrib; left and right alternate
_EDGE = 0.15  # mm, width over which the rim of the blade is rounded


def leaf(vertices: int | None = None) -> Mesh:
    """Build a leaf along +y with the end of the stem at the origin and its upper side towards +z: 80 x 38 mm.

    It is 0.35 mm thick between the veins, and up to 1.3 mm at the midrib and side veins, which stand out below. The
    surface is closed. Vertices: 1000 to 500000, by default 14000. Raises InputError for another count.
    """
    target = vertex_count("leaf", vertices, 14_000, 1000, 500_000)

    def rows(spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return y, half width and number of points of each row. The rows at both ends are single points."""
        y = np.linspace(0, _LENGTH, round(_LENGTH / (0.866 * spacing)) + 1)
        width = _half_width(y)
        counts = np.maximum(np.round(2 * width / spacing), 2).astype(int) + 3
        counts[[0, -1]] = 1
        return y, width, counts

    y, width, counts = rows(fit_spacing(lambda h: 2 * int(rows(h)[2].sum() - rows(h)[2].size), target))
    row = np.repeat(np.arange(len(counts)), counts)
    index = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    last = counts[row] - 1
    # A row has points on the rim, one point just inside the rim on each side, and evenly spaced points between these.
    inset = np.minimum(_EDGE / np.maximum(width, 1e-9), 0.3)[row]
    even = (index - 1) / np.maximum(last - 2, 1) * 2 - 1
    across = np.where(index == 0, -1.0, np.where(index == last, 1.0, even * (1 - inset)))
    across[last == 0] = 0.0
    x, y = across * width[row], y[row]

    vein = _veins(x, y)
    away = width[row] * (1 - np.abs(across))
    reach = np.minimum(np.maximum(_EDGE, (_BLADE + vein) / 2), np.maximum(width[row], 1e-9))
    rounded = np.sqrt(1 - np.clip(1 - away / reach, 0, 1) ** 2)
    middle = _middle(x, y)
    rim = (index == 0) | (index == last)
    upper = np.stack([x, y, middle + np.where(rim, 0, rounded * (0.5 * _BLADE + 0.25 * vein))], axis=1)
    lower = np.stack([x, y, middle - np.where(rim, 0, rounded * (0.5 * _BLADE + 0.75 * vein))], axis=1)

    below = np.arange(len(row))
    below[~rim] = len(row) + np.arange((~rim).sum())
    faces = join_rows(counts, (across + 1) / 2, closed=False)
    faces = np.concatenate([faces, below[faces][:, ::-1]])
    return Mesh(positions=np.concatenate([upper, lower[~rim]]).astype(np.float32), faces=faces, name="leaf")


def _half_width(y: np.ndarray) -> np.ndarray:
    """Compute half the width, mm, of stem and blade at y, mm; it is 0 at both ends."""
    along = np.clip((y - _STEM) / (_LENGTH - _STEM), 0, 1)
    blade = _HALF_WIDTH * np.sin(np.pi * along**0.72) ** 1.1
    stem = _STEM_RADIUS * np.sqrt(np.clip(1 - (1 - np.clip(y / _STEM_RADIUS, 0, 1)) ** 2, 0, 1)) * (1 - along)
    return np.hypot(stem, blade)


def _vein_phase(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Compute a phase that is a whole number on side veins. They leave the midrib at 45 degrees and bend to the tip."""
    beside = np.abs(x)
    return (y - 0.75 * beside - 0.012 * beside**2 - _STEM) / _VEIN_SPACING + 0.5 * (x > 0)


def _veins(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Compute the thickness, mm, that midrib, stem and side veins add to the blade."""
    along = np.clip((y - _STEM) / (_LENGTH - _STEM), 0, 1)
    midrib = (0.95 * (1 - along) + 0.1) * np.exp(-0.5 * (x / (0.9 - 0.4 * along)) ** 2)
    stem = (2 * _STEM_RADIUS - _BLADE) * np.clip(1 - (y - 0.6 * _STEM) / _STEM, 0, 1) ** 2
    phase = _vein_phase(x, y)
    away = np.abs(phase - np.round(phase)) * _VEIN_SPACING * 0.75  # times the cosine of the slope of the vein
    fade = np.clip(1.15 - np.abs(x) / np.maximum(_half_width(y), 1e-9), 0, 1) * np.clip(4 * along * (1 - along), 0, 1)
    side = 0.32 * fade * np.exp(-0.5 * (away / 0.42) ** 2)
    on_stem = np.clip((0.5 * _STEM - y) / _STEM + 1, 0, 1) * (np.abs(x) < 2 * _STEM_RADIUS)
    return np.maximum(np.maximum(midrib, side), stem * on_stem)


def _middle(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Compute the height, mm, of the middle of the sheet: a fold at the midrib, an arch, bulges between the veins."""
    fold = 0.22 * (np.sqrt(x**2 + 4) - 2)
    arch = -0.0035 * (y - 30) ** 2 - 0.004 * x**2
    half_width = _half_width(y)
    blade = np.clip(half_width / 6 - 0.3, 0, 1)
    quilt = -0.22 * np.cos(2 * np.pi * _vein_phase(x, y)) * blade * np.clip(np.abs(x) / 3, 0, 1)
    ripple = 0.9 * np.sin(y / 6.5 + np.sign(x)) * (np.abs(x) / _HALF_WIDTH) ** 2
    return fold + arch + quilt + ripple
