"""Textures with all wrap modes, and vertex colours, against sampling in numpy."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scenes import ABOVE, MATTE, drawable, lit, plane

from wgsss import frame as shared
from wgsss.bake.samples import Samples
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.registry import METHODS, make_method
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight, Maps, Mesh
from wgsss.scene.material import WRAPS
from wgsss.stage import Stage

Array = np.ndarray[Any, Any]
SIZE = 96
DOWN = DirectionalLight((0, -1, 0), (2.0, 1.0, 0.5))


def to_linear(bytes_: Array) -> Array:
    c = bytes_ / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def fold(index: Array, size: int, wrap: str) -> Array:
    """Return the texel that replaces one beyond the border (glTF 2.0, 3.8.4.4)."""
    if wrap == "repeat":
        return index % size
    if wrap == "clamp":
        return np.clip(index, 0, size - 1)
    index = index % (2 * size)
    return np.where(index < size, index, 2 * size - 1 - index)


def sampled(pixels: Array, uv: Array, wrap: tuple[str, str], nearest: bool) -> Array:
    """Return linear colours of an sRGB image at texture coordinates (..., 2)."""
    linear, (height, width) = to_linear(pixels), pixels.shape[:2]

    def texel(x: Array, y: Array) -> Array:
        return linear[fold(y, height, wrap[1]), fold(x, width, wrap[0])]

    u, v = uv[..., 0] * width, uv[..., 1] * height
    if nearest:
        return texel(np.floor(u).astype(int), np.floor(v).astype(int))
    x, y = np.floor(u - 0.5).astype(int), np.floor(v - 0.5).astype(int)
    a, b = (u - 0.5 - x)[..., None], (v - 0.5 - y)[..., None]
    top = texel(x, y) * (1 - a) + texel(x + 1, y) * a
    return top * (1 - b) + (texel(x, y + 1) * (1 - a) + texel(x + 1, y + 1) * a) * b


def seen_color(gpu: Gpu, scene: Any) -> Array:
    """Return the base colour in the g-buffer, linear."""
    graph = Graph(gpu)
    frame = shared.begin(graph, Stage(gpu, scene), (SIZE, SIZE))
    graph.run(frame.gbuffer.base_color)
    return to_linear(graph.read(frame.gbuffer.base_color)[..., :3])


@pytest.mark.parametrize(("wrap", "nearest"), list(product(product(WRAPS, WRAPS), (False, True))))
def test_textures_wrap_and_interpolate_by_their_sampler(gpu: Gpu, wrap: tuple[str, str], nearest: bool) -> None:
    pixels = np.random.default_rng(5).integers(0, 256, (3, 5, 3)).astype(np.uint8)
    mesh = plane(side=20.0)
    spread = replace(mesh, corner_uvs=mesh.corner_uvs * 4 - 1.5)
    material = replace(MATTE, maps=Maps(base_color=pixels, wrap=wrap, nearest=nearest))
    got = seen_color(gpu, lit(DOWN, mesh=spread, material=material))
    t = ((np.arange(SIZE) + 0.5) / SIZE) * 0.98 + 0.01
    uv = np.stack(np.meshgrid(t, t), axis=-1) * 4 - 1.5
    want = sampled(pixels, uv, wrap, nearest)
    wrong = np.abs(got - want).max(axis=2) > 0.015
    assert wrong.mean() < (0.02 if nearest else 1e-9), "texels' borders may fall on either side of a pixel's middle"


def test_unknown_wrap_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="wrap must be two of repeat, clamp, mirror"):
        Maps(wrap=("repeat", "border"))


def test_slopes_of_a_normal_map_are_scaled(gpu: Gpu) -> None:
    """Slanted light on a plane whose normal map tilts by 30 degrees towards it; scales of 1, 2 and 0."""
    slope = np.round(np.array([-0.5, 0.0, 0.866]) * 127 + 128).astype(np.uint8)
    normal = np.broadcast_to(slope, (2, 2, 3)).copy()
    slanted = DirectionalLight((0.6, -0.8, 0.0), (1.0, 1.0, 1.0))
    for scale in (0.0, 1.0, 2.0):
        graph = Graph(gpu)
        material = replace(MATTE, maps=Maps(normal=normal, normal_scale=scale))
        frame = shared.begin(graph, Stage(gpu, lit(slanted, material=material)), (8, 8))
        graph.run(frame.gbuffer.normal)
        leaning = np.array([-0.5 * scale, 0.866, 0.0])
        got = graph.read(frame.gbuffer.normal)[4, 4, :3]
        assert got == pytest.approx(leaning / np.linalg.norm(leaning), abs=0.01)


def coloured_plane() -> Mesh:
    """Return a plane whose vertices are red at the left and blue at the right."""
    mesh = plane(side=20.0)
    share = (mesh.positions[:, 0] / 20 + 0.5)[mesh.faces]
    return replace(mesh, corner_colors=np.stack([1 - share, np.zeros_like(share) + 0.25, share], axis=-1))


def test_colours_of_vertices_multiply_the_base_colour_texture(gpu: Gpu) -> None:
    pixels = np.full((2, 2, 3), (255, 188, 255), np.uint8)
    got = seen_color(gpu, lit(DOWN, mesh=coloured_plane(), material=replace(MATTE, maps=Maps(base_color=pixels))))
    share = (np.arange(SIZE) + 0.5) / SIZE
    want = np.stack([1 - share, np.full(SIZE, 0.25 * to_linear(np.array(188.0))), share], axis=-1)
    assert got[SIZE // 2] == pytest.approx(want, abs=0.01)


def test_light_that_enters_at_samples_has_the_colours_of_the_vertices(gpu: Gpu) -> None:
    graph, material = Graph(gpu), replace(MATTE, color_after=0.0)
    stage = Stage(gpu, lit(DOWN, mesh=coloured_plane(), material=material))
    frame, body = shared.begin(graph, stage, (8, 8)), stage.bodies[0]
    count = len(body.render_mesh.faces)
    middles = Samples(np.arange(count, dtype=np.int32), np.full((count, 3), 1 / 3), np.ones(count))
    coloured = shared.irradiance_points(frame, body, body.points(middles), count, middles)
    vertices = shared.irradiance_points(frame, body, body.vertices, len(body.render_mesh.vertex))
    graph.run(coloured, vertices)
    x = body.at(middles).position[:, 0]
    got = graph.read(coloured)[:, :3]
    plain = got[:, 0] / (0.5 - x / 20)
    assert plain == pytest.approx(plain[0], rel=1e-4)
    assert got[:, 2] / got[:, 0] == pytest.approx((x / 20 + 0.5) / (0.5 - x / 20) * 0.25, rel=1e-4)
    x = body.mesh.positions[body.render_mesh.vertex][:, 0]
    red = graph.read(vertices)[:, 0]
    assert red == pytest.approx(plain[0] * (0.5 - x / 20), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_draws_colours_of_vertices(gpu: Gpu, name: str) -> None:
    """Where vertices have no red, neither has the image by any method; where they are red, it is that of white."""
    white = plane(side=20.0, cells=4)
    share = np.repeat((white.positions[white.faces].mean(axis=1)[:, :1] > 0).astype(np.float32)[:, None], 3, axis=1)
    halves = replace(white, corner_colors=np.concatenate([share, np.ones_like(share), np.ones_like(share)], axis=2))
    knobs = {"map_size": 128} if "map_size" in METHODS[name].__dataclass_fields__ else {}
    got, plain = (
        Renderer(drawable(lit(DOWN, mesh=mesh), name), make_method(name, knobs), (16, 16), gpu).frame().pixels
        for mesh in (halves, white)
    )
    assert got[8, 1:5, 0].max() <= 0.02 * plain[8, 1:5, 0].max()
    assert got[8, 11:15] == pytest.approx(plain[8, 11:15], rel=0.05, abs=1e-3)
    assert got[8, 1:5, 1] == pytest.approx(plain[8, 1:5, 1], rel=0.05, abs=1e-3)
    assert ABOVE.height == 20
