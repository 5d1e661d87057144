"""Fixtures that the tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from wgsss.gpu import Gpu, default_gpu

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("WGSSS_DATA", ROOT.parent / "shared" / "data"))


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
