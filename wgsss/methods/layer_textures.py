"""Layers of a material as textures: the depths of their interfaces, and factors of their coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.gpu import Texture
from wgsss.optics import Layer
from wgsss.scene.layermaps import levels
from wgsss.scene.material import MAX_LAYERS, LayerMaps, Maps
from wgsss.stage import Body, Stage

Array = npt.NDArray[Any]

FAR = 1e8
"""mm: the depth of interfaces that do not exist."""
_INTERFACES = MAX_LAYERS - 1


@dataclass(frozen=True)
class LayerTextures:
    """What wgsl/subsurface_texture_mapping/layers.wgsl binds."""

    stack: dict[str, Any]
    """the value of struct Stack"""
    interfaces: Texture
    tints: Texture
    is_mapped: bool
    """whether `tints` has more than the neutral texel"""
    deepest: float
    """mm: the depth of the deepest interface"""
    extinction: Array
    """(3,) 1/mm: the mean extinction of the layers, weighted by their mean thickness"""


def layer_textures(stage: Stage, layers: tuple[Layer, ...], body: Body) -> LayerTextures:
    """Upload the textures of a body's layers. Raises InputError for more than MAX_LAYERS."""
    if len(layers) > MAX_LAYERS:
        raise InputError(
            f"material '{body.material.name}' has {len(layers)} layers, francois06 takes at most {MAX_LAYERS}"
        )
    maps = body.material.maps
    depths = interface_depths(layers, maps)
    unit = max(float(depths.max(initial=0.0)), 1e-6)
    padded = np.zeros((*depths.shape[:2], 4), np.float16)
    padded[..., : depths.shape[2]] = depths / unit
    tints = layer_tints(layers, maps)
    sigma = np.zeros((2, MAX_LAYERS, 4), np.float32)
    for j, layer in enumerate(layers):
        sigma[0, j] = [*layer.sigma_s, layer.g]
        sigma[1, j, :3] = layer.sigma_s + layer.sigma_a
    absent = np.where(np.arange(4) < len(layers) - 1, 0.0, FAR)
    return LayerTextures(
        stack={"sigma_s": sigma[0], "sigma_t": sigma[1], "unit": np.full(4, unit), "absent": absent},
        interfaces=stage.gpu.texture(padded, "rgba16float"),
        tints=stage.gpu.texture(np.ones((MAX_LAYERS, 1, 1, 4)) if tints is None else tints, "rgba16float"),
        is_mapped=tints is not None,
        deepest=float(depths.max(initial=0.0)),
        extinction=_mean_extinction(layers, depths),
    )


def _mean_extinction(layers: tuple[Layer, ...], depths: Array) -> Array:
    sigma_t = np.stack([layer.sigma_s + layer.sigma_a for layer in layers])
    mean = np.diff(depths.mean(axis=(0, 1)), prepend=0.0)
    if not mean.sum() > 0.0:
        last: Array = sigma_t[-1]
        return last
    weights = np.append(mean, 0.5 * mean.sum())  # the last layer has no end: what is seen of it counts as much
    extinction: Array = weights @ sigma_t / weights.sum()
    return extinction


def interface_depths(layers: tuple[Layer, ...], maps: Maps) -> Array:
    """Return the depth of each interface, mm, (H, W, interfaces), at the texels of the largest thickness map."""
    own = _per_layer(layers, maps)[:-1]
    size = _size([one.thickness for one in own])
    depths = np.zeros((*size, len(own)))
    below = np.zeros(size)
    for j, (layer, one) in enumerate(zip(layers, own, strict=False)):
        share = np.ones(size) if one.thickness is None else _resized(levels(one.thickness), size, maps)
        below = below + layer.thickness * share
        depths[..., j] = below
    return depths


def layer_tints(layers: tuple[Layer, ...], maps: Maps) -> Array | None:
    """Return linear factors of sigma_s and, as alpha, opacities: (layers, H, W, 4). None where all of them are 1."""
    own = _per_layer(layers, maps)
    images = [image for one in own for image in (one.color, one.opacity) if image is not None]
    if not images:
        return None
    size = _size(images)
    tints = np.ones((MAX_LAYERS, *size, 4))
    for tint, one in zip(tints, own, strict=False):
        if one.color is not None:
            tint[..., :3] = _resized(levels(one.color), size, maps)
        if one.opacity is not None:
            tint[..., 3] = _resized(levels(one.opacity), size, maps)
    return tints


def _per_layer(layers: tuple[Layer, ...], maps: Maps) -> tuple[LayerMaps, ...]:
    return maps.layers or (LayerMaps(),) * len(layers)


def _size(images: Sequence[Array | None]) -> tuple[int, int]:
    """Return the height and width that hold all of some images; 1 x 1 if there are none."""
    sizes = [image.shape[:2] for image in images if image is not None]
    return max((h for h, _ in sizes), default=1), max((w for _, w in sizes), default=1)


def _resized(image: Array, size: tuple[int, int], maps: Maps) -> Array:
    """Return an image at another size, interpolated as its sampler would."""
    for axis in (0, 1):
        old, new = image.shape[axis], size[axis]
        if old == new:
            continue
        at = (np.arange(new) + 0.5) * old / new - 0.5
        if maps.nearest:
            image = np.take(image, np.clip(np.round(at), 0, old - 1).astype(int), axis=axis)
            continue
        repeats = maps.wrap[1 - axis] == "repeat"
        low = np.floor(at).astype(int)
        part = (at - low).reshape(-1, *[1] * (image.ndim - 1 - axis))
        ends = [(low + i) % old if repeats else np.clip(low + i, 0, old - 1) for i in (0, 1)]
        first, second = (np.take(image, end, axis=axis) for end in ends)
        image = (1.0 - part) * first + part * second
    return image
