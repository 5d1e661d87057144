"""Files dropped on the window: what it shows then is what the command draws of them."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import numpy as np
import pytest
from desk import RIGHT, SMALL, Desk, desk, missing, pictures

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")

DROPS = """
import signal
from pathlib import Path
import glfw

drops = []
glfw.set_drop_callback = lambda window, act: drops.append((window, act))

def drop(*_):
    for window, act in drops:
        act(window, Path("dropped.txt").read_text().splitlines())

signal.signal(signal.SIGUSR1, drop)
"""
"""drops the files that are named in a file, when told so"""
CUBE = """
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1
f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6
"""


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    argv = ["slab", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(tmp_path_factory.mktemp("desk"), *argv, *SMALL, before=DROPS) as opened:
        opened.settled(lambda screen: bool(pictures(screen).any()))
        opened.do("mousemove", *RIGHT, "key", "3")
        yield opened


def drop(window: Desk, *files: object) -> None:
    window.output.with_name("dropped.txt").write_text("\n".join(map(str, files)))
    os.kill(window.program.pid, signal.SIGUSR1)


def test_a_mesh_dropped_is_shown(window: Desk) -> None:
    slab = window.drawn(RIGHT)
    window.settled(lambda screen: np.array_equal(pictures(screen), slab))
    file = window.output.with_name("cube.obj")
    file.write_text(CUBE)
    drop(window, file)
    window.settled(lambda screen: not np.array_equal(pictures(screen), slab))
    assert str(file) in window.copied(RIGHT)
    cube = window.drawn(RIGHT)
    window.settled(lambda screen: np.array_equal(pictures(screen), cube))


def test_a_material_dropped_is_worn_and_what_is_neither_changes_nothing(window: Desk) -> None:
    file, bad = window.output.with_name("ink.toml"), window.output.with_name("bad.obj")
    file.write_text('name = "ink"\nsigma_a = [0.5, 0.1, 0.02]\nsigma_s_prime = [0.5, 1.0, 2.0]\n')
    bad.write_text("v 0 zero 0\n")
    before = window.drawn(RIGHT)
    drop(window, file, bad)
    window.settled(lambda screen: not np.array_equal(pictures(screen), before))
    assert str(file) in window.copied(RIGHT)
    inked = window.drawn(RIGHT)
    window.settled(lambda screen: np.array_equal(pictures(screen), inked))
