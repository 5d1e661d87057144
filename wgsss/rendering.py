"""Render images: a scene by a method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import frame as shared
from wgsss.errors import RenderError, unknown
from wgsss.gpu import Gpu, default_gpu
from wgsss.graph import Graph, Handle
from wgsss.methods import Method
from wgsss.registry import make_method, name_of
from wgsss.scene import Scene, checks
from wgsss.stage import Stage
from wgsss.text import escaped

Array = npt.NDArray[Any]

AOVS = ("irradiance", "M_front", "M_back", "specular", "depth", "normal")
DEFAULT_METHOD = "deon07"


@dataclass(frozen=True, eq=False)
class Image:
    """A rendered frame.

    Attributes:
        pixels: float32 (H, W, 4), linear RGB radiance, W/(m^2 sr), and coverage.
        display: uint8 (H, W, 4), exposed, tone mapped and sRGB-encoded, with coverage in alpha.
        aovs: float32 (H, W, 3) or, for depth, (H, W, 1), by name: `irradiance` (L_d), `M_front` and `M_back` in W/m^2,
            `specular` in W/(m^2 sr), `depth` (distance along the viewing direction, mm; inf in the background) and
            `normal` (world space).
        timings: ms of each pass that ran, by name, measured by `clock`. A pass's first run includes its compilation.
        graph: the frame's graph, for `str` and `dot`.
        metadata: how the image was rendered: scene, method, knobs, adapter, exposure, tone_map, bloom, time_s.
    """

    pixels: Array
    display: Array
    aovs: dict[str, Array]
    timings: dict[str, float]
    clock: str
    graph: Graph = field(repr=False)
    metadata: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Drawn:
    """The outputs of a frame's passes by one method."""

    radiance: Handle
    display: Handle
    """the image for a display"""
    M: tuple[Handle, ...]
    """textures whose sum is M"""
    layers: dict[str, Handle | None]
    """by AOVS; None is black"""


def draw(frame: shared.Frame, method: Method) -> Drawn:
    """Declare the passes that draw a frame by a method."""
    diffused = method.passes(frame)
    reflected = shared.specular(frame)
    first, *second = diffused.M
    radiance = shared.composite(frame, first, second[0] if second else None, reflected)
    scene = frame.stage.scene
    layers = {
        "irradiance": shared.irradiance_pixels(frame),
        "M_front": diffused.M_front,
        "M_back": diffused.M_back,
        "specular": reflected,
        "depth": frame.gbuffer.depth,
        "normal": frame.gbuffer.normal,
    }
    shown = shared.bloom(frame.graph, radiance, scene.bloom)
    display = shared.tone_map(frame.graph, shown, scene.exposure, scene.tone_map)
    return Drawn(radiance, display, diffused.M, layers)


class Renderer:
    """Renders frames of one scene by one method at one size.

    The constructor bakes what the method needs, which may take a while the first time. Raises InputError for a size
    that the device cannot draw.
    """

    def __init__(self, scene: Scene, method: Method, size: tuple[int, int], gpu: Gpu | None = None) -> None:
        checks.image_size(size)
        self.gpu = gpu or default_gpu()
        self.gpu.trim()  # otherwise the pool would keep resources of all earlier sizes, scenes and knobs
        self.method, self.size = method, size
        self.stage = Stage(self.gpu, scene)
        method.bake(self.stage)

    def frame(self, time_s: float = 0.0, aovs: Sequence[str] = (), timed: bool = True) -> Image:
        """Return the image at a time in seconds, with the named extra outputs (AOVS).

        Raises RenderError where a pixel is not finite.
        """
        for name in aovs:
            if name not in AOVS:
                raise unknown("aov", name, AOVS)
        if time_s != self.stage.time_s:
            self.stage.pose(time_s)
        graph = Graph(self.gpu)
        frame = shared.begin(graph, self.stage, self.size)
        drawn = draw(frame, self.method)
        radiance, display = drawn.radiance, drawn.display
        layers = {name: drawn.layers[name] for name in aovs}
        graph.run(radiance, display, *(h for h in layers.values() if h is not None), timed=timed)
        pixels = graph.read(radiance)
        extra = {name: self._aov(graph, frame, name, handle) for name, handle in layers.items()}
        for name, values in (("radiance", pixels), *extra.items()):
            bad = ~np.isfinite(values).all(axis=2) & (pixels[..., 3] > 0)
            if bad.any():
                y, x = np.argwhere(bad)[0]
                raise RenderError(f"{int(bad.sum())} pixels of {name} are not finite, the first at x {x}, y {y}")
        return Image(pixels, graph.read(display), extra, graph.times, graph.clock, graph, self._metadata())

    def _metadata(self) -> dict[str, str]:
        scene, method = self.stage.scene, self.method
        return {
            "scene": escaped(scene.name),
            "method": name_of(method),
            "knobs": " ".join(f"{knob}={value}" for knob, value in vars(method).items()),
            "adapter": self.gpu.name,
            "exposure": f"{scene.exposure:g}",
            "tone_map": scene.tone_map,
            "bloom": f"{scene.bloom:g}",
            "time_s": f"{self.stage.time_s:g}",
        }

    def _aov(self, graph: Graph, frame: shared.Frame, name: str, handle: Handle | None) -> Array:
        width, height = self.size
        if handle is None:
            return np.zeros((height, width, 3), np.float32)
        texels = graph.read(handle).astype(np.float32)
        if name != "depth":
            return texels[..., :3]
        # Clip depth is affine in distance or in 1/distance: invert the lower right corner of the projection matrix.
        projection = frame.view.world_to_clip @ np.linalg.inv(self.stage.scene.camera.view())
        (a, b), (c, d) = projection[2:, 2:]
        with np.errstate(divide="ignore"):
            distance = -((b - texels * d) / (texels * c - a))
        return np.where(texels < 1.0, distance, np.inf).astype(np.float32)


def render(
    scene: Scene,
    method: str = DEFAULT_METHOD,
    size: tuple[int, int] = (512, 512),
    *,
    time: float = 0.0,
    aovs: Sequence[str] = (),
    **knobs: Any,
) -> Image:
    """Render `scene` by a named method at `size` (width, height) pixels, `time` seconds into its motion.

    `aovs` names extra outputs (see AOVS); `knobs` are the method's (see `wgsss methods`). Raises InputError for names
    and values that do not fit.
    """
    return Renderer(scene, make_method(method, knobs), size).frame(time, aovs)
