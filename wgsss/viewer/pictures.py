"""What methods make of one scene, from one graph: they share all passes that are not their own."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import frame as shared
from wgsss.gpu import Gpu
from wgsss.graph import Graph, Handle
from wgsss.methods import Method
from wgsss.rendering import AOVS, draw
from wgsss.scene import EnvironmentLight, Scene
from wgsss.stage import Stage
from wgsss.viewer.layers import SCENE_LAYERS, scene_layer

Array = npt.NDArray[Any]

LAYERS = ("image", *(name for name in AOVS if name != "depth"), *SCENE_LAYERS)
"""what may be shown of a picture"""


@dataclass(frozen=True, eq=False)
class Picture:
    """By one method.

    Attributes:
        display: rgba8unorm-srgb, tone mapped, on the device as long as the graph lives; None: black.
        M: rgba32float, what M is the sum of.
        passes: names of those that it took, shared ones among them.
    """

    display: Handle | None
    M: tuple[Handle, ...]
    passes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Drawing:
    """A frame by several methods: a picture for each; what they are of is at `gbuffer_id`, as of the g-buffer."""

    graph: Graph
    gbuffer_id: Handle
    pictures: list[Picture]

    @property
    def seen(self) -> Array:
        """bool (H, W): where something is."""
        found: Array = self.graph.read(self.gbuffer_id)[..., 2] > 0.0
        return found

    def M(self, picture: Picture) -> Array:
        """float32 (H, W, 3), W/m^2."""
        return np.sum([self.graph.read(handle)[..., :3] for handle in picture.M], axis=0)


class Easel:
    """Draws a scene that changes; what persists on the device is made anew only where it must be."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self._stage: Stage | None = None
        self._baked: set[Method] = set()
        self._lighting: tuple[Any, Any, Graph] | None = None
        """what shadows were drawn for, the lighting with them, and the graph that keeps them"""

    def stage(self, scene: Scene, methods: Sequence[Method], time_s: float = 0.0) -> Stage:
        """The scene, ready for the methods. Bakes, which may take a while the first time."""
        stage = self._stage
        if stage is None or not _alike(stage.rest, scene):
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

    def draw(
        self,
        scene: Scene,
        methods: Sequence[Method],
        size: tuple[int, int],
        time_s: float = 0.0,
        layer: str = "image",
        timed: bool = False,
    ) -> Drawing:
        """A picture by each method at a size in pixels, a time in seconds."""
        stage = self.stage(scene, methods, time_s)
        graph = Graph(self.gpu)
        shone = id(stage), stage.scene.lights, time_s
        kept = self._lighting[1] if self._lighting is not None and self._lighting[0] == shone else None
        frame = shared.begin(graph, stage, size, kept)
        found = []
        common = scene_layer(frame, layer) if layer in SCENE_LAYERS else None
        for drawn in [draw(frame, method) for method in methods]:
            display: Handle | None = drawn.display
            if layer in SCENE_LAYERS:
                display = common
            elif layer != "image":  # as if it were light that is seen
                light = drawn.layers[layer]
                display = light and shared.tone_map(graph, light, scene.exposure, scene.tone_map)
            passes = tuple(item.name for item in graph.needed(*([display] if display else []), *drawn.M))
            found.append(Picture(display, drawn.M, passes))
        seen = frame.gbuffer.gbuffer_id
        shadows = frame.lighting.shadow_maps
        wanted = [seen, *(h for p in found for h in (p.display, *p.M) if h is not None)]
        wanted += [shadows] if isinstance(shadows, Handle) else []
        graph.run(*dict.fromkeys(wanted), timed=timed)
        if isinstance(shadows, Handle):
            lighting = copy(frame.lighting)
            lighting.shadow_maps = shadows.resource.gpu
            self._lighting = shone, lighting, graph
        return Drawing(graph, seen, found)


def _alike(a: Scene, b: Scene) -> bool:
    """Whether what a stage keeps for one scene serves the other: cameras, and lights other than skies, may differ."""

    def skies(scene: Scene) -> Any:
        return [light for light in scene.lights if isinstance(light, EnvironmentLight)]

    return (
        len(a.objects) == len(b.objects)
        and skies(a) == skies(b)
        and all(
            x.mesh is y.mesh
            and x.material is y.material
            and x.motion is y.motion
            and np.array_equal(x.matrix, y.matrix)
            for x, y in zip(a.objects, b.objects, strict=True)
        )
    )
