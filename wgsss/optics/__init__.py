"""How light spreads below a surface. Lengths in mm, profiles in 1/mm^2, per RGB channel; no GPU."""

from __future__ import annotations

from wgsss.optics.dipole import Dipole, diffuse_fresnel
from wgsss.optics.fit import Profile, fit_error, fit_gaussians
from wgsss.optics.gaussians import SKIN_GAUSSIANS, SumOfGaussians

__all__ = [
    "SKIN_GAUSSIANS",
    "Dipole",
    "Profile",
    "SumOfGaussians",
    "diffuse_fresnel",
    "fit_error",
    "fit_gaussians",
]
