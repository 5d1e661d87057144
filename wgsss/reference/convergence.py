"""M at places on a body, summed over ever denser samples of its surface until it stops moving."""

from __future__ import annotations

from types import SimpleNamespace
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

_WIDTH = 3.0  # spacings at least within which all light leaves that counts, in the widest channel
_RESOLVED = 0.1  # but for this share
_POINTS = 1 << 18  # whose L_d one pass gathers


def converged(body: Body, receivers: Samples, profile: Profile, tolerance: float, samples: int) -> SimpleNamespace:
    """front, back and error (N, 3) of M at places on a body, without the base colour after diffusion.

    By samples dense enough for a change within `tolerance`, RMS, or by as many as there may be: then a `note` says so.
    """
    L_d = irradiance_at(body, receivers)
    width = float(profile.range(_RESOLVED).max()) if profile.total.any() else np.inf
    spacing = _first_spacing(body.mesh, width / _WIDTH, samples)
    last = at_spacing(body, receivers, L_d, profile, spacing)
    while True:
        spacing /= 2
        found = at_spacing(body, receivers, L_d, profile, spacing)
        found.error = np.abs(found.front + found.back - last.front - last.back)
        size = np.sqrt(np.square(found.front + found.back).mean(axis=0))
        moved = float((np.sqrt(np.square(found.error).mean(axis=0)) / np.where(size > 0, size, 1.0)).max())
        resolved = _WIDTH * spacing <= width
        if (enough := moved <= tolerance and resolved) or count(body.mesh, spacing / 2) > samples:
            change = f"still moves by {100 * moved:.2g} % from {last.samples} to {found.samples} samples"
            why = change if resolved else f"is of samples {spacing:.2g} mm apart, too far for the material"
            note = f"{body.material.name} on {body.mesh.name}: M {why}, and no more than {samples} may be taken"
            found.note = "" if enough else note
            return found
        last = found


def at_spacing(body: Body, receivers: Samples, L_d: Array, profile: Profile, spacing: float) -> SimpleNamespace:
    """front and back (N, 3) at places where L_d (N, 3) is known, by samples at most `spacing` mm apart, and how many
    `samples` that took."""
    mesh = body.mesh
    across = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    chosen = subdivided(mesh, spacing)
    there, here = body.at(chosen), body.at(receivers)
    flux = irradiance_at(body, chosen) * there.area[:, None]
    kernel = make_kernel(profile, spacing, across)
    total = len(flux) * len(L_d)
    label = f"{mesh.name}, {len(flux)} samples"
    with progress_bar(total=total, desc=label, unit=" pairs", unit_scale=True) as bar:
        sources, places = (Points(at.position, at.normal) for at in (there, here))
        front, back = surface_sum(body.stage.gpu, kernel, sources, flux, places, bar)
    return SimpleNamespace(front=front + kernel.near * L_d, back=back, samples=len(flux))


def _first_spacing(mesh: Mesh, widest: float, samples: int) -> float:
    """The spacing, mm, to begin with: `widest`, where that leaves a sample to each face and may be halved."""
    longest = float(longest_edges(mesh).max())
    spacing = min(longest, widest)
    while spacing < longest and count(mesh, spacing / 2) > samples:
        spacing = min(longest, spacing * 1.1)
    return spacing


def irradiance_at(body: Body, places: Samples) -> Array:
    """L_d (N, 3), W/m^2, times the base colour's share before diffusion, at places on a body."""
    graph = Graph(body.stage.gpu)
    frame = begin(graph, body.stage, (1, 1))
    handles = []
    for first in range(0, len(places.face), _POINTS):
        some = slice(first, first + _POINTS)
        chosen = Samples(places.face[some], places.barycentric[some], places.share[some])
        handles.append(irradiance_points(frame, body, body.points(chosen), len(chosen.face), chosen))
    graph.run(*handles, timed=True)  # each pass in a submission of its own
    return np.concatenate([graph.read(h)[:, :3] for h in handles])
