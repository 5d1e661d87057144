"""The layers of a material over the atlas of an object: their maps, their reflectance and their tables of weights."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.frame import Frame
from wgsss.gpu import Texture
from wgsss.graph import Bindings, Handle, Outputs
from wgsss.optics import Layer
from wgsss.optics.mapped import layer_table, shared_variances
from wgsss.scene.material import LayerMaps, Material
from wgsss.stage import Body, Stage
from wgsss.text import shortened

Array = npt.NDArray[Any]

_FULL = np.full((1, 1), 255, np.uint8)
_WHITE = np.full((1, 1, 3), 255, np.uint8)


def layers_of(body: Body) -> tuple[Layer, ...]:
    """Return the layers of a body's material; a homogeneous one has a single layer.

    Raises InputError if they are not known.
    """
    material = body.material
    if material.stack is None:
        name = shortened(material.name, 60)
        raise InputError(f"oat06 needs coefficients or layers, but material '{name}' has only a profile")
    return material.stack


def maps_of(material: Material, j: int) -> LayerMaps:
    """Return the maps of layer `j`; a layer without maps has empty ones."""
    return material.maps.layers[j] if material.maps.layers else LayerMaps()


def variances_of(body: Body) -> Array:
    """Return the variances, mm^2, of the Gaussians of all layers of a body."""
    return body.stage.shared(("layer variances", id(body.material)), lambda: shared_variances(layers_of(body)))


def weights_of(body: Body, j: int, *, infinite: bool = False) -> Bindings:
    """Return the bindings of wgsl/depth_parallax/weights.wgsl for layer `j` of a body.

    `infinite`: as if the layer were infinitely thick.
    """

    def make() -> Bindings:
        layers, maps = layers_of(body), maps_of(body.material, j)
        above = layers[j - 1].eta if j else 1.0
        below = layers[j + 1].eta if j + 1 < len(layers) else layers[j].eta
        layer = replace(layers[j], thickness=math.inf) if infinite else layers[j]
        varies = math.isfinite(layer.thickness) and not (maps.thickness is None and maps.opacity is None)
        rows = layer_table(layer, above, below, variances_of(body), shares=varies, colors=maps.color is not None)
        padded = np.concatenate([rows, np.zeros((*rows.shape[:-1], 1))], axis=-1)
        entries = np.array([rows.shape[2], rows.shape[1]], np.uint32)
        return {"weights": body.stage.gpu.buffer(padded.astype(np.float32)), "entries": entries}

    return body.stage.shared(("layer weights", id(body.material), j, infinite), make)


def draw_maps(frame: Frame, body: Body, size: int, *, alone: bool = False) -> list[Outputs]:
    """Return what wgsl/depth_parallax/maps.wgsl draws for each layer of a body, from the top down.

    `alone`: the reflectance is that of each layer without those below, as if it were infinitely thick.
    """
    below: Handle | Texture = frame.stage.gpu.black
    drawn: list[Outputs] = []
    for j in reversed(range(len(layers_of(body)))):
        maps = frame.graph.draw_outputs(
            "depth_parallax/maps",
            size=(size, size),
            label=f"layer {j + 1}",
            indices=body.indices,
            object=body.object_uniforms,
            vertices=body.vertices,
            below=frame.stage.gpu.black if alone else below,
            **_textures(body.stage, maps_of(body.material, j)),
            **weights_of(body, j, infinite=alone),
        )
        below = maps.rho
        drawn.append(maps)
    return drawn[::-1]


def coefficients_of(body: Body, j: int) -> dict[str, Any]:
    """Return absorption, scattering and thickness of layer `j` of a body, for parameters of shaders."""
    layer = layers_of(body)[j]
    thickness = min(layer.thickness, 1e6)
    return {"absorption": layer.sigma_a, "scattering": layer.sigma_s_prime, "thickness": thickness}


def _textures(stage: Stage, maps: LayerMaps) -> Bindings:
    color = _WHITE if maps.color is None else maps.color
    return {
        "thickness_map": _linear(stage, maps.thickness),
        "color_map": stage.image(color, "rgba8unorm-srgb"),
        "opacity_map": _linear(stage, maps.opacity),
    }


def _linear(stage: Stage, pixels: Array | None) -> Texture:
    """Return a texture of a map in 8 or 16 bits. Half floats, which any device filters, round to 1/2048."""
    if pixels is None or pixels.dtype == np.uint8:
        return stage.image(_FULL if pixels is None else pixels, "r8unorm")
    return stage.shared(
        ("layer map", id(pixels)), lambda: stage.gpu.texture((pixels / 65535.0).astype(np.float16), "r16float")
    )
