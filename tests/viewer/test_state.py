"""The command of a state draws what the state shows."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

from wgsss.cli import main
from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.registry import make_method
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    OrthographicCamera,
    PointLight,
    RectLight,
    SphereLight,
)
from wgsss.viewer import controls
from wgsss.viewer.pictures import Easel
from wgsss.viewer.state import Source, State, toml

SIZE = (24, 16)


def opened(**rest: Any) -> State:
    methods = [make_method("sam", {"select": "top", "surface": "screen"}), make_method("screen+none", {"taps": 9})]
    return State.open(Source("slab", vertices=300), methods, **rest)


def arguments(state: State, side: int = 0) -> list[str]:
    return shlex.split(state.command(side, SIZE))


def test_what_was_not_changed_is_not_said() -> None:
    assert arguments(opened()) == [
        *("wgsss", "render", "slab", "--vertices", "300", "--method", "sam"),
        *("--set", "select=top", "--set", "surface=screen", "--size", "24x16"),
    ]
    assert arguments(opened(), 1)[5:9] == ["--method", "screen+none", "--set", "taps=9"]


@pytest.mark.parametrize("change", ["orbit", "lights", "material", "all"])
def test_the_command_draws_what_is_shown(gpu: Gpu, tmp_path: Path, change: str) -> None:
    state = opened()
    if change in ("orbit", "all"):
        state.scene = replace(state.scene, camera=controls.orbit(state.scene.camera, 0.123, 0.0777))
    if change in ("lights", "all"):
        lights = (
            DirectionalLight((0.1, 1 / 3, -1.0), (1.0, 0.5, 2.0)),
            PointLight((10.0, 20.0, 30.0), (0.01, 0.02, 0.003)),
            RectLight((0.0, 0.0, -60.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 10.0, 20.0, (9.0, 8.0, 7.0), 4),
            SphereLight((0.0, 50.0, 50.0), 5.0, (10.0, 10.0, 10.0), 4),
            EnvironmentLight((0.1, 0.2, 0.3), rotation=12.5),
        )
        state.scene = replace(state.scene, lights=lights)
    if change in ("material", "all"):
        state.wear({"preset": "ketchup", "roughness": 0.31})
    if change == "all":
        camera = OrthographicCamera((0.0, 10.0, 80.0), (0.0, 0.0, 0.0), height=41.7)
        state.scene = replace(state.scene, camera=camera, exposure=-0.7, tone_map="reinhard", bloom=0.2)
        state.time_s = 0.3
    file = tmp_path / "drawn.png"
    assert main([*arguments(state)[1:], "-o", str(file)]) == 0
    drawing = Easel(gpu).draw(state.scene, state.methods, SIZE, state.time_s)
    display = drawing.pictures[0].display
    assert display is not None
    with Picture.open(file) as drawn:
        np.testing.assert_array_equal(np.asarray(drawn.convert("RGBA")), drawing.graph.read(display))


def test_a_material_takes_nothing_else_with_it() -> None:
    state = opened()
    state.scene = replace(state.scene, camera=controls.zoom(state.scene.camera, 2.0))
    seen = state.scene.camera
    state.wear("ketchup")
    assert (state.scene.objects[0].material.name, state.scene.camera) == ("ketchup", seen)
    with pytest.raises(InputError, match="unknown material 'ketchap'"):
        state.wear("ketchap")
    assert state.material == "ketchup"
    state.reset()
    assert (state.scene.objects[0].material.name, state.scene.camera) == ("ketchup", state.opened.camera)


def test_toml_in_one_line() -> None:
    import tomllib

    value = {"a": [1, 2.5, 1e-9], "b": 'say "no"\\', "c": {"d": True, "e": -3}, "f": [[1.0, 2.0], [3.0]]}
    assert tomllib.loads(f"x = {toml(value)}")["x"] == value
