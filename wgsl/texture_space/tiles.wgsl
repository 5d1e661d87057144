// Which tiles of an irradiance map have a texel with a value, in them or close by.

import package::screen::{screen_corner};
import package::targets::{R32Uint};
import package::tiles::{TILE};

override REACH: i32; // texels around a tile that count: of its gutters, on the smallest map that the tiles are for

@group(0) @binding(0) var source: texture_2d<f32>;

struct Tile {
    @location(0) used: R32Uint,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Tile {
    let size = vec2i(textureDimensions(source));
    let corner = vec2i(pixel.xy) * i32(TILE);
    var used = 0u;
    for (var y = -REACH; y < i32(TILE) + REACH; y++) {
        for (var x = -REACH; x < i32(TILE) + REACH; x++) {
            let texel = clamp(corner + vec2i(x, y), vec2i(0), size - 1);
            used |= u32(textureLoad(source, texel, 0).a > 0.0);
        }
    }
    return Tile(used);
}
