"""Layers that depend on the scene alone and on no method: UV stretch, thickness and the shadow map."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.stretch import stretch
from wgsss.bake.thickness import local_thickness
from wgsss.frame import Frame
from wgsss.gpu import Buffer, Gpu
from wgsss.graph import Handle
from wgsss.passes import Outputs
from wgsss.stage import Body

Array = npt.NDArray[Any]

_MAX_DENSITY_RATIO = 4.0
"""texels per mm over their median, at the red end of the colours of UV stretch"""


def _stretch_colours(body: Body) -> Array:
    """Return a linear RGB colour (R, 3) for each render vertex.

    Red means more texels per mm in the atlas than the median of the mesh, blue fewer.
    """
    import matplotlib

    density = np.sqrt(np.abs(np.linalg.det(stretch(body.rest.mesh, body.unwrap()).root)))
    place = 0.5 + 0.5 * np.log(density / np.median(density)) / np.log(_MAX_DENSITY_RATIO)
    return np.square(matplotlib.colormaps["coolwarm"](np.clip(place, 0.0, 1.0))[:, :3])


def _thickness_colours(body: Body) -> Array:
    """Return a linear RGB colour (R, 3) for each render vertex: white where the object is thin."""
    return local_thickness(body.rest.mesh, body.profile)[body.render_mesh.vertex]


_VERTEX_COLOURS: dict[str, Callable[[Body], Array]] = {"UV stretch": _stretch_colours, "thickness": _thickness_colours}
SCENE_LAYERS = (*_VERTEX_COLOURS, "shadow map")


def scene_layer(frame: Frame, layer: str) -> Handle | None:
    """Declare the passes that draw one of SCENE_LAYERS, rgba8unorm-srgb. Return None if the scene has no such layer."""
    return _shadow_map(frame) if layer == "shadow map" else _draw_vertex_colours(frame, layer)


def _shadow_map(frame: Frame) -> Handle | None:
    if not frame.lighting.views:
        return None
    shadow_maps = frame.lighting.shadow_maps
    return frame.graph.draw("viewer/shadow", size=shadow_maps.size[:2], shadow_maps=shadow_maps)


def _draw_vertex_colours(frame: Frame, layer: str) -> Handle | None:
    graph, stage = frame.graph, frame.stage
    drawn: Outputs | None = None
    for body in stage.bodies:
        colors = stage.shared(
            (layer, id(body.rest.mesh), id(body.material)), partial(_upload, stage.gpu, _VERTEX_COLOURS[layer], body)
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


def _upload(gpu: Gpu, colours: Callable[[Body], Array], body: Body) -> Buffer:
    """Upload the vertex colours of a body as array<vec4f>."""
    return gpu.buffer(np.pad(colours(body), ((0, 0), (0, 1))).astype(np.float32))
