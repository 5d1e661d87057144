// Draws the faces of a mesh into its atlas: face + 1 in each texel that a face covers, else 0. Of faces that overlap,
// the one drawn last remains: two drawings in opposite orders differ exactly where faces overlap.

import package::targets::{R32Uint};

struct Params {
    face_count: u32,
    reverse: u32, // 1: draw the faces in reverse order
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corner_uvs: array<vec2f>; // three per face

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) face: u32,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let face = select(i / 3, params.face_count - 1 - i / 3, params.reverse == 1);
    let uv = corner_uvs[3 * face + i % 3];
    return Varying(vec4f(2 * uv.x - 1, 1 - 2 * uv.y, 0, 1), face);
}

struct Texel {
    @location(0) face: R32Uint,
}

@fragment
fn fs(in: Varying) -> Texel {
    return Texel(in.face + 1);
}
