"""Measures of error against numbers computed by hand."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from conftest import needs_flip

from wgsss.errors import InputError, RenderError
from wgsss.study import metrics
from wgsss.study.metrics import NO_FLIP, error_map, errors, luminance, over_black

SEEN = np.ones((2, 2), bool)
REFERENCE = np.array([[1.0, 2.0], [2.0, 4.0]])[..., None] * np.ones(3)  # mean square 25/4, mean 9/4, maximum 4


def test_measures_computed_by_hand():
    M = REFERENCE.copy()
    M[0, 0] += 1.0  # 3 of 12 values, one pixel of four
    found = errors(M, REFERENCE, SEEN)
    assert found.rel_rmse == pytest.approx(math.sqrt(3 / 12) / 2.5)
    assert found.bias == pytest.approx(2.5 / 2.25)
    assert found.psnr == pytest.approx(10 * math.log10(16.0))  # over the one pixel that differs, by 1
    assert found.psnr_all == pytest.approx(10 * math.log10(16.0 / 0.25))
    assert found.flip is None and found.floor == 0.0


def test_one_channel_makes_a_pixel_differ():
    M = REFERENCE.copy()
    M[1, 1, 2] -= 3.0
    found = errors(M, REFERENCE, SEEN)
    assert found.psnr == pytest.approx(10 * math.log10(16.0 / (9.0 / 3)))
    assert found.psnr_all == pytest.approx(10 * math.log10(16.0 / (9.0 / 12)))
    assert found.rel_rmse == pytest.approx(math.sqrt(9 / 12) / 2.5)


def test_pixels_outside_the_mask_do_not_count():
    M, reference, seen = REFERENCE.copy(), REFERENCE.copy(), SEEN.copy()
    seen[0, 0] = False
    M[0, 0], reference[0, 0] = 100.0, math.nan
    found = errors(M, reference, seen)
    assert found.rel_rmse == 0.0 and found.bias == 1.0
    assert error_map(M, REFERENCE, seen).tolist() == [[0.0, 0.0], [0.0, 0.0]]


def test_equal_images_have_no_error_and_no_finite_psnr():
    found = errors(REFERENCE, REFERENCE, SEEN)
    assert (found.rel_rmse, found.psnr, found.psnr_all, found.bias) == (0.0, math.inf, math.inf, 1.0)
    rounded = errors(REFERENCE * (1 + 1e-7), REFERENCE, SEEN)
    assert rounded.psnr == math.inf
    assert json.loads(json.dumps(found.json(), allow_nan=False))["psnr"] is None


def test_relative_errors_are_undefined_against_black():
    found = errors(REFERENCE, 0 * REFERENCE, SEEN, error=REFERENCE)
    assert (found.rel_rmse, found.psnr, found.psnr_all, found.bias, found.floor) == (None,) * 5
    json.dumps(found.json(), allow_nan=False)


def test_floor_is_the_references_own_error():
    found = errors(REFERENCE, REFERENCE, SEEN, error=np.full_like(REFERENCE, 0.5))
    assert found.floor == pytest.approx(0.2)


@needs_flip
def test_flip_is_the_mean_over_the_mask():
    side, seen = 32, np.zeros((32, 32), bool)
    seen[8:24, 8:24] = True
    black, M = np.zeros((side, side, 4), np.uint8), np.ones((side, side, 3))
    black[..., 3] = 255
    white = np.full_like(black, 255)
    assert errors(M, M, seen, display=black, reference_display=black).flip == 0.0
    flip = errors(M, M, seen, display=white, reference_display=black).flip
    assert flip is not None and flip > 0.9  # FLIP of black against white is close to 1
    inside = np.where(seen[..., None], white, black)
    found = errors(M, M, seen, display=inside, reference_display=black).flip
    whole = errors(M, M, np.ones_like(seen), display=inside, reference_display=black).flip
    assert found is not None and whole is not None and found > 0.8 and whole < 0.6 * found


def test_missing_flip_has_a_reason(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(metrics, "find_spec", lambda name: None)
    picture = np.zeros((2, 2, 3), np.uint8)
    found = errors(REFERENCE, REFERENCE, SEEN, display=picture, reference_display=picture)
    assert (found.flip, found.flip_reason, found.rel_rmse) == (None, NO_FLIP, 0.0)
    assert found.json()["flip"] is None and found.json()["flip_reason"] == NO_FLIP
    assert "flip_reason" not in errors(REFERENCE, REFERENCE, SEEN).json()


def test_coverage_is_composited_over_black():
    assert over_black(np.array([[[200, 100, 50, 51]]], np.uint8)).tolist() == [[[40, 20, 10]]]
    assert over_black(np.array([[[200, 100, 50]]], np.uint8)).tolist() == [[[200, 100, 50]]]


def test_an_error_map_is_luminance_over_the_rms_of_the_reference():
    M = REFERENCE.copy()
    M[1, 0, 1] -= 1.0
    assert error_map(M, REFERENCE, SEEN)[1, 0] == pytest.approx(0.7152 / 2.5)
    assert luminance(np.ones(3)) == pytest.approx(1.0)
    assert error_map(M, 0 * M, SEEN)[0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("where", ["M", "M of the reference", "the reference's error"])
def test_numbers_that_are_not_finite_are_errors(where):
    bad = REFERENCE.copy()
    bad[1, 0, 2] = math.nan
    given = {"M": REFERENCE, "M of the reference": REFERENCE, "the reference's error": REFERENCE, where: bad}
    with pytest.raises(RenderError, match=f"1 pixels of {where} are not finite, the first at x 0, y 1"):
        errors(*list(given.values())[:2], SEEN, error=given["the reference's error"])


def test_an_empty_mask_is_an_error():
    with pytest.raises(InputError, match="no pixel shows an object"):
        errors(REFERENCE, REFERENCE, ~SEEN)
    with pytest.raises(InputError, match=r"M of the reference is of shape \(1, 2, 3\), not \(2, 2, 3\)"):
        errors(REFERENCE, REFERENCE[:1], SEEN)
