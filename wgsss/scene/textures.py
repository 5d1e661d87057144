"""The textures of a mesh file: which of them a part can use, their texture coordinates, and their pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.cutout import Mask
from wgsss.scene.files.contents import Look, Part, Texture
from wgsss.scene.images import read_map
from wgsss.scene.material import SLOTS, STEEPEST, Maps

Array = npt.NDArray[Any]
Say = Callable[[str], None]

FARTHEST_UV = 1e6
"""Texture coordinates beyond this, or not finite, become 0: single precision cannot resolve texels there."""

_SQUARED = 256
"""A mask without interpolation is refined to about this many texels per side, so that its corners stay sharp."""


_ROUNDING = 1e-4  # of texture coordinates at the border of the image


def first_texture(look: Look) -> Texture | None:
    """Return the first texture of the look. The others must lie over the same coordinates."""
    return next((texture for slot in SLOTS if (texture := _texture(look, slot)) is not None), None)


def usable_look(part: Part, say: Say) -> Look:
    """Return the look of a part without the textures that it cannot use.

    Those are all textures if it has no texture coordinates, and textures over other coordinates than the first one.
    """
    look, first = part.look, first_texture(part.look)
    if first is None:
        return look
    if first.coordinates not in part.uvs:
        where = f" {first.coordinates}" if first.coordinates else ""
        say(f"{part.name}: its textures are left out, since it has no texture coordinates{where}")
        return replace(look, base_color_map=None, normal_map=None, specular_map=None, cutoff=None)
    for slot in SLOTS:
        texture = _texture(look, slot)
        if texture is None:
            continue
        if (texture.coordinates, texture.transform) != (first.coordinates, first.transform):
            say(f"{slot} texture {texture.name} left out: its texture coordinates differ from those of {first.name}")
            look = _without(look, slot)
        elif texture.wrap != first.wrap and not _within(coordinates(part, look)):
            say(f"{slot} texture {texture.name} left out: it is wrapped differently from {first.name}")
            look = _without(look, slot)
        elif texture.nearest != first.nearest:
            say(f"{slot} texture {texture.name} uses the interpolation of {first.name}")
    return look


def _within(uvs: Array | None) -> bool:
    """Whether texture coordinates (V, 2) stay within the image, so that it does not repeat."""
    return uvs is None or bool(((uvs >= -_ROUNDING) & (uvs <= 1 + _ROUNDING)).all())


def shared(looks: list[Look], say: Say) -> Look:
    """Return the common properties of several looks. Properties that differ are left out."""
    first = looks[0]
    for slot in SLOTS:
        if any(_texture(look, slot) != _texture(first, slot) for look in looks):
            say(f"{slot} textures left out: the parts do not all have the same one")
            first = _without(first, slot)
    for name in ("base_color", "cutoff", "medium", "eta", "roughness", "specular", "normal_scale"):
        if any(getattr(look, name) != getattr(first, name) for look in looks):
            changed: dict[str, Any] = {name: getattr(Look(), name)}
            first = replace(first, **changed)
    return first


def coordinates(part: Part, look: Look) -> Array | None:
    """Compute the texture coordinates of a look on a part: float64 (V, 2), v down. None if the part has none."""
    first = first_texture(look)
    uvs = part.uvs.get(first.coordinates if first else 0)
    if uvs is None or first is None or first.transform is None:
        return uvs
    matrix = np.asarray(first.transform)
    with np.errstate(all="ignore"):  # what is not finite is counted later
        return np.stack([uvs[:, 0] * row[0] + uvs[:, 1] * row[1] + row[2] for row in matrix], axis=1)


class TextureReader:
    """Decodes the textures of a file, each only once."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._images: dict[Any, Array | None] = {}

    def maps(self, look: Look) -> Maps:
        """Decode the textures of a look. A texture that is damaged or too large is left out with a note."""
        base_color, normal, specular = (self._image(_texture(look, slot), slot) for slot in SLOTS)
        textures = Maps(base_color, normal, specular)
        first = first_texture(look)
        if first is not None:
            textures = replace(textures, wrap=first.wrap, nearest=first.nearest)
        scale = min(max(look.normal_scale, -STEEPEST), STEEPEST)
        if scale != look.normal_scale:
            self._say(f"a normal scale of {look.normal_scale:g} is replaced by {scale:g}")
        return replace(textures, normal_scale=scale, tint=look.base_color)

    def mask(self, look: Look) -> Mask | None:
        """Return the alpha mask of a look, or None if its alpha does not matter."""
        if look.cutoff is None:
            return None
        alpha = np.full((1, 1), 255, np.uint8)
        wrap = ("repeat", "repeat")
        if look.base_color_map is not None:
            wrap = look.base_color_map.wrap
            decoded = self._image(replace(look.base_color_map, channels="A"), "alpha")
            alpha = alpha if decoded is None else decoded
            if look.base_color_map.nearest:  # its outline follows the sides of texels
                finer = min(max(_SQUARED // max(alpha.shape), 1), 16)
                alpha = alpha.repeat(finer, axis=0).repeat(finer, axis=1)
        return Mask(look.alpha * alpha / 255.0, look.cutoff, wrap)

    def _image(self, texture: Texture | None, slot: str) -> Array | None:
        if texture is None:
            return None
        key = (texture.source, texture.channels, slot != "base_color")
        if key not in self._images:
            try:
                self._images[key] = read_map(texture.source, texture.channels, linear=slot != "base_color")
            except InputError as error:
                reason = str(error)
                if isinstance(texture.source, Path):
                    reason = reason.removeprefix(f"{texture.source}: ")
                self._say(f"{slot} texture left out: {texture.name}: {reason}")
                self._images[key] = None
        return self._images[key]


def _texture(look: Look, slot: str) -> Texture | None:
    texture: Texture | None = getattr(look, f"{slot}_map")
    return texture


def _without(look: Look, slot: str) -> Look:
    changed: dict[str, Any] = {f"{slot}_map": None}
    return replace(look, **changed)
