"""Measured materials, user materials and their validation."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.optics import SKIN_GAUSSIANS, Dipole
from wgsss.scene import MATERIALS, Maps, Material, material

# Jensen et al. 2001, figure 5: sigma_s' and sigma_a in 1/mm, and the total diffuse reflectance in closed form.
JENSEN = {
    "apple": ((2.29, 2.39, 1.97), (0.003, 0.0034, 0.046), (0.8464, 0.8407, 0.5279)),
    "chicken1": ((0.15, 0.21, 0.38), (0.015, 0.077, 0.19), (0.3137, 0.1558, 0.1264)),
    "chicken2": ((0.19, 0.25, 0.32), (0.018, 0.088, 0.2), (0.3212, 0.1599, 0.1076)),
    "cream": ((7.38, 5.47, 3.15), (0.0002, 0.0028, 0.0163), (0.9757, 0.9000, 0.7247)),
    "ketchup": ((0.18, 0.07, 0.03), (0.061, 0.97, 1.45), (0.1638, 0.0063, 0.0018)),
    "marble": ((2.19, 2.62, 3.0), (0.0021, 0.0041, 0.0071), (0.8302, 0.7910, 0.7526)),
    "potato": ((0.68, 0.7, 0.55), (0.0024, 0.009, 0.12), (0.7644, 0.6125, 0.2127)),
    "skimmilk": ((0.7, 1.22, 1.9), (0.0014, 0.0025, 0.0142), (0.8149, 0.8130, 0.6823)),
    "skin1": ((0.74, 0.88, 1.01), (0.032, 0.17, 0.48), (0.4360, 0.2273, 0.1310)),
    "skin2": ((1.09, 1.59, 1.79), (0.013, 0.07, 0.145), (0.6226, 0.4333, 0.3435)),
    "spectralon": ((11.6, 20.4, 14.9), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    "wholemilk": ((2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014), (0.9077, 0.8809, 0.7594)),
}
WAX = {"name": "wax", "sigma_a": (0.01, 0.02, 0.03), "sigma_s_prime": (1.0, 1.1, 1.2)}


@pytest.mark.parametrize("name", JENSEN)
def test_measured_material(name: str) -> None:
    material = MATERIALS[name]
    sigma_s_prime, sigma_a, total = JENSEN[name]
    assert (material.name, material.sigma_s_prime, material.sigma_a) == (name, sigma_s_prime, sigma_a)
    assert material.eta == (1.5 if name == "marble" else 1.3)
    assert material.gaussians is None and isinstance(material.profile, Dipole)
    np.testing.assert_allclose(material.profile.total, total, atol=1e-3)


def test_skin_is_the_six_gaussians_tinted_by_its_reflectance() -> None:
    skin = MATERIALS["skin"]
    assert set(MATERIALS) == {*JENSEN, "skin"}
    assert skin.profile is SKIN_GAUSSIANS
    np.testing.assert_allclose(skin.profile.total, 1.0, atol=1e-12)
    assert skin.base_color == (0.63, 0.44, 0.34)
    assert ((skin.eta - 1) / (skin.eta + 1)) ** 2 == pytest.approx(0.028, abs=3e-4)  # the value of d'Eon & Luebke


@pytest.mark.parametrize("spelling", ["wholemilk", "Whole Milk", "WHOLE_MILK", " whole-milk "])
def test_names_are_accepted_in_any_spelling(spelling: str) -> None:
    assert material(spelling) is MATERIALS["wholemilk"]


def test_unknown_name_suggests_the_nearest() -> None:
    with pytest.raises(InputError, match="unknown material 'marbel'; did you mean 'marble'"):
        material("marbel")


def test_user_material_has_the_profile_of_its_coefficients() -> None:
    wax = Material(**WAX, eta=1.4)
    assert isinstance(wax.profile, Dipole)
    np.testing.assert_allclose(wax.profile.total, Dipole(WAX["sigma_a"], WAX["sigma_s_prime"], 1.4).total)
    assert Material("wax", [0.01, 0.02, 0.03], np.array([1.0, 1.1, 1.2])).sigma_s_prime == (1.0, 1.1, 1.2)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sigma_a": None}, "sigma_a is missing"),
        ({"sigma_s_prime": None}, "sigma_s_prime is missing"),
        ({"sigma_a": (0.1, -0.1, 0.1)}, r"'wax': sigma_a of green must be from 0 to 1e\+06 \(1/mm\), not -0.1"),
        ({"sigma_a": (0.1, 0.1)}, "sigma_a must be three numbers"),
        ({"sigma_a": (0.1, "x", 0.1)}, "sigma_a must be three numbers"),
        ({"sigma_s_prime": (1, 1e-300, 1)}, "sigma_s_prime of green must be from 1e-06 to 1e"),
        ({"sigma_s_prime": (1, 0, 1)}, "sigma_s_prime of green must be from 1e-06 to 1e"),
        ({"sigma_s_prime": (1, float("inf"), 1)}, "sigma_s_prime of green .*, not inf"),
        ({"gaussians": SKIN_GAUSSIANS}, "give one or the other"),
        ({"eta": 0.9}, "eta must be from 1 to 3, not 0.9"),
        ({"eta": float("nan")}, "eta must be from 1 to 3"),
        ({"roughness": 0}, "roughness must be from 0.02 to 1, not 0"),
        ({"specular": 1.5}, "specular must be from 0 to 1"),
        ({"base_color": (1, 1, 2)}, "base_color must be three numbers, each from 0 to 1"),
        ({"transport": (0.2, 4.0)}, "transport must be three numbers"),
        ({"transport": (1.1, 4.0, 0.2)}, "transport must be a distortion up to 1, a power from 0.1"),
        ({"transport": (0.2, 0.05, 0.2)}, "a power from 0.1 and an ambient up to 1"),
        ({"transport": (0.2, 4.0, 1.1)}, "an ambient up to 1"),
        ({"color_after": "half"}, "color_after must be from 0 to 1, not 'half'"),
    ],
)
def test_a_field_out_of_range_is_named(changes: dict, message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        Material(**{**WAX, **changes})
    assert "\n" not in str(raised.value)


def test_transport_at_its_limits() -> None:
    for transport in ((0, 0.1, 0), (1, 64, 1)):
        assert Material(**WAX, transport=transport).transport == transport


@pytest.mark.parametrize(
    "maps",
    [
        {"base_color": np.zeros((4, 4, 4), np.uint8)},
        {"normal": np.zeros((4, 4, 3), np.float32)},
        {"specular": np.zeros((4, 4, 3), np.uint8)},
        {"specular": np.zeros((0, 4), np.uint8)},
    ],
)
def test_a_map_with_the_wrong_shape_is_refused(maps: dict) -> None:
    with pytest.raises(InputError, match=f"the {next(iter(maps))} map must be uint8 of H x W"):
        Maps(**maps)
