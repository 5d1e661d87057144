"""The method oat06: multitexturing with depth parallax (Oat 2006; Norberg 2010, sections 2.2 and 3.2).

The layers of a material are drawn over the object's atlas. From the top down, the light that enters each is blurred.
From the bottom up, what leaves each is blurred, shifted by parallax and blended with the layer above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.frame import Frame, irradiance_texels
from wgsss.gpu import Buffer, Texture
from wgsss.graph import Handle
from wgsss.methods.layer_atlas import coefficients_of, draw_maps, layers_of, maps_of, variances_of, weights_of
from wgsss.methods.method import Diffused
from wgsss.methods.texture_space import TextureSpace, atlas, by_slot
from wgsss.optics import SumOfGaussians
from wgsss.stage import Body, Stage

Array = npt.NDArray[Any]

TAPS = 16
"""of the disc that blurs in the paper's model"""
TURN = 0.5153
"""angle by which the disc is turned from pass to pass. A search chose it and the seed of the disc for few ghosts"""


class _Blurs(TextureSpace):
    """The blurs of texture space with the variances of a stack of layers."""

    def profile(self, body: Body) -> SumOfGaussians:
        variances = variances_of(body)
        return SumOfGaussians(variances, np.zeros((len(variances), 3)))


@dataclass(frozen=True)
class DepthParallax:
    """M_front as the light that the layers of a material return, each seen with parallax; M_back is not estimated.

    A homogeneous medium is one layer. A material of which only the profile is known is refused.
    """

    model: str = field(
        default="optical",
        metadata={
            "unit": "",
            "choices": ("optical", "paper"),
            "help": "optical: refraction, and blurs and weights by the optics of the layers; paper: as in the thesis",
        },
    )
    map_size: int = field(
        default=1024, metadata={"unit": "texels", "range": (64, 4096), "help": "side of the maps of the layers"}
    )
    transparency: float = field(
        default=0.5,
        metadata={"unit": "", "range": (0, 1), "help": "share of the inside that shows at a right angle (model=paper)"},
    )
    blur_passes: int = field(
        default=4, metadata={"unit": "", "range": (1, 8), "help": "passes of the blur of the light map (model=paper)"}
    )
    map_scale: float = field(
        default=0.5,
        metadata={"unit": "", "range": (0.125, 1), "help": "size of the light map over map_size (model=paper)"},
    )

    source: ClassVar[str] = (
        "Oat 2006, Rendering Goopy Materials with Multiple Layers; Norberg 2010, sections 2.2 and 3.2"
    )
    sweep: ClassVar[tuple[dict[str, Any], ...]] = (
        *({"model": "paper", "map_size": n} for n in (512, 1024)),
        *({"map_size": n} for n in (256, 512, 1024)),
    )

    needs_layers: ClassVar[bool] = True

    def bake(self, stage: Stage) -> None:
        """Unwrap each mesh, and fit the blurs of each layer. Raises InputError for a material without layers."""
        for body in stage.bodies:
            layers_of(body)
            if self.model == "optical":
                for size in self._blurs.sizes(body):
                    atlas(body, size)
                for j in range(len(layers_of(body))):
                    weights_of(body, j)
            else:
                for size in (self.map_size, self._light_size):
                    atlas(body, size)

    @property
    def _blurs(self) -> TextureSpace:
        return _Blurs(map_size=self.map_size)

    @property
    def _light_size(self) -> int:
        return max(round(self.map_size * self.map_scale), 1)

    def passes(self, frame: Frame) -> Diffused:
        M_front: Handle | None = None
        weights = np.zeros((6, 4))
        weights[0, :3] = frame.lighting.unit
        for body in frame.stage.bodies:
            leaving = self._optical(frame, body) if self.model == "optical" else self._paper(frame, body)
            M_front = frame.draw_object(
                "texture_space/gather", body, into=M_front, weights=weights, **by_slot([leaving])
            )
        assert M_front is not None, "a stage has a body"
        return Diffused(M_front)

    def _optical(self, frame: Frame, body: Body) -> Handle:
        """Return what leaves a body at its top, in `lighting.unit`, over its atlas, by the optics of its layers."""
        layers, maps, blurs = layers_of(body), draw_maps(frame, body, self.map_size), self._blurs
        entering = irradiance_texels(frame, body, self.map_size)
        depth: Handle | Texture = frame.stage.gpu.black
        depths: list[Handle | Texture] = []
        reflected: list[Handle] = []
        for j in range(len(layers)):
            drawn = frame.graph.draw_outputs(
                "depth_parallax/descend",
                size=(self.map_size, self.map_size),
                label=f"layer {j + 1}",
                params=coefficients_of(body, j),
                amount=maps[j].amount,
                color=maps[j].color,
                below=maps[j + 1].rho if j + 1 < len(layers) else frame.stage.gpu.black,
                above=depth,
                **by_slot(blurs.blur(frame, body, entering)),
                **weights_of(body, j),
            )
            depths.append(depth)
            reflected.append(drawn.reflected)
            entering, depth = drawn.entering, drawn.optical
        leaving = reflected[-1]
        for j in reversed(range(len(layers) - 1)):
            leaving = self._draw(
                "depth_parallax/ascend",
                frame,
                body,
                label=f"layer {j + 1}",
                params={**coefficients_of(body, j), "eta": layers[j].eta},
                amount=maps[j].amount,
                color=maps[j].color,
                reflected=reflected[j],
                above=depths[j],
                **by_slot(blurs.blur(frame, body, leaving)),
                **weights_of(body, j),
            )
        return leaving

    def _paper(self, frame: Frame, body: Body) -> Handle:
        """Return what leaves a body at its top, in `lighting.unit`, over its atlas, as in the thesis."""
        layers, maps = layers_of(body), draw_maps(frame, body, self.map_size, alone=True)
        light = irradiance_texels(frame, body, self.map_size)
        lights = [light]
        if len(layers) > 1:
            light = irradiance_texels(frame, body, self._light_size)
        for j in range(len(layers) - 1):
            light = self._disc_blur(frame, body, light, maps[j].amount, coefficients_of(body, j)["thickness"])
            lights.append(light)
        below: Handle | Texture = frame.stage.gpu.black
        for j in reversed(range(len(layers))):
            last = j + 1 == len(layers)
            below = self._draw(
                "depth_parallax/blend",
                frame,
                body,
                label=f"layer {j + 1}",
                params={
                    "thickness": coefficients_of(body, j)["thickness"],
                    "transparency": self.transparency,
                    "last": int(last),
                    "opaque": float(maps_of(body.material, j).opacity is not None),
                },
                disc=_disc_buffer(body.stage),
                amount=maps[j].amount,
                base=maps[j].rho,
                light=lights[j],
                below=below,
            )
        assert isinstance(below, Handle), "a body has a layer"
        return below

    def _draw(self, module: str, frame: Frame, body: Body, **options: Any) -> Handle:
        """Declare a pass over the triangles of a body in its atlas, and return its target."""
        charts = atlas(body, self.map_size)
        return frame.graph.draw(
            module,
            size=(self.map_size, self.map_size),
            indices=body.indices,
            object=body.object_uniforms,
            vertices=body.vertices,
            normal_map=body.maps.normal_map,
            eye=frame.view.eye,
            ids=charts.ids,
            seams=charts.seams,
            **options,
        )

    def _disc_blur(self, frame: Frame, body: Body, light: Handle, amount: Handle, radius: float) -> Handle:
        """Return a light map blurred by the disc, in n passes of r / sqrt(n), whose variance is that of one of r."""
        size = light.size[0]
        charts = atlas(body, size)
        for i in range(self.blur_passes):
            turn = (math.cos(i * TURN), math.sin(i * TURN))
            light = frame.graph.draw(
                "depth_parallax/disc",
                size=(size, size),
                label=str(i + 1),
                params={"thickness": radius / math.sqrt(self.blur_passes), "turn": turn},
                disc=_disc_buffer(body.stage),
                source=light,
                amount=amount,
                ids=charts.ids,
                seams=charts.seams,
                gradient_u=charts.gradient_u,
                gradient_v=charts.gradient_v,
            )
        return light


def disc(n: int) -> Array:
    """Return `n` points (n, 2) spread over a disc of radius 1, at the distances of a Poisson disc (Cook 1986).

    They are centred and have the variance of the disc, 1/4 along each axis: those of random points would shift the
    picture and stretch the blur.
    """
    random = np.random.default_rng(11)
    points = np.zeros((0, 2))
    while len(points) < n:  # the best of many candidates
        candidates = random.uniform(-1.0, 1.0, (64 * (len(points) + 1), 2))
        candidates = candidates[(np.square(candidates).sum(axis=1) <= 1.0)]
        nearest = np.linalg.norm(candidates[:, None] - points, axis=-1).min(axis=1, initial=np.inf)
        points = np.append(points, candidates[[nearest.argmax()]], axis=0)
    points -= points.mean(axis=0)
    variances, axes = np.linalg.eigh(points.T @ points / n)
    return np.asarray(points @ (axes / (2.0 * np.sqrt(variances))) @ axes.T)


def _disc_buffer(stage: Stage) -> Buffer:
    return stage.shared(("disc", TAPS), lambda: stage.gpu.buffer(disc(TAPS).astype(np.float32)))
