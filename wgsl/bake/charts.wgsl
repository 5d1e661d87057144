// Draws the charts of an atlas: the chart that covers each texel, and the gradients of the atlas coordinates over the
// surface there.

import package::charts::{INSIDE};
import package::targets::{R32Uint, RGBA16Float};

struct Params {
    size: f32, // width and height of the map, texels
}

struct Vertex {
    atlas: vec2f,
    root: vec3f,    // p, q, r of the symmetric root [p q; q r] of the inverse metric, uv per mm
    along_u: vec3f, // along_u and along_v: orthonormal directions on the surface, those of the columns of the root
    along_v: vec3f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(2) var<storage, read> faces: array<u32>; // three vertices each
@group(0) @binding(3) var<storage, read> face_charts: array<u32>;

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) root: vec3f,
    @location(1) along_u: vec3f,
    @location(2) along_v: vec3f,
    @location(3) @interpolate(flat, either) chart: u32,
}

struct Texel {
    @location(0) ids: R32Uint,
    @location(1) gradient_u: RGBA16Float, // texels per mm
    @location(2) gradient_v: RGBA16Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[faces[i]];
    let clip = vec4f(2.0 * vertex.atlas.x - 1.0, 1.0 - 2.0 * vertex.atlas.y, 0.0, 1.0);
    return Varying(clip, vertex.root, vertex.along_u, vertex.along_v, face_charts[i / 3u]);
}

@fragment
fn fs(in: Varying) -> Texel {
    // Interpolated directions are not orthonormal. The nearest orthonormal ones follow from the inverse square root of
    // their Gram matrix (a b; b c), which is [c+s -b; -b a+s] / (s sqrt(a + c + 2 s)), where s is the root of its
    // determinant.
    let a = dot(in.along_u, in.along_u);
    let b = dot(in.along_u, in.along_v);
    let c = dot(in.along_v, in.along_v);
    let s = sqrt(max(a * c - b * b, 1e-12));
    let scale = params.size / (s * sqrt(a + c + 2.0 * s));
    let along_u = scale * ((c + s) * in.along_u - b * in.along_v);
    let along_v = scale * ((a + s) * in.along_v - b * in.along_u);
    let gradient_u = in.root.x * along_u + in.root.y * along_v;
    let gradient_v = in.root.y * along_u + in.root.z * along_v;
    return Texel(INSIDE | in.chart, vec4f(gradient_u, 0.0), vec4f(gradient_v, 0.0));
}
