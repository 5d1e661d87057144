"""The cache of baked data: found again by content, rebuilt when damaged, shared between processes."""

from __future__ import annotations

import importlib
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest

from wgsss.bake.cache import cached


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


class Maker:
    """Makes an array and counts how often it was asked to."""

    def __init__(self, value: float = 1.0) -> None:
        self.calls = 0
        self.value = value

    def __call__(self) -> dict[str, np.ndarray]:
        self.calls += 1
        return {"a": np.full((64, 3), self.value, np.float32), "none": np.zeros((0, 2), np.int32)}


def test_second_time_comes_from_the_file(folder: Path) -> None:
    make = Maker()
    first = cached("thing", ["key", 1.5, np.arange(3)], make)
    again = cached("thing", ["key", 1.5, np.arange(3)], make)
    assert make.calls == 1
    assert [f.name.split("-")[0] for f in folder.iterdir()] == ["thing"]
    for name, array in first.items():
        assert again[name].dtype == array.dtype
        np.testing.assert_array_equal(again[name], array)


def test_any_change_of_content_is_another_entry(folder: Path) -> None:
    base = np.arange(6, dtype=np.int32)
    keys = [
        [base],
        [base[::-1]],
        [base.reshape(2, 3)],
        [base.astype(np.int64)],
        [base.view(np.float32)],
        [base[:3], base[3:]],
        ["1"],
        [1],
        [1.0],
        [b"1"],
        ["1", ""],
        [None],
    ]
    for key in keys:
        cached("thing", key, Maker())
    assert len(list(folder.iterdir())) == len(keys)


def test_a_change_of_code_is_another_entry(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = tmp_path / "maker.py"
    monkeypatch.syspath_prepend(tmp_path)
    for number in (1, 2):
        module.write_text(f"import numpy as np\ndef make():\n    return {{'a': np.full(1, {number})}}\n")
        monkeypatch.delitem(sys.modules, "maker", raising=False)
        importlib.invalidate_caches()
        namespace = importlib.import_module("maker")
        cached("thing", [], namespace.make)
    assert len(list(folder.iterdir())) == 2
    cached("thing", [], Maker(), code=["units"])
    cached("thing", [], Maker(), code=["targets"])
    assert len(list(folder.iterdir())) == 4


@pytest.mark.parametrize("damage", ["a bit", "cut short", "empty", "other text"])
def test_damaged_entry_is_rebuilt_with_a_warning(folder: Path, damage: str) -> None:
    make = Maker(7.0)
    cached("thing", ["k"], make)
    (path,) = folder.iterdir()
    data = bytearray(path.read_bytes())
    if damage == "a bit":
        data[len(data) // 3] ^= 1  # in the array's numbers: only a checksum can tell
    path.write_bytes({"a bit": data, "cut short": data[:-50], "empty": b"", "other text": b"hello"}[damage])
    with pytest.warns(UserWarning, match="damaged"):
        result = cached("thing", ["k"], make)
    assert make.calls == 2
    assert (result["a"] == 7.0).all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cached("thing", ["k"], make)
    assert make.calls == 2


def test_unwritable_folder_only_warns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(UserWarning, match="cannot be written") as caught:
        assert (cached("thing", [], Maker())["a"] == 1).all()
    assert len(caught) == 1


def test_what_fails_leaves_nothing(folder: Path) -> None:
    def fail() -> dict[str, np.ndarray]:
        raise RuntimeError("no")

    with pytest.raises(RuntimeError):
        cached("thing", [], fail)
    assert not folder.exists() or not list(folder.iterdir())


def test_many_at_once(folder: Path) -> None:
    barrier = threading.Barrier(8)
    results: list[float] = []

    def make() -> dict[str, np.ndarray]:
        barrier.wait(timeout=10)  # all of them find nothing, and all write
        return {"a": np.full(100_000, 3.0)}

    threads = [threading.Thread(target=lambda: results.append(cached("thing", [], make)["a"].sum())) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [300_000.0] * 8
    assert [f.suffix for f in folder.iterdir()] == [".npz"]


def test_progress_only_on_a_terminal(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cached("thing", [1], Maker(), label="doing")
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    cached("thing", [2], Maker(), label="doing")
    assert "doing" in capsys.readouterr().err
    cached("thing", [2], Maker(), label="doing")
    assert capsys.readouterr().err == ""
