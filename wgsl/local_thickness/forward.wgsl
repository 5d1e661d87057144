// M_back of one object, computed at its vertices and interpolated at the pixels.

import package::mesh::{Vertex, ObjectUniforms};
import package::screen::{direction_to_eye, is_hidden};
import package::local_thickness::transport::{Transport, light_out};
import package::targets::{RGBA32Float};

override MAPPED: bool = true; // whether the base colour varies over the object

struct Params {
    world_to_clip: mat4x4f,
    eye: vec4f,
    albedo: vec3f, // cDiffuseAlbedo, without the base colour of the g-buffer
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> transport: Transport;
@group(0) @binding(2) var<uniform> object: ObjectUniforms;
@group(0) @binding(3) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(4) var<storage, read> thickness: array<vec4f>; // by vertex of the mesh
@group(0) @binding(5) var base_color: texture_2d<f32>;
@group(0) @binding(6) var depth: texture_depth_2d;

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) M_back: vec3f,
}

struct Pixel {
    @location(0) M_back: RGBA32Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let x = (object.object_to_world * vec4f(vertex.position, 1.0)).xyz;
    let n = (object.object_to_world * vec4f(vertex.normal, 0.0)).xyz;
    let w_o = direction_to_eye(params.eye, x);
    let light = light_out(transport, x, n, w_o);
    return Varying(params.world_to_clip * vec4f(x, 1.0), params.albedo * light * thickness[vertex.welded].rgb);
}

@fragment
fn fs(in: Varying) -> Pixel {
    if is_hidden(in.clip, depth) {
        discard;
    }
    if MAPPED {
        return Pixel(vec4f(in.M_back * textureLoad(base_color, vec2u(in.clip.xy), 0).rgb, 1.0));
    }
    return Pixel(vec4f(in.M_back, 1.0));
}
