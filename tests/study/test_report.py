"""The folder of a comparison, and its page in a browser."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import browser
import matplotlib
import numpy as np
import OpenEXR
import pytest
from PIL import Image as Picture
from scenes import lit
from standins import Scaled

from wgsss import __version__
from wgsss.errors import InputError
from wgsss.registry import REFERENCES
from wgsss.scene import DirectionalLight
from wgsss.study import compare as module
from wgsss.study import error_maps, report
from wgsss.study.causes import CAUSES, Causes
from wgsss.study.compare import Comparison, compare
from wgsss.study.report import OWN_LIGHTS, check_folder, page, write_report

SIZE = (48, 32)
# The page and the sheet show any name of a scene as text and execute nothing.
NAME = "$\\frac{_ <!--<script></script><b>&amp;\u2028]]>"


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    scene = replace(lit(DirectionalLight((0.3, -1.0, 0.2), (3.0, 2.0, 1.0))), name=NAME)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(REFERENCES, "integral", Scaled)
        patch.setattr(module, "WARM_FRAMES", 1)
        found = compare(scene, ["lambert", Scaled(1.2)], size=SIZE)
        other = compare(
            replace(scene, lights=(DirectionalLight((0, -1, 0), (9, 9, 9)),)), ["lambert", Scaled(1.2)], size=SIZE
        )
    parts = dict(zip(CAUSES, (0.3, -0.1, 0.0, 0.2), strict=True))
    causes = Causes(0.4, {cause: abs(part) for cause, part in parts.items()}, parts)
    return replace(found, causes={run.name: causes for run in found.runs}, lights={"directional": other})


@pytest.fixture(scope="module")
def folder(comparison: Comparison, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("reports") / "report"
    write_report(comparison, place)
    return place


def test_the_report_has_all_files(comparison, folder):
    found = {file.name for file in folder.iterdir()}
    names = ["reference", "lambert", "integral"]  # the reference can also be one of the methods
    assert found == {
        "report.html",
        "contact_sheet.png",
        "metrics.json",
        *(f"{name}{ending}" for name in names for ending in (".png", ".exr")),
        *(f"{name}.error.png" for name in names[1:]),
    }
    numbers = json.loads((folder / "metrics.json").read_text())
    assert numbers["versions"].keys() >= {"wgsss", "wgpu", "flip-evaluator"}
    assert [run["error"]["rel_rmse"] for run in numbers["methods"]] == pytest.approx([0.2, 0.04], rel=1e-4)
    assert numbers["lights"]["directional"][0]["error"]["bias"] == pytest.approx(0.8, rel=1e-4)
    assert numbers["causes"]["lambert"]["part"]["profile"] == -0.1


def test_versions_name_packages_that_are_not_installed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(report, "_PACKAGES", ("numpy", "no-such-package"))
    assert report.versions() == {
        "wgsss": __version__,
        "numpy": np.__version__,
        "no-such-package": "not installed",
    }


def test_linear_images_hold_M(comparison, folder):
    with OpenEXR.File(str(folder / "reference.exr")) as exr:
        channels = exr.channels()
        M, error = channels["M_front"].pixels, channels["error"].pixels
    np.testing.assert_array_equal(M, comparison.truth.M_front)
    np.testing.assert_array_equal(error, comparison.truth.error)
    with OpenEXR.File(str(folder / "lambert.exr")) as exr:
        np.testing.assert_array_equal(exr.channels()["M_front"].pixels, comparison.runs[0].M)


def test_error_maps_share_a_scale(comparison, folder):
    """Errors of a fifth and a twenty-fifth of the same M take the colours at 1 and 1/sqrt(5), because of the square
    root."""
    end = error_maps.scale_end(comparison)
    maps = error_maps.maps(comparison)
    most = np.percentile(maps["lambert"][comparison.mask], 99.5)
    assert most <= 1.001 * end and end <= 2 * most
    np.testing.assert_allclose(maps["integral"], maps["lambert"] / 5, atol=1e-6)
    shown = {name: np.asarray(Picture.open(folder / f"{name}.error.png")) for name in maps}
    assert all(pixels.shape == (32, 48, 4) for pixels in shown.values())
    np.testing.assert_array_equal(shown["lambert"][..., 3] > 0, comparison.mask)
    bar = error_maps.colour_bar(1001)[0].astype(int)
    np.testing.assert_array_equal(bar[500], matplotlib.colormaps["magma"](0.5, bytes=True))
    y, x = np.argwhere(comparison.mask)[40]
    for name, pixels in shown.items():
        at = round(1000 * math.sqrt(min(maps[name][y, x] / end, 1.0)))
        assert np.abs(pixels[y, x] - bar[at]).max() <= 4
    assert [text for _, text in error_maps.ticks(0.2)] == ["0 %", "1.25 %", "5 %", "11.2 %", "20 %"]


def test_the_worst_square():
    values, seen = np.zeros((16, 24)), np.ones((16, 24), bool)
    values[9:11, 17:19] = 1.0
    x, y, side = error_maps.worst_square(values, seen)
    assert side == 4 and x <= 17 and x + side >= 19 and y <= 9 and y + side >= 11
    values[0, 0], seen[0, 0] = 100.0, False
    assert error_maps.worst_square(values, seen) == (x, y, side)
    assert error_maps.worst_square(np.zeros((1, 3)), np.ones((1, 3), bool))[2] == 1


def test_contact_sheet_shows_every_picture(comparison, folder):
    sheet = np.asarray(Picture.open(folder / "contact_sheet.png").convert("RGB")).astype(int)
    assert sheet.shape[0] > 600 and sheet.shape[1] > 1000
    brightest = comparison.image.display[comparison.mask][:, :3].max(axis=0)
    assert (np.abs(sheet - brightest).sum(axis=2) < 4).sum() > 50


def test_the_page_needs_no_other_files(comparison):
    text = page(comparison)
    assert re.findall(r"(?:src|href)=\S+", text) == ['href="data:,">'] and "url(" not in text and "://" not in text
    assert text.count("</script>") == 2 and "/*" + "DATA*/" not in text
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.S)[1])
    assert data["title"] == f"{NAME} against integral" and [light["name"] for light in data["lights"]] == [
        OWN_LIGHTS,
        "directional",
    ]
    assert len(data["lights"][0]["images"]) == 6


def test_a_report_replaces_an_older_report_and_no_other_files(comparison, folder):
    (folder / "notes.txt").write_text("mine")
    (folder / "metrics.json").write_text("old")
    write_report(comparison, folder)
    assert (folder / "notes.txt").read_text() == "mine"
    assert json.loads((folder / "metrics.json").read_text())["scene"] == NAME
    assert not list(folder.parent.glob(".*"))


def test_a_failed_report_leaves_no_files(comparison, tmp_path, monkeypatch):
    monkeypatch.setattr("wgsss.study.contact_sheet.draw", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_report(comparison, tmp_path / "new")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_an_error(tmp_path):
    assert check_folder(tmp_path / "new") == tmp_path / "new" and not (tmp_path / "new").exists()
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: this is not a folder"):
        check_folder(tmp_path / "file")
    with pytest.raises(InputError, match=r"no/new: there is no folder '.*no'"):
        check_folder(tmp_path / "no" / "new")
    with pytest.raises(InputError, match="cannot be written"):
        check_folder(Path("/proc/new"))


@pytest.fixture(scope="module")
def tab(folder: Path):
    if browser.chromium() is None:
        pytest.skip(f"no browser: none of {', '.join(browser.NAMES)} is installed")
    with browser.page() as page:
        page.open((folder / "report.html").as_uri())
        yield page


AT = "getComputedStyle(document.getElementById('over')).clipPath"
BOX = "(({x, y, width, height}) => [x, y, width, height])(document.getElementById('stage').getBoundingClientRect())"
MOVES = (
    "[...new Set([...document.querySelectorAll('.view img')].map((i) => getComputedStyle(i).transform.split(',')[0]))]"
)


def test_page_in_a_browser(tab):
    """The slider follows the mouse and the keys, all pictures zoom together, and the console stays empty."""
    x, y, width, height = tab.run(BOX)
    middle = (x + width / 2, y + height / 2)
    before = tab.run(AT)
    tab.drag(middle, (x + width / 4, y + height / 2))
    now = "Number(document.getElementById('handle').getAttribute('aria-valuenow'))"
    assert tab.run(now) == 25 and tab.run(AT) != before
    left = tab.run("document.getElementById('handle').getBoundingClientRect()['x'] + 19.2")
    assert left == pytest.approx(x + width / 4, abs=2)
    tab.run("document.getElementById('handle').focus()")
    tab.press("ArrowRight")
    tab.press("ArrowUp")
    tab.press("PageDown")
    assert tab.run(now) == 17
    tab.press("End")
    assert tab.run(now) == 100

    assert tab.run(MOVES) == ["matrix(1"]
    tab.press("+")
    assert tab.run(MOVES) == ["matrix(1.5"]
    tab.press("0")
    assert tab.run(MOVES) == ["matrix(1"]

    sources = "['over', 'under'].map((id) => document.getElementById(id).src)"
    over, under = tab.run(sources)
    assert over != under
    tab.press("x")
    assert tab.run(sources) == [under, over]
    change = "s.dispatchEvent(new Event('change'))"
    choose = f"((id, value) => {{ const s = document.getElementById(id); s.value = value; {change}; }})"
    tab.run(f"{choose}('a', 4)")
    assert tab.run("document.getElementById('tag-a').textContent") == "lambert: error"
    assert tab.run(sources)[0] not in (over, under)
    before = tab.run(sources)
    tab.run(f"{choose}('light', 1)")
    assert before[1] != tab.run(sources)[1]
    assert tab.run("document.querySelectorAll('#figures tbody tr').length") == 2
    assert tab.run("document.getElementById('title').textContent") == f"{NAME} against integral"
    assert tab.run("[...document.images].every((i) => i.complete && i.naturalWidth > 0)")
    assert tab.run("document.querySelectorAll('#bars .track span').length") == 8
    assert tab.said == []


def test_the_pictures_are_cut_at_the_line_at_every_zoom(tab):
    """Left of the line is the left picture, to the pixel, as the browser draws it."""
    _, _, width, _ = tab.run(BOX)
    for enlarge in (0, 3):
        tab.run(f"zoomBy({enlarge}, 20, 60)")
        for at in (30, 70):
            tab.run(f"state.at = {at}; show()")
            style = (
                "(({transform, clipPath}) => [transform, clipPath])(getComputedStyle(document.getElementById('over')))"
            )
            transform, clip = tab.run(style)
            scale, _, _, _, shift, _ = map(float, re.findall(r"-?[\d.]+", transform))
            inset = _resolved(clip, width)
            assert scale * (width - inset) + shift == pytest.approx(width * at / 100, abs=0.5)


def _resolved(clip: str, width: float) -> float:
    """Return the right inset of a clip-path, px. It is given in per cent, px or a sum of both."""
    right = re.fullmatch(r"inset\(\S+ (.*?)(?: 0px 0px| 0px)?\)", clip)[1]
    parts = re.findall(r"([+-]?)\s*(-?[\d.]+)(%|px)", right)
    return sum((-1 if sign == "-" else 1) * float(n) * (width / 100 if unit == "%" else 1) for sign, n, unit in parts)
