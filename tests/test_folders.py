"""Output folders are written completely or not at all, and removed if they stay empty."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from wgsss.errors import InputError
from wgsss.folders import atomic_folder, created_folder


@pytest.mark.parametrize("exists", [False, True])
def test_files_appear_together_and_old_files_stay(tmp_path: Path, exists: bool) -> None:
    folder = tmp_path / "out"
    if exists:
        folder.mkdir()
        (folder / "old").write_text("old")
        (folder / "a").write_text("old")
    with atomic_folder(folder) as place:
        for name in "ab":
            (place / name).write_text("new")
        assert not (folder / "b").exists()
    assert {path.name: path.read_text() for path in folder.iterdir()} == {
        **({"old": "old"} if exists else {}),
        **{"a": "new", "b": "new"},
    }
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, InputError])
@pytest.mark.parametrize("exists", [False, True])
def test_an_error_leaves_no_files(tmp_path: Path, error: type[BaseException], exists: bool) -> None:
    folder = tmp_path / "out"
    if exists:
        folder.mkdir()
    with pytest.raises(error), atomic_folder(folder) as place:
        (place / "a").write_text("new")
        raise error
    assert list(tmp_path.iterdir()) == ([folder] if exists else []) and not list(folder.glob("*"))


def test_a_folder_with_the_name_of_a_file_prevents_all_files(tmp_path: Path) -> None:
    (tmp_path / "out" / "b").mkdir(parents=True)
    with pytest.raises(InputError, match="b: this is a folder, in the place of a file"):
        with atomic_folder(tmp_path / "out") as place:
            for name in "abc":
                (place / name).write_text("new")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["b"]


BAD: dict[str, tuple[Callable[[Path], object], str]] = {
    "file": (lambda path: path.touch(), "this is not a folder"),
    "fifo": (os.mkfifo, "this is not a folder"),
    "device": (lambda path: path.symlink_to("/dev/null"), "this is not a folder"),
    "loop": (lambda path: path.symlink_to(path), "is not the name of a folder|cannot be written"),
    "x" * 300: (lambda path: None, "cannot be written .File name too long"),
    "a\0b": (lambda path: None, "is not the name of a folder"),
}


@pytest.mark.parametrize("name", BAD, ids=[name[:6].replace("\0", "NUL") for name in BAD])
@pytest.mark.parametrize("make", [atomic_folder, created_folder])
def test_invalid_folders_are_errors_before_the_block(tmp_path: Path, name: str, make: Callable[[Path], object]) -> None:
    prepare, says = BAD[name]
    prepare(tmp_path / name)
    before = list(tmp_path.iterdir())
    with pytest.raises(InputError, match=says):
        with make(tmp_path / name):  # type: ignore[attr-defined]
            raise AssertionError("the block ran")
    assert list(tmp_path.iterdir()) == before


def test_empty_new_folders_are_removed_and_others_stay(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with created_folder(tmp_path / "a" / "b" / "c"):
        assert (tmp_path / "a" / "b" / "c").is_dir()
    assert list((tmp_path / "a").iterdir()) == []
    with created_folder(tmp_path / "a" / "b" / "c"):
        (tmp_path / "a" / "b" / "kept").touch()
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["kept"]
