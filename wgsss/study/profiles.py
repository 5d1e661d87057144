"""The diffusion profile of one material by several models."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wgsss.errors import InputError, unknown
from wgsss.optics import (
    BetterDipole,
    BorshukovLewis,
    Dipole,
    Layer,
    Layers,
    Multipole,
    NormalizedDiffusion,
    Profile,
    fit_error,
    fit_gaussians,
)
from wgsss.scene import Material

Array = NDArray[np.float64]

PHOTONS = 1_000_000
SAMPLES = 64
"""Default number of distances in a result."""


@dataclass(frozen=True, eq=False)
class Case:
    """A material to model, either as deep as it is or as a slab of `thickness` mm above air.

    `k` is the number of Gaussians of a fit, `photons` the number of photons traced per channel. Raises InputError if a
    thickness is given for a material that is not homogeneous.
    """

    material: Material
    thickness: float | None = None
    k: int = 6
    photons: int = PHOTONS

    def __post_init__(self) -> None:
        if self.thickness is not None and self.material.sigma_a is None:
            raise InputError(f"material '{self.material.name}': a thickness needs one with sigma_a and sigma_s_prime")

    @cached_property
    def stack(self) -> tuple[Layer, ...]:
        """The medium as layers. Raises InputError if only its profile is known."""
        if self.material.stack is None:
            raise self._lacks("sigma_a and sigma_s_prime")
        if self.thickness is None:
            return self.material.stack
        return (replace(self.material.stack[0], thickness=self.thickness),)

    @cached_property
    def medium(self) -> Layer:
        """The homogeneous medium. Raises InputError if it is not homogeneous."""
        if self.material.sigma_a is None:
            raise self._lacks("sigma_a and sigma_s_prime")
        return self.stack[0]

    @cached_property
    def dipole(self) -> Dipole:
        """The dipole of a semi-infinite homogeneous medium."""
        return Dipole(self.medium.sigma_a, self.medium.sigma_s_prime, self.medium.eta)

    def _lacks(self, properties: str) -> InputError:
        return InputError(f"the material has no {properties}")


def _multipole(case: Case) -> Profile:
    if case.thickness is None:
        raise InputError("it needs a thickness (--thickness MM)")
    return Multipole(case.medium.sigma_a, case.medium.sigma_s_prime, case.medium.eta, thickness=case.thickness)


def _gaussians(case: Case) -> Profile:
    return fit_gaussians(case.material.profile, case.k)


def _table(case: Case) -> Profile:
    if case.material.table is None:
        raise InputError("the material has no table")
    return case.material.table


def _photons(case: Case) -> Profile:
    from wgsss.bake.photons import trace

    return trace(case.stack, case.photons, label=f"photons in {case.material.name}")


MODELS: dict[str, tuple[Callable[[Case], Profile], str]] = {
    "dipole": (lambda case: case.dipole, "classical dipole, Jensen et al. 2001"),
    "better-dipole": (
        lambda case: BetterDipole(case.medium.sigma_a, case.medium.sigma_s_prime, case.medium.eta),
        "d'Eon 2012",
    ),
    "multipole": (_multipole, "slab of a given thickness, Contini et al. 1997"),
    "layers": (lambda case: Layers(case.stack), "stack of slabs, Donner & Jensen 2005"),
    "burley": (
        lambda case: NormalizedDiffusion.searchlight(case.dipole.total, case.dipole.mean_free_path),
        "normalized diffusion, Christensen & Burley 2015, for a pencil of light",
    ),
    "burley-diffuse": (
        lambda case: NormalizedDiffusion.diffuse(case.dipole.total, case.dipole.mean_free_path),
        "the same, for diffuse light",
    ),
    "burley-dmfp": (
        lambda case: NormalizedDiffusion.from_diffuse_mean_free_path(
            case.dipole.total, case.dipole.diffuse_mean_free_path
        ),
        "the same, from the diffuse mean free path",
    ),
    "borshukov-lewis": (
        lambda case: BorshukovLewis.fit(case.material.profile),
        "1/(c + r)^k, Borshukov & Lewis 2003, fitted",
    ),
    "gaussians": (_gaussians, "sum of K Gaussians: the material's own, or fitted to its profile"),
    "table": (_table, "the material's own table"),
    "photons": (_photons, "Monte Carlo, with all orders of scattering"),
}
"""The models by name: a function that computes the profile of a case, and a description."""


def default_models(case: Case) -> list[str]:
    """Return the models that apply to a material and are fast."""
    if case.thickness is not None:
        return ["multipole", "dipole"]
    if case.material.sigma_a is not None:
        return ["dipole", "better-dipole", "burley", "gaussians"]
    own = next(name for name in ("layers", "table", "gaussians") if getattr(case.material, name) is not None)
    return list(dict.fromkeys([own, "gaussians"]))


def profiles(case: Case, models: Sequence[str]) -> dict[str, Profile]:
    """Compute the profile by each model. Raises InputError for an unknown model, or one that needs other data."""
    for name in models:
        if name not in MODELS:
            raise unknown("model", name, MODELS)
    by_model = {}
    for name in models:
        try:
            by_model[name] = MODELS[name][0](case)
        except InputError as error:
            raise InputError(f"material '{case.material.name}' by the model '{name}': {error}") from None
    return by_model


def distances_for(profiles: dict[str, Profile], n: int = SAMPLES) -> Array:
    """Return distances (n,) in mm that cover all profiles, from close to 0 to where 0.1 % of the light is left."""
    tables = [profile.table(2)[0] for profile in profiles.values()]
    return np.geomspace(min(r[0] for r in tables), max(r[-1] for r in tables), n)


def profile_json(name: str, profile: Profile, r: Array, k: int) -> dict[str, Any]:
    """Return a profile as JSON: its values at `r` (n,) mm, its totals, its range and its fit by `k` Gaussians.

    Raises InputError if R is infinite at one of the distances.
    """
    R = profile.reflectance(r)
    if not np.all(np.isfinite(R)):
        raise InputError(f"R of the model '{name}' is infinite at r = {r[~np.isfinite(R).all(axis=-1)][0]:g} mm")
    fit = fit_gaussians(profile, k)
    numbers: dict[str, Any] = {"model": name, "r_mm": r.tolist(), "R": R.tolist()}
    if profile.total_transmittance.any():
        numbers |= {"T": profile.transmittance(r).tolist(), "total_T": profile.total_transmittance.tolist()}
    numbers |= {"total": profile.total.tolist(), "range_mm": profile.range(0.01).tolist()}
    for error in ("total_error", "total_transmittance_error"):
        if hasattr(profile, error):
            numbers[error.replace("transmittance", "T")] = getattr(profile, error).tolist()
    numbers["gaussians"] = {
        "variances": fit.variances.tolist(),
        "weights": fit.weights.tolist(),
        "error": fit_error(profile, fit).tolist(),
    }
    return numbers
