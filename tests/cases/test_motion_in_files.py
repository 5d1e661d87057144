"""Animations of glTF files: choice by name, hidden parts, and storage of rotations."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import (
    ball,
    ball_primitive,
    checkered,
    colored,
    difference,
    encoded,
    loaded,
    picture,
    scene_and_notes,
    texture,
)
from gltfs import File

from wgsss.errors import InputError
from wgsss.scene import Scene, load_scene

HALF = math.sqrt(0.5)
SHOWN = [(1, 1, 1), (0, 0, 0), (1, 1, 1)]


def animate(file: File, *channels: tuple[int, str, Any, Any], kind: str = "LINEAR", **fields: Any) -> File:
    """Add an animation of channels (node, path, times, values) to a file, and return the file."""
    samplers, targets = [], []
    for node, path, times, values in channels:
        shape = {"weights": "SCALAR", "rotation": "VEC4"}.get(path, "VEC3")
        ends = {"input": file.rows(times, "SCALAR"), "output": file.rows(values, shape)}
        targets.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        samplers.append({**ends, "interpolation": kind})
    file.add("animations", channels=targets, samplers=samplers, **fields)
    return file


def two_balls() -> File:
    """Make a file with a ball at the origin, and a ball of another material to its right."""
    file = File()
    file.node(mesh=file.mesh(ball_primitive(file, colored(file))))
    other = texture(file, encoded(np.full((2, 2, 3), (20, 160, 40), np.uint8)))
    green = file.add("materials", name="green", pbrMetallicRoughness={"baseColorTexture": {"index": other}})
    file.node(mesh=file.mesh(ball_primitive(file, green)), translation=[0.15, 0, 0])
    return file


def seen(scene: Scene, time_s: float) -> tuple[bool, bool]:
    """Return whether the left and the right half of a picture show something."""
    alpha = picture(scene, time=time_s)[..., 3]
    return bool(alpha[:, :28].any()), bool(alpha[:, 36:].any())


# --- hidden for a while ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["lambert", "deon07", "jimenez15", "sam"])
def test_a_mesh_scaled_to_nothing_is_not_drawn(tmp_path: Path, method: str) -> None:
    """STEP interpolation of the scale is the usual way to hide a mesh. At other times, the mesh is unchanged."""
    file = animate(checkered(), (0, "scale", [0, 0.5, 1], SHOWN), kind="STEP")
    scene, still = loaded(file, tmp_path, size_mm=22), loaded(checkered(), tmp_path, size_mm=22)
    knobs: dict[str, Any] = {"deon07": {"map_size": 64}, "sam": {"surface": "screen"}}.get(method, {})
    for time_s in (0.0, 0.49):
        assert difference(scene, still, method, 32, time=time_s, **knobs) <= 1
    hidden = picture(scene, method, 32, time=0.7, **knobs)
    assert not hidden[..., 3].any() and not hidden[..., :3].any()


def test_one_of_two_parts_is_hidden(tmp_path: Path) -> None:
    scene = loaded(animate(two_balls(), (1, "scale", [0, 0.5, 1], SHOWN), kind="STEP"), tmp_path)
    assert [seen(scene, time_s) for time_s in (0.0, 0.7)] == [(True, True), (True, False)]


def test_one_of_two_parts_of_a_body_is_hidden(tmp_path: Path) -> None:
    file, material = File(), None
    for shift in (0.0, 0.15):
        file.node(mesh=file.mesh(ball_primitive(file, material)), translation=[shift, 0, 0])
    scene = loaded(animate(file, (1, "scale", [0, 0.5, 1], SHOWN), kind="STEP"), tmp_path)
    assert len(scene.objects) == 1
    assert [seen(scene, time_s) for time_s in (0.0, 0.7)] == [(True, True), (True, False)]


def test_both_parts_are_hidden(tmp_path: Path) -> None:
    file = animate(two_balls(), *((n, "scale", [0, 0.5, 1], SHOWN) for n in (0, 1)), kind="STEP")
    scene = loaded(file, tmp_path)
    assert [seen(scene, time_s) for time_s in (0.0, 0.7)] == [(True, True), (False, False)]


def test_a_scale_passes_through_zero(tmp_path: Path) -> None:
    """The scale goes from 1 to -1. The mesh is invisible in the middle, and mirrored after it."""
    file = animate(checkered(), (0, "scale", [0, 1], [(1, 1, 1), (-1, -1, -1)]))
    scene = loaded(file, tmp_path)
    counts = [int((picture(scene, time=time_s)[..., 3] > 0).sum()) for time_s in (0.0, 0.4, 0.5, 0.6, 0.999)]
    assert counts[2] == 0 < counts[1] < counts[0] / 10
    assert counts[3] == pytest.approx(counts[1], rel=0.2) and counts[4] == pytest.approx(counts[0], rel=0.02)


@pytest.mark.parametrize("joined", [False, True])
def test_a_part_hidden_at_rest_appears_later(tmp_path: Path, joined: bool) -> None:
    """The scale of the node is 0 at rest, and the animation enlarges it."""
    file = two_balls()
    if joined:
        primitives = [mesh["primitives"][0] for mesh in file.tree["meshes"]]
        primitives[1]["material"] = primitives[0]["material"]
    file.tree["nodes"][1]["scale"] = [0, 0, 0]
    animate(file, (1, "scale", [0, 0.5, 1], [(0, 0, 0), (1, 1, 1), (1, 1, 1)]), kind="STEP")
    path = file.save(tmp_path / "balls.glb")
    scene, lines = scene_and_notes(path)
    assert lines == []
    assert [seen(scene, time_s) for time_s in (0.0, 0.7)] == [(True, False), (True, True)]
    still, lines = scene_and_notes(path, animation="none")
    assert len(still.objects) == 1 and seen(still, 0.0)[0] and still.bounds[1, 0] < 51
    assert len(lines) == 1 and ("degenerate" in lines[0] or "no area" in lines[0])


def test_all_parts_hidden_at_rest_appear_later(tmp_path: Path) -> None:
    file = checkered(node={"scale": [0, 0, 0]})
    animate(file, (0, "scale", [0, 1], [(0, 0, 0), (1, 1, 1)]))
    path = file.save(tmp_path / "ball.glb")
    scene, _ = scene_and_notes(path)
    assert not picture(scene)[..., 3].any() and picture(scene, time=0.99)[..., 3].any()
    with pytest.raises(InputError, match="zero size"):
        load_scene(path, animation="none")


# --- which one -------------------------------------------------------------------------------------------------------


def shift(path: Path, **options: Any) -> list[float]:
    """Return the distance, mm, by which the ball moves in a second."""
    scene = scene_and_notes(path, **options)[0]
    return np.round(scene.at(0.5).bounds.mean(axis=0) - scene.bounds.mean(axis=0), 1).tolist()


def walks(*names: str | None) -> File:
    """Make a ball with animations that move it by 100 mm, 200 mm and so on along x in a second."""
    file = checkered()
    for number, name in enumerate(names, start=1):
        fields = {} if name is None else {"name": name}
        animate(file, (0, "translation", [0, 1], [(0, 0, 0), (0.2 * number, 0, 0)]), **fields)
    return file


def test_an_animation_is_chosen_by_name_or_number(tmp_path: Path) -> None:
    path = walks("Walk", "Run", "").save(tmp_path / "ball.glb")
    assert shift(path) == [100, 0, 0] == shift(path, animation="Walk") == shift(path, animation="0")
    assert shift(path, animation="Run") == [200, 0, 0] == shift(path, animation="1")
    assert shift(path, animation="2") == [300, 0, 0]
    assert load_scene(path, animation="none").objects[0].motion is None
    with pytest.raises(InputError, match=r"ball\.glb: unknown animation 'run'; did you mean 'Run'\?"):
        load_scene(path, animation="run")
    with pytest.raises(InputError, match=r"ball\.glb: unknown animation '3'"):
        load_scene(path, animation="3")


def test_animations_that_do_not_play_are_noted(tmp_path: Path) -> None:
    path = walks("Walk", "Run", "").save(tmp_path / "ball.glb")
    assert scene_and_notes(path)[1] == [
        "plays Walk, the first of 3 animations (--animation NAME plays another: Run, 2)"
    ]
    assert scene_and_notes(path, animation="Walk")[1] == scene_and_notes(path, animation="none")[1] == []
    assert scene_and_notes(walks("Walk"), tmp_path)[1] == []


def test_animations_with_one_name_get_numbers(tmp_path: Path) -> None:
    path = walks("Walk", "Walk", "none", "", "3").save(tmp_path / "ball.glb")
    assert shift(path, animation="Walk") == [100, 0, 0]
    assert shift(path, animation="1") == [200, 0, 0]
    assert shift(path, animation="2") == [300, 0, 0], "'none' means no animation"
    assert sorted(shift(path, animation=name)[0] for name in ("3", "4")) == [400, 500]


def test_channels_that_move_nothing_are_counted(tmp_path: Path) -> None:
    file = checkered()
    lamp = file.node()
    lift = [(0, 0, 0), (0, 1, 0)]
    animate(file, (0, "translation", [0, 1], lift), (lamp, "translation", [0, 1], lift), name="A")
    scene, lines = scene_and_notes(file, tmp_path)
    assert scene.objects[0].motion is not None
    assert lines == ["animation A: 1 channel moves nothing that is drawn"]


def test_parts_repeat_together_and_still_parts_do_not_move(tmp_path: Path) -> None:
    """The period is that of the whole animation, even if its longest channel moves nothing."""
    file = two_balls()
    file.node(mesh=file.mesh(ball_primitive(file)), translation=[0.3, 0, 0])
    lamp = file.node()
    lift = [(0, 0, 0), (0, 0.1, 0)]
    channels = [(n, "translation", [0, end], lift) for n, end in ((0, 1), (1, 2), (lamp, 5))]
    objects = scene_and_notes(animate(file, *channels), tmp_path)[0].objects
    assert [o.motion and o.motion.period_s for o in objects] == [5, 5, None]
    tops = [[float(o.at(time_s).placed[:, 1].max()) for o in objects] for time_s in (2.5, 5.5)]
    assert tops[0][:2] == pytest.approx([150, 150], abs=1) and tops[1][:2] == pytest.approx([100, 75], abs=1)


# --- how it is stored ------------------------------------------------------------------------------------------------


def turned(dtype: str, kind: str = "LINEAR") -> File:
    """Make a ball that rotates by a quarter turn about z in a second, and then stops."""
    file = checkered()
    keys = np.array([(0, 0, 0, 1), (0, 0, HALF, HALF), (0, 0, HALF, HALF)])
    tops = {"i1": 127, "i2": 32767}
    output = file.rows(np.round(keys * tops[dtype]) if dtype in tops else keys, "VEC4", dtype, normalized=dtype in tops)
    sampler = {"input": file.rows([0, 1, 2], "SCALAR"), "output": output, "interpolation": kind}
    file.add("animations", channels=[{"sampler": 0, "target": {"node": 0, "path": "rotation"}}], samplers=[sampler])
    return file


@pytest.mark.parametrize(("dtype", "near"), [("i1", 1.0), ("i2", 0.01)])
def test_rotations_stored_as_integers(tmp_path: Path, dtype: str, near: float) -> None:
    whole, plain = loaded(turned(dtype), tmp_path), loaded(turned("f4"), tmp_path)
    for time_s in (0.0, 0.5, 1.5):
        a, b = (scene.at(time_s).objects[0].mesh.positions for scene in (whole, plain))
        assert np.abs(a - b).max() < near
    top = plain.objects[0].mesh.positions[:, 1].argmax()
    assert plain.at(1.5).objects[0].mesh.positions[top] == pytest.approx((-50, 0, 0), abs=1e-3)


def test_a_skin_and_a_morph_target_together(tmp_path: Path) -> None:
    """The morph target moves the ball up by 100 mm, and the joint rotates this offset to the left."""
    file = checkered()
    count = len(ball()[0])
    primitive = file.tree["meshes"][0]["primitives"][0]
    primitive["attributes"]["JOINTS_0"] = file.rows(np.zeros((count, 4)), "VEC4", "u1")
    primitive["attributes"]["WEIGHTS_0"] = file.rows(np.tile((255, 0, 0, 0), (count, 1)), "VEC4", "u1", normalized=True)
    primitive["targets"] = [{"POSITION": file.rows(np.tile((0, 0.1, 0), (count, 1)), "VEC3")}]
    joint = file.node()
    file.add("skins", joints=[joint])
    file.tree["nodes"][0]["skin"] = 0
    animate(
        file,
        (0, "weights", [0, 1, 2], [0, 1, 1]),
        (joint, "rotation", [0, 1, 2], [(0, 0, 0, 1), (0, 0, HALF, HALF), (0, 0, HALF, HALF)]),
    )
    scene = loaded(file, tmp_path)
    assert scene.at(1.5).bounds.mean(axis=0) == pytest.approx((-100, 0, 0), abs=1)
    assert scene.at(0.5).bounds.mean(axis=0) == pytest.approx(np.array((-1, 1, 0)) * 50 * HALF, abs=1)


def test_a_cubic_spline_overshoots(tmp_path: Path) -> None:
    """The tangents of the file give x(t) = 4 t (1 - t), which is 0 at both keys."""
    file = checkered()
    rows = [(0, 0, 0), (0, 0, 0), (0.4, 0, 0), (-0.4, 0, 0), (0, 0, 0), (0, 0, 0)]
    animate(file, (0, "translation", [0, 1], rows), kind="CUBICSPLINE")
    scene = loaded(file, tmp_path)
    for time_s in (0.25, 0.5, 0.75):
        expected = 400 * time_s * (1 - time_s)
        assert scene.at(time_s).bounds.mean(axis=0)[0] - scene.bounds.mean(axis=0)[0] == pytest.approx(
            expected, abs=0.1
        )
