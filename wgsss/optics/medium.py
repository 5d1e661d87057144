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
"""1/mm: limits of the coefficients of materials. Some models need less scattering; none may have more."""
SHORTEST, LONGEST = 1e-6, 1e6
"""mm: limits of the lengths that users give."""
FARTHEST = 1e12
"""mm: the largest length that may follow from others."""
MOST_TOTAL = 100.0
"""The largest total of a profile. No medium reflects more than 1, but tables and fits may be inexact."""


@dataclass(frozen=True, eq=False)
class Medium:
    """The coefficients of a homogeneous medium.

    `sigma_a` (3,): absorption in 1/mm, at least 0. `sigma_s_prime` (3,): reduced scattering in 1/mm, above 0.
    `eta`: refractive index relative to air, 1 to 3. Raises InputError, naming the channel, for other values.
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
        """Reduced extinction sigma_t' = sigma_a + sigma_s' (3,), 1/mm."""
        return self.sigma_a + self.sigma_s_prime

    @property
    def mean_free_path(self) -> Array:
        """Mean free path 1 / sigma_t' (3,), mm."""
        return 1.0 / self.sigma_t_prime

    @property
    def albedo(self) -> Array:
        """Reduced single-scattering albedo alpha' (3,)."""
        return self.sigma_s_prime / self.sigma_t_prime

    @property
    def diffusion(self) -> Array:
        """Diffusion coefficient D = 1 / (3 sigma_t') (3,), mm."""
        return self.mean_free_path / 3.0

    @property
    def sigma_tr(self) -> Array:
        """Effective transport coefficient sigma_tr = sqrt(sigma_a / D) (3,), 1/mm.

        It is 0 without absorption. R then falls off as 1/r^3.
        """
        return np.sqrt(self.sigma_a / self.diffusion)

    @property
    def diffuse_mean_free_path(self) -> Array:
        """Diffuse mean free path 1 / sigma_tr (3,), mm; infinite without absorption."""
        with np.errstate(divide="ignore"):
            return 1.0 / self.sigma_tr


@dataclass(frozen=True, eq=False)
class Layer(Medium):
    """A plane layer of a medium.

    `thickness`: mm, above 0. The last layer of a stack may be infinitely thick. `g`: mean cosine of the
    Henyey-Greenstein phase function, above -1 and below 1: sigma_s = sigma_s' / (1 - g). Diffusion models do not depend
    on it; photons do. Raises InputError for other values.
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
        """Scattering coefficient (3,), 1/mm."""
        return self.sigma_s_prime / (1.0 - self.g)


def stack(layers: Sequence[Layer]) -> tuple[Layer, ...]:
    """Return layers, from the top down, as a tuple.

    Raises InputError if there is none, if one is no `Layer`, or if one but the last is infinitely thick.
    """
    if not layers:
        raise InputError("a stack needs at least one layer")
    for number, layer in enumerate(layers, start=1):
        if not isinstance(layer, Layer):
            raise InputError(f"layer {number} must be a Layer, not {layer!r}")
    for number, layer in enumerate(layers[:-1], start=1):
        if math.isinf(layer.thickness):
            raise InputError(f"layer {number} is infinitely thick: there cannot be a layer {number + 1} below it")
    return tuple(layers)


def check_index(name: str, eta: object) -> None:
    """Raise InputError unless `eta` is a number from 1 to 3, the indices that the polynomials of `fresnel` cover."""
    if not (is_number(eta) and 1.0 <= eta <= 3.0):  # type: ignore[operator]
        raise InputError(f"{name} must be a number from 1 to 3, not {shown(eta)}")


def coefficients(name: str, values: object, low: float, high: float, unit: str = "", *, above: bool = False) -> Array:
    """Return three numbers from `low` to `high` as a read-only array (3,). With `above`, `low` itself is not allowed.

    Raises InputError, naming the channel, the range and the value.
    """
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
