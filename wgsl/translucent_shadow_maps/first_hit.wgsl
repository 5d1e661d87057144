// A translucent shadow map: position, normal and atlas coordinates of the point where each ray of a light first hits
// one object (d'Eon & Luebke 2007, 14.5.7; Mikkelsen 2009, 3.4).

import package::mesh::{Vertex, ObjectUniforms};
import package::targets::{RGBA32Float, RG32Float, RGBA16Float};

struct Params {
    world_to_clip: mat4x4f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) atlas: vec2f,
}

struct Texel {
    @location(0) x_i: RGBA32Float, // mm, world; alpha: 1 where the ray hits the object
    @location(1) n_i: RGBA16Float,
    @location(2) atlas: RG32Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let x = object.object_to_world * vec4f(vertex.position, 1.0);
    let n = object.object_to_world * vec4f(vertex.normal, 0.0);
    return Varying(params.world_to_clip * x, x.xyz, n.xyz, vertex.atlas);
}

@fragment
fn fs(in: Varying) -> Texel {
    return Texel(vec4f(in.position, 1.0), vec4f(normalize(in.normal), 0.0), in.atlas);
}
