// One direction of a Gaussian blur over the surface, in the atlas (Mikkelsen 2009, 3.4; d'Eon & Luebke 2007, 14.5).
//
// The two directions of a separable blur must be the same on the surface wherever charts meet, so they follow from the
// surface and a world axis, not from the atlas. Taps are a distance in mm apart; the gradients of the atlas coordinates
// turn that into texels, whatever the stretch and the chart's orientation. A tap that leaves its chart goes on in the
// neighbour's, as the seams unfold it.

import package::units::{Area};
import package::charts::{INSIDE, Seam, across};
import package::screen::{screen_corner};
import package::targets::{RGBA16Float};

struct Params {
    axis: vec3f,      // the first direction is across it
    direction: u32,   // 0 or 1
    variance: Area,   // of the Gaussian, from the irradiance on
    reached: Area,    // the variance that the source has already
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var source: texture_2d<f32>; // may be larger than what is drawn
@group(0) @binding(2) var linear_clamp: sampler;
@group(0) @binding(3) var gradient_u: texture_2d<f32>; // texels per mm, and texels to the chart's border
@group(0) @binding(4) var gradient_v: texture_2d<f32>;
@group(0) @binding(5) var ids: texture_2d<u32>;
@group(0) @binding(6) var<storage, read> seams: array<Seam>;

struct Texel {
    @location(0) blurred: RGBA16Float,
}

const REACH: f32 = 3.0;       // sigmas to each side: 99.7 % of the Gaussian, and the weights are normalised
const SPACING: f32 = 1.5;     // sigmas of the source's own blur from tap to tap: ripples stay below 1e-3
const TEXEL_VARIANCE: f32 = 0.25; // texels^2 that a map blurs by itself: a box for its texels, a tent for their filter
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

// A place across a seam may lie in the rim of its chart where no texel's centre is covered: the nearest that is.
fn settled(uv: vec2f, size: vec2f) -> vec2f {
    if (id_at(uv, size) & INSIDE) != 0u {
        return uv;
    }
    let corner = floor(uv * size - 0.5) + 0.5;
    var best = uv;
    var nearest = 9.0;
    for (var i = 0u; i < 4u; i++) {
        let texel = corner + vec2f(f32(i & 1u), f32(i >> 1u));
        let d = distance(texel, uv * size);
        if d < nearest && (id_at(texel / size, size) & INSIDE) != 0u {
            nearest = d;
            best = texel / size;
        }
    }
    return best;
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
        a = settled(across(seam, mix(a, b, outside)), size);
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
    var home = pixel.xy / size;
    if id != 0u && (id & INSIDE) == 0u { // a texel of the gutter is one of the neighbour's
        home = settled(across(seams[id - 1u], home), size);
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
    let reached = max(params.reached, TEXEL_VARIANCE / (scale * scale));
    let variance = params.variance - reached;
    let spacing = max(1.0 / scale, SPACING * sqrt(reached));
    let exponent = -0.5 * spacing * spacing / variance;
    var taps = 0.0; // where nothing is drawn, or the Gaussian is narrower than a texel
    if id != 0u && variance > 0.0 {
        taps = clamp(ceil(REACH * sqrt(variance) / spacing), 1.0, MAX_TAPS);
    }
    var total = textureSampleLevel(source, linear_clamp, home, 0.0);
    // Apart, since on CPUs a branch costs all lanes what one of them takes: taps that stay in the chart, taps that may not.
    let clear = min(floor(u.w / (spacing * scale)), taps);
    var k = 1.0;
    for (; k <= clear; k += 1.0) {
        let weight = exp(exponent * k * k);
        let step = texels_per_mm * (spacing * k / size);
        total += weight * textureSampleLevel(source, linear_clamp, home + step, 0.0);
        total += weight * textureSampleLevel(source, linear_clamp, home - step, 0.0);
    }
    for (; k <= taps; k += 1.0) {
        let weight = exp(exponent * k * k);
        let step = texels_per_mm * (spacing * k / size);
        total += weight * textureSampleLevel(source, linear_clamp, walk(home, step, size), 0.0);
        total += weight * textureSampleLevel(source, linear_clamp, walk(home, -step, size), 0.0);
    }
    if id == 0u {
        discard; // at the end: on CPUs what is discarded runs on in the lanes of its neighbours
    }
    return Texel(vec4f(total.rgb / max(total.a, 1e-4), 1.0)); // alpha: 1 where the source has a value
}
