// The first shadow map as a picture: points near the light are bright.

import package::screen::{screen_corner};
import package::targets::{RGBA8UnormSrgb};

@group(0) @binding(0) var shadow_maps: texture_depth_2d_array;

struct Pixel {
    @location(0) display: RGBA8UnormSrgb,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let depth = textureLoad(shadow_maps, vec2u(pixel.xy), 0, 0);
    return Pixel(vec4f(vec3f(1.0 - depth), f32(depth < 1.0)));
}
