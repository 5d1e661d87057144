"""M by brute force: the integral over the surface, summed over ever denser samples until it stops moving."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.bake.samples import Samples, subdivided
from wgsss.frame import Frame, begin, irradiance_points
from wgsss.graph import Graph
from wgsss.optics import Profile
from wgsss.reference.estimate import Estimate, Reference
from wgsss.reference.kernel import make_kernel
from wgsss.reference.surface_sum import Points, surface_sum
from wgsss.scene import Mesh
from wgsss.stage import Body, Stage

Array = npt.NDArray[Any]

TOLERANCE, SAMPLES = 0.005, 1_000_000
_RADIUS = 4.0  # spacings within which L_d is taken as the same all over; see the tests of convergence
_RESOLVED = 0.25  # share of the light that leaves outside of that radius from the start, in the widest channel
_POINTS = 1 << 18  # whose L_d one pass gathers


@dataclass(frozen=True)
class Integral(Reference):
    """M_front and M_back as sums over samples of the surface; `error` is what the last doubling of density changed."""

    tolerance: float = field(
        default=TOLERANCE,
        metadata={
            "unit": "",
            "range": (1e-6, 1.0),
            "help": "change of M, RMS, on halving the spacing at which to stop",
        },
    )
    samples: int = field(
        default=SAMPLES, metadata={"unit": "", "range": (1000, 100_000_000), "help": "samples per object, at most"}
    )

    source: ClassVar[str] = "Maisch & Ropinski 2017, eq. 5 and 13, 14, by brute force"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({},)

    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        return integral(stage, size, tolerance=self.tolerance, samples=self.samples)


def integral(
    stage: Stage,
    size: tuple[int, int],
    *,
    profiles: Mapping[int, Profile] | None = None,
    tolerance: float = TOLERANCE,
    samples: int = SAMPLES,
) -> Estimate:
    """M of a scene as posed at `size` (width, height) pixels.

    Args:
        profiles: by the index of a body, in place of its material's.
        tolerance: once halving the spacing of samples changes M by less, RMS over an object's pixels relative to the
            RMS of M there, in the channel where it changes most, its samples are dense enough.
        samples: of an object, at most; but at least four for each face. Warns where M still moves.
    """
    width, height = size
    front, back, error = np.zeros((3, height, width, 3), np.float32)
    graph = Graph(stage.gpu)
    seen = _seen(begin(graph, stage, size))
    graph.run(seen.place, seen.color)
    place, color = graph.read(seen.place), graph.read(seen.color)[..., :3]
    for body in stage.bodies:
        here = place[..., 3] == body.index + 1
        if not here.any():
            continue
        b = place[here][:, :2].astype(np.float64)
        barycentric = np.column_stack([b, 1.0 - b.sum(axis=1)])
        receivers = Samples(place[here][:, 2].astype(np.int32), barycentric, np.zeros(len(b)))
        profile = (profiles or {}).get(body.index, body.material.profile)
        found = converged(body, receivers, profile, tolerance, samples)
        after = color[here]
        front[here], back[here], error[here] = found.front * after, found.back * after, found.error * after
    return Estimate(front, back, error)


def at_vertices(
    stage: Stage,
    body: Body,
    *,
    profile: Profile | None = None,
    tolerance: float = TOLERANCE,
    samples: int = SAMPLES,
) -> tuple[Array, Array]:
    """M_front and M_back, (V, 3) in W/m^2, at the vertices of a body's mesh.

    As the paper has M: without what `color_after` leaves of the base colour. Where normals or texture coordinates split
    a vertex, it counts as part of one of its sides. Arguments and warnings as of `integral`.
    """
    faces = body.mesh.faces
    used, first = np.unique(faces, return_index=True)
    receivers = Samples((first // 3).astype(np.int32), np.eye(3)[first % 3], np.zeros(len(first)))
    found = converged(body, receivers, profile or body.material.profile, tolerance, samples)
    front, back = np.zeros((2, len(body.mesh.positions), 3), np.float32)
    front[used], back[used] = found.front, found.back
    return front, back


def converged(
    body: Body, receivers: Samples, profile: Profile, tolerance: float = TOLERANCE, samples: int = SAMPLES
) -> SimpleNamespace:
    """front, back and error (N, 3) of M at places on a body, without the base colour after diffusion."""
    L_d = _irradiance(body, receivers)
    last: Any = None
    spacing = _first_spacing(body.mesh, profile)
    while True:
        found = at_spacing(body, receivers, L_d, profile, spacing)
        if last is not None:
            found.error = np.abs(found.front + found.back - last.front - last.back)
            size = np.sqrt(np.square(found.front + found.back).mean(axis=0))
            moved = float((np.sqrt(np.square(found.error).mean(axis=0)) / np.where(size > 0, size, 1.0)).max())
            if moved <= tolerance:
                return found
            if _count(body.mesh, spacing / 2) > samples:
                warnings.warn(
                    f"{body.material.name} on {body.mesh.name}: M still moves by {100 * moved:.2g} % from "
                    f"{last.samples} to {found.samples} samples, and no more than {samples} may be taken",
                    stacklevel=2,
                )
                return found
        last, spacing = found, spacing / 2


def at_spacing(body: Body, receivers: Samples, L_d: Array, profile: Profile, spacing: float) -> SimpleNamespace:
    """front and back (N, 3) at places where L_d (N, 3) is known, by samples at most `spacing` mm apart, and how many
    `samples` that took."""
    from tqdm import tqdm

    mesh = body.mesh
    across = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    chosen = subdivided(mesh, spacing)
    there, here = body.at(chosen), body.at(receivers)
    flux = _irradiance(body, chosen) * there.area[:, None]
    kernel = make_kernel(profile, _RADIUS * spacing, across)
    total = len(flux) * len(L_d)
    label = f"{mesh.name}, {len(flux)} samples"
    with tqdm(total=total, desc=label, unit=" pairs", unit_scale=True, file=sys.stderr, disable=None) as bar:
        sources, places = (Points(at.position, at.normal) for at in (there, here))
        front, back = surface_sum(body.stage.gpu, kernel, sources, flux, places, bar)
    return SimpleNamespace(front=front + kernel.near * L_d, back=back, samples=len(flux))


def _first_spacing(mesh: Mesh, profile: Profile) -> float:
    """The widest spacing, mm, that is worth a try: a sample a face or more, and the profile's width told apart."""
    corners = mesh.positions[mesh.faces].astype(np.float64)
    longest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
    width = float(profile.range(_RESOLVED).max())
    return min(longest, width / _RADIUS) if width > 0.0 else longest


