// The point of the surface at each pixel: its face and its barycentric coordinates.

import package::mesh::{Vertex, ObjectUniforms, color_after, map_coordinates};
import package::targets::{RGBA32Float};

struct Params {
    world_to_clip: mat4x4f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> corners: array<u32>; // indices of the vertices of the faces
@group(0) @binding(4) var base_color_map: texture_2d<f32>;
@group(0) @binding(5) var linear_repeat: sampler;
@group(0) @binding(6) var<storage, read> colors: array<vec4f>; // base colour of each vertex, or one for all

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) barycentric: vec2f,
    @location(1) uv: vec2f,
    @location(2) @interpolate(flat) face: u32,
    @location(3) color: vec3f,
}

struct Receivers {
    @location(0) place: RGBA32Float, // two barycentric coordinates, face, object id
    @location(1) color: RGBA32Float, // the part of the base colour applied after diffusion
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[corners[i]];
    let x = object.object_to_world * vec4f(vertex.position, 1.0);
    let barycentric = vec2f(f32(i % 3u == 0u), f32(i % 3u == 1u));
    let color = colors[min(corners[i], arrayLength(&colors) - 1u)].rgb;
    return Varying(params.world_to_clip * x, barycentric, vec2f(vertex.u, vertex.v), i / 3u, color);
}

@fragment
fn fs(in: Varying) -> Receivers {
    let color_at = map_coordinates(object, in.uv, textureDimensions(base_color_map));
    let color = color_after(object, in.color * textureSample(base_color_map, linear_repeat, color_at).rgb);
    return Receivers(vec4f(in.barycentric, f32(in.face), f32(object.id)), vec4f(color, 1.0));
}
