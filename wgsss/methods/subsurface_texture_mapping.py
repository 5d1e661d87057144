"""francois06: subsurface texture mapping (Norberg 2010, 2.1 and 3.1; Francois et al. 2006).

Light that is scattered exactly once, summed along the viewing ray through the layers of a material. The result depends
on the viewer, so it is no integral of a diffusion profile. M is pi L_inside / eta^2, where L_inside is the radiance
that arrives at the surface from below: the composite then shows rho_dt L_inside / eta^2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from wgsss.errors import InputError
from wgsss.frame import Frame
from wgsss.graph import Handle, Outputs
from wgsss.methods.layer_textures import LayerTextures, layer_textures
from wgsss.methods.method import Diffused
from wgsss.optics import Layer
from wgsss.stage import Body, Stage

RULES = ("segments", "midpoint", "printed")  # in the order of march.wgsl
LIGHTS = ("march", "eq14", "eq20")  # in the order of light_path.wgsl
NOISES = ("none", "white", "uv")  # in the order of march.wgsl
OPTICAL_DEPTH = 3.2
"""The viewing ray ends at least at this optical depth along the normal. Light from below passes as much again."""
THESIS: dict[str, Any] = {
    "rule": "printed",
    "light": "eq14",
    "distance": "tangent",
    "phase": "schlick",
    "noise": "uv",
    "refraction": False,
}
"""The knobs that make the method of the thesis, but for its fitted planes."""


@dataclass(frozen=True)
class SubsurfaceTextureMapping:
    """M by single scattering in layers whose thickness comes from textures; it contains the light of M_back."""

    steps: int = field(default=10, metadata={"unit": "", "range": (1, 1000), "help": "steps along the viewing ray"})
    rule: str = field(
        default="segments",
        metadata={
            "unit": "",
            "choices": RULES,
            "help": "how the sum over the steps is formed; printed is the thesis's",
        },
    )
    light: str = field(
        default="march",
        metadata={"unit": "", "choices": LIGHTS, "help": "how the optical depth to the light is estimated"},
    )
    light_steps: int = field(
        default=4, metadata={"unit": "", "range": (1, 64), "help": "steps along the light's ray, with light=march"}
    )
    distance: str = field(
        default="shadow",
        metadata={
            "unit": "",
            "choices": ("shadow", "tangent"),
            "help": "where light enters: by the shadow map and the curvature, or through the tangent plane",
        },
    )
    phase: str = field(
        default="hg",
        metadata={"unit": "", "choices": ("hg", "schlick"), "help": "phase function: Henyey-Greenstein or Schlick"},
    )
    noise: str = field(
        default="none",
        metadata={"unit": "", "choices": NOISES, "help": "random offsets: of the steps, or of texture coordinates"},
    )
    refraction: bool = field(
        default=True, metadata={"unit": "", "help": "refract light at the surface, and reflect a part of it"}
    )

    source: ClassVar[str] = "Norberg 2010, sections 2.1 and 3.1; Francois et al. 2006"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = (
        {"steps": 5, "light": "eq14"},
        {"steps": 5, "light_steps": 2},
        {"steps": 10},
        {"steps": 15},
        {"steps": 15, **THESIS},
        {"steps": 100, **THESIS},
    )

    needs_layers: ClassVar[bool] = True
    multiple: ClassVar[bool] = False
    """whether light that scatters more than once is estimated"""

    def bake(self, stage: Stage) -> None:
        """Upload the textures of layers.

        Raises InputError if the layers of a material are not known.
        """
        for body in stage.bodies:
            textures_of(body)

    def passes(self, frame: Frame) -> Diffused:
        constants = {
            "STEPS": self.steps,
            "RULE": RULES.index(self.rule),
            "LIGHT": LIGHTS.index(self.light),
            "LIGHT_STEPS": self.light_steps,
            "SHADOW": self.distance == "shadow",
            "SCHLICK": self.phase == "schlick",
            "NOISE": NOISES.index(self.noise),
            "REFRACTION": self.refraction,
        }
        surface = mesh_surface(frame)
        M: Handle | None = None
        for body in frame.stage.bodies:
            textures = textures_of(body)
            M = frame.draw_object(
                "subsurface_texture_mapping/march",
                body,
                into=M,
                constants={**constants, "MAPPED": textures.is_mapped},
                params=_ray(frame, body, textures),
                back_faces=back_faces(frame, body),
                mesh_uv=surface.mesh_uv,
                v_gradient=surface.v_gradient,
                curvatures=surface.curvatures,
                stack=textures.stack,
                interfaces=textures.interfaces,
                tints=textures.tints,
            )
        assert M is not None, "a stage has a body"
        return Diffused(M_front=M)


def _ray(frame: Frame, body: Body, textures: LayerTextures) -> dict[str, Any]:
    """Return the value of struct Params of march.wgsl."""
    extinction = textures.extinction
    return {
        "world_to_clip": frame.view.world_to_clip,
        "eta": body.material.eta,
        "depth_max": max(textures.deepest, OPTICAL_DEPTH / max(float(extinction.mean()), 1e-6)),
        "extinction": float(extinction.mean()),
        "least": max(float(extinction.min()), 1e-6),
    }


def textures_of(body: Body) -> LayerTextures:
    """Return the textures of a body's layers."""
    return body.stage.shared(("layer textures", body.index), lambda: layer_textures(body.stage, _stack(body), body))


def _stack(body: Body) -> tuple[Layer, ...]:
    """Return the layers of a body. Raises InputError if they are not known."""
    material = body.material
    if material.stack is None:
        raise InputError(f"francois06 needs coefficients or layers, but material '{material.name}' has only a profile")
    return material.stack


def mesh_surface(frame: Frame) -> Outputs:
    """Return the outputs of `surface.wgsl`: texture coordinates of the meshes and their gradients, and curvatures."""

    def draw() -> Outputs:
        drawn: Outputs | None = None
        for body in frame.stage.bodies:
            names = ("mesh_uv", "v_gradient", "curvatures")
            drawn = frame.graph.draw_outputs(
                "subsurface_texture_mapping/surface",
                size=frame.size,
                indices=body.indices,
                depth_buffer="new" if drawn is None else drawn.depth,
                into={} if drawn is None else {name: drawn[name] for name in names},
                params={"world_to_clip": frame.view.world_to_clip},
                object=body.object_uniforms,
                vertices=body.vertices,
                normal=frame.gbuffer.normal,
            )
        assert drawn is not None, "a scene has an object"
        return drawn

    return frame.once("mesh surface", draw)


def back_faces(frame: Frame, body: Body) -> Handle:
    """Return the depth, in clip space, of the nearest back face of a body at each pixel; 1 where there is none."""

    def draw() -> Handle:
        posed = frame.stage.scene.objects[body.index]
        drawn = frame.graph.draw_outputs(
            "subsurface_texture_mapping/back_faces",
            size=frame.size,
            indices=body.indices,
            depth_buffer="new",
            params={"object_to_clip": frame.view.world_to_clip @ posed.matrix},
            vertices=body.vertices,
            label=str(body.index),
        )
        return drawn.depth

    return frame.once(("back faces", body.index), draw)
