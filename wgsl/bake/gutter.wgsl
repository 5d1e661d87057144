// Draws around each border edge of a chart the texels that are nearer to it than to any other border: seam + 1.
// The depth buffer keeps the nearest one, and what the charts themselves cover (at depth 0).

import package::targets::{R32Uint};

// Of two edges that meet at the nearest corner, the one that a texel overshoots less is to win.
const OVERSHOOT: f32 = 1e-3;
const GUTTER: f32 = 3.0;    // texels: what the footprint of a filter at a border can touch
const BEHIND: f32 = 0.05; // texels: how far inside the edge a centre that no face covers may be, by rounding

struct Params {
    size: f32, // of the map, texels
}

struct Edge {
    a: vec2f, // uv
    b: vec2f,
    outward: f32, // +1: the outside is to the left of a -> b (u right, v down), -1: to its right
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> edges: array<Edge>;

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) edge: u32,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let edge = edges[i / 6];
    let a = params.size * edge.a;
    let along = normalize(params.size * edge.b - a);
    let out = edge.outward * vec2f(-along.y, along.x);
    let corner = array(vec2f(0, 0), vec2f(1, 0), vec2f(1, 1), vec2f(0, 0), vec2f(1, 1), vec2f(0, 1))[i % 6];
    let x = mix(-GUTTER, params.size * distance(edge.a, edge.b) + GUTTER, corner.x);
    let uv = (a + x * along + mix(-BEHIND, GUTTER, corner.y) * out) / params.size;
    return Varying(vec4f(2 * uv.x - 1, 1 - 2 * uv.y, 0, 1), i / 6);
}

struct Texel {
    @location(0) ids: R32Uint,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fs(in: Varying) -> Texel {
    let edge = edges[in.edge];
    let to_b = params.size * (edge.b - edge.a);
    let from_a = in.clip.xy - params.size * edge.a;
    let t = dot(from_a, to_b) / dot(to_b, to_b);
    let d = distance(from_a, saturate(t) * to_b);
    if d > GUTTER {
        discard;
    }
    let overshoot = length(to_b) * max(abs(t - 0.5) - 0.5, 0);
    return Texel(in.edge + 1, (0.01 + d + OVERSHOOT * overshoot) / (2 * GUTTER));
}