def _count(mesh: Mesh, spacing: float) -> int:
    """How many samples at `spacing` mm are."""
    corners = mesh.positions[mesh.faces].astype(np.float64)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return int(np.square(np.maximum(np.ceil(longest / spacing), 1)).sum())


def _irradiance(body: Body, places: Samples) -> Array:
    """L_d (N, 3), W/m^2, times the base colour's share before diffusion, at places on a body."""
    graph = Graph(body.stage.gpu)
    frame = begin(graph, body.stage, (1, 1))
    handles = []
    for first in range(0, len(places.face), _POINTS):
        some = slice(first, first + _POINTS)
        chosen = Samples(places.face[some], places.barycentric[some], places.share[some])
        handles.append(irradiance_points(frame, body, body.points(chosen), len(chosen.face)))
    graph.run(*handles, timed=True)  # each pass in a submission of its own
    return np.concatenate([graph.read(h)[:, :3] for h in handles])


def _seen(frame: Frame) -> Any:
    """Which face is seen at each pixel, and where on it."""
    drawn: Any = None
    for body in frame.stage.bodies:
        kept = {} if drawn is None else {n: getattr(drawn, n) for n in ("place", "color")}
        drawn = frame.graph.draw(
            "reference/integral_receivers",
            size=frame.size,
            count=3 * len(body.mesh.faces),
            depth_buffer="new" if drawn is None else drawn.depth,
            into=kept,
            params={"world_to_clip": frame.view.world_to_clip},
            surface=body.surface,
            vertices=body.vertices,
            corners=body.indices,
            base_color_map=body.maps.base_color_map,
        )
    return drawn
