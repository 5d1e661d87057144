"""Properties that every profile must have."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import trapezoid

from wgsss.errors import InputError
from wgsss.optics import (
    BetterDipole,
    BorshukovLewis,
    Dipole,
    Layer,
    Layers,
    Multipole,
    NormalizedDiffusion,
    Photons,
    Profile,
    SumOfGaussians,
    Tabulated,
    fit_gaussians,
    fit_shared_gaussians,
)

SIGMA_A, SIGMA_S_PRIME, ETA = np.array([0.032, 0.17, 0.48]), np.array([0.74, 0.88, 1.01]), 1.3
TURNED = [2, 0, 1]


def dipole(turn: list[int], size: float) -> Dipole:
    return Dipole(SIGMA_A[turn] / size, SIGMA_S_PRIME[turn] / size, ETA)


def layers(turn: list[int], size: float) -> Layers:
    upper = Layer(SIGMA_A[turn] / size, SIGMA_S_PRIME[turn] / size, 1.4, thickness=2.0 * size)
    return Layers([upper, Layer(0.5 * SIGMA_A[turn] / size, 2.0 * SIGMA_S_PRIME[turn] / size, 1.3)])


def table(turn: list[int], size: float) -> Tabulated:
    r = np.linspace(0.0, 20.0, 50)
    return Tabulated(size * r, dipole([0, 1, 2], 1.0).reflectance(r)[:, turn] / size**2)


def photons(turn: list[int], size: float) -> Photons:
    """Return the counts of photons that a dipole predicts."""
    edges = np.append(0.0, np.geomspace(0.01, 30.0, 300))
    beyond = dipole([0, 1, 2], 1.0).beyond(edges)[:, turn] * dipole(turn, 1.0).total
    R = -np.diff(beyond, axis=0) / (np.pi * np.diff(np.square(size * edges))[:, None])
    nothing = np.zeros_like(R)
    return Photons(
        edges=size * edges,
        R=R,
        R_error=nothing,
        T=nothing,
        T_error=nothing,
        R_outside=beyond[-1],
        T_outside=np.zeros(3),
        total_error=np.zeros(3),
        total_transmittance_error=np.zeros(3),
        absorbed=1.0 - beyond[0],
        specular=0.017,
        photons=1,
    )


MODELS: dict[str, Callable[[list[int], float], Profile]] = {
    "dipole": dipole,
    "better dipole": lambda turn, size: BetterDipole(SIGMA_A[turn] / size, SIGMA_S_PRIME[turn] / size, ETA),
    "multipole": lambda turn, size: Multipole(
        SIGMA_A[turn] / size, SIGMA_S_PRIME[turn] / size, ETA, thickness=2.0 * size, eta_below=1.2
    ),
    "layers": layers,
    "normalized diffusion": lambda turn, size: NormalizedDiffusion.searchlight(
        dipole(turn, size).total, dipole(turn, size).mean_free_path
    ),
    "Borshukov-Lewis": lambda turn, size: BorshukovLewis.fit(dipole(turn, size)),
    "Gaussians": lambda turn, size: fit_gaussians(dipole(turn, size), 3),
    "shared Gaussians": lambda turn, size: fit_shared_gaussians(dipole(turn, size), 3),
    "table": table,
    "photons": photons,
}


@pytest.fixture(params=MODELS)
def model(request: pytest.FixtureRequest) -> Callable[[list[int], float], Profile]:
    return MODELS[request.param]


def values(profile: Profile, r: np.ndarray) -> dict[str, np.ndarray]:
    """Return all results that depend on lengths, in the unit of `r`."""
    found = {name: getattr(profile, name)(r) for name in ("reflectance", "transmittance", "enclosed", "line_spread")}
    found |= {"total": profile.total, "total_transmittance": profile.total_transmittance, "range": profile.range(0.05)}
    return found | dict(zip(("table r", "table R"), profile.table(5), strict=True))


DIMENSIONS = {"reflectance": -2, "transmittance": -2, "line_spread": -1, "range": 1, "table r": 1, "table R": -2}
R = np.array([0.05, 0.7, 3.0])


def test_permuting_channels_permutes_every_result(model):
    plain, turned = values(model([0, 1, 2], 1.0), R), values(model(TURNED, 1.0), R)
    for name, found in plain.items():
        wanted = found if name == "table r" else found[..., TURNED]
        np.testing.assert_allclose(turned[name], wanted, rtol=1e-5, atol=1e-12, err_msg=name)


def test_halving_lengths_scales_reflectance_by_four(model):
    whole, half = values(model([0, 1, 2], 1.0), R), values(model([0, 1, 2], 0.5), 0.5 * R)
    for name, found in whole.items():
        wanted = found * 0.5 ** DIMENSIONS.get(name, 0)
        np.testing.assert_allclose(half[name], wanted, rtol=1e-5, atol=1e-9, err_msg=name)


def test_total_range_and_line_spread_are_integrals_of_reflectance(model):
    profile = model([0, 1, 2], 1.0)
    r = np.geomspace(1e-6, 2e3, 4000)
    ring = trapezoid(2 * np.pi * np.square(r)[:, None] * profile.reflectance(r), np.log(r), axis=0)
    line = trapezoid(2 * r[:, None] * profile.line_spread(r), np.log(r), axis=0)
    np.testing.assert_allclose(ring, profile.total, rtol=2e-3)
    np.testing.assert_allclose(line, profile.total, rtol=2e-3)
    for eps in (0.5, 0.05, 0.01):
        np.testing.assert_allclose(1 - profile.enclosed(profile.range(eps)).diagonal(), eps, rtol=1e-6)


def test_a_table_of_any_profile_reproduces_it(model):
    profile = model([0, 1, 2], 1.0)
    again = Tabulated(*profile.table(200))
    r = np.geomspace(0.05, 5.0, 20)
    np.testing.assert_allclose(again.reflectance(r), profile.reflectance(r), rtol=0.02, atol=1e-6)


def test_the_range_of_a_black_profile_is_zero():
    black = SumOfGaussians([1.0], [[0.5, 0.0, 0.2]])
    np.testing.assert_array_equal(black.range(0.01) > 0, [True, False, True])
    np.testing.assert_array_equal(black.enclosed(0.0), [0.0, 1.0, 0.0])
    r, values = SumOfGaussians([1.0], np.zeros((1, 3))).table(4)
    assert np.all(np.diff(r) > 0) and not values.any()


def test_a_table_of_one_entry_raises_an_error():
    with pytest.raises(InputError, match="at least 2 entries, not 1"):
        dipole([0, 1, 2], 1.0).table(1)
