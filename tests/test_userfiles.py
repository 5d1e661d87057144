"""Files named by users are checked before they are opened."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from wgsss.errors import InputError
from wgsss.scene import load_material, load_mesh, load_scene
from wgsss.userfiles import path_from, read_text, require_file


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 40)


def listening(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))


KINDS: dict[str, tuple[Callable[[Path], object], str]] = {
    "nothing": (lambda path: None, "no such file"),
    "an empty file": (lambda path: path.touch(), "the file is empty"),
    "a folder": (os.mkdir, "this is a folder"),
    "a fifo": (os.mkfifo, "this is not a regular file"),
    "a socket": (listening, "this is not a regular file"),
    "a device": (lambda path: path.symlink_to("/dev/zero"), "this is not a regular file"),
    "a link to itself": (lambda path: path.symlink_to(path), "cannot be read"),
    "a link to nothing": (lambda path: path.symlink_to("nowhere"), "no such file"),
    "a file of /proc": (lambda path: path.symlink_to("/proc/self/status"), "the file is empty"),
    "a sparse file": (sparse, "1099511627776 bytes are too many"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_reader_refuses_special_files(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make, says = KINDS[kind]
    monkeypatch.chdir(tmp_path)  # names of sockets must be short
    readers: dict[str, Callable[[Path], object]] = {"a.toml": load_scene, "b.toml": load_material}
    readers |= {f"a{suffix}": load_mesh for suffix in (".ply", ".obj", ".stl", ".glb", ".gltf")}
    for name, read in readers.items():
        make(Path(name))
        with pytest.raises(InputError, match=says):
            read(Path(name))


@pytest.mark.parametrize(
    ("name", "says"),
    [("x" * 300, "File name too long"), ("a\0b", "is not the name of a file"), ("a/" * 3000, "too long")],
)
def test_impossible_file_names_are_errors(name: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        require_file(Path(name))


def test_home_folders_are_expanded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert path_from("~/a.ply", Path("folder")) == tmp_path / "a.ply"
    assert path_from("a.ply", Path("folder")) == Path("folder/a.ply")
    for text, says in (("~nobodyatall/a.ply", "no such home folder"), ("", "is empty"), ("  ", "is empty")):
        with pytest.raises(InputError, match=says):
            path_from(text, Path())


def test_text_files(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1\r\n")
    assert read_text(path, "a TOML file") == "a = 1\n"
    path.write_bytes("a = 1".encode("utf-16"))
    with pytest.raises(InputError, match=r"a\.toml: not a TOML file: it is not UTF-8 text"):
        read_text(path, "a TOML file")
