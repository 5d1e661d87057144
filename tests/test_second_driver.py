"""Pictures by a second Vulkan driver, SwiftShader from Chromium, agree with those of the driver in use."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from scenes import NEED_LAYERS

from wgsss.gpu import Gpu
from wgsss.registry import METHODS

DRIVERS = [Path(folder, "vk_swiftshader_icd.json") for folder in ("/usr/lib/chromium", "/usr/share/vulkan/icd.d")]
DRIVER = next((path for path in DRIVERS if path.is_file()), None)
pytestmark = pytest.mark.skipif(
    DRIVER is None, reason="SwiftShader is not installed (Debian's package chromium has it)"
)

MOST_SILHOUETTE = 12  # pixels that only one driver covers
MOST_M = 0.03  # relative RMSE of M over pixels that both cover; edges of shadows differ slightly
MOST_FLIP = 0.02  # rounding by one step of 255 in most pixels gives 0.012; methods differ by 0.1

DRAWN = sorted(METHODS.keys() - set(NEED_LAYERS))  # the ear is of a material of which only the profile is known
DRAW = """
import sys
import numpy as np
import wgsss
from wgsss.gpu import default_gpu

KNOBS = {"deon07": {"map_size": 256}, "jimenez08": {"map_size": 256}, "sam": {"surface": "screen"},
         "jensen02": {"spacing": 6.0}}
scene, pictures = wgsss.load_scene("ear", vertices=2000), {"adapter": np.array(default_gpu().name)}
for method in sys.argv[2:]:
    image = wgsss.render(scene, method, (96, 96), aovs=["M_front", "M_back"], **KNOBS.get(method, {}))
    pictures[f"{method} display"] = image.display
    pictures[f"{method} M"] = image.aovs["M_front"] + image.aovs["M_back"]
np.savez(sys.argv[1], **pictures)
"""


def draw(folder: Path, **environment: str) -> Any:
    """Render the ear by the methods in a new process, since the environment of a process chooses its driver."""
    file = folder / "drawn.npz"
    env = {**os.environ, "PYTHONPATH": str(ROOT), "WGSSS_CACHE": str(folder / "cache"), **environment}
    done = subprocess.run([sys.executable, "-c", DRAW, str(file), *DRAWN], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with np.load(file) as pictures:
        return dict(pictures)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    """Return the pictures by the driver in use, and those by SwiftShader."""
    return (
        draw(tmp_path_factory.mktemp("first")),
        draw(tmp_path_factory.mktemp("second"), VK_DRIVER_FILES=str(DRIVER), WGPUPY_WGPU_ADAPTER_NAME=""),
    )


def test_the_second_driver_is_another_driver(gpu: Gpu, drawn: tuple[Any, Any]) -> None:
    first, second = (str(pictures["adapter"]) for pictures in drawn)
    assert first == gpu.name
    assert "SwiftShader" in second and second != first


@pytest.mark.parametrize("method", DRAWN)
def test_both_drivers_give_the_same_M(drawn: tuple[Any, Any], method: str) -> None:
    first, second = (pictures[f"{method} display"] for pictures in drawn)
    covered = [picture[..., 3] > 0 for picture in (first, second)]
    silhouette = int((covered[0] != covered[1]).sum())
    inside = covered[0] & covered[1]
    M = [pictures[f"{method} M"][inside].astype(np.float64) for pictures in drawn]
    error = float(np.sqrt(np.square(M[1] - M[0]).mean() / np.square(M[0]).mean()))
    print(f"{method}: {silhouette} pixels of the silhouette, M off by {error:.2e}")
    assert inside.sum() > 2000 and silhouette <= MOST_SILHOUETTE
    assert error <= MOST_M


@pytest.mark.parametrize("method", DRAWN)
def test_pictures_of_both_drivers_look_alike(drawn: tuple[Any, Any], method: str) -> None:
    flip = pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")
    first, second = (results[f"{method} display"] for results in drawn)
    pictures = [(p[..., :3] / 255 * (p[..., 3:] / 255)).astype(np.float32) for p in (first, second)]
    error, _, _ = flip.evaluate(*pictures, "LDR", applyMagma=False)
    seen = (first[..., 3] > 0) | (second[..., 3] > 0)
    assert float(error[..., 0][seen].mean()) <= MOST_FLIP
