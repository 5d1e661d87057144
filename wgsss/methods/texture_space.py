"""The surface method of deon07: diffusion in texture space by a sum of Gaussians (d'Eon & Luebke 2007; Mikkelsen 2009,
section 3.4).

L_d is drawn over the object's atlas, continued across the borders of charts, and blurred with ever wider Gaussians.
Each blur starts from the result of the last one, since the variances of successive Gaussians add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from wgsss.bake.charts import Charts
from wgsss.bake.charts import charts as make_charts
from wgsss.frame import Frame, irradiance_texels
from wgsss.gpu import Texture
from wgsss.graph import Bindings, Handle, Outputs
from wgsss.methods.method import Diffused
from wgsss.optics import SumOfGaussians, fit_shared_gaussians
from wgsss.stage import Body, Stage

SIGMA_TEXELS = 2.0  # the least sigma of a Gaussian on a smaller map, in its texels; see the tests of edges
MOST_HALVINGS = 2  # smaller maps would lose whole charts
SLOTS = 6
"""the number of blurred maps that shaders read"""
# The directions of a separable blur are undefined where the normal is parallel to the axis. With a different axis for
# each Gaussian, no point is affected by all.
_AXES = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class TextureSpace:
    """M_front as the sum of w_k G(v_k) * L_d over the atlas; M_back is not estimated."""

    map_size: int = field(
        default=1024, metadata={"unit": "texels", "range": (64, 4096), "help": "side of the irradiance map"}
    )
    gaussians: int = field(default=6, metadata={"unit": "", "range": (1, 6), "help": "number of Gaussians in the sum"})

    source: ClassVar[str] = "d'Eon & Luebke 2007, GPU Gems 3, chapter 14; Mikkelsen 2009, section 3.4"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = tuple({"map_size": n} for n in (256, 512, 1024, 2048))

    def bake(self, stage: Stage) -> None:
        """Unwrap each mesh, compute its stretch and seams, and fit the Gaussians to each material's profile."""
        for body in stage.bodies:
            for size in self.sizes(body):
                atlas(body, size)

    def sizes(self, body: Body) -> list[int]:
        """Return the size of the map for each Gaussian. The wide ones use smaller maps, halved at most MOST_HALVINGS
        times, on which their sigma spans SIGMA_TEXELS or more: a blurred map has no detail to lose."""
        sizes = []
        for sigma in np.sqrt(self.profile(body).variances):
            halvings = np.log2(max(sigma * self.texels_per_mm(body) / SIGMA_TEXELS, 1.0))
            sizes.append(max(self.map_size >> min(int(halvings), MOST_HALVINGS), 1))
        return sizes

    def texels_per_mm(self, body: Body) -> float:
        """Return the resolution of a body's irradiance map at rest: the square root of the mean texels per mm^2."""

        def uv_per_mm() -> float:
            render_mesh = body.unwrap()
            corners = render_mesh.atlas[render_mesh.faces].astype(np.float64)
            area = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 2
            return float(np.sqrt(area / body.rest.mesh.area))

        return self.map_size * body.stage.shared(("uv per mm", id(body.rest.mesh)), uv_per_mm)

    def profile(self, body: Body) -> SumOfGaussians:
        """Return a sum of Gaussians, with variances that the channels share, for the profile of a body's material. It
        is the profile itself where that is such a sum of at most `gaussians`, otherwise a fit."""
        return body.stage.shared(
            ("fit", id(body.material), self.gaussians),
            lambda: fit_shared_gaussians(body.profile, self.gaussians),
        )

    def passes(self, frame: Frame) -> Diffused:
        M_front: Handle | None = None
        for body in frame.stage.bodies:
            if maps := self.maps(frame, body):
                M_front = self._gather(frame, body, maps, M_front)
        if M_front is None:  # no body is in the image
            M_front = self._gather(frame, frame.stage.bodies[0], [frame.stage.gpu.black], None)
        return Diffused(M_front)

    def maps(self, frame: Frame, body: Body) -> list[Handle]:
        """Return the blurred maps that a body's pixels read, narrowest Gaussian first; none if the image shows none of
        it."""
        return self.blurs(frame, body)

    def _gather(self, frame: Frame, body: Body, maps: Sequence[Handle | Texture], into: Handle | None) -> Handle:
        """Return M_front of a body, drawn onto `into`: the sum of its maps by the profile's weights."""
        weights = np.zeros((SLOTS, 4))
        weights[: len(maps), :3] = self.profile(body).weights[: len(maps)] * frame.lighting.unit
        return frame.draw_object("texture_space/gather", body, into=into, weights=weights, **by_slot(maps))

    def blurs(self, frame: Frame, body: Body) -> list[Handle]:
        """Return a body's irradiance map, in `lighting.unit`, blurred with each Gaussian of its profile, narrowest
        first."""

        def make() -> list[Handle]:
            return self.blur(frame, body, irradiance_texels(frame, body, self.map_size))

        return frame.once(("blurs", self, body.index), make)

    def blur(self, frame: Frame, body: Body, irradiance: Handle) -> list[Handle]:
        """Return an irradiance map blurred with each Gaussian of a body's profile, narrowest first. Texels without a
        value stay without, and the blurs leave them out."""
        graph, sizes = frame.graph, self.sizes(body)

        def over(module: str, size: int, label: str = "", **options: Any) -> Outputs:
            charts = atlas(body, size)
            return graph.draw_outputs(
                module, size=(size, size), label=label, ids=charts.ids, seams=charts.seams, **options
            )

        dilated = over("texture_space/dilate", self.map_size, depth_buffer="new", source=irradiance)
        blurred, masks = dilated.dilated, {self.map_size: dilated.depth}
        for size in {*sizes} - {self.map_size}:
            masks[size] = over("texture_space/mask", size, str(size), depth_buffer="new", source=irradiance).depth
        reached = 0.0
        by_gaussian: list[Handle] = []
        for k, (variance, map_size) in enumerate(zip(self.profile(body).variances, sizes, strict=True)):
            charts = atlas(body, map_size)
            widths = {"variance": variance, "reached": reached, "finer": blurred.size[0] / map_size}
            for direction in (0, 1):
                nearer = 1.0 - (1 + 2 * k + direction) / (1 + 2 * len(sizes))
                drawn = over(
                    "texture_space/blur",
                    map_size,
                    f"{variance:.3g} mm2 {'uv'[direction]}",
                    depth_buffer=masks[map_size],
                    params={"axis": _AXES[k % 3], "direction": direction, "depth": nearer, **widths},
                    source=blurred,
                    gradient_u=charts.gradient_u,
                    gradient_v=charts.gradient_v,
                )
                blurred, masks[map_size] = drawn.blurred, drawn.depth
            reached = float(variance)
            by_gaussian.append(blurred)
        return by_gaussian


def atlas(body: Body, size: int) -> Charts:
    """Return a body's charts on square maps of `size` texels."""
    render_mesh, mesh, stage = body.unwrap(), body.rest.mesh, body.stage
    return stage.shared(("charts", id(mesh), size), lambda: make_charts(stage.gpu, mesh, render_mesh, size))


def by_slot(maps: Sequence[Handle | Texture]) -> Bindings:
    """Return blurred maps by binding name. Spare bindings get the last map; its weight there is 0."""
    return {f"blurred_{i}": maps[min(i, len(maps) - 1)] for i in range(SLOTS)}
