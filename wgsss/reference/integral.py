"""M by brute force: the integral over the surface, summed over ever denser samples until it stops moving."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.bake.samples import Samples
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
    """M_front and M_back as sums over samples of the surface; `error` is what halving their spacing changed last."""

    tolerance: float = field(
        default=TOLERANCE,
        metadata={"unit": "", "range": (1e-6, 1.0), "help": "relative change of M, RMS, by half the spacing"},
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
    """M of a scene as posed at `size` (width, height) pixels, cached.

    Args:
        profiles: by the index of a body, in place of its material's.
        tolerance: once halving the spacing of samples changes M by less, RMS over an object's pixels relative to the
            RMS of M there, in the channel where it changes most, its samples are dense enough.
        samples: of an object, at most; but at least four for each face. Warns where M still moves.
    """
    width, height = size
    used = {body.index: (profiles or {}).get(body.index, body.material.profile) for body in stage.bodies}

    def make() -> Arrays:
        front, back, error = np.zeros((3, height, width, 3), np.float32)
        notes = []
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
            found = converged(body, receivers, used[body.index], tolerance, samples)
            after = color[here]
            front[here], back[here], error[here] = found.front * after, found.back * after, found.error * after
            notes.append(found.note)
        return {"front": front, "back": back, "error": error, "notes": np.array(notes, "U")}

    found = _cached(stage, used, [*size, tolerance, samples], make)
    return Estimate(found["front"], found["back"], found["error"])


def at_vertices(
    stage: Stage,
    body: Body,
    *,
    profile: Profile | None = None,
    tolerance: float = TOLERANCE,
    samples: int = SAMPLES,
) -> tuple[Array, Array]:
    """M_front and M_back, float32 (V, 3) in W/m^2, at the vertices of a body's mesh, cached.

    As the paper has M: without what `color_after` leaves of the base colour. Where normals or texture coordinates split
    a vertex, it counts as part of one of its sides. Arguments and warnings as of `integral`.
    """
    profile = profile or body.material.profile

    def make() -> Arrays:
        used, first = np.unique(body.mesh.faces, return_index=True)
        receivers = Samples((first // 3).astype(np.int32), np.eye(3)[first % 3], np.zeros(len(first)))
        found = converged(body, receivers, profile, tolerance, samples)
        front, back = np.zeros((2, len(body.mesh.positions), 3), np.float32)
        front[used], back[used] = found.front, found.back
        return {"front": front, "back": back, "notes": np.array([found.note], "U")}

    found = _cached(stage, {body.index: profile}, ["vertices", body.index, tolerance, samples], make)
    return found["front"], found["back"]


def _cached(
    stage: Stage, profiles: Mapping[int, Profile], settings: Sequence[object], make: Callable[[], Arrays]
) -> Arrays:
    """What `make` gives for the scene as posed; its notes are warnings, now and whenever it comes from the cache."""
    scene = stage.scene
    # M depends neither on how the picture is shown nor on `transport`. The notes contain the names.
    skies = [light.pixels() for light in stage.environments()]
    names = [(body.material.name, body.mesh.name) for body in stage.bodies]
    still = [replace(body.rest, motion=None, material=replace(body.material, transport=None)) for body in stage.bodies]
    posed = [body.mesh for body in stage.bodies]
    key = [stage.gpu.name, scene.camera, scene.lights, skies, names, still, posed, profiles, settings]
    found = cached("integral", key, make)
    for note in filter(None, found["notes"].tolist()):
        warnings.warn(note, Note, stacklevel=3)
    return found


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
            object=body.object_uniforms,
            vertices=body.vertices,
            corners=body.indices,
            colors=body.colors,
            base_color_map=body.maps.base_color_map,
        )
    return drawn
