"""Materials: scattering and absorption below a surface, and reflection at the surface."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, unknown
from wgsss.optics import SKIN_GAUSSIANS, Dipole, Layer, Layers, Profile, SumOfGaussians, Tabulated
from wgsss.optics.medium import DENSEST, THINNEST, coefficients, stack
from wgsss.scene import checks
from wgsss.scene.checks import Triple
from wgsss.scene.layermaps import MAX_LAYERS as MAX_LAYERS
from wgsss.scene.layermaps import LayerMaps as LayerMaps
from wgsss.scene.layermaps import check_layer_maps, mean_stack
from wgsss.text import shortened

WRAPS = ("repeat", "clamp", "mirror")  # in the order of wgsl/mesh.wgsl
SLOTS = ("base_color", "normal", "specular")
"""Kinds of textures."""
STEEPEST = 100.0
"""Largest scale of the slopes of a normal map: beyond it all slopes are vertical."""


@dataclass(frozen=True, eq=False)
class Maps:
    """Textures over the texture coordinates of a mesh, top row at v = 0. None means no texture."""

    base_color: npt.NDArray[Any] | None = None
    """uint8 (H, W, 3), sRGB"""
    normal: npt.NDArray[Any] | None = None
    """uint8 (H, W, 3), linear, tangent space"""
    specular: npt.NDArray[Any] | None = None
    """uint8 (H, W), linear"""
    wrap: tuple[str, str] = ("repeat", "repeat")
    """how textures continue beyond 0 to 1 along u and v: each one of WRAPS"""
    nearest: bool = False
    """whether textures are sampled without interpolation"""
    normal_scale: float = 1.0
    """scale of the slopes of the normal map"""
    layers: tuple[LayerMaps, ...] = ()
    """one for each layer of the material, from the top down; empty if no layer has maps"""
    tint: Triple = (1.0, 1.0, 1.0)
    """linear base colour of the material in the file; it also multiplies the base colour of a material that
    replaces it"""

    def __post_init__(self) -> None:
        if len(self.wrap) != 2 or any(wrap not in WRAPS for wrap in self.wrap):
            raise InputError(f"wrap must be two of {', '.join(WRAPS)}, not {self.wrap!r}")
        checks.number(self, "normal_scale", -STEEPEST, STEEPEST)
        checks.triple(self, "tint", 0, 1)
        for name, channels in (("base_color", 3), ("normal", 3), ("specular", None)):
            pixels = getattr(self, name)
            if pixels is not None and (
                pixels.dtype != np.uint8 or pixels.size == 0 or pixels.shape[2:] != ((channels,) if channels else ())
            ):
                raise InputError(f"the {name} map must be uint8 of H x W{f' x {channels}' if channels else ''}")


@dataclass(frozen=True, eq=False)
class Material:
    """A translucent medium below a rough dielectric surface.

    The medium is given in one of four ways: by the coefficients of a homogeneous medium (sigma_a and sigma_s_prime), by
    layers of such media, or by its diffusion profile as a sum of Gaussians or as a table.
    Raises InputError naming the field that is out of range, and for the medium also the material and the channel.
    """

    name: str = field(metadata={"fingerprint": False})
    sigma_a: Triple | None = None
    """absorption, 1/mm"""
    sigma_s_prime: Triple | None = None
    """reduced scattering, 1/mm"""
    eta: float = 1.3
    """index of refraction relative to air; with layers, that of the top layer"""
    layers: tuple[Layer, ...] | None = None
    """layers from the top down, in place of the coefficients"""
    gaussians: SumOfGaussians | None = None
    """a diffusion profile as a sum of Gaussians, in place of the coefficients"""
    table: Tabulated | None = None
    """a tabulated diffusion profile, in place of the coefficients"""
    roughness: float = 0.35
    """perceptual roughness; GGX alpha = roughness^2. Below 0.02 a highlight falls between pixels"""
    specular: float = 1.0
    """scale of the GGX lobe, 0 to 1"""
    base_color: Triple = (1.0, 1.0, 1.0)
    """linear; multiplies the light that the profile returns"""
    color_after: float = 1.0
    """share of the base colour applied after diffusion, col(x_o)^a col(x_i)^(1 - a) (Mikkelsen 2009, section 3.5)"""
    transport: Triple | None = None
    """distortion, power and ambient of transmitted light, which replace the knobs of barre11"""
    maps: Maps = field(default_factory=Maps)

    def __post_init__(self) -> None:
        given = [name for name in IN_PLACE if getattr(self, name) is not None]
        if len(given) > 1 or (given and (self.sigma_a is not None or self.sigma_s_prime is not None)):
            raise InputError(f"{given[0]} stand in place of sigma_a and sigma_s_prime: give one or the other")
        try:
            checks.name(self)
            checks.number(self, "eta", 1, 3)
            self._check_medium()
        except InputError as error:
            raise InputError(f"material '{shortened(self.name, 60)}': {error}") from None
        checks.number(self, "roughness", 0.02, 1)
        checks.number(self, "specular", 0, 1)
        checks.triple(self, "base_color", 0, 1)
        checks.number(self, "color_after", 0, 1)
        if self.transport is not None:
            checks.triple(self, "transport", 0, 64)
            distortion, power, ambient = self.transport
            if distortion > 1 or power < 0.1 or ambient > 1:
                raise InputError("transport must be a distortion up to 1, a power from 0.1 and an ambient up to 1")

    def _check_medium(self) -> None:
        for name, kind in (("gaussians", SumOfGaussians), ("table", Tabulated)):
            if not isinstance(getattr(self, name), kind | None):
                raise InputError(f"{name} must be a {kind.__name__}")
        if self.layers is not None:
            object.__setattr__(self, "layers", stack(self.layers))
            object.__setattr__(self, "eta", self.layers[0].eta)
        check_layer_maps(self.layers, self.maps.layers)
        if not any(getattr(self, name) is not None for name in IN_PLACE):
            if self.sigma_a is None or self.sigma_s_prime is None:
                missing = "sigma_a" if self.sigma_a is None else "sigma_s_prime"
                raise InputError(
                    f"{missing} is missing: a material needs sigma_a and sigma_s_prime, or {', '.join(IN_PLACE)}"
                )
            for name, least in (("sigma_a", 0.0), ("sigma_s_prime", THINNEST)):
                sigma = coefficients(name, getattr(self, name), least, DENSEST, "1/mm")
                object.__setattr__(self, name, tuple(sigma.tolist()))

    @cached_property
    def stack(self) -> tuple[Layer, ...] | None:
        """The medium as layers: one infinite layer if it is homogeneous, None if only its profile is known."""
        if self.sigma_a is None or self.sigma_s_prime is None:
            return self.layers
        return (Layer(np.asarray(self.sigma_a), np.asarray(self.sigma_s_prime), self.eta),)

    @cached_property
    def mean_layers(self) -> tuple[Layer, ...] | None:
        """The layers; where they have maps, those of mean thickness, mean colour and mean opacity."""
        if self.layers is None or not self.maps.layers:
            return self.layers
        return mean_stack(self.layers, self.maps.layers)

    @cached_property
    def profile(self) -> Profile:
        """The diffusion profile R(r), 1/mm^2 per channel. A homogeneous medium has that of the dipole, and layers with
        maps that of their means.

        Raises InputError for layers too thin for diffusion theory. Photons can be traced through those too.
        """
        if self.gaussians is not None:
            return self.gaussians
        if self.table is not None:
            return self.table
        if self.mean_layers is not None:
            try:
                return Layers(self.mean_layers)
            except InputError as error:
                raise InputError(f"material '{self.name}': {error}") from None
        assert self.sigma_a is not None and self.sigma_s_prime is not None
        return Dipole(np.asarray(self.sigma_a), np.asarray(self.sigma_s_prime), self.eta)


IN_PLACE = ("layers", "gaussians", "table")
"""Fields that can define the medium in place of its coefficients."""

# Measured by Jensen et al. 2001, "A Practical Model for Subsurface Light Transport", figure 5: sigma_s' and sigma_a,
# 1/mm. Marble alone has an eta of 1.5: only so does the dipole's total give the diffuse reflectance of the same table.
_JENSEN_2001: dict[str, tuple[Triple, Triple, float]] = {
    "apple": ((2.29, 2.39, 1.97), (0.003, 0.0034, 0.046), 1.3),
    "chicken1": ((0.15, 0.21, 0.38), (0.015, 0.077, 0.19), 1.3),
    "chicken2": ((0.19, 0.25, 0.32), (0.018, 0.088, 0.2), 1.3),
    "cream": ((7.38, 5.47, 3.15), (0.0002, 0.0028, 0.0163), 1.3),
    "ketchup": ((0.18, 0.07, 0.03), (0.061, 0.97, 1.45), 1.3),
    "marble": ((2.19, 2.62, 3.0), (0.0021, 0.0041, 0.0071), 1.5),
    "potato": ((0.68, 0.7, 0.55), (0.0024, 0.009, 0.12), 1.3),
    "skimmilk": ((0.7, 1.22, 1.9), (0.0014, 0.0025, 0.0142), 1.3),
    "skin1": ((0.74, 0.88, 1.01), (0.032, 0.17, 0.48), 1.3),
    "skin2": ((1.09, 1.59, 1.79), (0.013, 0.07, 0.145), 1.3),
    "spectralon": ((11.6, 20.4, 14.9), (0.0, 0.0, 0.0), 1.3),
    "wholemilk": ((2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014), 1.3),
}

MATERIALS: dict[str, Material] = {
    name: Material(name, sigma_a=sigma_a, sigma_s_prime=sigma_s_prime, eta=eta)
    for name, (sigma_s_prime, sigma_a, eta) in _JENSEN_2001.items()
}
# d'Eon & Luebke 2007: the profile is normalised, so its colour comes from elsewhere: the diffuse reflectance of Skin2
# in the same table. Their reflectance at normal incidence, 0.028, is an eta of 1.4.
MATERIALS["skin"] = Material("skin", gaussians=SKIN_GAUSSIANS, eta=1.4, base_color=(0.63, 0.44, 0.34))


def material(name: str) -> Material:
    """Return a measured material by name. Case, spaces, hyphens and underscores are ignored ("Whole Milk").

    Raises InputError for an unknown name, with the most similar one.
    """
    measured = MATERIALS.get(re.sub(r"[\s_-]+", "", name).lower())
    if measured is None:
        raise unknown("material", name, MATERIALS)
    return measured
