"""A homogeneous scattering medium, and a layer of one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wgsss.errors import InputError

Array = NDArray[np.float64]

CHANNELS = ("red", "green", "blue")


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
        for name, low, above in (("sigma_a", 0.0, False), ("sigma_s_prime", 0.0, True)):
            object.__setattr__(self, name, coefficients(name, getattr(self, name), low, above, "1/mm"))
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
        if not self.thickness > 0.0:
            raise InputError(f"thickness must be above 0 (mm), not {self.thickness}")
        if not -1.0 < self.g < 1.0:
            raise InputError(f"g must be above -1 and below 1, not {self.g}")

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
    if not (isinstance(eta, int | float | np.number) and 1.0 <= float(eta) <= 3.0):
        raise InputError(f"{name} must be a number from 1 to 3, not {eta}")


def coefficients(
    name: str, values: object, low: float, above: bool = False, unit: str = "", high: float = math.inf
) -> Array:
    """Three finite numbers from `low` to `high`, read-only. Raises InputError, naming the channel and the value."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (3,):
        raise InputError(f"{name} must be three numbers, not {values!r}")
    for channel, value in zip(CHANNELS, array.tolist(), strict=True):
        if not (low < value if above else low <= value) or value > high or math.isinf(value):
            bound = f"{'above' if above else 'at least'} {low:g}" if math.isinf(high) else f"from {low:g} to {high:g}"
            raise InputError(f"{name} of {channel} must be {bound}{f' ({unit})' if unit else ''}, not {value:g}")
    array.flags.writeable = False
    return array
