"""Pictures of one scene by several methods, drawn from one graph: passes that methods share run once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import frame as shared
from wgsss.gpu import Gpu
from wgsss.graph import Graph, Handle
from wgsss.methods import Method
from wgsss.rendering import AOVS, draw
from wgsss.scene import EnvironmentLight, Light, Scene
from wgsss.stage import Stage
from wgsss.viewer.layers import SCENE_LAYERS, scene_layer

Array = npt.NDArray[Any]

LAYERS = ("image", *(name for name in AOVS if name != "depth"), *SCENE_LAYERS)
"""the images that a picture can show"""


@dataclass(frozen=True)
class View:
    """What to draw: a scene at a time, once by each of several methods."""

    scene: Scene
    methods: tuple[Method, ...]
    size: tuple[int, int]
    """width and height of a picture, pixels"""
    time_s: float = 0.0
    layer: str = "image"
    """one of LAYERS"""


@dataclass(frozen=True, eq=False)
class Picture:
    """The picture of one method.

    Attributes:
        display: rgba8unorm-srgb, tone mapped; exists on the device as long as its graph. None: black.
        M: rgba32float images in W/m^2 whose sum is M.
        passes: names of the passes that the picture needs, including those that it shares with others.
    """

    display: Handle | None
    M: tuple[Handle, ...]
    passes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Drawing:
    """A frame: one picture for each method, and the graph that drew them."""

    graph: Graph
    gbuffer_id: Handle
    pictures: list[Picture]

    @property
    def object_mask(self) -> Array:
        """Read back which pixels show an object: bool (H, W)."""
        mask: Array = self.graph.read(self.gbuffer_id)[..., 2] > 0.0
        return mask

    def read_M(self, picture: Picture) -> Array:
        """Read back the M of a picture: float32 (H, W, 3), W/m^2."""
        return np.sum([self.graph.read(handle)[..., :3] for handle in picture.M], axis=0)

    def pass_times(self, picture: Picture) -> dict[str, float]:
        """Return the ms of each pass of a picture by pass name; without passes that were not timed."""
        times = self.graph.times
        return {name: times[name] for name in picture.passes if name in times}


@dataclass(frozen=True, eq=False)
class _Shadows:
    """Shadow maps of an earlier frame.

    Attributes:
        key: the stage, lights and time that they were drawn for.
        lighting: the lighting of that frame.
        graph: the graph that owns the textures; they exist as long as it does.
    """

    key: tuple[int, tuple[Light, ...], float]
    lighting: shared.Lighting
    graph: Graph


class LiveRenderer:
    """Draws a scene that changes from frame to frame, and reuses data on the device from the last frame.

    Uploaded meshes, baked data and shadow maps are replaced only when the scene changes in a way that affects them.
    """

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self._stage: Stage | None = None
        self._baked: set[Method] = set()
        self._shadows: _Shadows | None = None

    def stage(self, scene: Scene, methods: Sequence[Method], time_s: float = 0.0) -> Stage:
        """Return a stage with the scene posed at a time and baked for the methods.

        The first baking for a mesh and a material may take a while.
        """
        stage = self._stage
        if stage is None or not _can_share_stage(stage.rest, scene):
            self._stage = stage = Stage(self.gpu, scene, time_s)
            self._baked.clear()
        elif stage.rest is not scene or stage.time_s != time_s:
            stage.rest = scene
            stage.pose(time_s)
        for method in methods:
            if method not in self._baked:
                method.bake(stage)
        self._baked = set(methods)
        return stage

    def draw(self, view: View, timed: bool = False) -> Drawing:
        """Draw a picture of the view by each of its methods. If `timed`, measure the time of each pass."""
        scene = view.scene
        stage = self.stage(scene, view.methods, view.time_s)
        graph = Graph(self.gpu)
        key = id(stage), stage.scene.lights, view.time_s
        reused = self._shadows.lighting if self._shadows is not None and self._shadows.key == key else None
        frame = shared.begin(graph, stage, view.size, reused)
        shows_scene_layer = view.layer in SCENE_LAYERS
        common = scene_layer(frame, view.layer) if shows_scene_layer else None
        pictures = []
        for drawn in [draw(frame, method) for method in view.methods]:
            display: Handle | None = drawn.display
            if shows_scene_layer:
                display = common
            elif view.layer != "image":  # tone map the layer as if it were radiance
                light = drawn.layers[view.layer]
                display = light and shared.tone_map(graph, light, scene.exposure, scene.tone_map)
            passes = tuple(item.name for item in graph.needed(*([display] if display else []), *drawn.M))
            pictures.append(Picture(display, drawn.M, passes))
        gbuffer_id, shadow_maps = frame.gbuffer.gbuffer_id, frame.lighting.shadow_maps
        outputs = [gbuffer_id, *(h for p in pictures for h in (p.display, *p.M) if h is not None)]
        outputs += [shadow_maps] if isinstance(shadow_maps, Handle) else []
        graph.run(*dict.fromkeys(outputs), timed=timed)
        if isinstance(shadow_maps, Handle):  # drawn in this frame: keep the texture for the next
            lighting = replace(frame.lighting, shadow_maps=shadow_maps.resource.gpu)
            self._shadows = _Shadows(key, lighting, graph)
        return Drawing(graph, gbuffer_id, pictures)


def _can_share_stage(a: Scene, b: Scene) -> bool:
    """Return whether the stage of one scene can be reused for the other.

    They need the same objects and environment lights; cameras and other lights may differ.
    """

    def environments(scene: Scene) -> list[EnvironmentLight]:
        return [light for light in scene.lights if isinstance(light, EnvironmentLight)]

    return (
        len(a.objects) == len(b.objects)
        and environments(a) == environments(b)
        and all(
            x.mesh is y.mesh
            and x.material is y.material
            and x.motion is y.motion
            and np.array_equal(x.matrix, y.matrix)
            for x, y in zip(a.objects, b.objects, strict=True)
        )
    )
