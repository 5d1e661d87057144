// The g-buffer: the object that each pixel shows, its atlas coordinates there, normal, base colour and specular scale.

import package::units::{Number};
import package::mesh::{Vertex, ObjectUniforms, bent_normal, map_coordinates};
import package::targets::{RGBA32Float, RGBA16Float, RGBA8UnormSrgb};

struct Params {
    world_to_clip: mat4x4f,
    eye: vec4f, // xyz, 1: the camera's position; xyz, 0: the direction towards it
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var base_color_map: texture_2d<f32>;
@group(0) @binding(4) var normal_map: texture_2d<f32>;
@group(0) @binding(5) var specular_map: texture_2d<f32>;
@group(0) @binding(6) var linear_repeat: sampler;
@group(0) @binding(7) var<storage, read> colors: array<vec4f>; // of each render vertex, or one for all

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) atlas: vec2f,
    @location(4) sky: Number,
    @location(5) color: vec3f,
}

struct GBuffer {
    @location(0) gbuffer_id: RGBA32Float, // atlas u, v; object id; share of the environment's irradiance, see mesh.wgsl
    @location(1) normal: RGBA16Float,     // shading normal, world; specular scale
    @location(2) base_color: RGBA8UnormSrgb, // of texture and vertices, without the object's factor, for 8 bits to suffice
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let x = object.object_to_world * vec4f(vertex.position, 1.0);
    let n = object.object_to_world * vec4f(vertex.normal, 0.0);
    let color = colors[min(i, arrayLength(&colors) - 1u)].rgb;
    return Varying(params.world_to_clip * x, x.xyz, n.xyz, vec2f(vertex.u, vertex.v), vertex.atlas, vertex.sky, color);
}

@fragment
fn fs(in: Varying) -> GBuffer {
    let normal_at = map_coordinates(object, in.uv, textureDimensions(normal_map));
    let slope = textureSample(normal_map, linear_repeat, normal_at).xyz;
    var n = bent_normal(normalize(in.normal), in.position, in.uv, slope, object.normal_scale);
    let to_eye = params.eye.xyz - in.position * params.eye.w;
    let facing = cross(dpdx(in.position), dpdy(in.position)); // the side of the triangle that is seen
    // An open sheet seen from behind shows its back: there the normal is reversed.
    if dot(in.normal, to_eye) < 0.0 && dot(in.normal, facing) * dot(facing, to_eye) < 0.0 {
        n = -n;
    }
    let specular_at = map_coordinates(object, in.uv, textureDimensions(specular_map));
    let specular = object.specular * textureSample(specular_map, linear_repeat, specular_at).r;
    let color_at = map_coordinates(object, in.uv, textureDimensions(base_color_map));
    let color = in.color * textureSample(base_color_map, linear_repeat, color_at).rgb;
    return GBuffer(vec4f(in.atlas, f32(object.id), in.sky), vec4f(n, specular), vec4f(color, 1.0));
}
