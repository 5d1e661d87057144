"""Baked data have the same bits for any number of BLAS threads."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

SCRIPT = """
from pathlib import Path
from tempfile import TemporaryDirectory
from wgsss.gpu import default_gpu
from wgsss.reference.mitsuba_grids import write_grids
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import load_scene
from wgsss.stage import Stage

ear, wave = load_scene("ear", vertices=1500), load_scene("wave", vertices=500)
methods = [("deon07", {"map_size": 64}), ("jimenez08", {"map_size": 64}), ("barre11", {}), ("jimenez15", {})]
methods += [("jensen02", {"spacing": 3.0}), *(("sam", {"select": select}) for select in ("fit", "top", "coarse"))]
for name, knobs in methods:
    Renderer(ear, make_method(name, knobs), (16, 16))
Renderer(wave, make_method("sam"), (16, 16)).frame(0.5)
organ = load_scene("organ", vertices=300)
Renderer(organ, make_method("lambert"), (16, 16)).frame(0.0)
make_method("layers", {"steps": 4, "light_steps": 2, "sky": 1}).estimate(Stage(default_gpu(), organ), (4, 4))
with TemporaryDirectory() as folder:
    write_grids(0, organ.objects[0], Path(folder), None, voxels=512)
make_method("integral", {"samples": 5000}).estimate(Stage(default_gpu(), ear), (8, 8))
"""


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Bake with one and with two BLAS threads. Returns the two cache folders."""
    found = []
    for threads in ("1", "2"):
        folder = tmp_path_factory.mktemp(f"threads{threads}")
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "WGSSS_CACHE": str(folder)}
        environment |= {f"{library}_NUM_THREADS": threads for library in ("OPENBLAS", "OMP", "MKL", "VECLIB")}
        subprocess.run([sys.executable, "-W", "ignore", "-c", SCRIPT], env=environment, check=True, timeout=300)
        found.append(folder)
    return found


def test_every_kind_of_cache_entry_is_baked(folders: list[Path]) -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "wgsss").rglob("*.py"))
    kinds = set(re.findall(r'\bcached\(\s*"([^"]+)"', source))
    assert len(kinds) > 10
    made = {path.name.rsplit("-", 1)[0] for path in folders[0].iterdir()}
    assert kinds - {"volume"} <= made  # the entries of volume are computed by Mitsuba


def test_one_and_two_threads_bake_the_same_bits(folders: list[Path]) -> None:
    one, two = ({path.name: path for path in folder.iterdir()} for folder in folders)
    assert one.keys() == two.keys()  # file names are made of the inputs
    for name in one:
        with np.load(one[name]) as first, np.load(two[name]) as second:
            assert first.files == second.files
            differ = [part for part in first.files if first[part].tobytes() != second[part].tobytes()]
        assert not differ, f"{name}: {differ}"
