// One layer and those below it, blended as Norberg 2010 (2.2): the layer's base colour under its light, and what the layers
// below show at (u', v'), blurred by the distance to them.

import package::depth_parallax::surface::{Varying, surface_at, texels_of, atlas_vertex};
import package::targets::{RGBA16Float};
import package::units::{Length, Number};
import package::walk::{walk};

struct Params {
    thickness: Length,    // at a share of 1
    transparency: Number, // alpha at a right angle
    opaque: Number,       // 1 if the layer has an opacity map, else 0
    last: u32,            // 1 if there is no layer below, else 0
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> disc: array<vec2f>; // offsets of the taps, of a disc of radius 1
@group(0) @binding(2) var amount: texture_2d<f32>; // of the layer, as maps.wgsl draws it
@group(0) @binding(3) var base: texture_2d<f32>;
@group(0) @binding(4) var light: texture_2d<f32>;  // may be smaller
@group(0) @binding(5) var below: texture_2d<f32>;  // or a single black texel
@group(0) @binding(6) var linear_clamp: sampler;

struct Texel {
    @location(0) leaving: RGBA16Float,
}

@fragment
fn fs(in: Varying) -> Texel {
    let surface = surface_at(in);
    let texel = vec2u(in.clip.xy);
    let size = vec2f(textureDimensions(amount));
    let uv = in.clip.xy / size;
    let share = textureLoad(amount, texel, 0);
    let lit = textureSampleLevel(light, linear_clamp, uv, 0.0);
    let outer = textureLoad(base, texel, 0).rgb * lit.rgb / max(lit.a, 1e-4);
    let facing = saturate(dot(surface.bent, surface.w_o)); // eq. 19
    // A layer is absent where its thickness map is black.
    let alpha = 1.0 - share.r * (1.0 - params.transparency * facing * (1.0 - params.opaque * share.g));
    // Eq. 15 and 16 in world space: the view vector reflected at the bent normal, then at the surface.
    let reflected = reflect(-surface.w_o, surface.bent);
    let transmitted = reflected - 2.0 * surface.n * dot(reflected, surface.n);
    let s = params.thickness * share.r / max(abs(dot(transmitted, surface.n)), 1e-3); // eq. 17
    let step = texels_of(surface, transmitted - surface.n * dot(transmitted, surface.n));
    if alpha <= 0.0 || params.last == 1u {
        return Texel(vec4f(outer, 1.0));
    }
    let shifted = walk(uv, s * step / size); // eq. 18
    let along = normalize(surface.to_u);
    let beside = cross(surface.n, along);
    var inner = vec4f(0.0);
    for (var i = 0u; i < arrayLength(&disc); i++) {
        let offset = texels_of(surface, s * (disc[i].x * along + disc[i].y * beside));
        inner += textureSampleLevel(below, linear_clamp, walk(shifted, offset / size), 0.0);
    }
    return Texel(vec4f(mix(outer, inner.rgb / max(inner.a, 1e-4), alpha), 1.0));
}
