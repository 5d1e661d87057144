"""A left ear: a thin cupped shell with a rolled rim, as one closed surface."""

from __future__ import annotations

import numpy as np

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._curve import smooth_curve
from wgsss.scene.shapes._relax import relax
from wgsss.scene.shapes._rows import fit_spacing, join_rows, spread, vertex_count

_SHELL = 2.0  # mm, thickness of the shell along its normal
_CENTRE = np.array([0.0, 1.0])

# Points of the outline, x and y, and the radius of the rim at each, mm. Seen from the side of the head: the nose is at
# negative x, y is up. The helix is thick at the top, and the edge at the cheek is as thin as the shell.
_OUTLINE = np.array(
    [
        (1.0, 30.0, 3.1), (9.5, 27.6, 3.0), (15.3, 21.0, 2.8), (17.6, 11.5, 2.6), (16.8, 1.0, 2.4),
        (13.8, -8.5, 2.1), (9.6, -17.0, 1.9), (6.2, -24.0, 1.9), (0.6, -29.4, 2.1), (-5.6, -28.4, 2.0),
        (-9.2, -22.0, 1.7), (-10.6, -14.0, 1.3), (-12.4, -5.0, 1.3), (-12.8, 4.0, 1.8), (-13.4, 13.0, 2.7),
        (-11.6, 22.0, 3.0), (-6.6, 28.0, 3.1),
    ]
)  # fmt: skip

# Ridges: the points of a curve, its height at each point (mm, towards the viewer) and its half width (mm).
_Ridge = tuple[tuple[tuple[float, float], ...], tuple[float, ...], float]
_ANTIHELIX: _Ridge = (
    ((0.5, -15.0), (5.0, -11.5), (8.2, -4.0), (8.4, 4.0), (6.0, 11.5), (2.5, 17.5), (0.0, 22.0)),
    (3.5, 5.0, 5.6, 5.6, 5.0, 4.0, 2.0),
    1.9,
)
_LOWER_CRUS = (((7.6, 6.0), (3.0, 10.0), (-3.0, 12.6), (-9.5, 14.0)), (3.0, 5.0, 4.6, 0.5), 1.7)
_HELIX_CRUS = (((-12.0, 9.0), (-9.6, 5.0), (-5.0, 1.6), (0.5, -0.4)), (0.3, 2.2, 4.2, 1.5), 2.0)
_TRAGUS = (((-9.4, -2.5), (-7.6, -6.5), (-7.6, -10.5)), (3.0, 7.0, 3.0), 1.9)
_ANTITRAGUS = (((2.0, -14.8), (-2.5, -16.0)), (2.0, 3.4), 2.0)
_LOBE = (((-3.5, -22.5), (2.0, -22.5)), (2.2, 2.2), 3.6)

# Hollows (the bowl in front of the ear canal, and the canal): x and y of the centre, depth and half width, mm.
_HOLLOWS = ((2.0, 5.0, 5.6, 4.4), (2.6, -2.0, 5.6, 4.4), (-0.8, -8.0, 5.2, 4.2), (-4.2, -5.5, 4.0, 2.8))
_FOLDS = (_ANTIHELIX, _LOWER_CRUS)
_FRONT_ONLY = (_HELIX_CRUS, _TRAGUS, _ANTITRAGUS, _LOBE)


