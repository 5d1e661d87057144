// Convert linear radiance for a display: exposure and tone curve; the target's format encodes sRGB.

import package::screen::{screen_corner};
import package::targets::{RGBA8UnormSrgb};

const NONE: u32 = 0u;
const REINHARD: u32 = 1u;
const ACES: u32 = 2u;

struct Params {
    scale: f32, // 2 to the power of the exposure in stops
    curve: u32, // NONE, REINHARD or ACES
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var radiance: texture_2d<f32>;

struct Pixel {
    @location(0) display: RGBA8UnormSrgb,
}

// Narkowicz's fit (2015) to the ACES reference rendering and output transforms.
fn aces(c: vec3f) -> vec3f {
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let sample = textureLoad(radiance, vec2u(pixel.xy), 0);
    var c = clamp(sample.rgb * params.scale, vec3f(0.0), vec3f(1e9)); // larger values would overflow in the curves
    if params.curve == REINHARD {
        c = c / (1.0 + c);
    } else if params.curve == ACES {
        c = aces(c);
    }
    return Pixel(vec4f(clamp(c, vec3f(0.0), vec3f(1.0)), sample.a));
}
