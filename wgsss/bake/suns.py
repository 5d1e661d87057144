"""Small bright regions of environment images, such as the sun, as directional lights.

A sun is too small to be prefiltered, and for the few rays by which a vertex finds out how much of the sky it sees; and
it casts a sharp shadow. What is left of the image has none of it. The light that an image gives stays the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

MOST_SUNS = 8
"""of an image: each has its shadow map"""
_RADIUS = math.radians(2.0)  # of the cone that holds a sun with its glare; at least _TEXELS of the image
_TEXELS = 1.5
_COARSEST = math.radians(9.0)  # images of which the cone would be wider have no suns
_LEAST_SHARE = 0.02  # of the light of the whole image: less light casts no shadow that is seen
_LEAST_CONTRAST = 8.0  # of the mean radiance in the cone over that around it, up to twice its radius
_MOST_TRIED = 64  # peaks of an image


@dataclass(frozen=True)
class Sun:
    towards: Array
    """the unit direction towards it (3,)"""
    irradiance: Array
    """RGB, W/m^2, on a surface that faces it (3,)"""


def take_suns(pixels: Array) -> tuple[list[Sun], Array]:
    """The suns of a latitude-longitude image (H, W, 3) of radiance, the strongest first, and the image without them.

    A sun is what a cone has in excess of the mean radiance around it. Its irradiance is the excess times its solid
    angle, summed up; its direction is the mean of the excess.
    """
    height, width = pixels.shape[:2]
    radius = max(_RADIUS, _TEXELS * math.pi / height)
    grey = pixels.mean(axis=2)
    least = _LEAST_SHARE * float(grey.sum(axis=1, dtype=np.float64) @ solid_angles(height, width))
    if radius > _COARSEST or least == 0.0:
        return [], pixels
    cone = 2.0 * math.pi * (1.0 - math.cos(radius))
    found: list[tuple[Sun, _Region]] = []
    for _ in range(_MOST_TRIED):
        row, column = divmod(int(grey.argmax()), width)
        if grey[row, column] * cone < least:
            break
        region = _Region(pixels, directions(row, column, height, width), radius)
        sun = region.sun
        if sun is not None:  # about its middle rather than its brightest texel
            region = _Region(pixels, sun.towards, radius)
            sun = region.sun
        grey[region.rows, region.columns] = -1.0  # tried
        grey[row, column] = -1.0
        if sun is not None and sun.irradiance.mean() >= least:
            apart = all(float((sun.towards * other.towards).sum()) < math.cos(2.0 * radius) for other, _ in found)
            found += [(sun, region)] if apart else []
    found.sort(key=lambda pair: -float(pair[0].irradiance.mean()))
    if not found:
        return [], pixels
    rest = pixels.copy()
    for _, region in found[:MOST_SUNS]:
        rest[region.rows[region.inside], region.columns[region.inside]] -= region.excess.astype(np.float32)
    return [sun for sun, _ in found[:MOST_SUNS]], rest


def solid_angles(height: int, width: int) -> Array:
    """Steradians (height,) of a texel in each row of a latitude-longitude image."""
    return -np.diff(np.cos(np.linspace(0.0, np.pi, height + 1))) * (2.0 * np.pi / width)


def directions(row: Any, column: Any, height: int, width: int) -> Array:
    """The directions (..., 3) of places in a latitude-longitude image, in texels: that of the first texel is 0, 0."""
    polar = (np.asarray(row) + 0.5) * (np.pi / height)
    around = (np.asarray(column) + 0.5) * (2.0 * np.pi / width) - np.pi  # see EnvironmentLight
    sine = np.sin(polar)
    return np.stack([sine * np.sin(around), np.cos(polar), -sine * np.cos(around)], axis=-1)


class _Region:
    """The texels of an image within twice a radius of a direction.

    Attributes:
        rows, columns: (N,) of the texels.
        inside: (N,) whether they are within the radius.
        excess: the radiance of those inside (M, 3) above the mean of the others.
        sun: that excess, if its contrast to the others is that of a sun.
    """

    def __init__(self, pixels: Array, centre: Array, radius: float) -> None:
        height, width = pixels.shape[:2]
        polar = math.acos(min(max(float(centre[1]), -1.0), 1.0))
        low, high = polar - 2.0 * radius, polar + 2.0 * radius
        rows = np.arange(max(math.floor(low / math.pi * height), 0), min(math.ceil(high / math.pi * height), height))
        columns = np.arange(width)
        if low > radius and high < math.pi - radius:  # columns that meet at the pole are all near
            reach = math.ceil(math.asin(math.sin(2.0 * radius) / math.sin(polar)) / (2.0 * math.pi) * width) + 1
            middle = math.floor((0.5 + math.atan2(centre[0], -centre[2]) / (2.0 * math.pi)) * width)
            columns = np.arange(middle - reach, middle + reach + 1)[:width] % width
        row, column = (a.ravel() for a in np.meshgrid(rows, columns, indexing="ij"))
        d = directions(row, column, height, width)
        cosine = (d * centre).sum(axis=1)
        kept = cosine > math.cos(2.0 * radius)
        self.rows, self.columns, d = row[kept], column[kept], d[kept]
        self.inside = cosine[kept] > math.cos(radius)
        weight = solid_angles(height, width)[self.rows]
        radiance = pixels[self.rows, self.columns].astype(np.float64)
        inner, outer = (np.where(here, weight, 0.0) for here in (self.inside, ~self.inside))
        means = [(w[:, None] * radiance).sum(axis=0) / max(w.sum(), 1e-30) for w in (inner, outer)]
        self.excess = np.maximum(radiance[self.inside] - means[1], 0.0)
        self.sun: Sun | None = None
        power = self.excess * weight[self.inside, None]
        if means[0].mean() > _LEAST_CONTRAST * means[1].mean() and power.any():
            mean = (power.mean(axis=1)[:, None] * d[self.inside]).sum(axis=0)
            self.sun = Sun(mean / np.linalg.norm(mean), power.sum(axis=0))
