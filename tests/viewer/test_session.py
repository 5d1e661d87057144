"""The actions of a session, and the command that draws the same picture."""

from __future__ import annotations

import shlex
import tomllib
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
from wgsss.viewer import manipulation
from wgsss.viewer.command import Source, toml
from wgsss.viewer.layout import PANEL_WIDTH, Layout
from wgsss.viewer.session import ERROR, LEFT, MAX_NOTES, RIGHT, SPLIT, Session

SIZE = (24, 16)


@pytest.fixture
def session(gpu: Gpu) -> Session:
    return open_slab(gpu)


def open_slab(gpu: Gpu, **options: Any) -> Session:
    methods = [make_method("sam", {"select": "top", "surface": "screen"}), make_method("screen+none", {"taps": 9})]
    session = Session.open(gpu, Source("slab", vertices=300), methods, **options)
    session.layout = Layout(2 * SIZE[0], SIZE[1])
    assert session.layout.picture_size == SIZE
    return session


def test_command_states_only_what_differs_from_the_defaults(session: Session) -> None:
    assert shlex.split(session.command(0)) == [
        *("wgsss", "render", "slab", "--vertices", "300", "--method", "screen+sam"),
        *("--set", "select=top", "--size", "24x16"),
    ]
    assert shlex.split(session.command(1))[5:9] == ["--method", "screen+none", "--set", "taps=9"]


@pytest.mark.parametrize("change", ["orbit", "lights", "material", "all"])
def test_command_draws_what_is_shown(session: Session, tmp_path: Path, change: str) -> None:
    if change in ("orbit", "all"):
        session.set_camera(manipulation.orbit(session.scene.camera, 0.123, 0.0777))
    if change in ("lights", "all"):
        lights = (
            DirectionalLight((0.1, 1 / 3, -1.0), (1.0, 0.5, 2.0)),
            PointLight((10.0, 20.0, 30.0), (0.01, 0.02, 0.003)),
            RectLight((0.0, 0.0, -60.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 10.0, 20.0, (9.0, 8.0, 7.0), 4),
            SphereLight((0.0, 50.0, 50.0), 5.0, (10.0, 10.0, 10.0), 4),
            EnvironmentLight((0.1, 0.2, 0.3), rotation=12.5),
        )
        session.scene = replace(session.scene, lights=lights)
    if change in ("material", "all"):
        session.set_material({"preset": "ketchup", "roughness": 0.31})
    if change == "all":
        camera = OrthographicCamera((0.0, 10.0, 80.0), (0.0, 0.0, 0.0), height=41.7)
        session.scene = replace(session.scene, camera=camera, exposure=-0.7, tone_map="reinhard", bloom=0.2)
        session.time_s = 0.3
    file = tmp_path / "drawn.png"
    assert main([*shlex.split(session.command(0))[1:], "-o", str(file)]) == 0
    drawing = session.painter.renderer.draw(session.view)
    display = drawing.pictures[0].display
    assert display is not None
    with Picture.open(file) as drawn:
        np.testing.assert_array_equal(np.asarray(drawn.convert("RGBA")), drawing.graph.read(display))


def test_material_keeps_the_camera_and_reset_keeps_the_material(session: Session) -> None:
    camera = manipulation.zoom(session.scene.camera, 2.0)
    session.set_camera(camera)
    session.set_material("ketchup")
    assert (session.scene.objects[0].material.name, session.scene.camera) == ("ketchup", camera)
    with pytest.raises(InputError, match="unknown material 'ketchap'"):
        session.set_material("ketchap")
    assert session.material == "ketchup"
    session.reset()
    assert (session.scene.objects[0].material.name, session.scene.camera) == ("ketchup", session.opened.camera)


def test_side_for_keys_is_the_one_shown_alone_or_the_one_under_the_pointer(session: Session) -> None:
    sides = {}
    for comparison in (SPLIT, LEFT, RIGHT, ERROR):
        for x in (1.25, 1.75):
            session.comparison, session.pointer = comparison, (x * SIZE[0], 5.0)
            sides[comparison, x] = session.side
    assert sides == {
        **{(SPLIT, 1.25): 0, (SPLIT, 1.75): 1, (ERROR, 1.25): 0, (ERROR, 1.75): 1},
        **{(LEFT, 1.25): 0, (LEFT, 1.75): 0, (RIGHT, 1.25): 1, (RIGHT, 1.75): 1},
    }


def test_attempt_notes_bad_input_and_asks_for_a_frame(session: Session) -> None:
    frames: list[str] = []
    session.refresh = lambda: frames.append("")
    session.attempt(lambda: session.set_material("ketchap"))
    assert "ketchap" in session.notes[0] and frames
    for number in range(MAX_NOTES):
        session.note(str(number))
    assert session.notes == [str(number) for number in reversed(range(MAX_NOTES))]


def test_opening_a_scene_drops_material_time_and_history(session: Session, tmp_path: Path) -> None:
    session.set_material("ketchup")
    session.time_s, history = 1.0, session.history
    file = tmp_path / "ink.toml"
    file.write_text('name = "ink"\nsigma_a = [0.5, 0.1, 0.02]\nsigma_s_prime = [0.5, 1.0, 2.0]\n')
    session.open_file(str(file))
    assert (session.material, session.time_s) == (str(file), 1.0)
    session.open_file("sphere")
    assert (session.material, session.time_s, session.source.scene) == (None, 0.0, "sphere")
    assert session.history is not history and session.scene is session.opened
    with pytest.raises(InputError):
        session.open_file(str(tmp_path / "missing.obj"))


def test_layout_converts_positions_both_ways() -> None:
    layout = Layout(1000.0, 500.0, 2.0)
    assert layout.picture_size == (2 * (1000 - PANEL_WIDTH), 1000)
    assert layout.to_window(-1.0, 1.0) == (PANEL_WIDTH, 0.0)
    assert layout.to_picture(*layout.to_window(0.25, -0.5)) == pytest.approx((0.25, -0.5))
    assert Layout(400.0, 300.0).panel_width == 200.0, "the panel takes half of a narrow window at most"


def test_toml_fits_on_one_line() -> None:
    value = {"a": [1, 2.5, 1e-9], "b": 'say "no"\\', "c": {"d": True, "e": -3}, "f": [[1.0, 2.0], [3.0]]}
    assert tomllib.loads(f"x = {toml(value)}")["x"] == value
