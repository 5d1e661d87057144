"""The dipole diffusion profile of a half space (Jensen et al. 2001, as corrected by 004 eq. 30)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Dipole:
    """R(r) of a homogeneous half space under a pencil of light, by a real and a mirrored point source.

    `sigma_a`: absorption (3,) in 1/mm. `sigma_s_prime`: reduced scattering (3,) in 1/mm.
    `eta`: refractive index of the medium over that of its surroundings, >= 1. Raises InputError for anything else.

    The profile is per unit of flux that entered the medium: Fresnel losses on the way in and out are the renderer's.
    """

    sigma_a: Array
    sigma_s_prime: Array
    eta: float = 1.3

    def __post_init__(self) -> None:
        for name in ("sigma_a", "sigma_s_prime"):
            sigma = np.array(getattr(self, name), dtype=np.float64)
            if sigma.shape != (3,) or not np.all(np.isfinite(sigma)) or np.any(sigma < 0):
                raise InputError(f"{name} must be three numbers >= 0 (1/mm), not {sigma.tolist()}")
            sigma.flags.writeable = False
            object.__setattr__(self, name, sigma)
        if np.any(self.sigma_t_prime == 0):
            raise InputError("sigma_a and sigma_s_prime are both 0 in a channel: nothing there for light to meet")
        if not (np.isfinite(self.eta) and self.eta >= 1):
            raise InputError(f"eta must be a number >= 1, not {self.eta}")

    @property
    def sigma_t_prime(self) -> Array:
        """Reduced extinction (3,) in 1/mm."""
        return self.sigma_a + self.sigma_s_prime

    @property
    def mean_free_path(self) -> Array:
        """1 / sigma_t' (3,) in mm; also z_r, the depth of the real source."""
        return 1.0 / self.sigma_t_prime

    @property
    def albedo(self) -> Array:
        """Reduced albedo alpha' (3,)."""
        return self.sigma_s_prime / self.sigma_t_prime

    @property
    def sigma_tr(self) -> Array:
        """Effective transport coefficient (3,) in 1/mm; 0 where nothing absorbs, and R then falls as 1/r^3."""
        return np.sqrt(3.0 * self.sigma_a * self.sigma_t_prime)

    @property
    def boundary(self) -> float:
        """A = (1 + Fdr) / (1 - Fdr), the internal reflection in the boundary condition (004 eq. 23)."""
        fdr = diffuse_fresnel(self.eta)
        return (1.0 + fdr) / (1.0 - fdr)

    @property
    def total(self) -> Array:
        """Total diffuse reflectance R_d (3,): the integral of R over the plane, in closed form."""
        absorbed = np.sqrt(3.0 * (1.0 - self.albedo))
        return 0.5 * self.albedo * (1.0 + np.exp(-4.0 / 3.0 * self.boundary * absorbed)) * np.exp(-absorbed)

    def reflectance(self, r: ArrayLike) -> Array:
        """R(r) in 1/mm^2, shape (..., 3), at distances `r` (...) in mm: 004 eq. 30."""
        r = np.asarray(r, dtype=np.float64)[..., None]
        z_r = self.mean_free_path
        z_v = z_r * (1.0 + 4.0 / 3.0 * self.boundary)
        return self.albedo / (4.0 * np.pi) * (self._source(r, z_r) + self._source(r, z_v))

    def _source(self, r: Array, z: Array) -> Array:
        """The flux through the surface at `r` from a point source at distance `z` from it, times 4 pi."""
        d = np.hypot(r, z)
        return (self.sigma_tr * d + 1.0) * z * np.exp(-self.sigma_tr * d) / d**3


def diffuse_fresnel(eta: float) -> float:
    """Fdr: the share of diffuse light reflected back inside at the boundary of a medium of relative index `eta`.

    Polynomial fits of Egan and Hilgeman, as in Jensen et al. 2001; `eta` is inside over outside. Within 0.002.
    """
    if eta >= 1.0:
        return -1.440 / eta**2 + 0.710 / eta + 0.668 + 0.0636 * eta
    return -0.4399 + 0.7099 / eta - 0.3319 / eta**2 + 0.0636 / eta**3
