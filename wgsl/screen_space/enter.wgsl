// What enters one object at its pixels, and what arrives there from behind as if it did; and which way its surface runs
// there: the input of the blurs.

import package::mesh::{ObjectUniforms, color_before};
import package::rectangle::{rectangle_corner};
import package::targets::{RGBA32Float, RG32Float};

struct Params {
    clip_to_world: mat4x4f,
    rectangle: vec4f, // where the object may be
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var gbuffer_id: texture_2d<f32>;
@group(0) @binding(3) var normal: texture_2d<f32>;
@group(0) @binding(4) var base_color: texture_2d<f32>;
@group(0) @binding(5) var depth: texture_depth_2d;
@group(0) @binding(6) var irradiance: texture_2d<f32>;
@group(0) @binding(7) var behind: texture_2d<f32>; // or a single black texel

struct Pixel {
    @location(0) entering: RGBA32Float, // times the base colour's share before diffusion; 1 - depth, 0 off the object
    @location(1) slope: RG32Float,      // of the depth, per pixel to the right and down: the same all over a plane
}

const LEAST_COSINE: f32 = 0.1; // beyond, a pixel spans ten times its width: nothing is left to blur

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return rectangle_corner(i, params.rectangle);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if u32(textureLoad(gbuffer_id, texel, 0).z) != object.id {
        discard;
    }
    let here = textureLoad(depth, texel, 0);
    let n = normalize(textureLoad(normal, texel, 0).xyz);
    let per_pixel = vec2f(2.0, -2.0) / vec2f(textureDimensions(depth));
    let at = params.clip_to_world * vec4f(pixel.xy * per_pixel + vec2f(-1.0, 1.0), here, 1.0);
    let x = at.xyz / at.w;
    let right = params.clip_to_world[0] * per_pixel.x;
    let down = params.clip_to_world[1] * per_pixel.y;
    let away = params.clip_to_world[2].xyz - x * params.clip_to_world[2].w;
    // Steps on the plane through x are those that the normal is at right angles to.
    let facing = min(dot(n, away), -LEAST_COSINE * length(away));
    let slope = -vec2f(dot(n, right.xyz - x * right.w), dot(n, down.xyz - x * down.w)) / facing;
    let color = color_before(object, textureLoad(base_color, texel, 0).rgb);
    let arriving = textureLoad(behind, min(texel, textureDimensions(behind) - 1u), 0).rgb;
    return Pixel(vec4f((textureLoad(irradiance, texel, 0).rgb + arriving) * color, 1.0 - here), slope);
}
