"""Reading WGSL modules: imports, errors, memory layouts. The GPU reads each field back from the packed bytes."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss import wgsl
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.wgsl import WgslError

EVERY_FIELD = """
struct Inner { a: vec3f, b: f32, c: array<PAIR, 3>, }
struct All {
    f: f32, v3: vec3f, i: i32, u: u32,
    v2: vec2f, v4: vec4f, vi: vec3i, vu: vec2u,
    m2: mat2x2f, m3: mat3x3f, m4: mat4x4<f32>, m34: mat3x4f, m43: mat4x3f, m23: mat2x3f,
    inner: Inner, list: array<vec4f, N>, pad: f32, more: array<Inner, 2>, last: vec3<f32>,
}
const N: u32 = 2u;
"""
READ_BACK = [  # an expression of vec4f for each field, and what it must be
    ("vec4f(all.f, f32(all.i), f32(all.u), all.pad)", lambda v: [v["f"], v["i"], v["u"], v["pad"]]),
    ("vec4f(all.v3, all.v2.y)", lambda v: [*v["v3"], v["v2"][1]]),
    ("all.v4", lambda v: v["v4"]),
    ("vec4f(vec3f(all.vi), f32(all.vu.y))", lambda v: [*v["vi"], v["vu"][1]]),
    ("vec4f(all.m2[0], all.m2[1])", lambda v: [*v["m2"][:, 0], *v["m2"][:, 1]]),
    ("vec4f(all.m3[2], all.m3[0].y)", lambda v: [*v["m3"][:, 2], v["m3"][1, 0]]),
    ("all.m4 * vec4f(1.0, 2.0, 3.0, 4.0)", lambda v: v["m4"] @ [1, 2, 3, 4]),
    ("all.m34[2]", lambda v: v["m34"][:, 2]),
    ("vec4f(all.m43[3], all.m23[1].z)", lambda v: [*v["m43"][:, 3], v["m23"][2, 1]]),
    ("vec4f(all.inner.a, all.inner.b)", lambda v: [*v["inner"]["a"], v["inner"]["b"]]),
    ("vec4f(all.inner.c[2].xy, all.list[1].zw)", lambda v: [*v["inner"]["c"][2][:2], *v["list"][1][2:]]),
    (
        "vec4f(all.more[1].c[1].xy, all.more[1].b, all.more[0].b)",
        lambda v: [*v["more"]["c"][1][1][:2], v["more"]["b"][1], v["more"]["b"][0]],
    ),
    ("vec4f(all.last, 1.0)", lambda v: [*v["last"], 1]),
]


def random_all(rng, pair):
    def number(*shape):
        return rng.uniform(-9, 9, shape).astype(np.float32)

    return dict(
        f=number(),
        v3=number(3),
        i=-7,
        u=9,
        v2=number(2),
        v4=number(4),
        vi=np.array([1, -2, 3]),
        vu=np.array([4, 5]),
        m2=number(2, 2),
        m3=number(3, 3),
        m4=number(4, 4),
        m34=number(4, 3),
        m43=number(3, 4),
        m23=number(3, 2),
        inner=dict(a=number(3), b=number(), c=number(3, pair)),
        list=number(2, 4),
        pad=number(),
        more=dict(a=number(2, 3), b=number(2), c=number(2, 3, pair)),
        last=number(3),
    )


@pytest.mark.parametrize(
    ("space", "pair"), [("uniform", 4), ("storage, read", 2)]
)  # uniform arrays need a stride of 16
def test_gpu_reads_each_field_where_it_was_packed(gpu: Gpu, modules, space, pair):
    body = "\n".join(f"    values[{i}] = {expression};" for i, (expression, _) in enumerate(READ_BACK))
    modules(
        probe=EVERY_FIELD.replace("PAIR", f"vec{pair}f")
        + f"""
