"""The twelve materials measured by Jensen et al. 2001, with R_d worked out apart from this package."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from wgsss.optics import Dipole


class Measured(NamedTuple):
    sigma_s_prime: tuple[float, float, float]
    sigma_a: tuple[float, float, float]
    eta: float
    total: tuple[float, float, float]

    @property
    def dipole(self) -> Dipole:
        return Dipole(self.sigma_a, self.sigma_s_prime, self.eta)


MEASURED = {
    "apple": Measured((2.29, 2.39, 1.97), (0.003, 0.0034, 0.046), 1.3, (0.8464162414, 0.8406751849, 0.5278548097)),
    "chicken1": Measured((0.15, 0.21, 0.38), (0.015, 0.077, 0.19), 1.3, (0.3136792102, 0.1558054307, 0.1264444692)),
    "chicken2": Measured((0.19, 0.25, 0.32), (0.018, 0.088, 0.2), 1.3, (0.3212388242, 0.1599384542, 0.1076315347)),
    "cream": Measured((7.38, 5.47, 3.15), (0.0002, 0.0028, 0.0163), 1.3, (0.9757367092, 0.9000159588, 0.7247316276)),
    "ketchup": Measured((0.18, 0.07, 0.03), (0.061, 0.97, 1.45), 1.3, (0.1638360108, 0.006336931078, 0.001829805023)),
    "marble": Measured((2.19, 2.62, 3.0), (0.0021, 0.0041, 0.0071), 1.5, (0.8301914563, 0.7909601966, 0.7526099448)),
    "potato": Measured((0.68, 0.7, 0.55), (0.0024, 0.009, 0.12), 1.3, (0.7644219144, 0.612500474, 0.212706547)),
    "skimmilk": Measured((0.7, 1.22, 1.9), (0.0014, 0.0025, 0.0142), 1.3, (0.8149459557, 0.8129841989, 0.6822951647)),
    "skin1": Measured((0.74, 0.88, 1.01), (0.032, 0.17, 0.48), 1.3, (0.4359563596, 0.2273311995, 0.130998825)),
    "skin2": Measured((1.09, 1.59, 1.79), (0.013, 0.07, 0.145), 1.3, (0.6226308623, 0.4332712377, 0.3434576435)),
    "spectralon": Measured((11.6, 20.4, 14.9), (0.0, 0.0, 0.0), 1.3, (1.0, 1.0, 1.0)),
    "wholemilk": Measured((2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014), 1.3, (0.9076984568, 0.8808684966, 0.7594127091)),
}


@pytest.fixture(params=MEASURED)
def measured(request: pytest.FixtureRequest) -> Measured:
    """Each measured material in turn."""
    return MEASURED[request.param]


@pytest.fixture
def skin() -> Dipole:
    """Skin1."""
    return MEASURED["skin1"].dipole
