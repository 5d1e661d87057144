// The maps of one layer over the atlas of an object, and the total reflectance of that layer and those below.

import package::depth_parallax::weights::{REFLECTED, DOWNWARDS, UPWARDS, FROM_BELOW, place_at, row_at, total_at};
import package::mesh::{Vertex, ObjectUniforms, map_coordinates};
import package::targets::{RGBA16Float};

@group(0) @binding(0) var<uniform> object: ObjectUniforms;
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(2) var thickness_map: texture_2d<f32>;
@group(0) @binding(3) var color_map: texture_2d<f32>;
@group(0) @binding(4) var opacity_map: texture_2d<f32>;
@group(0) @binding(5) var linear_repeat: sampler;
@group(0) @binding(6) var below: texture_2d<f32>; // reflectance of the layers below, or a single black texel

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec2f,
}

struct Texel {
    @location(0) amount: RGBA16Float, // r: share of the thickness; g: opacity
    @location(1) color: RGBA16Float,  // share of the scattering
    @location(2) rho: RGBA16Float,    // total reflectance of this layer and those below
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let clip = vec4f(2.0 * vertex.atlas.x - 1.0, 1.0 - 2.0 * vertex.atlas.y, 0.0, 1.0);
    return Varying(clip, vec2f(vertex.u, vertex.v));
}

@fragment
fn fs(in: Varying) -> Texel {
    let thickness = textureSample(thickness_map, linear_repeat,
        map_coordinates(object, in.uv, textureDimensions(thickness_map))).r;
    let color = textureSample(color_map, linear_repeat, map_coordinates(object, in.uv, textureDimensions(color_map))).rgb;
    let opacity = textureSample(opacity_map, linear_repeat,
        map_coordinates(object, in.uv, textureDimensions(opacity_map))).r;
    let place = place_at(thickness * opacity, color);
    let rho_below = textureLoad(below, min(vec2u(in.clip.xy), textureDimensions(below) - 1u), 0).rgb;
    let there_and_back = total_at(DOWNWARDS, place) * total_at(UPWARDS, place);
    let rho = total_at(REFLECTED, place) + there_and_back * rho_below / (1.0 - row_at(FROM_BELOW, place) * rho_below);
    return Texel(vec4f(thickness, opacity, 0.0, 1.0), vec4f(color, 1.0), vec4f(rho, 1.0));
}
