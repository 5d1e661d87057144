// Fill the gutters around the charts with the values at the same points of the surface, across the border in the
// neighbouring chart (Mikkelsen 2009, 3.4: offsets are determined once and applied in a single pass). The depth buffer
// is the mask of the passes that follow (mask.wgsl).

import package::charts::{INSIDE, Seam, across, settled};
import package::mask::{BEHIND, covered_around};
import package::screen::{screen_corner};
import package::targets::{RGBA16Float};

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var ids: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> seams: array<Seam>;
@group(0) @binding(3) var linear_clamp: sampler;

struct Texel {
    @location(0) dilated: RGBA16Float, // alpha: 1, or 0 where there is no value
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
    var value = textureLoad(source, vec2u(pixel.xy), 0);
    var covered = value.a;
    if id != 0u && (id & INSIDE) == 0u {
        let home = settled(ids, across(seams[id - 1u], pixel.xy * texel));
        value = textureSampleLevel(source, linear_clamp, home, 0.0);
        covered = value.a + covered_around(source, linear_clamp, home, texel);
    }
    // Alpha is coverage: next to a border the filter reads empty texels, too.
    let dilated = vec4f(value.rgb / max(value.a, 1e-4), f32(value.a > 0.0));
    return Texel(dilated, select(0.0, BEHIND, id != 0u && covered > 0.0));
}
