"""Single scattering below the surface of a body, by a march along refracted lines of sight and refracted light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.emitters import LightValue
from wgsss.reference.layered_medium import Coefficients, LayeredMedium
from wgsss.reference.refracted_light import Boundary, henyey_greenstein, incident
from wgsss.reference.world_surface import Hits, WorldSurface

Array = npt.NDArray[Any]

_DEEPEST = 14.0  # optical depth at which a line of sight ends: exp(-14) is 1e-6
_STRETCH = 3.0  # logarithm of the ratio of the last step along a line of sight to the first
_COARSE = 32  # steps of the search for the end of a line of sight
_REFRACTIONS = 5  # rays cast to find where the light that reaches a point has entered
_DARK = 1e-7  # transmittance below which light is not followed


@dataclass(frozen=True)
class Resolution:
    """Numbers of steps along a line of sight, and along the light that reaches a point."""

    steps: int
    light_steps: int


class SingleScattering:
    """Radiance inside a body that was scattered once.

    Light enters the body once, where it first meets the surface on its way back from the point that scatters it. The
    focusing of light by a curved, refracting surface is left out, as the product's L_d leaves it out.
    """

    def __init__(
        self,
        medium: LayeredMedium,
        boundary: Boundary,
        surface: WorldSurface,
        blockers: Sequence[WorldSurface],
        lights: Sequence[LightValue],
        resolution: Resolution,
    ) -> None:
        """`blockers` are the surfaces that cast shadows."""
        self._medium, self._boundary, self._surface = medium, boundary, surface
        self._blockers, self._lights, self._resolution = blockers, lights, resolution

    def radiance(self, x: Array, normal: Array, to_eye: Array) -> Array:
        """Return the radiance L (N, 3) that arrives from inside at points x of the surface, W/(m^2 sr).

        It arrives along the refraction of the unit directions `to_eye` (N, 3).
        """
        into = -self._boundary.refracted(to_eye, normal)[0]
        sight = self._line_of_sight(x, into)
        total = np.zeros((len(x), 3))
        nodes, depth_of_lift = sight.position.copy(), np.zeros(sight.position.shape[:2])
        nodes[:, 0] += self._surface.lift * into  # the first node is on the surface
        depth_of_lift[:, 0] = -self._surface.lift * np.einsum("nd,nd->n", into, normal)
        nodes = nodes.reshape(-1, 3)
        d = np.repeat(into, sight.position.shape[1], axis=0)
        normals = np.repeat(normal, sight.position.shape[1], axis=0)
        is_dark = (sight.transmittance.max(axis=2) < _DARK).ravel()
        for light in self._lights:
            beam, direction = self._light_at(light, nodes, normals, depth_of_lift.ravel(), is_dark)
            phase = henyey_greenstein(np.einsum("nd,nd->n", direction, d)[:, None], self._medium.g)
            phase = phase.reshape(*sight.position.shape[:2], -1)
            scattering = np.einsum("nsj,nsjc,nsj->nsc", sight.shares, sight.sigma_s, _middles(phase))
            carried = sight.transmittance * beam.reshape(sight.transmittance.shape)
            mean = logarithmic_mean(carried[:, :-1], carried[:, 1:])
            total += np.einsum("nsc,nsc,ns->nc", scattering, mean, sight.length)
        return total

    def _line_of_sight(self, x: Array, into: Array) -> _Path:
        hits = self._surface.first(x + self._surface.lift * into, into)
        reach = np.minimum(hits.distance, 4.0 * np.linalg.norm(np.ptp(self._surface.positions, axis=0)))
        coarse = self._path(x, into, reach[:, None] * _spread(_COARSE))
        is_over = coarse.transmittance.max(axis=2) < np.exp(-_DEEPEST)
        end = np.where(is_over.any(axis=1), is_over.argmax(axis=1), _COARSE)
        distances = (reach * _spread(_COARSE)[end])[:, None] * _spread(self._resolution.steps)
        if self._medium.is_uniform:
            return self._path(x, into, distances)
        return self._path(x, into, with_crossings(distances, self._above(x, into, distances)[0]))

    def _above(self, x: Array, direction: Array, distances: Array) -> tuple[Array, Array]:
        """Return the depth of each interface below the nodes of rays (N, S + 1, J - 1), and the uv there (_, 2)."""
        position = x[:, None] + distances[..., None] * direction[:, None]
        depth, uv = self._surface.closest(position.reshape(-1, 3))
        return (self._medium.interfaces(uv) - depth[:, None]).reshape(*distances.shape, -1), uv

    def _path(self, x: Array, direction: Array, distances: Array) -> _Path:
        """Return rays from points x (N, 3) with nodes at `distances` (N, S + 1)."""
        position = x[:, None] + distances[..., None] * direction[:, None]
        count, nodes = distances.shape
        length = np.diff(distances, axis=1)
        medium = self._medium
        if medium.is_uniform:
            at = medium.coefficients(np.zeros((1, 2)))
            shares = np.ones((count, nodes - 1, 1))
            coefficients = Coefficients(at.sigma_s[None], at.sigma_t[None])
        else:
            above, uv = self._above(x, direction, distances)
            shares = shares_of_layers(above)
            at = medium.coefficients(uv)
            coefficients = Coefficients(
                _middles(at.sigma_s.reshape(count, nodes, -1, 3)), _middles(at.sigma_t.reshape(count, nodes, -1, 3))
            )
        tau = np.einsum("nsj,nsjc,ns->nsc", shares, np.broadcast_to(coefficients.sigma_t, (*shares.shape, 3)), length)
        transmittance = np.ones((count, nodes, 3))
        transmittance[:, 1:] = np.exp(-np.cumsum(tau, axis=1))
        sigma_s = np.broadcast_to(coefficients.sigma_s, (*shares.shape, 3))
        return _Path(position, length, shares, sigma_s, transmittance)

    def _light_at(
        self, light: LightValue, x: Array, normal: Array, too_deep: Array, is_dark: Array
    ) -> tuple[Array, Array]:
        """Return the irradiance (N, 3) that light causes across its direction at points x inside, and the direction.

        The direction (N, 3) points towards the entry of the light. `normal` is that from which the search for the
        entry starts. Points with `too_deep` (N,) mm above 0 lie that much deeper than the points that are meant.
        """
        beam, direction = np.zeros((len(x), 3)), np.tile((0.0, 0.0, 1.0), (len(x), 1))
        followed = np.flatnonzero(~is_dark)
        if not len(followed):
            return beam, direction
        x = x[followed]
        w, _ = self._boundary.refracted(incident(light, x)[0], normal[followed])
        for _ in range(1 if self._boundary.eta == 1.0 else _REFRACTIONS):
            hits = self._surface.first(x, w)
            inside, (outside, irradiance, away) = w, incident(light, hits.position)
            w, inside_cosine = self._boundary.refracted(outside, hits.normal)
        cosine = np.einsum("nd,nd->n", outside, hits.normal)
        leaves = np.einsum("nd,nd->n", inside, hits.face_normal) > 0.0
        direction[followed] = inside
        lit = np.flatnonzero(hits.is_hit & leaves & (cosine > 0.0) & (irradiance.max(axis=1) > 0.0))
        if len(lit):
            lit = lit[self._is_visible(Hits(*(getattr(hits, n)[lit] for n in _HIT_FIELDS)), outside[lit], away[lit])]
        if len(lit):
            entered = irradiance[lit] * (cosine * self._boundary.rho_dt(cosine) / inside_cosine)[lit, None]
            less = too_deep[followed[lit]] / inside_cosine[lit]
            distance = np.maximum(hits.distance[lit] - less, 0.0)
            beam[followed[lit]] = entered * self._transmittance(x[lit], inside[lit], distance)
        return beam, direction

    def _is_visible(self, at: Hits, towards: Array, distance: Array) -> Array:
        """Return whether lights at `distance` (N,) in directions (N, 3) reach points of the surface: bool (N,)."""
        origin = at.position + self._surface.lift * at.face_normal
        blocked = np.zeros(len(origin), bool)
        for other in self._blockers:
            blocked |= other.first(origin, towards).distance < distance
        return ~blocked

    def _transmittance(self, x: Array, direction: Array, distance: Array) -> Array:
        """Return the transmittance (N, 3) from points x to the surface."""
        steps = 1 if self._medium.is_uniform else self._resolution.light_steps
        path = self._path(x, direction, distance[:, None] * np.linspace(0.0, 1.0, steps + 1))
        last: Array = path.transmittance[:, -1]
        return last


_HIT_FIELDS = ("is_hit", "distance", "position", "normal", "face_normal")


@dataclass(frozen=True, eq=False)
class _Path:
    """N rays with S steps through J layers."""

    position: Array
    """(N, S + 1, 3) mm: the nodes"""
    length: Array
    """(N, S) mm: the steps"""
    shares: Array
    """(N, S, J): share of each step inside each layer"""
    sigma_s: Array
    """(N, S, J, 3) 1/mm"""
    transmittance: Array
    """(N, S + 1, 3): from the start to each node"""


def shares_of_layers(above: Array) -> Array:
    """Return the share of each step inside each layer (N, S, J), for interfaces that are linear within a step.

    `above` (N, S + 1, J - 1): the depth of each interface below each node, mm.
    """
    before, after = above[:, :-1], above[:, 1:]
    high, low = np.maximum(before, after), np.minimum(before, after)
    upper = np.where(low >= 0.0, 1.0, np.clip(high, 0.0, None) / np.maximum(high - low, 1e-300))
    ends = np.ones((*upper.shape[:2], 1))
    shares: Array = np.diff(np.concatenate([0.0 * ends, upper, ends], axis=2), axis=2)
    return shares


def with_crossings(distances: Array, above: Array) -> Array:
    """Add nodes to rays where they cross interfaces, two for each interface: ascending distances (N, S + 1 + C).

    `distances` (N, S + 1) of the nodes; `above` as of `shares_of_layers`. Nodes that are not needed are at the end.
    """
    before, after = above[:, :-1], above[:, 1:]
    share = before / np.where(before == after, 1.0, before - after)
    at = distances[:, :-1, None] + share * np.diff(distances, axis=1)[..., None]
    last = distances[:, -1:]
    crossings = np.sort(np.where(before * after < 0.0, at, last[..., None]).reshape(len(at), -1), axis=1)
    result: Array = np.sort(np.concatenate([distances, crossings[:, : 2 * above.shape[2]]], axis=1), axis=1)
    return result


def logarithmic_mean(a: Array, b: Array) -> Array:
    """Return the mean of an exponential that falls from a to b over a step; where one is 0, the mean of the two."""
    both = np.maximum(a, 1e-300) / np.maximum(b, 1e-300)
    logarithm = np.log(both)
    is_steep = (a > 0.0) & (b > 0.0) & (np.abs(logarithm) > 1e-5)
    return np.where(is_steep, (a - b) / np.where(is_steep, logarithm, 1.0), 0.5 * (a + b))


def _spread(steps: int) -> Array:
    """Return steps + 1 nodes from 0 to 1, denser near 0."""
    return np.expm1(_STRETCH * np.linspace(0.0, 1.0, steps + 1)) / np.expm1(_STRETCH)


def _middles(values: Array) -> Array:
    """Return the means (N, S, ...) of values at the nodes of each step."""
    return 0.5 * (values[:, :-1] + values[:, 1:])
