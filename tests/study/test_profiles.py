"""Models of one material: which ones apply, their numbers, and the plot."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wgsss.errors import InputError
from wgsss.optics import Dipole, Layer, Multipole, NormalizedDiffusion, Tabulated
from wgsss.scene import MATERIALS, Material
from wgsss.study.profile_plot import plot
from wgsss.study.profiles import MODELS, Case, default_models, distances_for, profile_json, profiles

SKIN1 = MATERIALS["skin1"]
TWO = [Layer((0.005,) * 3, (1.3,) * 3, 1.4, thickness=6.0), Layer((0.01,) * 3, (1.0,) * 3, 1.4)]
LAYERED = Material("two", layers=TWO)
ONE_TABLE = Material("measured", table=Tabulated([0.0, 1.0, 2.0], [[1.0, 1.0, 1.0], [0.5, 0.4, 0.3], [0.0, 0.0, 0.0]]))


@pytest.mark.parametrize(
    ("case", "wanted"),
    [
        (Case(SKIN1), ["dipole", "better-dipole", "burley", "gaussians"]),
        (Case(SKIN1, thickness=5.0), ["multipole", "dipole"]),
        (Case(MATERIALS["skin"]), ["gaussians"]),
        (Case(LAYERED), ["layers", "gaussians"]),
        (Case(ONE_TABLE), ["table", "gaussians"]),
    ],
)
def test_the_default_models_of_a_material(case, wanted):
    found = profiles(case, default_models(case))
    assert list(found) == wanted
    r = distances_for(found)
    assert r.shape == (64,) and np.all(np.diff(r) > 0)
    for name, profile in found.items():
        row = profile_json(name, profile, r, case.k)
        assert np.shape(row["R"]) == (64, 3)
        assert json.loads(json.dumps(row, allow_nan=False)) == row


def test_the_numbers_of_a_profile_are_its_values():
    row = profile_json("dipole", SKIN1.profile, np.array([0.1, 1.0]), 4)
    skin = Dipole(SKIN1.sigma_a, SKIN1.sigma_s_prime, 1.3)
    np.testing.assert_array_equal(row["R"], skin.reflectance([0.1, 1.0]))
    np.testing.assert_allclose(row["total"], [0.43596, 0.22733, 0.13100], atol=1e-5)
    np.testing.assert_allclose(row["range_mm"], [13.67, 5.76, 2.99], atol=0.005)
    fit = row["gaussians"]
    assert np.shape(fit["variances"]) == np.shape(fit["weights"]) == (4, 3)
    assert np.all(np.array(fit["error"]) < 0.0153)
    assert "T" not in row
    # the sum of Gaussians, written out
    v, w = np.array(fit["variances"]), np.array(fit["weights"])
    near = (w * np.exp(-1.0 / (2 * v)) / (2 * np.pi * v)).sum(axis=0)
    np.testing.assert_allclose(near, row["R"][1], rtol=0.1)


def test_a_slab_transmits():
    found = profiles(Case(SKIN1, thickness=3.0), ["multipole", "layers"])
    slab = Multipole(SKIN1.sigma_a, SKIN1.sigma_s_prime, 1.3, thickness=3.0)
    for name, profile in found.items():
        row = profile_json(name, profile, np.array([0.5, 2.0]), 6)
        np.testing.assert_allclose(row["T"], slab.transmittance([0.5, 2.0]), rtol=1e-6)
        np.testing.assert_allclose(row["total_T"], slab.total_transmittance, rtol=1e-9)


def test_burley_uses_the_albedo_and_mean_free_path_of_the_material():
    found = profiles(Case(SKIN1), ["burley", "burley-diffuse", "burley-dmfp"])
    skin = SKIN1.profile
    for profile in found.values():
        assert isinstance(profile, NormalizedDiffusion)
        np.testing.assert_allclose(profile.total, skin.total)
    A, mfp = skin.total, 1 / skin.sigma_t_prime
    np.testing.assert_allclose(found["burley"].d, mfp / (1.85 - A + 7 * np.abs(A - 0.8) ** 3))
    np.testing.assert_allclose(found["burley-diffuse"].d, mfp / (1.9 - A + 3.5 * (A - 0.8) ** 2))
    np.testing.assert_allclose(found["burley-dmfp"].d, 1 / skin.sigma_tr / (3.5 + 100 * (A - 0.33) ** 4))


def test_photons_are_one_of_the_models():
    found = profiles(Case(SKIN1, photons=20_000), ["photons"])["photons"]
    assert found.photons >= 20_000
    np.testing.assert_allclose(found.total, SKIN1.profile.total, rtol=0.5)


@pytest.mark.parametrize(
    ("case", "models", "says"),
    [
        (Case(SKIN1), ["dipol"], "unknown model 'dipol'; did you mean 'dipole'"),
        (Case(SKIN1), ["multipole"], "'skin1' by the model 'multipole': it needs a thickness \\(--thickness MM\\)"),
        (Case(SKIN1), ["table"], "'skin1' by the model 'table': the material has no table"),
        (
            Case(MATERIALS["skin"]),
            ["dipole"],
            "'skin' by the model '.*': the material has no sigma_a",
        ),
        (
            Case(MATERIALS["skin"]),
            ["photons"],
            "'skin' by the model '.*': the material has no sigma_a",
        ),
        (
            Case(LAYERED),
            ["better-dipole"],
            "'two' by the model 'better-dipole': the material has no sigma_a",
        ),
        (Case(SKIN1, thickness=1.0), ["multipole"], "'skin1' by the model 'multipole': .*red.*1.295"),
    ],
)
def test_a_model_that_does_not_apply_is_an_error(case, models, says):
    with pytest.raises(InputError, match=says) as raised:
        profiles(case, models)
    assert "\n" not in str(raised.value)


def test_a_thickness_needs_coefficients():
    for material in (LAYERED, MATERIALS["skin"], ONE_TABLE):
        with pytest.raises(InputError, match=f"'{material.name}': a thickness needs"):
            Case(material, thickness=3.0)


def test_an_infinite_value_is_an_error():
    burley = profiles(Case(SKIN1), ["burley"])["burley"]
    with pytest.raises(InputError, match="'burley' is infinite at r = 0 mm"):
        profile_json("burley", burley, np.array([1.0, 0.0]), 6)


def test_every_model_has_a_description():
    assert all(about for _, about in MODELS.values())


def test_the_plot_shows_every_model(tmp_path: Path):
    found = profiles(Case(SKIN1, photons=20_000), ["dipole", "burley", "photons"])
    plot(found, "skin1", tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    for colour in ((0, 114, 178), (213, 94, 0), (0, 0, 0)):
        assert (np.abs(pixels.astype(int) - colour).max(axis=1) < 20).sum() > 300
    plot(found, "$\\frac{ </svg>\x1b\n", tmp_path / "a.svg")
    assert (tmp_path / "a.svg").read_text().lstrip().startswith("<?xml")
