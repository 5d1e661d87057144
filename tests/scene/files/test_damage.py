"""Damaged text and binary meshes are read or refused in one line, without warnings and without hanging."""

from __future__ import annotations

import random
import struct
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.obj import read_obj
from wgsss.scene.files.off import read_off
from wgsss.scene.files.ply import read_ply
from wgsss.scene.files.stl import read_stl

READERS = {"obj": read_obj, "ply": read_ply, "stl": read_stl, "off": read_off}
ODD_WORDS = [
    *b"nan inf -1 0 99999999999 1e400 abc 1_0 / 1// /1 \\ # 1.#QNAN -1e300 -0 4294967295".split(),
    *(b"\xff\xfe", b"\xe2\x80\xa8", b"\x85", b"", b"\n", b"\r", b"\0", b"9" * 5000, b" \\\n", b"x" * 999),
]
RING = [(np.cos(a), np.sin(a), z) for z in (0.0, 1.0) for a in np.arange(6) * np.pi / 3]
QUADS = [(i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i) for i in range(6)]
MATERIALS = b"""newmtl a
Kd 1 .5 0
map_Kd -s 2 2 -o .1 .2 -clamp on t.png
norm -bm .5 t.png
d 0.5
newmtl b #2
Ni 1.5
Ks 1 1 1
map_d t.png
map_Kd t.png
bump b.png
"""


def lines(rows) -> bytes:
    return "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()


def an_obj() -> bytes:
    data = b"mtllib a.mtl\no x\n" + lines(("v", *p) for p in RING) + lines(("vt", *p[:2]) for p in RING)
    data += lines(("vn", *p) for p in RING) + b"usemtl a\ns 1\n"
    data += lines(("f", *(f"{i + 1}/{i + 1}/{i + 1}" for i in q)) for q in QUADS[:3]) + b"usemtl b #2\n"
    return (
        data + lines(("f", *(i - 12 for i in q)) for q in QUADS[3:]) + b"f 1 2 3 4 5 6\nf 7//1 8//1 \\\n9//1\nl 1 2\n"
    )


def a_ply(order: str) -> bytes:
    form = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = f"""ply
format {form} 1.0
comment TextureFile t.png
element vertex 12
property float x
property double y
property float z
property float nx
property float ny
property float nz
property uchar red
property uchar green
property uchar blue
element face 7
property list uchar int vertex_indices
property list uchar float texcoord
property short texnumber
element tristrips 1
property list int int vertex_indices
end_header
""".encode()
    rows = [("fdffffBBB", (*p, *p, 1, 2, 3)) for p in RING]
    for i, corners in enumerate([*QUADS, range(6)]):
        n = len(corners)
        rows.append((f"B{n}iB{2 * n}fh", (n, *corners, 2 * n, *[0.5] * (2 * n), i % 2)))
    rows.append(("8i", (7, 0, 1, 2, -1, 3, 4, 5)))
    if order:
        return head + b"".join(struct.pack(order + letters, *row) for letters, row in rows)
    return head + lines(row for _, row in rows)


def an_stl(text: bool) -> bytes:
    facets = [[RING[i] for i in q[:3]] for q in QUADS]
    if not text:
        return (
            bytes(80) + struct.pack("<I", 6) + b"".join(struct.pack("<12fH", 0, 0, 0, *sum(f, ()), 0) for f in facets)
        )
    loops = [
        b"facet normal 0 0 0\nouter loop\n" + lines(("vertex", *p) for p in f) + b"endloop\nendfacet\n" for f in facets
    ]
    return b"solid x\n" + b"".join(loops) + b"endsolid x\n"


def an_off(rich: bool) -> bytes:
    head, extra = (b"STCNOFF\n", (0, 0, 1, 10, 20, 30, 255, 0.5, 0.5)) if rich else (b"OFF\n", ())
    return head + b"12 6 0\n" + lines((*p, *extra) for p in RING) + lines((4, *q, *[9, 9, 9] * rich) for q in QUADS)


