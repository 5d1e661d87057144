"""barre11's translucency: local thickness, baked, and the light behind it (Barré-Brisebois & Bouchard 2011).

As printed, light that has crossed an object is

    vLTLight = L + N distortion
    fLTDot   = saturate(V . -vLTLight)^power scale
    fLT      = attenuation (fLTDot + ambient) thickness
    out      = albedo light fLT

summed over the lights, without shadows. Here `albedo` is the profile's total times the base colour, `light` times
`attenuation` the irradiance that a surface facing the light has, and `out` is M_back: the pass that shows M multiplies
by rho_dt / pi, which is the 1 / pi that games leave out of the albedo. So a thickness and a bracket of 1 are a surface
that lets through all that it would reflect.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.bake.thickness import local_thickness
from wgsss.errors import InputError, unknown
from wgsss.frame import Frame
from wgsss.gpu import Buffer
from wgsss.graph import Handle
from wgsss.methods.method import Method
from wgsss.stage import Body, Stage

Array = npt.NDArray[Any]

SETS = 4
"""of parameters that a g-buffer has room for"""


@dataclass(frozen=True)
class LocalThickness:
    """M_back by the thickness around each vertex, and by where the light and the viewer are.

    What depends on the material is in the thickness (see `wgsss.bake.thickness`) and in the albedo. The defaults of the
    knobs are fitted to the diffusion integral's M_back at the vertices of `ear`, seen from all round, of skin, skin1,
    marble and wholemilk at once, and then to the other scenes as they are seen. The mean of M_back is then 0.99, 1.06,
    1.12 and 1.08 of the integral's on the ear, 1.07 on the statue, 0.88 on the gyroid, 0.80 on the milk, 1.14 on the
    wave and 0.62 on the leaf. It changes with the view, as the integral's does not. A larger power, as the paper has,
    errs less where one looks towards the light and more elsewhere.

    As in the paper, `distortion`, `power` and `ambient` are the material's, where it has them (its `transport`), and
    `scale` tunes them all. A g-buffer tells up to SETS of them apart, by bits that colour spares: 7 bits of red and
    green are left, or 6 of grey.

    An environment counts as light from straight behind: by scale + ambient of the irradiance that a surface
    facing away has. Nothing casts shadows, as in the paper, and what moves keeps its thickness at rest.
    """

    distortion: float = field(
        default=0.0, metadata={"unit": "", "range": (0, 1), "help": "how far the normal turns the light that is seen"}
    )
    power: float = field(
        default=2.0, metadata={"unit": "", "range": (0.1, 64), "help": "how narrow the light from behind is seen"}
    )
    scale: float = field(
        default=0.8, metadata={"unit": "", "range": (0, 10), "help": "of the light from behind, on all lights"}
    )
    ambient: float = field(
        default=0.05, metadata={"unit": "", "range": (0, 1), "help": "share of the light that is seen from everywhere"}
    )
    thickness: str = field(
        default="coloured", metadata={"unit": "", "choices": ("coloured", "grey"), "help": "what the map has"}
    )
    stored: str = field(
        default="vertices",
        metadata={"unit": "", "choices": ("vertices", "g-buffer"), "help": "where; 8 bits and light per pixel"},
    )

    source: ClassVar[str] = "Barré-Brisebois & Bouchard 2011"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({"thickness": "grey"}, {"stored": "g-buffer"})
    beside: ClassVar[type] = object

    def __post_init__(self) -> None:
        for knob in fields(self):
            choices, value = knob.metadata.get("choices"), getattr(self, knob.name)
            if choices is not None and value not in choices:
                raise unknown(knob.name, value, choices)

    def bake(self, stage: Stage) -> None:
        """Measure the thickness of each mesh for its material.

        Raises InputError where a g-buffer is to tell more than SETS parameters of materials apart.
        """
        if self.stored == "g-buffer" and len(found := self._sets(stage)) > SETS:
            raise InputError(f"a g-buffer has room for {SETS} materials' transport, not for {len(found)}")
        for body in stage.bodies:
            self.map(body)

    def map(self, body: Body) -> Array:
        """float32 (V, 3): the thickness at the vertices, white where it is thin. Grey lets through as much white light
        as coloured, weighted by what the channels reflect."""
        mesh, profile = body.rest.mesh, body.material.profile
        coloured = body.stage.shared(
            ("local thickness", id(mesh), id(body.material)), lambda: local_thickness(mesh, profile)
        )
        if self.thickness == "coloured":
            return coloured
        weights = profile.total / max(profile.total.sum(), 1e-30)
        return np.repeat((coloured @ weights)[:, None], 3, axis=1).astype(np.float32)

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        maps = {body: self._upload(body) for body in frame.stage.bodies}
        translucent = {body: thickness for body, thickness in maps.items() if thickness is not None}
        if not translucent:
            return None
        return self._forward(frame, translucent) if self.stored == "vertices" else self._deferred(frame, translucent)

    def _upload(self, body: Body) -> Buffer | None:
        """Return the map on the device; None where no light comes through."""

        def make() -> Buffer | None:
            thickness = self.map(body)
            return body.stage.gpu.buffer(np.pad(thickness, ((0, 0), (0, 1)))) if thickness.any() else None

        key = ("local thickness map", id(body.rest.mesh), id(body.material), self.thickness)
        return body.stage.shared(key, make)

    def _forward(self, frame: Frame, translucent: dict[Body, Buffer]) -> Handle | None:
        """Return M_back, computed at the vertices and interpolated between them."""
        module = "local_thickness/forward"
        M_back: Handle | None = None
        for body, thickness in translucent.items():
            M_back = frame.graph.draw(
                module,
                into=M_back,
                size=frame.size,
                indices=body.indices,
                constants={"MAPPED": body.is_coloured},
                params={"world_to_clip": frame.view.world_to_clip, "eye": frame.view.eye, "albedo": _albedo(body)},
                vertices=body.vertices,
                thickness=thickness,
                transport=self._transport(body),
                **frame.bindings(module, body),
            )
        return M_back

    def _deferred(self, frame: Frame, translucent: dict[Body, Buffer]) -> Handle:
        """Return M_back, computed at the pixels from a target into which all bodies draw their thickness."""
        sets = self._sets(frame.stage)
        coloured = self.thickness == "coloured"
        constants = {"COLOURED": coloured, "BITS": 0 if len(sets) == 1 else 1 if coloured else 2}
        module = "local_thickness/gbuffer"
        stored: Handle | None = None
        for body, thickness in translucent.items():
            stored = frame.graph.draw(
                module,
                into=stored,
                size=frame.size,
                indices=body.indices,
                constants=constants,
                params={"world_to_clip": frame.view.world_to_clip, "which": sets.index(self._transport(body))},
                vertices=body.vertices,
                thickness=thickness,
                **frame.bindings(module, body),
            )
        assert stored is not None
        return frame.per_object(
            "local_thickness/deferred",
            lambda body: {"albedo": _albedo(body)},
            bodies=translucent,
            constants=constants,
            transports=sets,
            stored=stored,
        )

    def _transport(self, body: Body) -> dict[str, float]:
        """The parameters of a body: its material's own, or the knobs."""
        names = ("distortion", "power", "ambient")
        own = body.material.transport or tuple(getattr(self, name) for name in names)
        return {**dict(zip(names, own, strict=True)), "scale": self.scale}

    def _sets(self, stage: Stage) -> list[dict[str, float]]:
        """The parameters that the bodies have, each once."""
        found: list[dict[str, float]] = []
        for body in stage.bodies:
            if (transport := self._transport(body)) not in found:
                found.append(transport)
        return found


def _albedo(body: Body) -> Array:
    """Return the printed cDiffuseAlbedo (3,), without the base colour's map."""
    albedo: Array = body.material.profile.total * body.material.base_color
    return albedo
