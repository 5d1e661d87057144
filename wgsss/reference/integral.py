"""M by brute force: the integral over the surface, summed over denser and denser samples until it converges."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.bake.samples import Samples, vertex_samples
from wgsss.cache import Arrays, cached
from wgsss.errors import Note
from wgsss.frame import Frame, begin
from wgsss.graph import Graph
from wgsss.optics import Profile
from wgsss.reference.convergence import converged
from wgsss.reference.estimate import Estimate, Reference
from wgsss.stage import Body, Stage

Array = npt.NDArray[Any]

TOLERANCE, SAMPLES = 0.01, 1_000_000


@dataclass(frozen=True)
class Integral(Reference):
    """M_front and M_back as sums over samples of the surface. The last halving of the spacing gives `error`."""

    tolerance: float = field(
        default=TOLERANCE,
        metadata={"unit": "", "range": (1e-6, 1.0), "help": "relative change of M, RMS, when the spacing is halved"},
    )
    samples: int = field(
        default=SAMPLES,
        metadata={"unit": "", "range": (1000, 100_000_000), "help": "largest number of samples per object"},
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
    """Return M of a scene as posed, at `size` (width, height) pixels. Cached.

    Args:
        profiles: by the index of a body, instead of the profile of its material.
        tolerance: the samples of an object are dense enough if halving their spacing changes M by at most this. The
            change is the RMS over the object's pixels, relative to the RMS of M there, in the worst channel.
        samples: largest number of samples of an object, but each face has at least four. Warns if M has not converged.
    """
    width, height = size
    used = {body.index: (profiles or {}).get(body.index, body.profile) for body in stage.bodies}

    def compute() -> Arrays:
        front, back, error = np.zeros((3, height, width, 3), np.float32)
        notes = []
        graph = Graph(stage.gpu)
        pixels = pixel_receivers(begin(graph, stage, size))
        graph.run(pixels.place, pixels.color)
        place, color = graph.read(pixels.place), graph.read(pixels.color)[..., :3]
        for body in stage.bodies:
            here = place[..., 3] == body.index + 1
            if not here.any():
                continue
            b = place[here][:, :2].astype(np.float64)
            barycentric = np.column_stack([b, 1.0 - b.sum(axis=1)])
            receivers = Samples(place[here][:, 2].astype(np.int32), barycentric, np.zeros(len(b)))
            M = converged(body, receivers, used[body.index], tolerance, samples)
            after = color[here]
            front[here], back[here], error[here] = M.front * after, M.back * after, M.error * after
            notes.append(M.note)
        return {"front": front, "back": back, "error": error, "notes": np.array(notes, "U")}

    arrays = _cached(stage, used, [*size, tolerance, samples], compute)
    return Estimate(arrays["front"], arrays["back"], arrays["error"])


def at_vertices(
    stage: Stage,
    body: Body,
    *,
    profile: Profile | None = None,
    tolerance: float = TOLERANCE,
    samples: int = SAMPLES,
) -> tuple[Array, Array]:
    """Return M_front and M_back, float32 (V, 3) in W/m^2, at the vertices of a body's mesh. Cached.

    As in Maisch & Ropinski 2017, M excludes the part of the base colour that `color_after` applies after diffusion. If
    normals or texture coordinates split a vertex, it is taken as part of one of its sides. Arguments and warnings are
    those of `integral`.
    """
    profile = profile or body.profile

    def compute() -> Arrays:
        used = np.unique(body.mesh.faces)
        M = converged(body, vertex_samples(body.mesh, used), profile, tolerance, samples)
        front, back = np.zeros((2, len(body.mesh.positions), 3), np.float32)
        front[used], back[used] = M.front, M.back
        return {"front": front, "back": back, "notes": np.array([M.note], "U")}

    arrays = _cached(stage, {body.index: profile}, ["vertices", body.index, tolerance, samples], compute)
    return arrays["front"], arrays["back"]


def _cached(
    stage: Stage, profiles: Mapping[int, Profile], settings: Sequence[object], compute: Callable[[], Arrays]
) -> Arrays:
    """Return the arrays of `compute` for the scene as posed. Its notes are warnings, also when they are cached."""
    scene = stage.scene
    # M depends neither on how the picture is shown nor on `transport`. The notes contain the names.
    skies = [light.pixels() for light in stage.environments()]
    names = [(body.material.name, body.mesh.name) for body in stage.bodies]
    still = [replace(body.rest, motion=None, material=replace(body.material, transport=None)) for body in stage.bodies]
    posed = [body.mesh for body in stage.bodies]
    key = [stage.gpu.name, scene.camera, scene.lights, skies, names, still, posed, profiles, settings]
    arrays = cached("integral", key, compute)
    for note in filter(None, arrays["notes"].tolist()):
        warnings.warn(note, Note, stacklevel=3)
    return arrays


def pixel_receivers(frame: Frame) -> Any:
    """Declare the passes that find the point of the surface at each pixel.

    Returns the handles `place` (two barycentric coordinates, face, object id) and `color` (the part of the base colour
    applied after diffusion).
    """
    drawn: Any = None
    for body in frame.stage.bodies:
        targets = {} if drawn is None else {n: getattr(drawn, n) for n in ("place", "color")}
        drawn = frame.graph.draw_outputs(
            "reference/integral_receivers",
            size=frame.size,
            count=3 * len(body.mesh.faces),
            depth_buffer="new" if drawn is None else drawn.depth,
            into=targets,
            params={"world_to_clip": frame.view.world_to_clip},
            object=body.object_uniforms,
            vertices=body.vertices,
            corners=body.indices,
            colors=body.colors,
            base_color_map=body.maps.base_color_map,
        )
    return drawn
