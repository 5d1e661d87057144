"""A homogeneous scattering medium, and a layer of one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wgsss.errors import InputError
from wgsss.text import shown, span
from wgsss.values import array_of, is_number

Array = NDArray[np.float64]

CHANNELS = ("red", "green", "blue")

THINNEST, DENSEST = 1e-6, 1e6
"""1/mm: of the coefficients of materials; models may need less scattering, but no medium has more"""
SHORTEST, LONGEST = 1e-6, 1e6
"""mm: of lengths in media"""
FARTHEST = 1e12
"""mm: of lengths that follow from others"""
MOST_TOTAL = 100.0
"""of the light that a profile gives back in all: no medium more than 1, but tables and fits may be off"""


@dataclass(frozen=True, eq=False)
class Medium:
    """Coefficients of a homogeneous medium.

    `sigma_a`: absorption (3,) in 1/mm, at least 0. `sigma_s_prime`: reduced scattering (3,) in 1/mm, above 0.
    `eta`: refractive index relative to air, 1 to 3. Raises InputError, naming the channel, for anything else.
    """

    sigma_a: Array
    sigma_s_prime: Array
    eta: float = 1.3

    def __post_init__(self) -> None:
        for name, above in (("sigma_a", False), ("sigma_s_prime", True)):
            values = coefficients(name, getattr(self, name), 0.0, 1e12, "1/mm", above=above)
            object.__setattr__(self, name, values)
        check_index("eta", self.eta)

    @property
    def sigma_t_prime(self) -> Array:
        """Reduced extinction (3,) in 1/mm."""
        return self.sigma_a + self.sigma_s_prime

    @property
    def mean_free_path(self) -> Array:
        """1 / sigma_t' (3,) in mm."""
        return 1.0 / self.sigma_t_prime

    @property
    def albedo(self) -> Array:
        """Reduced single-scattering albedo alpha' (3,)."""
        return self.sigma_s_prime / self.sigma_t_prime

    @property
    def diffusion(self) -> Array:
        """Diffusion coefficient D = 1 / (3 sigma_t') (3,) in mm."""
        return self.mean_free_path / 3.0

    @property
    def sigma_tr(self) -> Array:
        """Effective transport coefficient (3,) in 1/mm; 0 where nothing absorbs, and R then falls as 1/r^3."""
        return np.sqrt(self.sigma_a / self.diffusion)

    @property
    def diffuse_mean_free_path(self) -> Array:
        """1 / sigma_tr (3,) in mm; infinite where nothing absorbs."""
        with np.errstate(divide="ignore"):
            return 1.0 / self.sigma_tr


@dataclass(frozen=True, eq=False)
class Layer(Medium):
    """A plane layer of a medium.

    `thickness`: mm, above 0; infinite for the last of a stack. `g`: mean cosine of its Henyey-Greenstein phase
    function, above -1 and below 1, so that sigma_s = sigma_s' / (1 - g): diffusion does without it, photons do not.
    """

    thickness: float = math.inf
    g: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("sigma_a", "sigma_s_prime"):
            coefficients(name, getattr(self, name), 0.0, DENSEST, "1/mm")
        if self.thickness != math.inf and not (is_number(self.thickness) and 0.0 < self.thickness <= LONGEST):
            raise InputError(f"thickness must be {span(0.0, LONGEST, True, 'mm')}, or inf, not {shown(self.thickness)}")
        if not (is_number(self.g) and -1.0 < self.g < 1.0):
            raise InputError(f"g must be a number above -1 and below 1, not {shown(self.g)}")

    @property
    def sigma_s(self) -> Array:
        """Scattering (3,) in 1/mm."""
        return self.sigma_s_prime / (1.0 - self.g)


def stack(layers: Sequence[Layer]) -> tuple[Layer, ...]:
    """A stack from the top down. Raises InputError if it is empty, or goes on below a layer without end."""
    if not layers:
        raise InputError("a stack needs at least one layer")
    for number, layer in enumerate(layers, start=1):
        if not isinstance(layer, Layer):
            raise InputError(f"layer {number} must be a Layer, not {layer!r}")
    for number, layer in enumerate(layers[:-1], start=1):
        if math.isinf(layer.thickness):
            raise InputError(f"layer {number} has no end: there cannot be a layer {number + 1} below it")
    return tuple(layers)


def check_index(name: str, eta: object) -> None:
    """Raises InputError unless a refractive index relative to air is one that the polynomials of `fresnel` cover."""
    if not (is_number(eta) and 1.0 <= eta <= 3.0):  # type: ignore[operator]
        raise InputError(f"{name} must be a number from 1 to 3, not {shown(eta)}")


def coefficients(name: str, values: object, low: float, high: float, unit: str = "", *, above: bool = False) -> Array:
    """Three numbers from `low` to `high`, read-only; `above` leaves out `low`. Raises InputError, naming the channel,
    the range and the value."""
    try:
        array = array_of(values)
    except ValueError:
        array = np.empty(0)
    if array.shape != (3,):
        raise InputError(f"{name} must be three numbers{f' ({unit})' if unit else ''}, not {shown(values)}")
    for channel, value in zip(CHANNELS, array.tolist(), strict=True):
        if not (low < value if above else low <= value) or value > high:
            raise InputError(f"{name} of {channel} must be {span(low, high, above, unit)}, not {value:g}")
    array.flags.writeable = False
    return array