@group(0) @binding(0) var<{space}> all: All;
@group(0) @binding(1) var<storage, read_write> values: array<vec4f>;
@compute @workgroup_size(1) fn main() {{
{body}
}}"""
    )
    value = random_all(np.random.default_rng(1), pair)
    graph = Graph(gpu)
    values = graph.dispatch("probe", size=len(READ_BACK), all=value)
    graph.run(values)
    np.testing.assert_allclose(graph.read(values), [expected(value) for _, expected in READ_BACK], rtol=1e-6)


def test_arrays_of_structs_pack_from_dicts_and_structured_arrays(modules):
    modules(m="struct L { p: vec3f, k: f32, q: vec3f } @group(0) @binding(0) var<storage> ls: array<L>;")
    layout = wgsl.load("m").layout("array<L>")
    columns = dict(p=np.arange(6).reshape(2, 3), k=[7, 8], q=np.ones((2, 3)))
    rows = [dict(p=[0, 1, 2], k=7, q=[1, 1, 1]), dict(p=[3, 4, 5], k=8, q=[1, 1, 1])]
    assert layout.pack(columns) == layout.pack(rows)
    assert len(layout.pack(rows)) == 2 * 32
    structured = np.zeros(2, layout.dtype)
    structured["p"], structured["k"], structured["q"] = columns["p"], columns["k"], columns["q"]
    assert layout.pack(structured) == layout.pack(rows)
    assert len(layout.pack([])) == 32  # a binding cannot be empty


@pytest.mark.parametrize(
    ("value", "complaint"),
    [
        (dict(p=[1, 2, 3]), "has the fields k, p; got p"),
        (dict(p=[1, 2], k=0), r"S.p: expected shape \(3,\)"),
        (dict(p=[1, 2, 3], k=0, x=1), "got k, p, x"),
        (3.0, "expected a dict"),
    ],
)
def test_errors_of_packing_name_the_field(modules, value, complaint):
    modules(m="struct S { p: vec3f, k: f32 }")
    with pytest.raises(WgslError, match=complaint):
        wgsl.load("m").layout("S").pack(value)


def test_imports_include_a_file_once_and_check_names(modules):
    modules(
        base="fn one() -> f32 { return 1.0; }",
        left="import package::base::{one};\nfn left() -> f32 { return one(); }",
        top="import package::left::{left};\nimport package::base::one;\nfn top() -> f32 { return left() + one(); }",
    )
    module = wgsl.load("top")
    assert module.source.count("fn one") == 1
    assert "import" not in module.source
    modules(wrong="// a comment\nimport package::base::{two};")
    with pytest.raises(WgslError, match=r"wrong.wgsl:2: base.wgsl does not declare two"):
        wgsl.load("wrong")
    modules(lost="import package::nowhere::x;")
    with pytest.raises(WgslError, match=r"lost.wgsl:1: no module 'nowhere'"):
        wgsl.load("lost")
    modules(a="import package::b::y;\nfn x() {}", b="import package::a::x;\nfn y() {}")
    with pytest.raises(WgslError, match="circular import a -> b -> a"):
        wgsl.load("a")


def test_compiler_errors_point_into_the_imported_file(gpu, modules):
    modules(
        base="\n\nfn one() -> f32 { return missing; }",
        top="import package::base::one;\n@compute @workgroup_size(1) fn main() { _ = one(); }",
    )
    with pytest.raises(WgslError, match=r"base\.wgsl:3:26"):
        gpu.shader(wgsl.load("top"))


def test_reads_bindings_targets_and_workgroups(modules):
    modules(
        m="""
const TILE: u32 = 8u;
override COUNT: u32 = 4u;
alias RGBA16Float = vec4f; alias R32Uint = u32;
struct Out { @location(1) id: R32Uint, @location(0) light: RGBA16Float, }
@group(0) @binding(0) var<uniform> params: vec4f; // not this: @group(0) @binding(9) var x: f32;
@group(0) @binding(1) var map: texture_2d<f32>;
@group(0) @binding(2) var linear_clamp: sampler;
@group(0) @binding(3) var<storage, read_write> out: array<vec4f>;
@group(0) @binding(4) var image: texture_storage_2d<rgba16float, write>;
@fragment fn fs() -> Out { return Out(1u, vec4f()); }
@compute @workgroup_size(TILE, COUNT) fn cs() { }
"""
    )
    module = wgsl.load("m")
    kinds = {n: (b.number, b.space, b.access) for n, b in module.bindings.items()}
    assert kinds == {
        "params": (0, "uniform", "read"),
        "map": (1, "texture", "read"),
        "linear_clamp": (2, "sampler", "read"),
        "out": (3, "storage", "read_write"),
        "image": (4, "storage_texture", "write"),
    }
    assert module.targets == (("light", "rgba16float"), ("id", "r32uint"))
    assert module.workgroup_size({}) == (8, 4, 1)
    assert module.workgroup_size({"COUNT": 2}) == (8, 2, 1)
    assert module.stages == {"fragment": "fs", "compute": "cs"}
