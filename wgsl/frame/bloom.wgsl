// One direction of bloom: a share of each pixel's light spreads over the pixels around it, as in a lens or an eye.
// Light that would leave the image is reflected at its border, so that the sum stays the same.

import package::screen::{screen_corner};
import package::targets::{RGBA32Float};

override DIRECTION: u32; // 0: along rows; 1: along columns, and mixed with the light that does not spread

struct Params {
    strength: f32, // share of the light that spreads
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var radiance: texture_2d<f32>;
@group(0) @binding(2) var spread: texture_2d<f32>; // the radiance, or the result of the first direction
@group(0) @binding(3) var<storage, read> weights: array<f32>; // of the pixel itself and of those at distances 1, 2, ...

struct Pixel {
    @location(0) bloomed: RGBA32Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

fn reflected(i: i32, size: i32) -> i32 {
    let k = (i % (2 * size) + 2 * size) % (2 * size);
    return min(k, 2 * size - 1 - k);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let here = vec2i(pixel.xy);
    let size = vec2i(textureDimensions(spread));
    let step = select(vec2i(1, 0), vec2i(0, 1), DIRECTION == 1u);
    var total = weights[0] * textureLoad(spread, here, 0);
    for (var k = 1u; k < arrayLength(&weights); k++) {
        for (var side = -1; side <= 1; side += 2) {
            let there = here + side * i32(k) * step;
            let texel = vec2i(reflected(there.x, size.x), reflected(there.y, size.y));
            total += weights[k] * textureLoad(spread, texel, 0);
        }
    }
    if DIRECTION == 1u {
        total = mix(textureLoad(radiance, here, 0), total, params.strength);
        total = vec4f(total.rgb / max(total.a, 1e-20), total.a); // the light that arrives, over black
    }
    return Pixel(total);
}
