"""Scene files whose material has layers with maps, drawn by methods that know no layers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

import wgsss
from wgsss.errors import InputError
from wgsss.scene import load_scene

SCENE = """
[[object]]
shape = "slab"
vertices = 200
[object.material]
specular = 0
[[object.material.layers]]
thickness = 1.0
thickness_map = "map.png"
sigma_a = [0.01, 0.02, 0.05]
sigma_s_prime = [0.5, 0.4, 0.3]
eta = 1.4
[[object.material.layers]]
sigma_a = [0.02, 0.1, 0.1]
sigma_s_prime = [0.5, 0.4, 0.3]
eta = 1.4
"""


def scene_file(folder: Path, level: int, text: str = SCENE) -> Path:
    Picture.fromarray(np.full((4, 6), level, np.uint16)).save(folder / "map.png")
    path = folder / "s.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("method", ["lambert", "jimenez15", "barre11"])
def test_methods_draw_layers_that_are_too_thin_for_diffusion(tmp_path: Path, method: str) -> None:
    image = wgsss.render(load_scene(scene_file(tmp_path, 65535)), method=method, size=(32, 32))
    assert np.isfinite(image.pixels).all() and image.pixels[..., :3].max() > 0.01


def test_a_darker_thickness_map_lets_the_darker_layer_below_show(tmp_path: Path) -> None:
    def green(level: int) -> float:
        image = wgsss.render(load_scene(scene_file(tmp_path, level)), method="lambert", size=(32, 32))
        return float(image.pixels[..., 1].mean())

    assert green(65535) > 1.03 * green(32768) > 1.03**2 * green(6554)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('"map.png"', '"none.png"', "[[layers]] 1: thickness_map: "),
        ("thickness = 1.0", "thickness = -1.0", "[[layers]] 1: thickness must be above 0"),
        ("thickness = 1.0", "thickness = nan", "[[layers]] 1: thickness must be above 0"),
        ("thickness = 1.0", "", "layer 1 is infinitely thick"),
        ('shape = "slab"', 'shape = "sphere"', "[[object]] 1: sphere: the mesh has no texture coordinates"),
    ],
)
def test_what_is_wrong_is_named_with_file_table_and_key(tmp_path: Path, old: str, new: str, expected: str) -> None:
    with pytest.raises(InputError) as error:
        load_scene(scene_file(tmp_path, 65535, SCENE.replace(old, new)))
    text = str(error.value)
    assert text.startswith(str(tmp_path / "s.toml: [[object]] 1")) and expected in text and "\n" not in text
