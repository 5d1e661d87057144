"""Textures of the layers of a material, and the stack of their means."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.optics import Layer
from wgsss.optics.medium import THINNEST
from wgsss.scene.files.colors import linear

MAX_LAYERS = 4
"""Largest number of layers of a material whose layers have maps."""


@dataclass(frozen=True, eq=False)
class LayerMaps:
    """Textures of one layer of a material, over the texture coordinates of a mesh, top row at v = 0.

    Raises InputError for an array of another type or shape.
    """

    thickness: npt.NDArray[Any] | None = None
    """uint8 or uint16 (H, W), linear: share of the thickness of the layer, which is reached at white; 0 where the layer
    is absent. Without it the layer has its thickness everywhere"""
    color: npt.NDArray[Any] | None = None
    """uint8 (H, W, 3), sRGB: multiplies sigma_s (Norberg 2010, section 5.1)"""
    opacity: npt.NDArray[Any] | None = None
    """uint8 or uint16 (H, W), linear: share of the layer's scattering and absorption that is present"""

    def __post_init__(self) -> None:
        for name in ("thickness", "color", "opacity"):
            pixels, types = getattr(self, name), (np.uint8,) if name == "color" else (np.uint8, np.uint16)
            shape = (3,) if name == "color" else ()
            if pixels is not None and (pixels.dtype not in types or pixels.size == 0 or pixels.shape[2:] != shape):
                kinds = " or ".join(np.dtype(kind).name for kind in types)
                raise InputError(f"the {name} map of a layer must be {kinds} of H x W{' x 3' if shape else ''}")

    @property
    def empty(self) -> bool:
        """Whether the layer has no texture."""
        return self.thickness is None and self.color is None and self.opacity is None


def check_layer_maps(layers: Sequence[Layer] | None, maps: Sequence[LayerMaps]) -> None:
    """Raise InputError, naming the layer and the key, if a stack of layers cannot have these maps."""
    if not maps:
        return
    if layers is None or len(maps) != len(layers):
        raise InputError(f"maps of {len(maps)} layers need as many layers, not {len(layers or ())}")
    if len(layers) > MAX_LAYERS:
        raise InputError(f"layers with maps can be {MAX_LAYERS} at most, not {len(layers)}")
    last = len(layers)
    if not math.isinf(layers[-1].thickness):
        raise InputError(f"thickness of layer {last}: the last of the layers with maps must be infinitely thick")
    for number, one in enumerate(maps, start=1):
        if one.thickness is None:
            continue
        if number == last:
            raise InputError(f"thickness_map of layer {number}: the last layer is infinitely thick and cannot have one")
        for other, layer in enumerate(layers, start=1):
            if layer.eta != layers[0].eta:
                raise InputError(
                    f"thickness_map of layer {number}: eta of layer {other} is {layer.eta:g} and that of layer 1 "
                    f"{layers[0].eta:g}, but layers with a thickness map need one eta"
                )


def levels(pixels: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Convert a map of a layer to linear values from 0 to 1: colours (H, W, 3) from sRGB, levels (H, W) as they are."""
    shares = pixels / float(np.iinfo(pixels.dtype).max)
    return linear(shares) if pixels.ndim == 3 else shares


def mean_stack(layers: Sequence[Layer], maps: Sequence[LayerMaps]) -> tuple[Layer, ...]:
    """Return layers of the mean thickness, mean colour and mean opacity of their maps. Absent layers are left out."""
    means = []
    for layer, one in zip(layers, maps, strict=True):
        share = 1.0 if one.thickness is None else _mean(one.thickness)
        if share == 0.0:
            continue
        opacity = 1.0 if one.opacity is None else _mean(one.opacity)
        color = np.ones(3) if one.color is None else _mean_color(one.color)
        means.append(
            replace(
                layer,
                thickness=layer.thickness * share,
                sigma_a=layer.sigma_a * opacity,
                sigma_s_prime=np.maximum(layer.sigma_s_prime * color * opacity, THINNEST),
            )
        )
    return tuple(means)


def _mean(pixels: npt.NDArray[Any]) -> float:
    """Return the mean of a linear map, as a share of its largest value."""
    return float(pixels.mean(dtype=np.float64)) / float(np.iinfo(pixels.dtype).max)


def _mean_color(pixels: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """Return the mean (3,) of an sRGB map in linear units."""
    counts = np.stack([np.bincount(pixels[..., channel].ravel(), minlength=256) for channel in range(3)])
    mean: npt.NDArray[np.float64] = counts @ linear(np.arange(256) / 255.0) / (pixels.size // 3)
    return mean
