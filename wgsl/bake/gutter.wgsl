// Draws the gutter: seam + 1 in the texels around each border edge of a chart that are nearer to it than to other
// edges.
//
// The depth is the distance to the edge. The depth buffer also protects the texels inside charts, which have depth 0.

import package::targets::{R32Uint};

// If the nearest point is a corner, two edges are equally near: this small weight of the distance along an edge, beyond
// its end, decides.
const OVERSHOOT: f32 = 1e-3;
const GUTTER: f32 = 3.0;  // texels: width of the gutter, which the footprint of a filter at a border can reach
const BEHIND: f32 = 0.05; // texels: uncovered centres may lie inside the edge by this much, by rounding

struct Params {
    size: f32, // width and height of the map, texels
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
