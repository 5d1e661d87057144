"""Files dropped on the window: it shows what the copied command draws of them."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest
from desk import RIGHT, SIZE_OPTION, Desk, desk, missing, pictures

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")

DROPS = """
import signal
from pathlib import Path
import glfw

callbacks = []
glfw.set_drop_callback = lambda window, callback: callbacks.append((window, callback))

def drop(*_):
    for window, callback in callbacks:
        callback(window, Path("dropped.txt").read_text().splitlines())

signal.signal(signal.SIGUSR1, drop)
"""
"""drops the files that dropped.txt names, on SIGUSR1"""
CUBE = """
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1
f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6
"""


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    argv = ["slab", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(tmp_path_factory.mktemp("desk"), *argv, *SIZE_OPTION, before=DROPS) as opened:
        opened.wait_for_pictures()
        opened.xdotool("mousemove", *RIGHT, "key", "3")
        yield opened


def drop(window: Desk, *files: object) -> None:
    window.output.with_name("dropped.txt").write_text("\n".join(map(str, files)))
    os.kill(window.program.pid, signal.SIGUSR1)


def test_dropped_mesh_is_shown(window: Desk) -> None:
    slab = window.render(RIGHT)
    window.wait_for_pixels(pictures, slab)
    file = window.output.with_name("cube.obj")
    file.write_text(CUBE)
    drop(window, file)
    window.wait_for_change(pictures, slab)
    assert str(file) in window.copy_command(RIGHT)
    window.wait_for_pixels(pictures, window.render(RIGHT))


def test_dropped_material_is_used_and_a_damaged_file_changes_nothing(window: Desk) -> None:
    file, damaged = window.output.with_name("ink.toml"), window.output.with_name("damaged.obj")
    file.write_text('name = "ink"\nsigma_a = [0.5, 0.1, 0.02]\nsigma_s_prime = [0.5, 1.0, 2.0]\n')
    damaged.write_text("v 0 zero 0\n")
    before = window.render(RIGHT)
    drop(window, file, damaged)
    window.wait_for_change(pictures, before)
    assert str(file) in window.copy_command(RIGHT)
    window.wait_for_pixels(pictures, window.render(RIGHT))
