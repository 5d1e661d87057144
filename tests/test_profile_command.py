"""`wgsss profile`: text, JSON, CSV and plots."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from wgsss.cli import main
from wgsss.optics import Dipole, Tabulated
from wgsss.scene import MATERIALS, load_material
from wgsss.study.profiles import MODELS

SKIN1 = MATERIALS["skin1"]


def run(capsys: pytest.CaptureFixture[str], *argv: str, code: int = 0) -> tuple[str, str]:
    assert main(["profile", *argv]) == code
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return out, err


def test_json_has_all_fields(capsys):
    out, _ = run(capsys, "Skin1", "--model", "dipole", "--model", "burley", "--r", "0.1,0.5,2", "--k", "4", "--json")
    result = json.loads(out)
    assert result["material"] == "skin1" and [m["model"] for m in result["models"]] == ["dipole", "burley"]
    dipole = result["models"][0]
    assert dipole.keys() == {"model", "r_mm", "R", "total", "range_mm", "gaussians"}
    assert dipole["r_mm"] == [0.1, 0.5, 2.0]
    np.testing.assert_allclose(dipole["R"], Dipole(SKIN1.sigma_a, SKIN1.sigma_s_prime).reflectance([0.1, 0.5, 2.0]))
    assert dipole["gaussians"].keys() == {"variances", "weights", "error"}
    assert np.shape(dipole["gaussians"]["weights"]) == (4, 3)


def test_text_has_totals_ranges_and_errors(capsys):
    out, _ = run(capsys, "skin1")
    assert "0.4360   0.2273   0.1310" in out and "13.67    5.759    2.995" in out
    assert [line.split()[0] for line in out.splitlines()[-4:]] == ["dipole", "better-dipole", "burley", "gaussians"]
    out, _ = run(capsys, "skin1", "--r", "1", "--thickness", "3")
    assert "total T" in out and "multipole T" in out and "3 mm thick" in out


def test_csv_of_a_model_can_be_the_table_of_a_material(tmp_path: Path, capsys):
    out, _ = run(capsys, "skin1", "--model", "dipole", "--csv")
    rows = list(csv.reader(io.StringIO(out)))
    assert rows[0] == ["r_mm", "dipole_R_red", "dipole_R_green", "dipole_R_blue"] and len(rows) == 65
    (tmp_path / "skin.csv").write_text(out)
    (tmp_path / "skin.toml").write_text('table = "skin.csv"\neta = 1.3\n')
    material = load_material(tmp_path / "skin.toml")
    assert isinstance(material.profile, Tabulated)
    np.testing.assert_allclose(material.profile.total, SKIN1.profile.total, rtol=5e-3)
    assert run(capsys, str(tmp_path / "skin.toml"))[0].startswith("skin: known by its profile")


def test_a_material_with_layers(tmp_path: Path, capsys):
    layer = "[[layers]]\nsigma_a = [0.005, 0.005, 0.005]\nsigma_s_prime = [1.3, 1.3, 1.3]\neta = 1.4\n"
    path = tmp_path / "two.toml"
    path.write_text(layer + "thickness = 6\n" + layer)
    out, _ = run(capsys, str(path), "--photons", "10000")
    assert "two, layer 2: eta 1.4, without end" in out and "photons" in out and "standard error" in out
    path.write_text(layer + layer)
    _, err = run(capsys, str(path), code=2)
    assert "material 'two': layer 1 is infinitely thick" in err


def test_layers_too_thin_for_diffusion_need_the_photon_model(tmp_path: Path, capsys):
    """The slab of van de Hulst has R = 0.09739 and T = 0.66096."""
    path = tmp_path / "slab.toml"
    layer = "[[layers]]\nsigma_a = [1, 1, 1]\nsigma_s_prime = [2.25, 2.25, 2.25]\ng = 0.75\neta = 1\nthickness = 0.2\n"
    path.write_text(layer)
    out, _ = run(capsys, str(path), "--model", "photons", "--photons", "50000", "--json")
    photons = json.loads(out)["models"][0]
    for name, exact in (("total", 0.09739), ("total_T", 0.66096)):
        off = np.abs(np.array(photons[name]) - exact)
        assert np.all(off < 4 * np.array(photons[f"{name}_error"]))
    _, err = run(capsys, str(path), code=2)
    assert err.count("\n") == 1 and "'slab'" in err and "mean free path of red, 0.3077 mm, not 0.2" in err
    assert main(["render", "sphere", "--vertices", "500", "--material", str(path), "-o", str(tmp_path / "a.png")]) == 2
    assert "material 'slab': thickness of layer 1" in capsys.readouterr().err and not (tmp_path / "a.png").exists()


def test_help_names_every_model(capsys):
    with pytest.raises(SystemExit):
        main(["profile", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert all(name in text for name in MODELS)


def test_a_plot_is_written(tmp_path: Path, capsys):
    out, _ = run(capsys, "marble", "-o", str(tmp_path / "a.png"))
    assert (tmp_path / "a.png").stat().st_size > 10_000 and "a.png" in out


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["skin9"], "unknown material 'skin9'"),
        (["skin1", "--model", "dipol"], "unknown model 'dipol'; did you mean 'dipole'"),
        (["skin1", "--k", "7"], "'7' is not a whole number from 1 to 6"),
        (["skin1", "--k", "0"], "'0' is not a whole number"),
        (["skin1", "--r", "1,-2"], r"has a distance that is not from 0 to 1e12 \(mm\)"),
        (["skin1", "--r", "1,,2"], "'' is not a number"),
        (["skin1", "--r", "0"], "'burley' is infinite at r = 0 mm"),
        (["skin1", "--thickness", "0"], r"'0' is not a number from 1e-06 to 1e\+13 \(mm\)"),
        (["skin1", "--thickness", "1"], "'skin1' by the model 'multipole': .*red.*1.295"),
        (["skin", "--thickness", "1"], "'skin': a thickness needs"),
        (["skin", "--photons", "10"], "'skin' by the model '.*': the material has no sigma_a and sigma_s_prime"),
        (["skin1", "--photons", "0"], "'0' is not a whole number"),
        (["skin1", "--csv", "--json"], "one of them"),
        (["skin1", "-o", "a.pdf"], "the file extension must be .png or .svg"),
        (["skin1", "-o", "/no/a.png"], "there is no folder"),
    ],
)
def test_bad_input_is_one_line(argv, says, capsys):
    import re

    out, err = run(capsys, *argv, code=2)
    assert out == "" and err.count("\n") == 1 and re.search(says, err), err


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "sigma_a = [0.1, -0.1, 0.1]\nsigma_s_prime = [1, 1, 1]",
            r"'bad': sigma_a of green must be from 0 .*, not -0.1",
        ),
        ("sigma_a = [0.1, 0.1, nan]\nsigma_s_prime = [1, 1, 1]", "'bad': sigma_a of blue .*, not nan"),
        ("sigma_a = [0.1, 0.1, 0.1]\nsigma_s_prime = [0, 1, 1]", "'bad': sigma_s_prime of red .*, not 0"),
        ("sigma_a = [0.1, 0.1, 0.1]\nsigma_s_prime = [1, 1, 1]\neta = 0.9", "eta must be from 1 to 3, not 0.9"),
        ("layers = []", "'bad': a stack needs at least one layer"),
        ("layers = 3", r"layers must be a list of tables: \[\[layers\]\]"),
        ("[[layers]]\nsigma_a = [1, 1, 1]", r"\[\[layers\]\] 1: key 'sigma_s_prime' is missing"),
        ("[[layers]]\nsigma_a = [1, 1, 1]\nsigma_s_prime = [1, 1, 1]\nthickness = -1", "1: thickness must be above 0"),
        (
            "[[layers]]\nsigma_a = [1, 1, 1]\nsigma_s_prime = [1, 1, 1]\nthickness = 'x'",
            "1: thickness must be a number",
        ),
        (
            "[[layers]]\nsigma_a = [1, 1, 1]\nsigma_s_prime = [1, 1, -1]\neta = 1.2",
            "1: sigma_s_prime of blue .*, not -1",
        ),
        (
            "[[layers]]\nsigma_a = [1, 1, 1]\nsigma_s_prime = [1, 1, 1]\neta = 0.5",
            "1: eta must be a number from 1 to 3",
        ),
        (
            "[[layers]]\nsigma_a = [1, 1, 1]\nsigma_s_prime = [1, 1, 1]\ng = 1",
            "1: g must be a number above -1 and below 1",
        ),
        ("table = 'no.csv'", "table: .*no.csv"),
        ("table = 'bad.csv'", "bad.csv"),
        (
            "reflectance = [0.5, 1.5, 0.5]\nmean_free_path = [1, 1, 1]",
            "reflectance of green must be above 0 and at most 1, not 1.5",
        ),
        ("reflectance = [0.5, 0.5, 0.5]", "mean_free_path or diffuse_mean_free_path"),
        ("mean_free_path = [1, 1, 1]", "key 'reflectance' is missing"),
        ("reflectance = [0.5, 0.5, 0.5]\nmean_free_path = [1, 1, 1]\nsigma_a = [1, 1, 1]", "one or the other"),
    ],
)
def test_bad_materials_are_one_line(text, says, tmp_path: Path, capsys):
    import re

    (tmp_path / "bad.csv").write_text("0,1,1,1\n2,1,1,1\n1,1,1,1\n")
    path = tmp_path / "bad.toml"
    path.write_text(text)
    _, err = run(capsys, str(path), code=2)
    assert err.count("\n") == 1 and "bad." in err and re.search(says, err), err


def test_a_material_may_be_defined_by_reflectance_and_mean_free_path(tmp_path: Path):
    path = tmp_path / "own.toml"
    path.write_text(
        'preset = "skin"\nreflectance = [0.436, 0.2273, 0.131]\nmean_free_path = [1.2953, 0.9524, 0.6711]\neta = 1.3'
    )
    material = load_material(path)
    np.testing.assert_allclose(material.sigma_a, SKIN1.sigma_a, rtol=2e-3)
    np.testing.assert_allclose(material.sigma_s_prime, SKIN1.sigma_s_prime, rtol=2e-3)
