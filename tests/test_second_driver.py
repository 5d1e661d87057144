"""The same pictures by another Vulkan driver: SwiftShader, which comes with Chromium, beside the one that is in use."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT

from wgsss.gpu import Gpu
from wgsss.registry import METHODS

DRIVERS = [Path(folder, "vk_swiftshader_icd.json") for folder in ("/usr/lib/chromium", "/usr/share/vulkan/icd.d")]
DRIVER = next((path for path in DRIVERS if path.is_file()), None)
pytestmark = pytest.mark.skipif(
    DRIVER is None, reason="SwiftShader is not installed (Debian's package chromium has it)"
)

MOST_SILHOUETTE = 12  # pixels that only one of the two covers
MOST_M = 0.03  # relative RMSE of M over pixels that both cover: edges of shadows fall a little differently
MOST_FLIP = 0.02  # one step of 255 in most pixels, by which two drivers round, makes 0.012; methods differ by 0.1

DRAW = """
import sys
import numpy as np
import wgsss
from wgsss.gpu import default_gpu

KNOBS = {"deon07": {"map_size": 256}, "jimenez08": {"map_size": 256}, "sam": {"surface": "screen"},
         "jensen02": {"spacing": 6.0}}
scene, found = wgsss.load_scene("ear", vertices=2000), {"adapter": np.array(default_gpu().name)}
for method in sys.argv[2:]:
    image = wgsss.render(scene, method, (96, 96), aovs=["M_front", "M_back"], **KNOBS.get(method, {}))
    found[f"{method} display"] = image.display
    found[f"{method} M"] = image.aovs["M_front"] + image.aovs["M_back"]
np.savez(sys.argv[1], **found)
"""


def draw(folder: Path, **environment: str) -> Any:
    """The ear by every method, in a process of its own: a process has its drivers from its environment."""
    file = folder / "drawn.npz"
    env = {**os.environ, "PYTHONPATH": str(ROOT), "WGSSS_CACHE": str(folder / "cache"), **environment}
    done = subprocess.run([sys.executable, "-c", DRAW, str(file), *METHODS], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with np.load(file) as found:
        return dict(found)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    """What the driver in use draws, and SwiftShader."""
    return (
        draw(tmp_path_factory.mktemp("here")),
        draw(tmp_path_factory.mktemp("there"), VK_DRIVER_FILES=str(DRIVER), WGPUPY_WGPU_ADAPTER_NAME=""),
    )


def test_it_is_another_driver(gpu: Gpu, both: tuple[Any, Any]) -> None:
    here, there = (str(found["adapter"]) for found in both)
    assert here == gpu.name
    assert "SwiftShader" in there and there != here


@pytest.mark.parametrize("method", METHODS)
def test_its_pictures_are_the_same(both: tuple[Any, Any], method: str) -> None:
    here, there = (found[f"{method} display"] for found in both)
    covered = [picture[..., 3] > 0 for picture in (here, there)]
    silhouette = int((covered[0] != covered[1]).sum())
    inside = covered[0] & covered[1]
    M = [found[f"{method} M"][inside].astype(np.float64) for found in both]
    error = float(np.sqrt(np.square(M[1] - M[0]).mean() / np.square(M[0]).mean()))
    print(f"{method}: {silhouette} pixels of the silhouette, M off by {error:.2e}")
    assert inside.sum() > 2000 and silhouette <= MOST_SILHOUETTE
    assert error <= MOST_M


@pytest.mark.parametrize("method", METHODS)
def test_they_look_alike(both: tuple[Any, Any], method: str) -> None:
    flip = pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")
    here, there = (found[f"{method} display"] for found in both)
    pictures = [(p[..., :3] / 255 * (p[..., 3:] / 255)).astype(np.float32) for p in (here, there)]
    error, _, _ = flip.evaluate(*pictures, "LDR", applyMagma=False)
    seen = (here[..., 3] > 0) | (there[..., 3] > 0)
    assert float(error[..., 0][seen].mean()) <= MOST_FLIP
