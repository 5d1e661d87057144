// Fills the texels around the charts from where they lie on the surface: across the border, in the chart of the
// neighbouring triangle (Mikkelsen 2009, 3.4, offsets determined once, applied in a single pass).

import package::charts::{INSIDE, Seam, across, settled};
import package::screen::{screen_corner};
import package::targets::{RGBA16Float};

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var ids: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> seams: array<Seam>;
@group(0) @binding(3) var linear_clamp: sampler;

struct Texel {
    @location(0) dilated: RGBA16Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Texel {
    let texel = vec2u(pixel.xy);
    let id = textureLoad(ids, texel, 0).r;
    if id == 0u {
        discard;
    }
    var value = textureLoad(source, texel, 0);
    if (id & INSIDE) == 0u {
        let home = settled(ids, across(seams[id - 1u], pixel.xy / vec2f(textureDimensions(ids))));
        value = textureSampleLevel(source, linear_clamp, home, 0.0);
    }
    // Alpha is coverage: beside a border the filter has met texels that nothing has drawn.
    return Texel(vec4f(value.rgb / max(value.a, 1e-4), 1.0));
}
