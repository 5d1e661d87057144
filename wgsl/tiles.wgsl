// Passes over the tiles of a map that have anything in them. What is empty costs a vertex, where a triangle over the
// whole map would have all its texels ask.

import package::rectangle::{rectangle_corner};

const TILE: u32 = 16u; // texels a side

// A corner of a tile, the vertices being six for each texel of `tiles`; for empty tiles all are at one place. `side` is
// that of a tile, of the whole map.
fn tile_corner(i: u32, tiles: texture_2d<u32>, side: f32) -> vec4f {
    let across = textureDimensions(tiles).x;
    let tile = vec2u((i / 6u) % across, (i / 6u) / across);
    if textureLoad(tiles, tile, 0).r == 0u {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    let low = vec2f(tile) * side * 2.0 - 1.0;
    let high = vec2f(tile + 1u) * side * 2.0 - 1.0;
    return rectangle_corner(i % 6u, vec4f(low.x, -high.y, high.x, -low.y));
}
