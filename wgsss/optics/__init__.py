"""Models of how light spreads below a surface.

Lengths are in mm, coefficients in 1/mm and profiles in 1/mm^2. Arrays have one value for each RGB channel. Nothing here
uses a GPU.
"""

from __future__ import annotations

from wgsss.optics.borshukov_lewis import BorshukovLewis
from wgsss.optics.burley import NormalizedDiffusion
from wgsss.optics.dipole import BetterDipole, Dipole
from wgsss.optics.fit import fit_error, fit_gaussians, fit_shared_gaussians
from wgsss.optics.fresnel import diffuse_fresnel
from wgsss.optics.gaussians import SKIN_GAUSSIANS, SumOfGaussians
from wgsss.optics.layers import Layers
from wgsss.optics.medium import Layer, Medium
from wgsss.optics.multipole import Multipole
from wgsss.optics.photons import Photons
from wgsss.optics.profile import Profile
from wgsss.optics.tabulated import Tabulated
from wgsss.optics.thin import blend

__all__ = [
    "SKIN_GAUSSIANS",
    "BetterDipole",
    "BorshukovLewis",
    "Dipole",
    "Layer",
    "Layers",
    "Medium",
    "Multipole",
    "NormalizedDiffusion",
    "Photons",
    "Profile",
    "SumOfGaussians",
    "Tabulated",
    "blend",
    "diffuse_fresnel",
    "fit_error",
    "fit_gaussians",
    "fit_shared_gaussians",
]
