"""M at points of a body, summed over denser and denser samples of its surface until it converges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.samples import Samples, count, longest_edges, subdivided
from wgsss.console import progress_bar
from wgsss.frame import begin, irradiance_points
from wgsss.graph import Graph
from wgsss.optics import Profile
from wgsss.reference.kernel import make_kernel
from wgsss.reference.surface_sum import Points, surface_sum
from wgsss.scene import Mesh
from wgsss.stage import Body

Array = npt.NDArray[Any]

_WIDTH = 3.0  # smallest width of the profile in spacings, in the widest channel
_RESOLVED = 0.1  # share of the light that leaves outside this width
_POINTS = 1 << 18  # largest number of points whose L_d one pass gathers


@dataclass(frozen=True, eq=False)
class Sums:
    """M_front and M_back (N, 3) at points of a body, without the base colour after diffusion."""

    front: Array
    back: Array
    samples: int
    """Number of samples that were summed."""


@dataclass(frozen=True, eq=False)
class Converged:
    """The sums with the densest samples."""

    front: Array
    back: Array
    error: Array
    """|change of M| (N, 3) when the spacing was last halved."""
    note: str
    """Says why the samples are too few, or is empty."""


def converged(body: Body, receivers: Samples, profile: Profile, tolerance: float, samples: int) -> Converged:
    """Compute M at points of a body, and halve the spacing of the samples until M changes by at most `tolerance`, RMS.

    Stops with a note before there would be more than `samples` samples.
    """
    L_d = irradiance_at(body, receivers)
    width = float(profile.range(_RESOLVED).max()) if profile.total.any() else np.inf
    spacing = _first_spacing(body.mesh, width / _WIDTH, samples)
    last = sum_at_spacing(body, receivers, L_d, profile, spacing)
    while True:
        spacing /= 2
        sums = sum_at_spacing(body, receivers, L_d, profile, spacing)
        error = np.abs(sums.front + sums.back - last.front - last.back)
        size = np.sqrt(np.square(sums.front + sums.back).mean(axis=0))
        change = float((np.sqrt(np.square(error).mean(axis=0)) / np.where(size > 0, size, 1.0)).max())
        is_resolved = _WIDTH * spacing <= width
        if (has_converged := change <= tolerance and is_resolved) or count(body.mesh, spacing / 2) > samples:
            why = (
                f"M still changes by {100 * change:.2g} % from {last.samples} to {sums.samples} samples"
                if is_resolved
                else f"the samples are {spacing:.2g} mm apart, too far for the material"
            )
            note = f"{body.material.name} on {body.mesh.name}: {why}, and the limit is {samples} samples"
            return Converged(sums.front, sums.back, error, "" if has_converged else note)
        last = sums


def sum_at_spacing(body: Body, receivers: Samples, L_d: Array, profile: Profile, spacing: float) -> Sums:
    """Compute M at points with known L_d (N, 3), by samples of the surface that are at most `spacing` mm apart."""
    mesh = body.mesh
    across = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    chosen = subdivided(mesh, spacing)
    senders, places = body.at(chosen), body.at(receivers)
    flux = irradiance_at(body, chosen) * senders.area[:, None]
    kernel = make_kernel(profile, spacing, across)
    total = len(flux) * len(L_d)
    label = f"{mesh.name}, {len(flux)} samples"
    with progress_bar(total=total, desc=label, unit=" pairs", unit_scale=True) as bar:
        sender_points, receiver_points = (Points(at.position, at.normal) for at in (senders, places))
        front, back = surface_sum(body.stage.gpu, kernel, sender_points, flux, receiver_points, bar)
    return Sums(front + kernel.near * L_d, back, len(flux))


def _first_spacing(mesh: Mesh, widest: float, samples: int) -> float:
    """Return the first spacing, mm: `widest`, or more if half of it would need more than `samples` samples."""
    longest = float(longest_edges(mesh).max())
    spacing = min(longest, widest)
    while spacing < longest and count(mesh, spacing / 2) > samples:
        spacing = min(longest, spacing * 1.1)
    return spacing


def irradiance_at(body: Body, points: Samples) -> Array:
    """Return L_d (N, 3), W/m^2, times the part of the base colour applied before diffusion, at points of a body."""
    graph = Graph(body.stage.gpu)
    frame = begin(graph, body.stage, (1, 1))
    handles = []
    for first in range(0, len(points.face), _POINTS):
        some = slice(first, first + _POINTS)
        chosen = Samples(points.face[some], points.barycentric[some], points.share[some])
        handles.append(irradiance_points(frame, body, body.points(chosen), len(chosen.face), chosen))
    graph.run(*handles, timed=True)  # timing submits each pass on its own
    return np.concatenate([graph.read(h)[:, :3] for h in handles])
