"""Form factors between reduced triangle fans, integrated numerically on the GPU (Maisch & Ropinski 2017, eq. 11).

The form factor K_oi is what sender i contributes to M at receiver o per unit of irradiance L_d at i. It is a double
integral of R_d over the fans of both. Each fan is replaced by quadrature points, more of them where R_d varies more
over the two fans. A distant pair then costs one evaluation of R_d, and a near one hundreds.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fan_quadrature import FanPoints, Fans
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.optics import Profile
from wgsss.optics.lookup import interval_starts, leading_bits
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

_MODULE = "sam/form_factors"
_FLAT_LIMITS = (0.004, 0.012)
"""largest estimated relative error of K, to second order, for points of order 0 and of order 1"""
_GAUSS_LIMITS = (2.0, 4.0, 14.0, 20.0, 60.0, 120.0)
"""for Gauss points of order 2, 3, ...: largest product of the fans' extents and the relative curvature of R_d where the
fans come nearest to each other. Measured: K is then off by half a percent at most, and by 2 % beyond the last limit"""
_HALF_WIDTH = 1.5  # of a fan, in square roots of its extent
MAX_ORDER = len(_FLAT_LIMITS) + len(_GAUSS_LIMITS)
"""the highest order of quadrature points that is used"""
_DARK = 0.01  # of the brightest channel's R_d: the error of a channel that is darker than this counts less
_MAX_TURNS = 60_000  # of a shader's loops: lavapipe ends them after 65,535, counting nested loops together
_MAX_POINTS = 1_000_000  # on the device at once
_DISPATCH_SECONDS = 0.4  # that one dispatch should take
_FIRST_RATE = 1e7  # pairs of points per second, which any device manages: replaced by the measured rate


@dataclass(frozen=True, eq=False)
class Reflectance:
    """A table of R_d over the squared distance, whose rows are addressed by the leading bits of a float32."""

    R: Array
    """float32 (k, 4), 1/mm^2; the last column is 0"""
    first: int
    """the leading bits of the squared distance of the first row"""
    bend: Array
    """float64 (k,): relative curvature of R_d, q^2 |d^2R/dq^2| / R with q = r^2, of the channel where it is largest. It
    is the second-order error of taking R_d for linear over a change of q that is as large as q"""

    @property
    def squares(self) -> Array:
        """The squared distances of the rows, float64 (k,), mm^2."""
        return interval_starts(self.first, self.first + len(self.R))


def reflectance(profile: Profile, farthest: float) -> Reflectance:
    """Tabulate R_d up to a distance of `farthest` mm.

    The table starts at a thousandth of the radius within which half of the light leaves; R_d is constant below that.
    """
    lit = profile.total > 0.0
    nearest = 1e-3 * float(profile.range(0.5)[lit].min()) if lit.any() else 1.0
    first, last = leading_bits(np.square([nearest, max(farthest, 2.0 * nearest)])).tolist()
    q = interval_starts(first, last + 2)
    R = profile.reflectance(np.sqrt(q))
    u = np.log(q)
    slope = np.gradient(R, u, axis=0)
    curved = np.abs(np.gradient(slope, u, axis=0) - slope)
    bend = (curved / np.maximum(R + _DARK * R.max(axis=1, keepdims=True), 1e-300)).max(axis=1)
    return Reflectance(np.column_stack([R, np.zeros(len(q))]).astype(np.float32), first, bend)


def form_factors(gpu: Gpu, mesh: Mesh, profile: Profile, pairs: Array) -> Array:
    """Return the form factors K_oi of pairs of vertices, float32 (P, 3), without unit.

    K_oi is the mean over the fan of o of the integral of R_d(|x_i - x_o|) over the fan of i (eq. 11). It is 0 where a
    vertex has no faces. The sides of the pair (eq. 13, 14) are not tested.

    Args:
        pairs: int (P, 2), receiver o and sender i.
    """
    return FormFactors(gpu, mesh, profile).of(pairs)


class FormFactors:
    """Integrates form factors K_oi (eq. 11) between vertices of one mesh, for one profile."""

    def __init__(self, gpu: Gpu, mesh: Mesh, profile: Profile) -> None:
        self.gpu, self.fans = gpu, Fans(mesh)
        self.R = reflectance(profile, float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) + 1e-3)
        self.table = gpu.buffer(self.R.R)
        self.rate = _FIRST_RATE

    def of(self, pairs: Array, max_order: int = MAX_ORDER) -> Array:
        """Return K_oi of pairs (P, 2), float32 (P, 3), with quadrature points of at most the order `max_order`."""
        pairs = np.asarray(pairs, np.int64).reshape(-1, 2)
        K = np.zeros((len(pairs), 3))
        has_area = (self.fans.area[pairs] > 0.0).all(axis=1)
        orders = np.where(has_area, np.minimum(self._orders(pairs), max_order), -1)
        for order in np.unique(orders[has_area]):
            chosen = np.flatnonzero(orders == order)
            K[chosen] = self._integrate(pairs[chosen], int(order))
        return K.astype(np.float32)

    def _orders(self, pairs: Array) -> Array:
        """Choose the order (P,) of the quadrature points for each pair, from how much R_d varies over both fans."""
        fans, (o, i) = self.fans, pairs.T
        d = fans.centre[i] - fans.centre[o]
        square = np.maximum(np.einsum("pk,pk->p", d, d), 1e-30)
        extent = fans.extent[o] + fans.extent[i]
        across = [np.square(np.einsum("pk,pk->p", d, fans.normal[v])) for v in (o, i)]
        # Only the extent along d changes the distance to first order. A fan is flat: it has none along its normal.
        along = sum(fans.extent[v] * np.maximum(1.0 - a / square, 0.25) for v, a in zip((o, i), across, strict=True))
        flat_error = self._curvature(square + extent) * along
        # The least distance between the fans, estimated from their normals and widths.
        apart = np.minimum(*across)
        aside = np.maximum(np.sqrt(np.maximum(square - apart, 0.0)) - _HALF_WIDTH * np.sqrt(extent), 0.0)
        variation = self._curvature(apart + np.square(aside)) * extent
        flat_order = np.searchsorted(_FLAT_LIMITS, flat_error, side="right")
        gauss_order = len(_FLAT_LIMITS) + np.searchsorted(_GAUSS_LIMITS, variation, side="right")
        return np.where(flat_order < len(_FLAT_LIMITS), flat_order, gauss_order)

    def _curvature(self, q: Array) -> Array:
        """Return the relative curvature of R_d at squared distances `q` (P,), mm^2, per mm^2 of squared movement."""
        q = np.maximum(q, self.R.squares[0])
        curvature: Array = np.interp(q, self.R.squares, self.R.bend) / q
        return curvature

    def _integrate(self, pairs: Array, order: int) -> Array:
        """Return K (P, 3) by points of one order, in dispatches of about `_DISPATCH_SECONDS`."""
        count = self.fans.point_counts(order)
        # Receivers with many points are split into parts. All parts are equally long, since invocations that run in
        # step take as many turns as the longest loop among them.
        step = max(_MAX_TURNS // int(count.max() + 1), 1)
        work = count[pairs[:, 0]] * count[pairs[:, 1]]
        K = np.zeros((len(pairs), 3))
        first = 0
        while first < len(pairs):
            ahead = slice(first, first + max(int(self.rate * _DISPATCH_SECONDS), 1))
            within = np.cumsum(work[ahead]) <= self.rate * _DISPATCH_SECONDS
            within &= np.cumsum(count[pairs[ahead]].sum(axis=1)) <= _MAX_POINTS
            batch = slice(first, first + max(int(within.sum()), 1))
            K[batch] = self._dispatch(pairs[batch], self.fans.points(np.unique(pairs[batch]), order), step)
            first = batch.stop
        return K / self.fans.area[pairs[:, :1]]

    def _dispatch(self, pairs: Array, points: FanPoints, step: int) -> Array:
        """Return the integral of R_d over both fans of each pair, float64 (P, 3), mm^2.

        Each invocation sums over at most `step` points of the receiver and all points of the sender.
        """
        start = time.perf_counter()
        row = np.searchsorted(points.vertex, pairs)
        (o, i), (o_end, i_end) = points.start[row].T, points.start[row + 1].T
        count = -(-(o_end - o) // step)
        pair = np.repeat(np.arange(len(pairs)), count)
        starts = np.cumsum(count) - count
        o_first = o[pair] + (np.arange(len(pair)) - starts[pair]) * step
        terms = {
            "o_first": o_first,
            "o_end": np.minimum(o_first + step, o_end[pair]),
            "i_first": i[pair],
            "i_end": i_end[pair],
        }
        graph = Graph(self.gpu)
        sums = graph.dispatch(
            _MODULE,
            size=len(pair),
            params={"first_entry": self.R.first},
            table=self.table,
            points={"position": points.position, "area": points.area, "extent": points.extent},
            terms=terms,
        )
        graph.run(sums)
        integrals = np.add.reduceat(graph.read(sums)[:, :3].astype(np.float64), starts, axis=0)
        done = float(((o_end - o) * (i_end - i)).sum())
        rate = done / (time.perf_counter() - start)
        self.rate = float(np.clip(rate, self.rate / 2, self.rate * 4)) if done > 1e5 else self.rate
        return integrals
