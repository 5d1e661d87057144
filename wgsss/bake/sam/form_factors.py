"""Form factors between reduced triangle fans (000 eq. 11), integrated over both on the GPU."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.fan_quadrature import Fans, Points
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

_MODULE = "sam/form_factors"
# Shares of K by which it may be off, to second order, where fans count as one point each, and where each quad does.
_BENT = (0.004, 0.012)
# Otherwise Gauss' points of order 2, 3 and so on, by how large the fans are against what R bends over where they come
# nearest to each other, squared. Measured, so that K is off by half a percent at most, and by 2 % beyond the last.
_NEAREST = (2.0, 4.0, 14.0, 20.0, 60.0, 120.0)
_WIDTH = 1.5  # of a fan to either side, in roots of its mean squared extent
MOST = len(_BENT) + len(_NEAREST)
"""the highest order of points in a quad"""
_DARK = 0.01  # of the brightest channel's R: what a channel that is darker is off by matters less
_TURNS = 60_000  # of a shader's loops: lavapipe ends them after 65,535, those of nested ones together
_POINTS = 1_000_000  # on the device at once
_SUBMISSION = 0.4  # seconds that a dispatch may take
_FIRST_RATE = 1e7  # pairs of points per second that any device manages


@dataclass(frozen=True, eq=False)
class Reflectance:
    """R_d over the squared distance, by its leading bits as a float32."""

    R: Array
    """float32 (k, 4), 1/mm^2"""
    first: int
    """the leading bits of the first row"""
    bend: Array
    """float64 (k,): by how much of itself R differs from a straight line over a change of the squared distance as large
    as itself, to second order: q^2 |d^2R/dq^2| / R with q = r^2, of the channel where it is most"""

    @property
    def squares(self) -> Array:
        """float64 (k,), mm^2: the squared distances."""
        return squares(self.first, self.first + len(self.R))


def squares(first: int, end: int) -> Array:
    """The squared distances (end - first,), mm^2, whose leading bits count up from `first`."""
    bits = np.arange(first, end, dtype=np.uint32) << np.uint32(shift())
    return bits.view(np.float32).astype(np.float64)


def shift() -> int:
    """Bits of a squared distance that tables leave out."""
    return wgsl.load(_MODULE).constants["SHIFT"]


def reflectance(profile: Profile, farthest: float) -> Reflectance:
    """R_d up to `farthest` mm. Nearer than a thousandth of what half of the light travels it is level."""
    lit = profile.total > 0.0
    nearest = 1e-3 * float(profile.range(0.5)[lit].min()) if lit.any() else 1.0
    first, last = (int(np.float32(r * r).view(np.uint32)) >> shift() for r in (nearest, max(farthest, 2.0 * nearest)))
    q = squares(first, last + 2)
    R = profile.reflectance(np.sqrt(q))
    u = np.log(q)
    slope = np.gradient(R, u, axis=0)
    curved = np.abs(np.gradient(slope, u, axis=0) - slope)
    bend = (curved / np.maximum(R + _DARK * R.max(axis=1, keepdims=True), 1e-300)).max(axis=1)
    return Reflectance(np.column_stack([R, np.zeros(len(q))]).astype(np.float32), first, bend)


def form_factors(gpu: Gpu, mesh: Mesh, profile: Profile, pairs: Array) -> Array:
    """K_oi (P, 3), float32, of pairs (P, 2) of vertices o and i: without unit.

    The mean over the fan of o of the integral over the fan of i of R_d(|x_i - x_o|). By Gauss' points, as many as
    the profile bends over the fans; far apart, each counts as one. 0 for vertices without a fan.
    """
    return FormFactors(gpu, mesh, profile).of(pairs)


class FormFactors:
    """The form factors of one mesh and profile, a few at a time."""

    def __init__(self, gpu: Gpu, mesh: Mesh, profile: Profile) -> None:
        self.gpu, self.fans = gpu, Fans(mesh)
        self.R = reflectance(profile, float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) + 1e-3)
        self.table = gpu.buffer(self.R.R)
        self.rate = _FIRST_RATE

    def of(self, pairs: Array, most: int = MOST) -> Array:
        """As `form_factors`, by points of the order `most` at most."""
        pairs = np.asarray(pairs, np.int64).reshape(-1, 2)
        K = np.zeros((len(pairs), 3))
        both = (self.fans.area[pairs] > 0.0).all(axis=1)
        orders = np.where(both, np.minimum(self._orders(pairs), most), -1)
        for order in np.unique(orders[both]):
            chosen = np.flatnonzero(orders == order)
            K[chosen] = self._integrated(pairs[chosen], int(order))
        return K.astype(np.float32)

    def _orders(self, pairs: Array) -> Array:
        """Of which order (P,) the points for each pair are, so that they tell how R bends over both fans."""
        fans, (o, i) = self.fans, pairs.T
        d = fans.centre[i] - fans.centre[o]
        square = np.maximum(np.einsum("pk,pk->p", d, d), 1e-30)
        extent = fans.extent[o] + fans.extent[i]
        across = [np.square(np.einsum("pk,pk->p", d, fans.normal[v])) for v in (o, i)]
        # What moves along d changes the distance, and in a fan nothing moves along its normal.
        along = sum(fans.extent[v] * np.maximum(1.0 - a / square, 0.25) for v, a in zip((o, i), across, strict=True))
        bent = self._bend(square + extent) * along
        # Where the fans come nearest to each other, about which their normals and sizes say what is needed.
        apart = np.minimum(*across)
        aside = np.maximum(np.sqrt(np.maximum(square - apart, 0.0)) - _WIDTH * np.sqrt(extent), 0.0)
        nearest = self._bend(apart + np.square(aside)) * extent
        few = np.searchsorted(_BENT, bent, side="right")
        return np.where(few < len(_BENT), few, len(_BENT) + np.searchsorted(_NEAREST, nearest, side="right"))

    def _bend(self, q: Array) -> Array:
        """1/mm^2, (P,): by how much of itself R bends at squared distances, per square of what moves."""
        q = np.maximum(q, self.R.squares[0])
        found: Array = np.interp(q, self.R.squares, self.R.bend) / q
        return found

    def _integrated(self, pairs: Array, order: int) -> Array:
        """K (P, 3) by points of one order."""
        count = self.fans.count(order)
        # Alike for all, since invocations that walk in step take as many turns as the longest loops of any.
        step = max(_TURNS // int(count.max() + 1), 1)
        work = count[pairs[:, 0]] * count[pairs[:, 1]]
        K = np.zeros((len(pairs), 3))
        first = 0
        while first < len(pairs):
            ahead = slice(first, first + max(int(self.rate * _SUBMISSION), 1))
            within = np.cumsum(work[ahead]) <= self.rate * _SUBMISSION
            within &= np.cumsum(count[pairs[ahead]].sum(axis=1)) <= _POINTS
            some = slice(first, first + max(int(within.sum()), 1))
            K[some] = self._dispatch(pairs[some], self.fans.points(np.unique(pairs[some]), order), step)
            first = some.stop
        return K / self.fans.area[pairs[:, :1]]

    def _dispatch(self, pairs: Array, points: Points, step: int) -> Array:
        start = time.perf_counter()
        at = np.searchsorted(points.vertex, pairs)
        (o, i), (o_end, i_end) = points.start[at].T, points.start[at + 1].T
        count = -(-(o_end - o) // step)
        which = np.repeat(np.arange(len(pairs)), count)
        starts = np.cumsum(count) - count
        o_first = o[which] + (np.arange(len(which)) - starts[which]) * step
        terms = {
            "o_first": o_first,
            "o_end": np.minimum(o_first + step, o_end[which]),
            "i_first": i[which],
            "i_end": i_end[which],
        }
        graph = Graph(self.gpu)
        sums = graph.dispatch(
            _MODULE,
            size=len(which),
            params={"first_entry": self.R.first},
            table=self.table,
            points={"position": points.position, "area": points.area, "extent": points.extent},
            terms=terms,
        )
        graph.run(sums)
        found = np.add.reduceat(graph.read(sums)[:, :3].astype(np.float64), starts, axis=0)
        done = float(((o_end - o) * (i_end - i)).sum())
        rate = done / (time.perf_counter() - start)
        self.rate = float(np.clip(rate, self.rate / 2, self.rate * 4)) if done > 1e5 else self.rate
        return found
