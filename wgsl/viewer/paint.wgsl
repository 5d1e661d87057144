// Draw one object in colours given at its vertices.

import package::mesh::{Vertex, ObjectUniforms};
import package::targets::{RGBA8UnormSrgb};

struct Params {
    world_to_clip: mat4x4f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> colors: array<vec4f>; // by render vertex, linear

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) color: vec3f,
}

struct Pixel {
    @location(0) display: RGBA8UnormSrgb,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let x = object.object_to_world * vec4f(vertices[i].position, 1.0);
    return Varying(params.world_to_clip * x, colors[i].rgb);
}

@fragment
fn fs(in: Varying) -> Pixel {
    return Pixel(vec4f(in.color, 1.0));
}
