"""Layers that belong to the scene and to no method: what the atlas does to the surface, thickness, shadow maps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.stretch import stretch
from wgsss.bake.thickness import local_thickness
from wgsss.frame import Frame
from wgsss.gpu import Gpu
from wgsss.graph import Handle
from wgsss.stage import Body

Array = npt.NDArray[Any]

_DENSEST = 4.0
"""times the median number of texels per mm, at the end of the colours"""


def _stretch(body: Body) -> Array:
    """(R, 3) by render vertex: red has more texels per mm than the median, blue fewer."""
    import matplotlib

    density = np.sqrt(np.abs(np.linalg.det(stretch(body.rest.mesh, body.unwrap()).root)))
    place = 0.5 + 0.5 * np.log(density / np.median(density)) / np.log(_DENSEST)
    return np.square(matplotlib.colormaps["coolwarm"](np.clip(place, 0.0, 1.0))[:, :3])


def _thickness(body: Body) -> Array:
    """(R, 3) by render vertex: white is thin."""
    return local_thickness(body.rest.mesh, body.material.profile)[body.render_mesh.vertex]


_PAINTED: dict[str, Callable[[Body], Array]] = {"UV stretch": _stretch, "thickness": _thickness}
SCENE_LAYERS = (*_PAINTED, "shadow map")


def scene_layer(frame: Frame, layer: str) -> Handle | None:
    """One of SCENE_LAYERS as a picture, rgba8unorm-srgb; None where there is nothing to show."""
    graph, stage = frame.graph, frame.stage
    if layer == "shadow map":
        if not frame.lighting.views:
            return None
        size = frame.lighting.shadow_maps.size[:2]
        return graph.draw("viewer/shadow", size=size, shadow_maps=frame.lighting.shadow_maps)
    drawn: Any = None
    for body in stage.bodies:
        colors = stage.shared(
            (layer, id(body.rest.mesh), id(body.material)), partial(_upload, stage.gpu, _PAINTED[layer], body)
        )
        drawn = graph.draw_outputs(
            "viewer/paint",
            size=frame.size,
            indices=body.indices,
            into={} if drawn is None else {"display": drawn.display},
            depth_buffer="new" if drawn is None else drawn.depth,
            params={"world_to_clip": frame.view.world_to_clip},
            object=body.object_uniforms,
            vertices=body.vertices,
            colors=colors,
        )
    return None if drawn is None else drawn.display


def _upload(gpu: Gpu, colour: Callable[[Body], Array], body: Body) -> Any:
    return gpu.buffer(np.pad(colour(body), ((0, 0), (0, 1))).astype(np.float32))
