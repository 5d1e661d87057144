// Shows M that a reference has computed.

import package::screen::{screen_corner};
import package::targets::{RGBA32Float};

@group(0) @binding(0) var known: texture_2d<f32>;

struct Pixel {
    @location(0) M: RGBA32Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    return Pixel(textureLoad(known, vec2u(pixel.xy), 0));
}
