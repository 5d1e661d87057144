// L_d over the atlas of one object: its triangles are drawn at their atlas coordinates (Mikkelsen 2009, 3.4, step 2).

import package::units::{Number};
import package::mesh::{Vertex, ObjectUniforms, bent_normal, color_before, map_coordinates};
import package::lights::{transmitted_irradiance};
import package::screen::{direction_to_eye};
import package::targets::{RGBA16Float};

struct Params {
    unit: f32,                // irradiance that a value of 1 means, W/m^2
    eye: vec4f,               // xyz, 1: the camera's position; xyz, 0: the direction towards it
    planes: array<vec4f, 6>,  // texels behind any of these planes are left out
}

@group(0) @binding(0) var<uniform> object: ObjectUniforms;
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(2) var base_color_map: texture_2d<f32>;
@group(0) @binding(3) var normal_map: texture_2d<f32>;
@group(0) @binding(4) var specular_map: texture_2d<f32>;
@group(0) @binding(5) var linear_repeat: sampler;
@group(0) @binding(6) var<uniform> params: Params;
// Texels are left out where the cosine of the angle between normal and viewer is smaller; by render vertex, or one for
// all.
@group(0) @binding(7) var<storage, read> least_cosines: array<f32>;
@group(0) @binding(8) var<storage, read> colors: array<vec4f>; // of each render vertex, or one for all

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) sky: Number,
    @location(4) least_cosine: Number,
    @location(5) color: vec3f,
}

struct Texel {
    @location(0) irradiance: RGBA16Float, // in params.unit: L_d times the share of the base colour before diffusion; 1, or 0 where left out
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let x = object.object_to_world * vec4f(vertex.position, 1.0);
    let n = object.object_to_world * vec4f(vertex.normal, 0.0);
    let clip = vec4f(vertex.atlas.x * 2.0 - 1.0, 1.0 - vertex.atlas.y * 2.0, 0.0, 1.0);
    let least_cosine = least_cosines[min(i, arrayLength(&least_cosines) - 1u)];
    let color = colors[min(i, arrayLength(&colors) - 1u)].rgb;
    return Varying(clip, x.xyz, n.xyz, vec2f(vertex.u, vertex.v), vertex.sky, least_cosine, color);
}

// Whether a part of the texel around x faces the viewer enough and is in front of all planes.
fn is_visible(x: Position, n: Direction, least_cosine: Number) -> bool {
    let cosine = dot(n, direction_to_eye(params.eye, x));
    var visible = cosine + fwidth(cosine) >= least_cosine;
    for (var i = 0u; i < 6u; i++) {
        visible = visible && dot(params.planes[i], vec4f(x, 1.0)) >= 0.0;
    }
    return visible;
}

@fragment
fn fs(in: Varying) -> Texel {
    let x = in.position;
    let dx = dpdx(x); // the sides of the texel, over which L_d is averaged: edges of shadows would move by half a texel
    let dy = dpdy(x);
    let n_s = normalize(in.normal);
    let visible = is_visible(x, n_s, in.least_cosine);
    let normal_at = map_coordinates(object, in.uv, textureDimensions(normal_map));
    let n = bent_normal(n_s, x, in.uv, textureSample(normal_map, linear_repeat, normal_at).xyz, object.normal_scale);
    let specular_at = map_coordinates(object, in.uv, textureDimensions(specular_map));
    let specular = object.specular * textureSample(specular_map, linear_repeat, specular_at).r;
    let color_at = map_coordinates(object, in.uv, textureDimensions(base_color_map));
    let color = in.color * textureSample(base_color_map, linear_repeat, color_at).rgb;
    var L_d = vec3f(0.0);
    if visible {
        L_d = transmitted_irradiance(x, n, specular, in.sky, dx, dy);
    }
    if !visible {
        discard;
    }
    return Texel(vec4f(L_d / params.unit * color_before(object, color), 1.0));
}