def ear(vertices: int | None = None) -> Mesh:
    """Build a left ear facing +z, with its back edge at +x: 60 mm tall, a shell of 2 mm with a rim of up to 6 mm.

    The surface is closed. Its rings go from the centre of the front outwards, over the rolled rim, and to the centre of
    the back. Vertices: 500 to 500000, by default 6000. Raises InputError for another count.
    """
    target = vertex_count("ear", vertices, 6000, 500, 500_000)
    outline = smooth_curve(_OUTLINE, 512, closed=True)
    rim, radius = outline[:, :2], outline[:, 2]
    tangent = np.roll(rim, -1, axis=0) - np.roll(rim, 1, axis=0)
    inward = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    perimeter = np.linalg.norm(rim - np.roll(rim, 1, axis=0), axis=1).sum()
    reach = perimeter / (2 * np.pi)

    def rings(spacing: float) -> tuple[int, int, np.ndarray]:
        """Return the numbers of rings on each sheet and over the rim, and the number of points of each ring."""
        apart = spacing * 0.866
        sheet, bead = max(round(reach / apart), 3), max(round(1.2 * np.pi * radius.mean() / apart), 3)
        share = np.concatenate([np.arange(1, sheet + 1) / sheet, np.ones(bead - 1), np.arange(sheet, 0, -1) / sheet])
        counts = np.maximum(np.round(share * perimeter / spacing), 5).astype(int)
        return sheet, bead, np.concatenate([[1], counts, [1]])

    sheet, bead, counts = rings(fit_spacing(lambda h: int(rings(h)[2].sum()), target))
    row = np.repeat(np.arange(len(counts)), counts)
    params = spread(counts, closed=True) + 0.5 * (row % 2) / counts[row]

    def around(values: np.ndarray) -> np.ndarray:
        """Interpolate values (N, K) along the outline at the points of all rings."""
        at = np.linspace(0, 1, len(values) + 1)
        wrapped = np.concatenate([values, values[:1]])
        return np.stack([np.interp(params, at, wrapped[:, k]) for k in range(values.shape[1])], axis=1)

    # In cross-section, the rim is a circle. It touches the back sheet, and meets the front sheet at the angle `start`
    # about the centre of the circle: 0 is inwards, 90 degrees is towards the viewer. Where the shell is thicker than
    # the circle (the tragus), the circle is enlarged.
    start = np.arcsin(np.clip(_SHELL / radius - 1, -1, 1))
    for _ in range(2):
        front_edge = rim + inward * (radius * (1 + np.cos(start)))[:, None]
        back_edge = rim + inward * radius[:, None]
        thickness = _front(front_edge) - _back(back_edge)
        radius = _smooth_around(np.maximum(radius, thickness / 2))
        start = np.arcsin(np.clip(thickness / radius - 1, -1, 1))
    height = _back(back_edge) + radius

    on_front, on_back = row <= sheet, row >= sheet + bead
    share = np.where(on_front, row / sheet, (len(counts) - 1 - row) / sheet)[:, None]
    edge = np.where(on_front[:, None], around(front_edge), around(back_edge))
    position = np.empty((len(row), 3))
    position[:, :2] = _CENTRE + share * (edge - _CENTRE)
    position[on_front, 2] = _front(position[on_front, :2])
    position[on_back, 2] = _back(position[on_back, :2])

    turn = np.clip((row - sheet) / bead, 0, 1)
    at = around(np.column_stack([rim, inward, radius, height, start]))
    angle = at[:, 6] + turn * (1.5 * np.pi - at[:, 6])
    curl = at[:, :2] + at[:, 2:4] * (at[:, 4] * (1 + np.cos(angle)))[:, None]
    on_rim = (row >= sheet) & (row <= sheet + bead)
    position[on_rim, :2] = curl[on_rim]
    position[on_rim, 2] = (at[:, 5] + at[:, 4] * np.sin(angle))[on_rim]

    faces = join_rows(counts, params, closed=True)
    position = relax(position, faces, steps=3)
    return Mesh(positions=position.astype(np.float32), faces=faces, name="ear")


def _smooth_around(values: np.ndarray) -> np.ndarray:
    """Smooth values (N,) along the outline over about a fifteenth of its length."""
    width = len(values) // 30
    window = np.hanning(2 * width + 3)[1:-1]
    return np.convolve(np.pad(values, width, mode="wrap"), window / window.sum(), mode="valid")


def _ridges(q: np.ndarray, features: tuple[_Ridge, ...], *, soften: float) -> np.ndarray:
    """Compute the height (N,), mm, of ridges at points (N,2). `soften` widens and lowers them."""
    total = np.zeros(len(q))
    for points, heights, width in features:
        curve = smooth_curve(np.column_stack([points, heights]), 2 * len(points) - 1)
        start, run = curve[:-1], np.diff(curve, axis=0)
        off_x, off_y = q[:, None, 0] - start[:, 0], q[:, None, 1] - start[:, 1]
        along = (off_x * run[:, 0] + off_y * run[:, 1]) / (run[:, 0] ** 2 + run[:, 1] ** 2)
        along = np.clip(along, 0, 1)
        away = (off_x - along * run[:, 0]) ** 2 + (off_y - along * run[:, 1]) ** 2
        fall = np.exp(away * (-0.5 / (width * soften) ** 2)) * (start[:, 2] + along * run[:, 2]) / soften
        total += fall.max(axis=1)
    return total


def _cup(q: np.ndarray) -> np.ndarray:
    """Compute the height of the sheet without folds at points (N,2): a bowl with raised back edge and top."""
    height = 0.010 * (q[:, 0] + 6) ** 2 + 0.003 * q[:, 1] ** 2 + 0.05 * q[:, 1]
    for x, y, depth, width in _HOLLOWS:
        height -= depth * np.exp(((q[:, 0] - x) ** 2 + (q[:, 1] - y) ** 2) * (-0.5 / width**2))
    return height


def _front(q: np.ndarray) -> np.ndarray:
    """Compute the height (N,), mm, of the front sheet at points (N,2)."""
    return _cup(q) + _ridges(q, _FOLDS + _FRONT_ONLY, soften=1.0)


def _back(q: np.ndarray) -> np.ndarray:
    """Compute the height (N,), mm, of the back sheet: the cup with softer folds, one shell thickness behind it."""

    def sheet(q: np.ndarray) -> np.ndarray:
        return _cup(q) + _ridges(q, _FOLDS, soften=1.5)

    step = 0.2
    slope_x, slope_y = ((sheet(q + d) - sheet(q - d)) / (2 * step) for d in (np.array([step, 0]), np.array([0, step])))
    return sheet(q) - _SHELL * np.minimum(np.sqrt(1 + slope_x**2 + slope_y**2), 2.0)
