"""Numbers of glTF files in every storage (normalised, quantised, strided, sparse) give the same picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import RADIUS, ball, ball_primitive, checkered, colored, difference, differing, loaded, picture
from gltfs import CODES, File

from wgsss.scene import Scene, load_scene

Array = np.ndarray[Any, Any]
TOPS = {"i1": 127, "u1": 255, "i2": 32767, "u2": 65535}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """Load a ball with a checker whose numbers are all floating-point."""
    return loaded(checkered(), tmp_path_factory.mktemp("plain"))


def with_attributes(**makers: Any) -> File:
    """Make a ball with a checker. Each of `makers` is a function that adds an attribute to the file."""
    file = File()
    attributes = {name: make(file) for name, make in makers.items()}
    file.node(mesh=file.mesh(ball_primitive(file, colored(file), attributes=attributes)))
    return file


def whole(values: Array, dtype: str) -> Array:
    return np.round(values * TOPS[dtype])


def interleaved(file: File, columns: dict[str, tuple[Array, str, str, bool]], padding: int = 0) -> dict[str, int]:
    """Add accessors with one buffer view: columns of (values, kind, dtype, normalised), padded to 4 bytes."""
    fields: list[Any] = []
    for name, (values, _, dtype, _) in columns.items():
        fields += [(name, f"<{dtype}", values.shape[1]), (f"{name} padding", "u1", -values.itemsize % 4)]
        used = np.dtype(dtype).itemsize * values.shape[1]
        fields[-1] = (f"{name} padding", "u1", (-used % 4,))
    rows = np.zeros(len(next(iter(columns.values()))[0]), np.dtype([*fields, ("rest", "u1", (padding,))]))
    for name, (values, *_) in columns.items():
        rows[name] = values
    view = file.view(rows.tobytes(), byteStride=rows.itemsize)
    accessors = {}
    for name, (values, kind, dtype, normalized) in columns.items():
        accessors[name] = file.add(
            "accessors",
            bufferView=view,
            byteOffset=rows.dtype.fields[name][1],
            componentType=CODES[dtype],
            type=kind,
            count=len(values),
            normalized=normalized,
        )
    return accessors


def sparse(
    file: File, kind: str, index: Array, values: Array, *, indices: str = "u2", dtype: str = "f4", **base: Any
) -> int:
    """Add an accessor that replaces some rows of a buffer view, or of zeros."""
    patch = {
        "count": len(index),
        "indices": {"bufferView": file.view(index, indices), "componentType": CODES[indices]},
        "values": {"bufferView": file.view(values, dtype)},
    }
    return file.add("accessors", componentType=CODES[dtype], type=kind, sparse=patch, **base)


# --- normalised, quantised, strided ----------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", ["u1", "u2"])
def test_texture_coordinates_may_be_normalised(tmp_path: Path, plain: Scene, dtype: str) -> None:
    """Core glTF 2.0 allows this without an extension."""
    file = with_attributes(TEXCOORD_0=lambda f: f.rows(whole(ball()[1], dtype), "VEC2", dtype, normalized=True))
    assert difference(loaded(file, tmp_path), plain) <= 1


@pytest.mark.parametrize("dtype", ["i2", "u2"])
def test_positions_may_be_normalised(tmp_path: Path, plain: Scene, dtype: str) -> None:
    """KHR_mesh_quantization allows integers for 0 to 1 or -1 to 1. A node scales and translates them."""
    low, span = (-RADIUS, 2 * RADIUS) if dtype == "u2" else (0.0, RADIUS)
    stored = whole((ball()[0] - low) / span, dtype)
    file = with_attributes(POSITION=lambda f: f.rows(stored, "VEC3", dtype, normalized=True))
    file.tree["nodes"][0].update(scale=[span] * 3, translation=[low] * 3)
    file.tree["extensionsUsed"] = file.tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    scene = loaded(file, tmp_path)
    assert np.ptp(scene.bounds, axis=0) == pytest.approx(np.ptp(plain.bounds, axis=0), rel=1e-4)
    assert differing(scene, plain) < 0.01


def test_quantised_positions_need_not_be_normalised(tmp_path: Path, plain: Scene) -> None:
    file = with_attributes(POSITION=lambda f: f.rows(np.round(ball()[0] / RADIUS * 16383), "VEC3", "i2"))
    file.tree["nodes"][0]["scale"] = [RADIUS / 16383] * 3
    assert differing(loaded(file, tmp_path), plain) < 0.01


def test_quantised_coordinates_with_a_texture_transform(tmp_path: Path, plain: Scene) -> None:
    """gltfpack writes integers, and a texture transform that scales them to 0 to 1."""
    file = File()
    scale = {"KHR_texture_transform": {"scale": [1 / 65535, 1 / 65535]}}
    uvs = file.rows(whole(ball()[1], "u2"), "VEC2", "u2")
    material = colored(file, extensions=scale)
    file.node(mesh=file.mesh(ball_primitive(file, material, attributes={"TEXCOORD_0": uvs})))
    assert difference(loaded(file, tmp_path), plain) <= 1


@pytest.mark.parametrize("padding", [0, 4, 20])
def test_interleaved_attributes(tmp_path: Path, plain: Scene, padding: int) -> None:
    """Positions, normals and coordinates of several types share the rows of one buffer view, with gaps."""
    points, uvs, _ = ball()
    file = File()
    columns = {
        "POSITION": (whole(points / RADIUS, "i2"), "VEC3", "i2", True),
        "NORMAL": (whole(points / RADIUS, "i1"), "VEC3", "i1", True),
        "TEXCOORD_0": (whole(uvs, "u2"), "VEC2", "u2", True),
    }
    attributes = interleaved(file, columns, padding)
    material = colored(file)
    file.node(mesh=file.mesh(ball_primitive(file, material, attributes=attributes)), scale=[RADIUS] * 3)
    assert differing(loaded(file, tmp_path), plain) < 0.01


def test_offsets_of_views_and_accessors(tmp_path: Path, plain: Scene) -> None:
    """The file has offsets of a view in its buffer and of an accessor in its view, and a second buffer."""
    points, _, faces = ball()
    file = with_attributes()
    data = np.concatenate([[7.0] * 5, np.ravel(points)]).astype("<f4").tobytes()
    accessor = file.tree["accessors"][file.tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    accessor.update(bufferView=file.view(data), byteOffset=20, count=len(points))
    indices = file.tree["accessors"][file.tree["meshes"][0]["primitives"][0]["indices"]]
    (tmp_path / "faces.bin").write_bytes(bytes(6) + np.ravel(faces).astype("<u2").tobytes())
    indices["bufferView"] = file.add("bufferViews", buffer=1, byteOffset=6, byteLength=2 * faces.size)
    file.tree["buffers"] = [
        {"byteLength": len(file.data)},
        {"byteLength": 6 + 2 * faces.size, "uri": "faces.bin"},
    ]
    assert difference(loaded(file, tmp_path), plain) == 0


# --- sparse ----------------------------------------------------------------------------------------------------------


def bump() -> tuple[Array, Array]:
    """Return the vertices near the top of the ball, and their positions 100 mm further out."""
    points = ball()[0]
    index = np.flatnonzero(points[:, 1] > 0.6 * RADIUS)
    return index, points[index] * 3


@pytest.mark.parametrize("indices", ["u1", "u2", "u4"])
def test_sparse_positions(tmp_path: Path, indices: str) -> None:
    points = ball()[0]
    index, moved = bump()
    dense = points.copy()
    dense[index] = moved

    def maker(file: File) -> int:
        return sparse(
            file, "VEC3", index, moved, indices=indices, bufferView=file.view(points, "f4"), count=len(points)
        )

    scene = loaded(with_attributes(POSITION=maker), tmp_path)
    assert scene.bounds[1, 1] == pytest.approx(150) and np.ptp(scene.bounds, axis=0)[1] == pytest.approx(200)
    same = loaded(with_attributes(POSITION=lambda f: f.rows(dense, "VEC3")), tmp_path)
    assert difference(scene, same) == 0


def test_sparse_positions_without_a_view_start_from_zero(tmp_path: Path, plain: Scene) -> None:
    points = ball()[0]
    file = with_attributes(POSITION=lambda f: sparse(f, "VEC3", np.arange(len(points)), points, count=len(points)))
    assert difference(loaded(file, tmp_path), plain) == 0


def test_sparse_positions_of_whole_numbers(tmp_path: Path, plain: Scene) -> None:
    stored = whole(ball()[0] / RADIUS, "i2")
    index = np.arange(0, len(stored), 3)
    base = stored.copy()
    base[index] = 0

    def maker(file: File) -> int:
        padded = np.zeros((len(base), 4))
        padded[:, :3] = base
        view = file.view(padded, "i2", byteStride=8)
        return sparse(file, "VEC3", index, stored[index], dtype="i2", bufferView=view, count=len(base), normalized=True)

    file = with_attributes(POSITION=maker)
    file.tree["nodes"][0]["scale"] = [RADIUS] * 3
    assert differing(loaded(file, tmp_path), plain) < 0.01


def test_sparse_texture_coordinates(tmp_path: Path, plain: Scene) -> None:
    uvs = ball()[1]
    index = np.flatnonzero(uvs[:, 0] > 0.3)
    base = uvs.copy()
    base[index] = 0

    def maker(file: File) -> int:
        return sparse(file, "VEC2", index, uvs[index], bufferView=file.view(base, "f4"), count=len(uvs))

    assert difference(loaded(with_attributes(TEXCOORD_0=maker), tmp_path), plain) == 0


def test_indices_of_faces_may_be_sparse(tmp_path: Path, plain: Scene) -> None:
    """The accessor of the triangles is sparse."""
    corners = np.ravel(ball()[2])
    index = np.arange(30, 60)
    base = corners.copy()
    base[index] = 0
    file = with_attributes()
    number = sparse(
        file, "SCALAR", index, corners[index], dtype="u2", bufferView=file.view(base, "u2"), count=len(base)
    )
    file.tree["meshes"][0]["primitives"][0]["indices"] = number
    assert difference(loaded(file, tmp_path), plain) == 0


def test_sparse_positions_are_animated(tmp_path: Path) -> None:
    points = ball()[0]
    index, moved = bump()
    file = with_attributes(
        POSITION=lambda f: sparse(f, "VEC3", index, moved, bufferView=f.view(points, "f4"), count=len(points))
    )
    half = np.sqrt(0.5)
    times, turns = file.rows([0, 1, 2], "SCALAR"), file.rows([(0, 0, 0, 1), (0, 0, half, half), (0, 0, 0, 1)], "VEC4")
    channel = {"sampler": 0, "target": {"node": 0, "path": "rotation"}}
    file.add("animations", channels=[channel], samplers=[{"input": times, "output": turns}])
    scene = loaded(file, tmp_path)
    assert scene.bounds[1, 1] == pytest.approx(150)
    turned = scene.at(1.0)
    assert turned.bounds[0, 0] == pytest.approx(-150), "the direction up has become left"
    assert turned.bounds[1, 1] == pytest.approx(scene.bounds[1, 0])


def test_sparse_morph_targets(tmp_path: Path) -> None:
    points = ball()[0]
    index, moved = bump()

    def morphed(file: File) -> int:
        return sparse(file, "VEC3", index, moved - points[index], count=len(points))

    file = with_attributes()
    file.tree["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": morphed(file)}]
    file.tree["meshes"][0]["weights"] = [0.5]
    scene = loaded(file, tmp_path)
    assert scene.bounds[1, 1] == pytest.approx(100)
    file.tree["nodes"][0]["weights"] = [1.0]
    assert loaded(file, tmp_path).bounds[1, 1] == pytest.approx(150), "a node's own weights take precedence"


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path, plain: Scene) -> None:
    path = checkered().save(tmp_path / "ball.gltf")
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert difference(load_scene(path), plain) == 0


def test_draco_is_decoded_or_the_error_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the package that decodes Draco, the error names the extension and the package."""
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    file = checkered()
    primitive = file.tree["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    for number in (*primitive["attributes"].values(), primitive["indices"]):
        del file.tree["accessors"][number]["bufferView"]
    for required in (False, True):
        if required:
            file.tree["extensionsRequired"] = ["KHR_draco_mesh_compression"]
        with pytest.raises(ValueError, match=r"KHR_draco_mesh_compression.* DracoPy") as raised:
            load_scene(file.save(tmp_path / "ball.glb"))
        assert "\n" not in str(raised.value) and "zero size" not in str(raised.value)


def test_the_plain_ball_shows_its_checker(plain: Scene) -> None:
    """The picture that all others are compared with shows about four of the eight squares around the ball."""
    seen = picture(plain, size=96)
    row = seen[48]
    reds = row[row[:, 3] > 0, 0] > row[row[:, 3] > 0, 2]
    assert 3 <= np.count_nonzero(np.diff(reds.astype(int))) <= 5
