"""The render graph: culling, reuse of resources, checks and times."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.graph import Graph
from wgsss.wgsl import WgslError

SCREEN = """
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, DEPTH, 1.0);
}
const DEPTH: f32 = 0.5;
alias RGBA32Float = vec4f;
struct Out { @location(0) value: RGBA32Float }
"""
FILL = (
    SCREEN
    + """
@group(0) @binding(0) var<uniform> level: f32;
@fragment fn fs() -> Out { return Out(vec4f(level)); }
"""
)
ADD = (
    SCREEN
    + """
@group(0) @binding(0) var left: texture_2d<f32>;
@group(0) @binding(1) var right: texture_2d<f32>;
@fragment fn fs(@builtin(position) p: vec4f) -> Out {
    return Out(textureLoad(left, vec2u(p.xy), 0) + textureLoad(right, vec2u(p.xy), 0));
}
"""
)
COUNT = """
override START: u32 = 0u;
@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
@compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x < arrayLength(&numbers) { numbers[id.x] += START + id.x; }
}
"""


@pytest.fixture
def graph(gpu, modules) -> Graph:
    modules(fill=FILL, add=ADD, count=COUNT)
    return Graph(gpu)


def test_only_passes_that_the_outputs_need_run(graph):
    a = graph.draw("fill", level=1.0, size=(4, 2), label="a")
    b = graph.draw("fill", level=2.0, size=(4, 2), label="b")
    unused = graph.draw("add", left=a, right=b, label="unused")
    total = graph.draw("add", left=a, right=a, label="total")
    graph.run(total)
    assert [p.name for p in graph.ran] == ["fill a", "add total"]
    assert [p.name for p in graph.culled] == ["fill b", "add unused"]
    assert graph.read(total).shape == (2, 4, 4)
    assert (graph.read(total) == 2).all()
    with pytest.raises(WgslError, match="was not among the handles"):
        graph.read(unused)
    assert "fill b" in str(graph) and str(graph).count("culled") == 3
    assert '"fill a" -> "add total"' in graph.dot() and "color=grey" in graph.dot()


def test_transients_share_textures(graph):
    value = graph.draw("fill", level=1.0, size=(64, 64))
    for _ in range(10):
        value = graph.draw("add", left=value, right=value)
    graph.run(value)
    assert (graph.read(value) == 2**10).all()
    assert graph.peak_bytes == 2 * 64 * 64 * 16  # ten passes, never more than a source and a target


def test_pooled_textures_are_cleared(gpu, modules):
    modules(
        fill=FILL,
        half=FILL.replace("fn fs()", "fn fs(@builtin(position) p: vec4f)").replace(
            "return Out", "if p.x < 2.0 { discard; } return Out"
        ),
    )
    for module, expected in (("fill", [3, 3]), ("half", [0, 3])):
        graph = Graph(gpu)
        value = graph.draw(module, level=3.0, size=(4, 1))
        graph.run(value)
        assert graph.read(value)[0, [0, 3], 0].tolist() == expected


def test_drawing_onto_a_target_keeps_it_and_renames_it(gpu, modules):
    modules(
        fill=FILL,
        half=FILL.replace("fn fs()", "fn fs(@builtin(position) p: vec4f)").replace(
            "return Out", "if p.x < 2.0 { discard; } return Out"
        ),
        add=ADD,
    )
    graph = Graph(gpu)
    first = graph.draw("fill", level=1.0, size=(4, 1))
    second = graph.draw("half", level=5.0, into=first)
    graph.run(second)
    assert graph.read(second)[0, :, 0].tolist() == [1, 1, 5, 5]
    with pytest.raises(WgslError, match="stale"):
        graph.draw("add", left=first, right=second)


def test_each_layer_has_its_own_depth_test(gpu, modules):
    near, far = (FILL.replace("DEPTH: f32 = 0.5", f"DEPTH: f32 = {d}") for d in (0.2, 0.8))
    modules(near=near, far=far)
    graph = Graph(gpu)
    layers = graph.texture("layers", (4, 4, 2), "depth32float")
    drawn = graph.draw_outputs("near", level=1.0, size=(4, 4), depth_buffer=layers, layer=0)
    drawn = graph.draw_outputs("far", level=2.0, into=drawn.value, depth_buffer=drawn.depth, layer=0)
    other = graph.draw_outputs("far", level=3.0, size=(4, 4), depth_buffer=drawn.depth, layer=1)
    graph.run(drawn.value, other.depth)
    assert (graph.read(drawn.value) == 1).all()
    np.testing.assert_allclose(graph.read(other.depth)[:, 0, 0, 0], [0.2, 0.8])


def test_compute_makes_and_updates_buffers(graph):
    numbers = graph.dispatch("count", size=10)
    again = graph.dispatch("count", size=10, numbers=numbers, constants={"START": 100})
    graph.run(again)
    assert graph.read(again).tolist() == [2 * i + 100 for i in range(10)]
    with pytest.raises(WgslError, match="no override is called STOP"):
        graph.dispatch("count", size=10, constants={"STOP": 1})


def test_errors_list_the_bindings_of_the_module_and_of_the_call(graph):
    a = graph.draw("fill", level=1.0, size=(2, 2))
    with pytest.raises(
        WgslError,
        match=r"add has the bindings left: texture_2d<f32>, right: .*; got left, rigth; "
        r"missing: right; unknown: rigth \(did you mean 'right'\?\)",
    ):
        graph.draw("add", left=a, rigth=a)
    with pytest.raises(WgslError, match="'right' is a texture_2d<f32>, got float"):
        graph.draw("add", left=a, right=1.0)
    with pytest.raises(WgslError, match="which no pass has written"):
        graph.draw("add", left=a, right=graph.texture("t", (2, 2, 1), "rgba32float"))
    with pytest.raises(WgslError, match="give a size"):
        graph.draw("fill", level=1.0)


def test_draw_and_dispatch_refuse_modules_with_several_outputs(graph):
    with pytest.raises(WgslError, match="fill has the outputs value, depth: use draw_outputs"):
        graph.draw("fill", level=1.0, size=(2, 2), depth_buffer="new")
    outputs = graph.draw_outputs("fill", level=1.0, size=(2, 2), depth_buffer="new")
    assert list(outputs) == ["value", "depth"] and outputs.depth is outputs["depth"]
    with pytest.raises(AttributeError, match="the pass writes value, depth, and no 'dept'"):
        _ = outputs.dept


SHARED = """
@group(1) @binding(0) var<uniform> level: f32;
@group(1) @binding(1) var<uniform> other: f32;
fn doubled(other: f32) -> f32 { return 2.0 * other; }
fn tripled() -> f32 { return 3.0 * other; }
"""
USES_SHARED = (
    "import package::shared::{level, doubled};\n"
    + SCREEN
    + "@fragment fn fs() -> Out { let tripled = 1.0; return Out(vec4f(tripled * doubled(level))); }"
)


def test_imported_bindings_that_no_entry_point_uses_are_not_bound(gpu, modules):
    modules(shared=SHARED, uses=USES_SHARED)
    graph = Graph(gpu)
    value = graph.draw("uses", level=3.0, size=(2, 2))
    graph.run(value)
    assert (graph.read(value) == 6).all()
    with pytest.raises(WgslError, match=r"unknown: other \(no entry point uses it\)"):
        graph.draw("uses", level=3.0, other=1.0, size=(2, 2))


def test_bindings_of_two_files_with_one_number_are_refused(gpu, modules):
    modules(
        shared=SHARED,
        more="@group(1) @binding(0) var<uniform> more: f32;",
        uses="import package::more::{more};\n" + USES_SHARED.replace("doubled(level)", "doubled(level + more)"),
    )
    with pytest.raises(WgslError, match=r"uses: more and level are both @group\(1\) @binding\(0\)"):
        Graph(gpu).draw("uses", level=3.0, more=1.0, size=(2, 2))


def test_times_name_their_clock(graph, gpu):
    a = graph.draw("fill", level=1.0, size=(8, 8))
    b = graph.draw("add", left=a, right=a)
    graph.run(b)
    assert graph.times == {}
    graph.run(b, timed=True)
    assert list(graph.times) == ["fill", "add"] and all(ms > 0 for ms in graph.times.values())
    assert graph.clock == ("fenced wall clock" if gpu.is_cpu else "gpu timestamps")
    assert graph.clock in str(graph)
    assert (graph.read(b) == 2).all()


def test_equal_values_are_uploaded_once(graph):
    a = graph.draw("fill", level=7.0, size=(2, 2))
    b = graph.draw("fill", level=7.0, size=(2, 2))
    c = graph.draw("fill", level=8.0, size=(2, 2))
    total = graph.draw("add", left=graph.draw("add", left=a, right=b), right=c)
    graph.run(total)
    assert (graph.read(total) == 22).all()
    assert graph.uploaded_bytes == 2 * 256
