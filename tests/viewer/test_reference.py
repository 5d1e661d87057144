"""A background process refines references, and their errors are those of the pictures."""

from __future__ import annotations

import time

import numpy as np
import pytest

from wgsss.gpu import Gpu
from wgsss.reference import Finished, Integral
from wgsss.registry import make_method
from wgsss.scene import load_scene
from wgsss.stage import Stage
from wgsss.viewer.painter import measure
from wgsss.viewer.pictures import LiveRenderer, View
from wgsss.viewer.reference import BackgroundReference, Request

SIZE = (16, 8)
SCENE = load_scene("slab", vertices=300)
REFERENCE = Integral(samples=2000)


def test_background_process_refines_the_estimate_until_it_is_complete(gpu: Gpu) -> None:
    background = BackgroundReference()
    request = Request(SCENE, 0.0, SIZE, REFERENCE)
    assert background.estimate(request) is None and background.is_refining
    scales, end = [], time.monotonic() + 240.0
    while background.is_refining and time.monotonic() < end:
        estimate = background.estimate(request)
        if estimate is not None:
            scales.append(background.scale)
            assert estimate.M.shape == (*SIZE[::-1], 3)
        time.sleep(0.05)
    assert background.scale == 1.0 and sorted(scales) == scales
    estimate = background.estimate(request)
    assert estimate is not None
    np.testing.assert_array_equal(estimate.M, REFERENCE.estimate(Stage(gpu, SCENE), SIZE).M)
    later = background.estimate(Request(SCENE, 0.5, SIZE, REFERENCE))
    assert later is not estimate, "the estimate of another time is discarded"
    background.close()


def test_requests_do_not_block_and_a_process_that_died_is_replaced() -> None:
    background = BackgroundReference()
    scene = load_scene("ear", vertices=20_000)
    assert background.estimate(Request(scene, 0.0, SIZE, Integral())) is None
    for i in range(20):  # many times what a pipe holds, before the process reads any
        request = Request(scene, i / 25, SIZE, Integral())
        background.estimate(request)
    assert background._process is not None
    background._process.kill()
    background._process.join()
    assert background.estimate(request) is None
    assert "has ended" in background.error_message and not background.is_refining
    background.estimate(Request(scene, 0.5, SIZE, REFERENCE))
    assert background.is_refining, "the next request starts another process"
    background.close()


def test_errors_are_those_of_the_pictures_and_vanish_for_the_reference_itself(gpu: Gpu) -> None:
    renderer = LiveRenderer(gpu)
    reference = Finished(REFERENCE.estimate(Stage(gpu, SCENE), SIZE))
    drawing = renderer.draw(View(SCENE, (make_method("lambert"), reference), SIZE))
    measurement = measure(drawing, drawing.pictures, reference)
    assert measurement is not None
    left, right = measurement.errors
    assert left is not None and right is not None and right.rel_rmse == 0.0
    mask = drawing.object_mask
    M, exact = drawing.read_M(drawing.pictures[0])[mask].astype(float), reference.estimate.M[mask].astype(float)
    assert left.rel_rmse == pytest.approx(np.sqrt(np.square(M - exact).mean() / np.square(exact).mean()))
    assert measurement.error_map is not None
    assert measurement.error_map[..., 3].astype(bool).tolist() == mask.tolist()
    alone = measure(drawing, [drawing.pictures[0], None], None)
    assert alone is not None and alone.errors == [None, None] and alone.error_map is None
