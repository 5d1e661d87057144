// What the march needs of the surface at each pixel, beside the g-buffer: the mesh's own texture coordinates, their
// gradients along the surface, and its curvature. Drawn only for methods that ask for it.
//
// Gradients and curvature are those of the face, from the differences of position, texture coordinates and normal of
// its vertices as posed. Nothing is baked, so that a mesh may deform.

import package::mesh::{Vertex, ObjectUniforms};
import package::targets::{RGBA32Float, RG32Float, RGBA16Float};
import package::subsurface_texture_mapping::tangents::{Tangents, tangents_of};

struct Params {
    world_to_clip: mat4x4f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var normal: texture_2d<f32>; // of the g-buffer

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) direction: vec3f, // the normal of the vertices
    @location(2) uv: vec2f,
}

struct Texel {
    @location(0) mesh_uv: RGBA32Float,    // u, v, and the gradient of u, 1/mm, along the tangents
    @location(1) v_gradient: RG32Float,   // 1/mm, along the tangents
    @location(2) curvatures: RGBA16Float, // the shape operator in the tangents: 11, 12, 22; 1/mm, above 0 where convex
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let x = object.object_to_world * vec4f(vertex.position, 1.0);
    let n = object.object_to_world * vec4f(vertex.normal, 0.0);
    return Varying(params.world_to_clip * x, x.xyz, n.xyz, vec2f(vertex.u, vertex.v));
}

@fragment
fn fs(in: Varying) -> Texel {
    let dx = dpdx(in.position);
    let dy = dpdy(in.position);
    let du = vec2f(dpdx(in.uv.x), dpdy(in.uv.x));
    let dv = vec2f(dpdx(in.uv.y), dpdy(in.uv.y));
    let n = normalize(textureLoad(normal, vec2u(in.clip.xy), 0).xyz);
    let side = select(-1.0, 1.0, dot(n, in.direction) >= 0.0); // -1 where the g-buffer has reversed the normal
    let n_dx = side * dpdx(in.direction);
    let n_dy = side * dpdy(in.direction);
    let tangents = tangents_of(n);
    // The gradient of a quantity with the differences d along the picture is d.x * dual_x + d.y * dual_y.
    let across = cross(dx, dy);
    let size = max(dot(across, across), 1e-30);
    let dual_x = cross(dy, across) / size;
    let dual_y = cross(across, dx) / size;
    let x = vec2f(dot(dual_x, tangents.first), dot(dual_x, tangents.second));
    let y = vec2f(dot(dual_y, tangents.first), dot(dual_y, tangents.second));
    let along_first = n_dx * x.x + n_dy * y.x; // how the normal turns along the tangents
    let along_second = n_dx * x.y + n_dy * y.y;
    let s11 = dot(along_first, tangents.first);
    let s12 = 0.5 * (dot(along_first, tangents.second) + dot(along_second, tangents.first));
    let s22 = dot(along_second, tangents.second);
    return Texel(vec4f(in.uv, du.x * x + du.y * y), dv.x * x + dv.y * y, vec4f(s11, s12, s22, 0.0));
}
