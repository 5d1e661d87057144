"""References come in the background, coarse first, and end where they would have ended in front."""

from __future__ import annotations

import time

import numpy as np
import pytest

from wgsss.gpu import Gpu
from wgsss.reference import Integral
from wgsss.registry import make_method
from wgsss.scene import load_scene
from wgsss.stage import Stage
from wgsss.viewer.measure import measure
from wgsss.viewer.pictures import Easel
from wgsss.viewer.truth import Known, Truth, View

SIZE = (16, 8)
SCENE = load_scene("slab", vertices=300)
REFERENCE = Integral(samples=2000)


def test_a_reference_is_refined_by_a_process_of_its_own(gpu: Gpu) -> None:
    truth = Truth()
    view = View(SCENE, 0.0, SIZE, REFERENCE)
    assert truth.of(view) is None and truth.is_refining
    shares, end = [], time.monotonic() + 240.0
    while truth.is_refining and time.monotonic() < end:
        found = truth.of(view)
        if found is not None:
            shares.append(truth.share)
            assert found.M.shape == (*SIZE[::-1], 3)
        time.sleep(0.05)
    wanted = REFERENCE.estimate(Stage(gpu, SCENE), SIZE)
    assert truth.share == 1.0 and sorted(shares) == shares
    found = truth.of(view)
    assert found is not None
    np.testing.assert_array_equal(found.M, wanted.M)
    assert truth.of(View(SCENE, 0.5, SIZE, REFERENCE)) is None, "another view is not known yet"
    truth.close()


def test_a_window_does_not_wait_for_an_estimate_to_end_and_outlives_the_process() -> None:
    truth = Truth()
    scene = load_scene("ear", vertices=20_000)
    assert truth.of(View(scene, 0.0, SIZE, Integral())) is None
    for i in range(20):  # many times what a pipe holds, while the process has hardly begun
        truth.of(View(scene, i / 25, SIZE, Integral()))
    truth._process.kill()
    truth._process.join()
    assert truth.of(truth._view) is None and "has ended" in truth.fault and not truth.is_refining  # type: ignore[arg-type]
    truth.of(View(scene, 0.5, SIZE, REFERENCE))
    assert truth.is_refining, "another begins"
    truth.close()


def test_errors_are_those_of_the_pictures_and_vanish_for_what_is_known(gpu: Gpu) -> None:
    easel = Easel(gpu)
    lambert = make_method("lambert")
    estimate = REFERENCE.estimate(Stage(gpu, SCENE), SIZE)
    known = Known(estimate)
    drawing = easel.draw(SCENE, [lambert, known], SIZE)
    measured = measure(drawing, drawing.pictures, known)
    assert measured is not None
    left, right = measured.errors
    assert left is not None and right is not None and right.rel_rmse == 0.0
    M, seen = drawing.M(drawing.pictures[0])[drawing.seen], estimate.M[drawing.seen]
    wanted = np.sqrt(np.square(M.astype(float) - seen).mean() / np.square(seen.astype(float)).mean())
    assert left.rel_rmse == pytest.approx(wanted)
    assert measured.map is not None and measured.map[..., 3].astype(bool).tolist() == drawing.seen.tolist()
    alone = measure(drawing, [drawing.pictures[0], None], None)
    assert alone is not None and alone.errors == [None, None] and alone.map is None
