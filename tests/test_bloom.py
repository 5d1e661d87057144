"""Bloom: light spreads over the surrounding pixels, and its sum stays the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import lit

from wgsss import frame as shared
from wgsss.cli import main
from wgsss.errors import InputError
from wgsss.graph import Graph
from wgsss.methods.lambert import Lambert
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight
from wgsss.scene.shapes import sphere

DOWN = DirectionalLight((0, -1, 0), (9, 8, 7))
WIDTH, HEIGHT = 100, 192  # a standard deviation of 3 pixels


def bloomed(gpu: Any, pixels: Any, strength: float) -> Any:
    """Return the radiance (H, W, 4) with bloom."""
    graph = Graph(gpu)
    texture = gpu.texture(pixels.astype(np.float32), "rgba32float")
    # A pass that only copies the texture, to have a handle.
    radiance = graph.draw(
        "frame/bloom",
        size=(WIDTH, HEIGHT),
        constants={"DIRECTION": 0},
        params={"strength": 0.0},
        radiance=texture,
        spread=texture,
        weights=np.ones(1, np.float32),
    )
    result = shared.bloom(graph, radiance, strength)
    graph.run(result)
    return graph.read(result)


@pytest.mark.parametrize("place", [(96, 50), (0, 0), (191, 2)])
def test_the_light_of_a_bright_pixel_spreads_over_its_surroundings(gpu, place):
    pixels = np.zeros((HEIGHT, WIDTH, 4))
    pixels[place] = (1000.0, 500.0, 1.0, 1.0)
    found = bloomed(gpu, pixels, 0.25)
    arriving = found[..., :3] * found[..., 3:]
    np.testing.assert_allclose(arriving.sum(axis=(0, 1)), [1000.0, 500.0, 1.0], rtol=1e-4)
    assert found[..., 3].sum() == pytest.approx(1.0, rel=1e-4)
    if place == (96, 50):
        y, x = np.mgrid[:HEIGHT, :WIDTH]
        gaussian = np.exp(-((y - 96) ** 2 + (x - 50) ** 2) / (2 * 3.0**2))
        gaussian *= (abs(y - 96) <= 9) & (abs(x - 50) <= 9)
        expected = 250.0 * gaussian / gaussian.sum()
        expected[place] += 750.0
        np.testing.assert_allclose(arriving[..., 0], expected, rtol=1e-4, atol=1e-6)


def test_uniform_light_does_not_change(gpu):
    found = bloomed(gpu, np.full((HEIGHT, WIDTH, 4), (3.0, 2.0, 1.0, 1.0)), 0.5)
    np.testing.assert_allclose(found, np.broadcast_to([3.0, 2.0, 1.0, 1.0], found.shape), rtol=1e-5)


def test_bloom_of_0_has_no_passes_and_bloom_changes_the_display_only(gpu):
    scene = lit(DOWN, mesh=sphere(5.0, 300))
    images = {share: Renderer(replace(scene, bloom=share), Lambert(), (48, 64), gpu).frame() for share in (0.0, 0.3)}
    plain = Renderer(scene, Lambert(), (48, 64), gpu).frame()
    assert plain.display.tobytes() == images[0.0].display.tobytes() != images[0.3].display.tobytes()
    assert plain.pixels.tobytes() == images[0.0].pixels.tobytes() == images[0.3].pixels.tobytes()
    passes = {share: sum("bloom" in item.name for item in image.graph.passes) for share, image in images.items()}
    assert passes == {0.0: 0, 0.3: 2}


@pytest.mark.parametrize("share", [-0.1, 1.1])
def test_shares_outside_of_0_to_1_are_refused(share):
    with pytest.raises(InputError, match="bloom"):
        replace(lit(DOWN), bloom=share)


def test_the_command_has_an_option_for_bloom(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    pictures = []
    for words in ([], ["--bloom", "0"], ["--bloom", "0.5"]):
        assert main(["render", "slab", "--vertices", "300", "--method", "lambert", "--size", "48x48", *words]) == 0
        pictures.append((tmp_path / "slab.png").read_bytes())
    assert pictures[0] == pictures[1] != pictures[2]
    capsys.readouterr()
    assert main(["render", "slab", "--bloom", "2"]) == 2
    assert "bloom" in capsys.readouterr().err
