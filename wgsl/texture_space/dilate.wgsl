// Fills the texels around the charts from where they lie on the surface: across the border, in the chart of the
// neighbouring triangle (Mikkelsen 2009, 3.4, offsets determined once, applied in a single pass).

import package::charts::{INSIDE, Seam, across, settled};
import package::targets::{RGBA16Float};
import package::tiles::{tile_corner};

struct Params {
    tile: f32, // side of a tile, of the map
}

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var ids: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> seams: array<Seam>;
@group(0) @binding(3) var linear_clamp: sampler;
@group(0) @binding(4) var<uniform> params: Params;
@group(0) @binding(5) var tiles: texture_2d<u32>;

struct Texel {
    @location(0) dilated: RGBA16Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return tile_corner(i, tiles, params.tile);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Texel {
    let texel = vec2u(pixel.xy);
    let id = textureLoad(ids, texel, 0).r;
    var value = textureLoad(source, texel, 0);
    if id != 0u && (id & INSIDE) == 0u {
        let home = settled(ids, across(seams[id - 1u], pixel.xy / vec2f(textureDimensions(ids))));
        value = textureSampleLevel(source, linear_clamp, home, 0.0);
    }
    if id == 0u || value.a == 0.0 {
        discard;
    }
    // Alpha is coverage: beside a border the filter has met texels that nothing has drawn.
    return Texel(vec4f(value.rgb / max(value.a, 1e-4), 1.0));
}
