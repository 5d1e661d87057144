"""Leaves: quads that are cut by the alpha of their texture (glTF alphaMode MASK)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import difference, encoded, picture, scene_and_notes, texture, transformed
from gltfs import File

from wgsss import render
from wgsss.errors import InputError
from wgsss.scene import DirectionalLight, Mesh, OrthographicCamera, Scene, load_mesh, load_scene

Array = np.ndarray[Any, Any]

SIDE = 0.1  # metres
A, B = 0.24, 0.4  # half axes of the ellipse, as shares of the side of the quad
GREEN = (30, 120, 20)


def leaf(size: int = 64, low: int = 0, soft: bool = False) -> Array:
    """Return uint8 (size, size, 4): green, with alpha 255 in an ellipse and `low` around it."""
    t = (np.arange(size) + 0.5) / size - 0.5
    r = np.hypot(t[None, :] / A, t[:, None] / B)
    share = np.clip((1 - r) * 3 + 0.5, 0, 1) if soft else (r < 1).astype(float)
    image = np.empty((size, size, 4), np.uint8)
    image[..., :3], image[..., 3] = GREEN, np.round(low + (255 - low) * share)
    return image


def material_of(file: File, image: Array, **fields: Any) -> int:
    """Add a masked material. `info` and `sampling` are fields of the texture, `alpha` is that of the base colour."""
    base = {"index": texture(file, encoded(image), **fields.pop("sampling", {})), **fields.pop("info", {})}
    pbr = {"baseColorTexture": base, "metallicFactor": 0}
    if "alpha" in fields:
        pbr["baseColorFactor"] = [1, 1, 1, fields.pop("alpha")]
    return file.add("materials", pbrMetallicRoughness=pbr, **{"alphaMode": "MASK", "doubleSided": True, **fields})


def quad(file: File, material: int, shift: Any = (0, 0, 0), uvs: Any = None, **fields: Any) -> dict[str, Any]:
    """Make an upright square that faces +z."""
    corners = np.array([(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]) * SIDE + shift
    own = [(0, 1), (1, 1), (1, 0), (0, 0)] if uvs is None else uvs
    attributes = {"TEXCOORD_0": file.rows(own, "VEC2"), **fields.pop("attributes", {})}
    return file.primitive(corners, [(0, 1, 2), (0, 2, 3)], material=material, attributes=attributes, **fields)


def masked(image: Array | None = None, uvs: Any = None, **material: Any) -> File:
    file = File()
    file.node(mesh=file.mesh(quad(file, material_of(file, leaf() if image is None else image, **material), uvs=uvs)))
    return file


def area(mesh: Mesh) -> float:
    """Return the area of a mesh as a share of the area of the quad."""
    return mesh.area / (SIDE * 1000) ** 2


def cut(file: File, path: Path, **options: Any) -> Scene:
    """Load the scene of a leaf. Its only warnings are about boundary edges."""
    scene, lines = scene_and_notes(file, path, **options)
    assert all("boundary edge" in line for line in lines), lines
    return scene


ELLIPSE = math.pi * A * B


def test_a_leaf_is_cut_to_its_ellipse(tmp_path: Path) -> None:
    scene = cut(masked(), tmp_path)
    assert area(scene.objects[0].mesh) == pytest.approx(ELLIPSE, rel=0.02)
    seen = picture(scene, size=96)[..., 3] > 0
    tall, wide = np.ptp(np.flatnonzero(seen.any(axis=1))), np.ptp(np.flatnonzero(seen.any(axis=0)))
    assert wide / tall == pytest.approx(A / B * math.cos(math.radians(20)), rel=0.08)
    assert seen.sum() == pytest.approx(math.pi / 4 * wide * tall, rel=0.08), "an ellipse, not a rectangle"
    colour = picture(scene, size=96)[48, 48]
    assert colour[1] > 2 * colour[0] and colour[1] > 2 * colour[2]


@pytest.mark.parametrize(
    ("material", "radius"),
    [
        ({"alphaCutoff": 0.1}, 1 + 0.4 / 3),  # alpha is (1 - r) * 3 + 0.5 near the outline
        ({"alphaCutoff": 0.9}, 1 - 0.4 / 3),
        ({}, 1.0),
        ({"alphaCutoff": 0.45, "alpha": 0.5}, 1 - 0.4 / 3),
        ({"alpha": 0.8}, 1 - 0.125 / 3),
    ],
)
def test_the_outline_follows_the_alpha_cutoff(tmp_path: Path, material: dict[str, Any], radius: float) -> None:
    scene = cut(masked(leaf(soft=True, size=128), **material), tmp_path)
    assert area(scene.objects[0].mesh) == pytest.approx(ELLIPSE * radius**2, rel=0.01)


@pytest.mark.parametrize(
    ("image", "material"),
    [
        (leaf()[..., :3], {}),
        (leaf(low=200), {}),
        (leaf(), {"alphaCutoff": 0.0}),
        (leaf(), {"alphaMode": "OPAQUE"}),
        (leaf()[..., :3], {"alpha": 0.5}),
        (leaf(), {"alphaMode": "OPAQUE", "alphaCutoff": 0.9, "alpha": 0.1}),
    ],
)
def test_a_mask_without_effect_keeps_the_whole_quad(tmp_path: Path, image: Array, material: dict[str, Any]) -> None:
    """The image has no alpha, or its alpha is above the cutoff, or the cutoff is 0, or there is no mask."""
    mesh = cut(masked(image, **material), tmp_path).objects[0].mesh
    assert len(mesh.faces) == 2 and area(mesh) == pytest.approx(1)


@pytest.mark.parametrize(
    ("image", "material"),
    [(leaf(low=0) * [1, 1, 1, 0], {}), (leaf()[..., :3], {"alpha": 0.4}), (leaf(), {"alphaCutoff": 1.5})],
)
def test_a_mask_that_leaves_nothing_is_an_error(tmp_path: Path, image: Array, material: dict[str, Any]) -> None:
    path = masked(image.astype(np.uint8), **material).save(tmp_path / "leaf.glb")
    with pytest.warns(UserWarning, match="nothing is drawn where alpha is below"):
        with pytest.raises(InputError, match=r"leaf\.glb: .*its alpha mask leaves nothing$"):
            load_scene(path)


def test_a_mask_that_removes_one_of_two_materials_is_noted(tmp_path: Path) -> None:
    file = File()
    gone = material_of(file, (leaf() * [1, 1, 1, 0]).astype(np.uint8), name="gone")
    file.node(mesh=file.mesh(quad(file, gone), quad(file, material_of(file, leaf()), (0.2, 0, 0))))
    scene, lines = scene_and_notes(file, tmp_path)
    assert len(scene.objects) == 1 and scene.bounds[0, 0] > 100
    assert [line for line in lines if "boundary" not in line] == [
        "gone: nothing is drawn where alpha is below 0.5, which is everywhere"
    ]


@pytest.mark.parametrize(
    "transform",
    [
        {"scale": [3, 3]},
        {"offset": [0.5, 0.0]},
        {"scale": [0.5, 0.5], "offset": [0.25, 0.25]},
        {"rotation": 0.5, "offset": [0.1, -0.2], "scale": [2, 1]},
    ],
)
def test_a_mask_follows_the_texture_transform(tmp_path: Path, transform: dict[str, Any]) -> None:
    """The result is that of transformed coordinates."""
    baked = transformed(np.array([(0, 1), (1, 1), (1, 0), (0, 0)]), **transform)
    by_info = masked(leaf(128), info={"extensions": {"KHR_texture_transform": transform}})
    scenes = [cut(file, tmp_path) for file in (by_info, masked(leaf(128), baked))]
    meshes = [scene.objects[0].mesh for scene in scenes]
    assert 0.1 < area(meshes[0]) < 0.98 and len(meshes[0].faces) > 50
    assert area(meshes[0]) == pytest.approx(area(meshes[1]), rel=1e-4)
    assert difference(*scenes) <= 1


@pytest.mark.parametrize(("wrap", "share"), [(10497, 9.0), (33648, 9.0), (33071, 1.0)])
def test_a_mask_repeats_according_to_its_sampler(tmp_path: Path, wrap: int, share: float) -> None:
    """Coordinates from -1 to 2 show nine leaves if they repeat, and one leaf if they are clamped."""
    uvs = np.array([(0, 1), (1, 1), (1, 0), (0, 0)]) * 3 - 1
    file = masked(leaf(96), uvs, sampling={"sampler": 0})
    file.add("samplers", wrapS=wrap, wrapT=wrap)
    assert area(cut(file, tmp_path).objects[0].mesh) == pytest.approx(ELLIPSE * share / 9, rel=0.02)


def test_a_mask_without_interpolation_has_square_corners(tmp_path: Path) -> None:
    """Of four by four texels, the four in the middle are opaque. With NEAREST, they give a square."""
    image = np.zeros((4, 4, 4), np.uint8)
    image[1:3, 1:3] = 255
    file = masked(image, sampling={"sampler": 0})
    file.add("samplers", magFilter=9728, minFilter=9728)
    mesh = cut(file, tmp_path).objects[0].mesh
    assert area(mesh) == pytest.approx(0.25, rel=0.03)
    corners = np.abs(mesh.positions[:, :2] / 1000 / SIDE).sum(axis=1)
    assert corners.max() > 0.47, "corners, at 0.5, are not cut off"


def test_a_mask_on_a_skinned_and_animated_leaf_moves_with_it(tmp_path: Path) -> None:
    """The cut leaf lies on the quad at every time: points with equal texture coordinates coincide.

    The upper half of the quad follows a joint that rotates.
    """
    posed = []
    for mode in ("OPAQUE", "MASK"):
        file = masked(alphaMode=mode)
        primitive = file.tree["meshes"][0]["primitives"][0]
        share = np.array([(1, 0, 0, 0), (1, 0, 0, 0), (0.2, 0.8, 0, 0), (0, 1, 0, 0)])
        primitive["attributes"]["JOINTS_0"] = file.rows(np.tile((0, 1, 0, 0), (4, 1)), "VEC4", "u1")
        primitive["attributes"]["WEIGHTS_0"] = file.rows(share, "VEC4")
        lower, upper = file.node(), file.node()
        file.add("skins", joints=[lower, upper])
        file.tree["nodes"][0]["skin"] = 0
        half = math.sqrt(0.5)
        times, turns = file.rows([0, 1], "SCALAR"), file.rows([(0, 0, 0, 1), (half, 0, 0, half)], "VEC4")
        channel = {"sampler": 0, "target": {"node": upper, "path": "rotation"}}
        file.add("animations", channels=[channel], samplers=[{"input": times, "output": turns}])
        posed.append(cut(file, tmp_path).objects[0])
    whole, part = posed
    assert len(part.mesh.faces) > 100 and area(part.mesh) == pytest.approx(ELLIPSE, rel=0.02)
    for time_s in (0.0, 0.5, 0.9):
        quad_now, part_now = whole.at(time_s).mesh, part.at(time_s).mesh
        uvs, at = part_now.corner_uvs.reshape(-1, 2), part_now.positions[part_now.faces].reshape(-1, 3)
        expected = []
        for triangle, places in zip(quad_now.corner_uvs, quad_now.positions[quad_now.faces], strict=True):
            weights = np.linalg.solve(np.vstack([triangle.T, np.ones(3)]), np.vstack([uvs.T, np.ones(len(uvs))])).T
            expected.append(np.where((weights > -1e-4).all(axis=1)[:, None], weights @ places, np.nan))
        near = np.nanmin([np.linalg.norm(at - e, axis=1) for e in expected], axis=0)
        assert near.max() < 0.01, f"mm, at {time_s} s"


def test_thin_stems_keep_their_width(tmp_path: Path) -> None:
    """A stem two texels wide runs diagonally over an image of 256 texels. No part of it is lost."""
    y, x = np.mgrid[:256, :256] + 0.5
    stem = leaf(256)
    stem[..., 3] = 255 * (np.abs(y * 0.6 + x * 0.8 - 180) < 1)
    mesh = cut(masked(stem), tmp_path).objects[0].mesh
    assert area(mesh) == pytest.approx((stem[..., 3] > 0).mean(), rel=0.05)


def test_two_materials_have_separate_masks(tmp_path: Path) -> None:
    file = File()
    small = leaf()
    small[:, :32, 3] = 0
    materials = [material_of(file, leaf()), material_of(file, small)]
    file.node(mesh=file.mesh(quad(file, materials[0]), quad(file, materials[1], (0.2, 0, 0))))
    whole, half = (o.mesh for o in cut(file, tmp_path).objects)
    assert area(half) == pytest.approx(area(whole) / 2, rel=0.03)


def test_leaves_of_one_material_keep_their_mask_in_one_mesh(tmp_path: Path) -> None:
    """`load_mesh` joins all parts into one mesh."""
    file = File()
    material = material_of(file, leaf())
    file.node(mesh=file.mesh(quad(file, material), quad(file, material, (0.2, 0, 0))))
    with pytest.warns(UserWarning, match="boundary edges"):
        assert area(load_mesh(file.save(tmp_path / "leaf.glb")).mesh) == pytest.approx(2 * ELLIPSE, rel=0.02)


def test_a_leaf_casts_the_shadow_of_its_outline(tmp_path: Path) -> None:
    """A wall behind the leaf is lit from the front. Its shadow is an ellipse and not a square."""
    file = File()
    white = file.add("materials", name="wall", pbrMetallicRoughness={"metallicFactor": 0})
    wall = file.primitive(
        np.array([(-0.2, -0.2, -0.1), (0.2, -0.2, -0.1), (0.2, 0.2, -0.1), (-0.2, 0.2, -0.1)]),
        [(0, 1, 2), (0, 2, 3)],
        material=white,
    )
    file.node(mesh=file.mesh(quad(file, material_of(file, leaf())), wall))
    # From the front left: the shadow falls 100 mm to the right of the leaf.
    lights, camera = (
        [DirectionalLight((1.0, 0, -1), (1, 1, 1))],
        OrthographicCamera((100, 0, 300), (100, 0, 0), height=100),
    )
    dark = render(cut(file, tmp_path, lights=lights, camera=camera), "lambert", (64, 64)).pixels[..., 0] < 1e-3
    assert dark.mean() == pytest.approx(ELLIPSE, rel=0.1)
    assert not dark[:12, :12].any() and dark[32, 32]


def test_a_masked_leaf_looks_like_a_polygon(tmp_path: Path) -> None:
    """A masked leaf looks like a polygon with the same outline and texture."""
    cut_out = cut(masked(leaf(256)), tmp_path)
    turns = np.linspace(0, 2 * np.pi, 73)[:-1]
    rim = np.stack([A * np.cos(turns), B * np.sin(turns), 0 * turns], axis=1)
    points = np.concatenate([[(0, 0, 0)], rim]) * SIDE
    faces = [(0, i + 1, (i + 1) % 72 + 1) for i in range(72)]
    file = File()
    uvs = file.rows(points[:, :2] / SIDE * [1, -1] + 0.5, "VEC2")
    material = material_of(file, leaf(256), alphaMode="OPAQUE")
    file.node(mesh=file.mesh(file.primitive(points, faces, material=material, attributes={"TEXCOORD_0": uvs})))
    polygon = cut(file, tmp_path)
    a, b = picture(cut_out, size=96), picture(polygon, size=96)
    assert (np.abs(a - b).max(axis=2) > 3).mean() < 0.02
