// One direction of a Gaussian blur over the surface, in the atlas (Mikkelsen 2009, 3.4; d'Eon & Luebke 2007, 14.5).
//
// The two directions of a separable blur must be the same on the surface wherever charts meet, so they follow from the
// surface and a world axis, not from the atlas. Taps are a distance in mm apart; the gradients of the atlas coordinates
// turn that into texels, whatever the stretch and the chart's orientation. A tap that leaves its chart goes on in the
// neighbour's, as the seams unfold it.

import package::units::{Length};
import package::charts::{INSIDE, Seam, across};
import package::screen::{screen_corner};
import package::targets::{RGBA16Float};

struct Params {
    axis: vec3f,      // the first direction is across it
    direction: u32,   // 0 or 1
    sigma: Length,    // of the Gaussian
    smooth_to: Length, // sigma of the blur that the source has had
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var source: texture_2d<f32>;
@group(0) @binding(2) var linear_clamp: sampler;
@group(0) @binding(3) var gradient_u: texture_2d<f32>; // texels per mm, and texels to the chart's border
@group(0) @binding(4) var gradient_v: texture_2d<f32>;
@group(0) @binding(5) var ids: texture_2d<u32>;
@group(0) @binding(6) var<storage, read> seams: array<Seam>;

struct Texel {
    @location(0) blurred: RGBA16Float,
}

const REACH: f32 = 3.0;       // sigmas to each side: 99.7 % of the Gaussian, and the weights are normalised
const SPACING: f32 = 1.5;     // taps may be this many sigmas of the source's own blur apart: its spectrum leaves 1e-4 there
const MAX_TAPS: f32 = 64.0;   // to each side
const MAX_CROSSINGS: u32 = 4u;
const BISECTIONS: u32 = 6u;   // of a step of up to 64 texels, to one texel

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

fn id_at(uv: vec2f, size: vec2f) -> u32 {
    return textureLoad(ids, vec2u(clamp(uv * size, vec2f(0.0), size - 1.0)), 0).r;
}

// Where one gets from `start`, inside a chart, by walking `step` over the surface.
fn walk(start: vec2f, step: vec2f, size: vec2f) -> vec2f {
    var a = start;
    var b = start + step;
    for (var i = 0u; i < MAX_CROSSINGS; i++) {
        let chart = id_at(a, size);
        if id_at(b, size) == chart {
            return b;
        }
        var inside = 0.0; // the crossing, by bisection
        var outside = 1.0;
        for (var k = 0u; k < BISECTIONS; k++) {
            let middle = 0.5 * (inside + outside);
            if id_at(mix(a, b, middle), size) == chart {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        let id = id_at(mix(a, b, outside), size);
        if id == 0u || (id & INSIDE) != 0u { // no seam is known there: stay at the border
            return mix(a, b, inside);
        }
        let seam = seams[id - 1u];
        a = across(seam, mix(a, b, outside));
        b = across(seam, b);
        if (id_at(a, size) & INSIDE) == 0u { // the neighbour is thinner than a texel
            return a;
        }
    }
    return a;
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Texel {
    let size = vec2f(textureDimensions(ids));
    let id = textureLoad(ids, vec2u(pixel.xy), 0).r;
    if id == 0u {
        discard;
    }
    var home = pixel.xy / size;
    if (id & INSIDE) == 0u { // a texel of the gutter is one of the neighbour's
        home = across(seams[id - 1u], home);
    }
    let u = textureLoad(gradient_u, vec2u(clamp(home * size, vec2f(0.0), size - 1.0)), 0);
    let v = textureLoad(gradient_v, vec2u(clamp(home * size, vec2f(0.0), size - 1.0)), 0);
    let n = normalize(cross(u.xyz, v.xyz));
    var e = cross(params.axis, n);
    e = select(normalize(cross(params.axis.yzx, n)), normalize(e), dot(e, e) > 1e-8);
    if params.direction == 1u {
        e = cross(n, e);
    }
    let texels_per_mm = vec2f(dot(u.xyz, e), dot(v.xyz, e));
    let scale = length(texels_per_mm);
    let spacing = max(1.0 / scale, SPACING * params.smooth_to);
    let taps = clamp(ceil(REACH * params.sigma / spacing), 1.0, MAX_TAPS);
    let exponent = -0.5 * (spacing * spacing) / (params.sigma * params.sigma);

    var total = textureSampleLevel(source, linear_clamp, home, 0.0).rgb;
    var weights = 1.0;
    for (var k = 1.0; k <= taps; k += 1.0) {
        let weight = exp(exponent * k * k);
        let step = texels_per_mm * (spacing * k / size);
        var forth = home + step;
        var back = home - step;
        if k * spacing * scale > u.w {
            forth = walk(home, step, size);
            back = walk(home, -step, size);
        }
        total += weight * (textureSampleLevel(source, linear_clamp, forth, 0.0).rgb + textureSampleLevel(source, linear_clamp, back, 0.0).rgb);
        weights += 2.0 * weight;
    }
    return Texel(vec4f(total / weights, 1.0));
}
