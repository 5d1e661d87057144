// The input of the blurs: the light that enters one object at its pixels, with the light that arrives there from behind
// as if it entered, and the slope of the surface.

import package::mesh::{color_before};
import package::per_object::{view, object, depth, is_other_object, normal_at, base_color_at};
import package::targets::{RGBA32Float, RG32Float};

@group(0) @binding(0) var irradiance: texture_2d<f32>;
@group(0) @binding(1) var behind: texture_2d<f32>; // or a single black texel

struct Pixel {
    @location(0) entering: RGBA32Float, // times the share of the base colour before diffusion; alpha: 1 - depth, 0 elsewhere
    @location(1) slope: RG32Float,      // change of depth per pixel to the right and down, which is constant on a plane
}

const LEAST_COSINE: f32 = 0.1; // at smaller cosines a pixel spans ten times its width, and more, of the surface

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let here = textureLoad(depth, texel, 0);
    let n = normal_at(texel);
    let per_pixel = vec2f(2.0, -2.0) / vec2f(textureDimensions(depth));
    let at = view.clip_to_world * vec4f(pixel.xy * per_pixel + vec2f(-1.0, 1.0), here, 1.0);
    let x = at.xyz / at.w;
    let right = view.clip_to_world[0] * per_pixel.x;
    let down = view.clip_to_world[1] * per_pixel.y;
    let away = view.clip_to_world[2].xyz - x * view.clip_to_world[2].w;
    // The slope follows from the steps along the tangent plane being perpendicular to the normal.
    let facing = min(dot(n, away), -LEAST_COSINE * length(away));
    let slope = -vec2f(dot(n, right.xyz - x * right.w), dot(n, down.xyz - x * down.w)) / facing;
    let color = color_before(object, base_color_at(texel));
    let arriving = textureLoad(behind, min(texel, textureDimensions(behind) - 1u), 0).rgb;
    return Pixel(vec4f((textureLoad(irradiance, texel, 0).rgb + arriving) * color, 1.0 - here), slope);
}