SOUND = {
    "obj": [an_obj()],
    "ply": [a_ply(""), a_ply("<"), a_ply(">")],
    "stl": [an_stl(True), an_stl(False)],
    "off": [an_off(True), an_off(False)],
}


def damaged(data: bytes, r: random.Random) -> bytes:
    """Change, cut or insert bytes, shuffle, repeat or drop lines, or replace words."""
    if len(data) < 3:
        return data
    kind = r.randrange(8)
    rows, words = data.split(b"\n"), data.split(b" ")
    if kind == 0:
        changed = bytearray(data)
        for _ in range(r.randrange(1, 20)):
            changed[r.randrange(len(data))] = r.randrange(256)
        return bytes(changed)
    if kind == 1:
        return data[: r.randrange(len(data))]
    if kind == 2:
        at = r.randrange(len(data))
        return data[:at] + r.randbytes(r.randrange(1, 40)) + data[at:]
    if kind == 3:
        r.shuffle(rows)
    elif kind == 4:
        at = r.randrange(len(rows))
        rows[at:at] = [r.choice(rows)] * r.randrange(1, 5)
    elif kind == 5:
        del rows[r.randrange(len(rows))]
    elif kind == 6:
        for _ in range(r.randrange(1, 5)):
            words[r.randrange(len(words))] = r.choice(ODD_WORDS)
        return b" ".join(words)
    else:
        at = r.randrange(min(len(data), 600))  # in the header, if the format has one
        return data[:at] + r.choice([b"9", b"0", b"-", b".", b"\n", b" ", b"e", b"\xff"]) + data[at + 1 :]
    return b"\n".join(rows)


def check(contents: Contents) -> None:
    assert contents.parts
    for part in contents.parts:
        count = len(part.positions)
        assert part.positions.shape == (count, 3) and part.positions.dtype == np.float64
        assert len(part.faces) and part.faces.shape[1] == 3 and part.faces.dtype == np.int64
        assert part.faces.min() >= 0 and part.faces.max() < count
        for uvs in part.uvs.values():
            assert uvs.shape == (count, 2) and uvs.dtype == np.float64 and np.isfinite(uvs).all()
        if part.normals is not None:
            assert part.normals.shape == (count, 3) and np.isfinite(part.normals).all()
        if part.colors is not None:
            assert part.colors.shape == (count, 3) and (part.colors >= 0).all() and (part.colors <= 1).all()
    for note in contents.notes:
        assert note == note.strip() and len(note.splitlines()) == 1


@pytest.mark.parametrize("suffix", READERS)
def test_undamaged_files_are_read(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "a.mtl").write_bytes(MATERIALS)
    for data in SOUND[suffix]:
        (tmp_path / f"mesh.{suffix}").write_bytes(data)
        check(READERS[suffix](tmp_path / f"mesh.{suffix}"))


@pytest.mark.parametrize("suffix", READERS)
def test_damaged_files_are_read_or_refused(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "t.png").write_bytes(b"x")
    path, outcomes = tmp_path / f"mesh.{suffix}", {True: 0, False: 0}
    for seed in range(60):
        r = random.Random(seed)
        data = damaged(r.choice(SOUND[suffix]), r)
        path.write_bytes(damaged(data, r) if r.random() < 0.3 else data)
        (tmp_path / "a.mtl").write_bytes(damaged(MATERIALS, r) if r.random() < 0.7 else MATERIALS)
        start = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                check(READERS[suffix](path))
        except InputError as error:
            assert str(error).startswith(f"{path}: ") and len(str(error).splitlines()) == 1
            outcomes[False] += 1
        else:
            outcomes[True] += 1
        assert time.perf_counter() - start < 5.0, f"seed {seed}"
    assert min(outcomes.values()) > 0, "some damaged files are read and some are refused"


@pytest.mark.parametrize("suffix", READERS)
def test_missing_files_and_folders_are_errors(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(InputError, match="no such file"):
        READERS[suffix](tmp_path / f"gone.{suffix}")
    (tmp_path / f"folder.{suffix}").mkdir()
    with pytest.raises(InputError, match=f"folder.{suffix}: "):
        READERS[suffix](tmp_path / f"folder.{suffix}")
