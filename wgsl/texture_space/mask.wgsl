// The mask (mask.wgsl) of a map smaller than the irradiance map.

import package::charts::{INSIDE, Seam, across, settled};
import package::mask::{BEHIND, covered_around};
import package::screen::{screen_corner};

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var ids: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> seams: array<Seam>;
@group(0) @binding(3) var linear_clamp: sampler;

struct Texel {
    @builtin(frag_depth) mask: f32,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Texel {
    let id = textureLoad(ids, vec2u(pixel.xy), 0).r;
    let texel = 1.0 / vec2f(textureDimensions(ids));
    var home = pixel.xy * texel;
    if id != 0u && (id & INSIDE) == 0u {
        home = settled(ids, across(seams[id - 1u], home));
    }
    let here = textureSampleLevel(source, linear_clamp, home, 0.0).a;
    let covered = here + covered_around(source, linear_clamp, home, texel);
    return Texel(select(0.0, BEHIND, id != 0u && covered > 0.0));
}
