"""The cache of baked data: found again by content, rebuilt when damaged, shared between processes."""

from __future__ import annotations

import errno
import importlib
import io
import os
import sys
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from wgsss.cache import cached
from wgsss.errors import Note


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


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "a bit": lambda data: data[: len(data) // 3] + bytes([data[len(data) // 3] ^ 1]) + data[len(data) // 3 + 1 :],
    "cut short": lambda data: data[:-50],
    "empty": lambda data: b"",
    "other text": lambda data: b"hello",
    "an array alone": lambda data: saved(np.save, np.zeros(3)),
    "no keys": lambda data: saved(np.savez),
    "other keys": lambda data: saved(np.savez, b=np.zeros(3)),
    "objects": lambda data: saved(np.savez, a=np.array([None])),
    "other shapes": lambda data: replaced(data, a=np.zeros((64, 2), np.float32)),
    "other dtypes": lambda data: replaced(data, a=np.zeros((64, 3), np.float64)),
    "more keys": lambda data: replaced(data, more=np.zeros(3)),
}


def saved(save: Any, *values: np.ndarray, **arrays: np.ndarray) -> bytes:
    stream = io.BytesIO()
    save(stream, *values, **arrays)
    return stream.getvalue()


def replaced(data: bytes, **arrays: np.ndarray) -> bytes:
    """The entry with some of its arrays replaced."""
    with np.load(io.BytesIO(data)) as entry:
        return saved(np.savez, **{**entry, **arrays})


@pytest.mark.parametrize("damage", DAMAGES)
def test_an_entry_that_is_damaged_or_of_other_content_is_made_anew_with_a_warning(folder: Path, damage: str) -> None:
    make = Maker(7.0)
    cached("thing", ["k"], make)
    (path,) = folder.iterdir()
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    with pytest.warns(Note, match="damaged, or of other content") as caught:
        result = cached("thing", ["k"], make)
    assert make.calls == 2 and len(caught) == 1
    assert (result["a"] == 7.0).all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cached("thing", ["k"], make)
    assert make.calls == 2


def test_the_entry_of_another_key_is_not_taken(folder: Path) -> None:
    cached("thing", ["k"], Maker(1.0))
    (path,) = folder.iterdir()
    cached("thing", ["l"], Maker(2.0))
    (other,) = set(folder.iterdir()) - {path}
    other.write_bytes(path.read_bytes())
    with pytest.warns(Note, match="of other content"):
        assert (cached("thing", ["l"], Maker(2.0))["a"] == 2.0).all()


@pytest.mark.parametrize("kind", ["folder", "fifo", "link to a device", "link to itself"])
def test_a_file_or_folder_in_the_place_of_an_entry_is_replaced_or_ignored(folder: Path, kind: str) -> None:
    cached("thing", ["k"], Maker())
    (path,) = folder.iterdir()
    path.unlink()
    if kind == "folder":
        path.mkdir()
    elif kind == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero" if kind == "link to a device" else path)
    with pytest.warns(Note) as caught:
        assert (cached("thing", ["k"], Maker(3.0))["a"] == 3.0).all()
    assert all(path.name in str(note.message) for note in caught)
    assert [file.name for file in folder.iterdir()] == [path.name]
    assert path.is_dir() if kind == "folder" else path.is_file() and not path.is_symlink()


def test_unwritable_folder_only_warns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(Note, match="cannot be written") as caught:
        assert (cached("thing", [], Maker())["a"] == 1).all()
    assert len(caught) == 1


def test_a_full_disk_leaves_no_entry_and_the_result_is_used(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write_some(file: Any, **arrays: np.ndarray) -> None:
        file.write(b"PK")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(np, "savez", write_some)
    with pytest.warns(Note, match="No space left"):
        assert (cached("thing", [], Maker())["a"] == 1).all()
    assert not list(folder.iterdir())


def test_an_entry_is_made_with_one_blas_thread_also_after_another_that_it_needs(folder: Path) -> None:
    def threads() -> set[int]:
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    before, seen = threads(), []

    def make() -> dict[str, np.ndarray]:
        cached("inner", [], Maker())
        seen.append(threads())
        return {"a": np.zeros(1)}

    cached("outer", [], make)
    assert (seen, threads()) == ([{1}], before)


def test_a_failed_write_leaves_no_file(folder: Path) -> None:
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
