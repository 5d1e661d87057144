"""Small bright regions of environment images, such as the sun, as directional lights.

A sun casts a sharp shadow. It is too small for prefiltered maps, and for the few rays by which the visible share of the
sky is computed. It is removed from the image, so the total light stays the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

MOST_SUNS = 8
"""The most suns of an image: each needs a shadow map."""
_RADIUS = math.radians(2.0)  # of the cone that contains a sun and its glare; at least _TEXELS of the image
_TEXELS = 1.5
_COARSEST = math.radians(9.0)  # the largest radius: images that need a larger one are too coarse to have suns
_LEAST_SHARE = 0.02  # of the light of the whole image: a weaker sun casts no visible shadow
_LEAST_CONTRAST = 8.0  # of the mean radiance in the cone over that around it, up to twice its radius
_MOST_TRIED = 64  # the most peaks of an image that are tested


@dataclass(frozen=True)
class Sun:
    """A sun of an image, before the rotation of its light."""

    towards: Array
    """unit vector (3,) towards the sun"""
    irradiance: Array
    """RGB (3,), W/m^2, on a surface that faces the sun"""


def take_suns(pixels: Array) -> tuple[list[Sun], Array]:
    """Return the suns of an image, the strongest first, and the image without them.

    `pixels` (H, W, 3): radiance by latitude and longitude, W/(m^2 sr). A sun is the excess of the radiance in a cone
    over the mean radiance around the cone. Its irradiance is the sum of the excess times the solid angle; its direction
    is the mean direction of the excess.
    """
    height, width = pixels.shape[:2]
    radius = max(_RADIUS, _TEXELS * math.pi / height)
    grey = pixels.mean(axis=2)
    least = _LEAST_SHARE * float(grey.sum(axis=1, dtype=np.float64) @ solid_angles(height, width))
    if radius > _COARSEST or least == 0.0:
        return [], pixels
    cone = 2.0 * math.pi * (1.0 - math.cos(radius))
    suns: list[tuple[Sun, _Region]] = []
    for _ in range(_MOST_TRIED):
        row, column = divmod(int(grey.argmax()), width)
        if grey[row, column] * cone < least:
            break
        region = _Region(pixels, texel_directions(row, column, height, width), radius)
        sun = region.sun
        if sun is not None:  # again, around its centre instead of its brightest texel
            region = _Region(pixels, sun.towards, radius)
            sun = region.sun
        grey[region.rows, region.columns] = -1.0  # tried
        grey[row, column] = -1.0
        if sun is not None and sun.irradiance.mean() >= least:
            apart = all(float((sun.towards * other.towards).sum()) < math.cos(2.0 * radius) for other, _ in suns)
            suns += [(sun, region)] if apart else []
    suns.sort(key=lambda pair: -float(pair[0].irradiance.mean()))
    if not suns:
        return [], pixels
    rest = pixels.copy()
    for _, region in suns[:MOST_SUNS]:
        rest[region.rows[region.inside], region.columns[region.inside]] -= region.excess.astype(np.float32)
    return [sun for sun, _ in suns[:MOST_SUNS]], rest


def solid_angles(height: int, width: int) -> Array:
    """Return the solid angle of a texel in each row of a latitude-longitude image: (height,), sr."""
    return -np.diff(np.cos(np.linspace(0.0, np.pi, height + 1))) * (2.0 * np.pi / width)


def texel_directions(row: Any, column: Any, height: int, width: int) -> Array:
    """Return the directions (..., 3) of points in a latitude-longitude image.

    `row` and `column` (...) are in texels; the centre of the first texel is at 0, 0.
    """
    polar = (np.asarray(row) + 0.5) * (np.pi / height)
    around = (np.asarray(column) + 0.5) * (2.0 * np.pi / width) - np.pi  # see EnvironmentLight
    sine = np.sin(polar)
    return np.stack([sine * np.sin(around), np.cos(polar), -sine * np.cos(around)], axis=-1)


class _Region:
    """The N texels of an image within twice a radius around a direction.

    Attributes:
        rows, columns: (N,) of the texels.
        inside: (N,), whether each texel is within the radius.
        excess: (M, 3), the radiance of the texels inside, less the mean radiance of the others.
        sun: the excess as a sun; None if its contrast to the others is too low.
    """

    def __init__(self, pixels: Array, centre: Array, radius: float) -> None:
        height, width = pixels.shape[:2]
        polar = math.acos(min(max(float(centre[1]), -1.0), 1.0))
        low, high = polar - 2.0 * radius, polar + 2.0 * radius
        rows = np.arange(max(math.floor(low / math.pi * height), 0), min(math.ceil(high / math.pi * height), height))
        columns = np.arange(width)
        if low > radius and high < math.pi - radius:  # near a pole, all columns are near
            reach = math.ceil(math.asin(math.sin(2.0 * radius) / math.sin(polar)) / (2.0 * math.pi) * width) + 1
            middle = math.floor((0.5 + math.atan2(centre[0], -centre[2]) / (2.0 * math.pi)) * width)
            columns = np.arange(middle - reach, middle + reach + 1)[:width] % width
        row, column = (a.ravel() for a in np.meshgrid(rows, columns, indexing="ij"))
        d = texel_directions(row, column, height, width)
        cosine = (d * centre).sum(axis=1)
        near = cosine > math.cos(2.0 * radius)
        self.rows, self.columns, d = row[near], column[near], d[near]
        self.inside = cosine[near] > math.cos(radius)
        weight = solid_angles(height, width)[self.rows]
        radiance = pixels[self.rows, self.columns].astype(np.float64)
        inner, outer = (np.where(chosen, weight, 0.0) for chosen in (self.inside, ~self.inside))
        means = [(w[:, None] * radiance).sum(axis=0) / max(w.sum(), 1e-30) for w in (inner, outer)]
        self.excess = np.maximum(radiance[self.inside] - means[1], 0.0)
        self.sun: Sun | None = None
        power = self.excess * weight[self.inside, None]
        if means[0].mean() > _LEAST_CONTRAST * means[1].mean() and power.any():
            mean = (power.mean(axis=1)[:, None] * d[self.inside]).sum(axis=0)
            self.sun = Sun(mean / np.linalg.norm(mean), power.sum(axis=0))
