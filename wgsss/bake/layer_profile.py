"""Diffusion profiles of layers with maps, by photons where diffusion theory has none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wgsss.bake.photons import trace
from wgsss.cache import Arrays, cached
from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.optics import Layer, Photons, Profile, Tabulated
from wgsss.scene import Material

Array = NDArray[np.float64]

PHOTONS = 400_000  # per channel
_SHARE = 0.004  # of the light: the least that a row of the table stands for, so that its noise is a few per cent


def diffusion_profile(gpu: Gpu, material: Material) -> Profile:
    """Return the profile of a material. For layers with maps that are too thin for diffusion theory, it is a table
    measured by photons, from the cache where it has one.

    Raises InputError for layers without maps that are too thin.
    """
    layers = material.mean_layers
    if layers is None or not material.maps.layers:
        return material.profile
    try:
        return material.profile
    except InputError:
        return photon_table(gpu, layers)


def photon_table(gpu: Gpu, layers: tuple[Layer, ...]) -> Tabulated:
    """Measure the profile of a stack of layers by photons, as a table. Cached."""

    def make() -> Arrays:
        r, R = _rows(trace(layers, PHOTONS, gpu=gpu))
        return {"r": r, "R": R}

    arrays = cached("layer-profile", [layers, PHOTONS], make, label="photons through the layers")
    return Tabulated(arrays["r"], arrays["R"])


def _rows(photons: Photons) -> tuple[Array, Array]:
    """Return distances (n,) and R (n, 3) of a table that has the total of the photons in each channel.

    Rings are joined until they hold enough light of a channel. Beyond the last one R falls off to 0.
    """
    light = photons.R * photons.areas
    least = _SHARE * photons.total
    squares = np.square(photons.edges)
    ends, sums, since = [0], [], np.zeros(3)
    for ring, more in enumerate(light, start=1):
        since = since + more
        if (since >= least).any():
            ends.append(ring)
            sums.append(since)
            since = np.zeros(3)
    outer = squares[ends]
    middle = np.sqrt(0.5 * (outer[1:] + outer[:-1]))
    R = np.array(sums) / (np.pi * np.diff(outer))[:, None]
    r, R = np.append(middle, 2.0 * photons.edges[ends[-1]]), np.append(R, np.zeros((1, 3)), axis=0)
    return r, R * (photons.total / Tabulated(r, R).total)
