"""Fixtures that the tests share."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from wgsss import wgsl
from wgsss.gpu import Gpu, default_gpu

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("WGSSS_DATA", ROOT.parent / "shared" / "data"))

HAS_FLIP = find_spec("flip_evaluator") is not None
needs_flip = pytest.mark.skipif(not HAS_FLIP, reason="flip-evaluator is not installed")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-goldens", action="store_true", help="write the goldens anew, and compare nothing")


@pytest.fixture(scope="session")
def gpu() -> Gpu:
    """The device. Tests need one: a missing adapter is an error, not a skip."""
    return default_gpu()


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Tests bake into a folder of their own, so that what a user has cached neither helps nor hurts."""
    os.environ["WGSSS_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture
def data() -> Path:
    """The folder of real meshes and light probes."""
    if not DATA.is_dir():
        pytest.skip(f"no real data at {DATA} (set WGSSS_DATA)")
    return DATA


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Writes modules of a test's own, name=text, in place of the shaders; gives back their folder."""
    monkeypatch.setattr(wgsl.load, "__defaults__", (tmp_path,))

    def write(**texts: str) -> Path:
        for name, text in texts.items():
            (tmp_path / f"{name}.wgsl").write_text(text)
        return tmp_path

    return write
