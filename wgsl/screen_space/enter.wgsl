// What enters one object at its pixels, and how its depth runs there: the input of the blurs.

import package::mesh::{Surface, color_before};
import package::screen::{screen_corner};
import package::targets::{RGBA32Float, RG32Float};

@group(0) @binding(0) var<uniform> surface: Surface;
@group(0) @binding(1) var where_seen: texture_2d<f32>;
@group(0) @binding(2) var base_color: texture_2d<f32>;
@group(0) @binding(3) var depth: texture_depth_2d;
@group(0) @binding(4) var irradiance: texture_2d<f32>;

struct Pixel {
    @location(0) entering: RGBA32Float, // L_d times the base colour's share before diffusion; 1 - depth, 0 off the object
    @location(1) slope: RG32Float,      // of the depth, per pixel to the right and down: the same all over a plane
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

// The change of depth from `before` to `here`, or on to `after`: the lesser, since the other may lie across a step.
fn slope_between(before: f32, here: f32, after: f32) -> f32 {
    let back = here - before;
    let ahead = after - here;
    let slope = select(back, ahead, abs(ahead) < abs(back));
    return select(0.0, slope, abs(slope) < 1.0); // no neighbour on the object
}

// Depth at a pixel of the object; elsewhere so deep that no slope leads there.
fn depth_on_object(texel: vec2i) -> f32 {
    let p = clamp(texel, vec2i(0), vec2i(textureDimensions(depth)) - 1);
    let on = u32(textureLoad(where_seen, p, 0).z) == surface.id && all(p == texel);
    return select(4.0, textureLoad(depth, p, 0), on);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2i(pixel.xy);
    if u32(textureLoad(where_seen, texel, 0).z) != surface.id {
        discard;
    }
    let here = textureLoad(depth, texel, 0);
    let slope = vec2f(
        slope_between(depth_on_object(texel - vec2i(1, 0)), here, depth_on_object(texel + vec2i(1, 0))),
        slope_between(depth_on_object(texel - vec2i(0, 1)), here, depth_on_object(texel + vec2i(0, 1))),
    );
    let color = color_before(surface, textureLoad(base_color, texel, 0).rgb);
    return Pixel(vec4f(textureLoad(irradiance, texel, 0).rgb * color, 1.0 - here), slope);
}
