// One direction of a Gaussian blur over the surface, in the atlas (Mikkelsen 2009, 3.4; d'Eon & Luebke 2007, 14.5).
//
// The two directions of a separable blur must be the same on the surface wherever charts meet, so they follow from the
// surface and a world axis, not from the atlas. Taps are a distance in mm apart; the gradients of the atlas coordinates
// turn that into texels, whatever the stretch and the chart's orientation. A tap that leaves its chart goes on in the
// neighbour's, as the seams unfold it.

import package::units::{Area};
import package::charts::{INSIDE, Seam, across, id_at, settled};
import package::screen::{screen_corner};
import package::targets::{RGBA16Float};

struct Params {
    axis: vec3f,      // the first direction is across it
    direction: u32,   // 0 or 1
    variance: Area,   // of the Gaussian
    reached: Area,    // of the last one, which the source has been blurred by; 0 for the irradiance
    finer: f32,       // texels of the source per texel of what is drawn
    depth: f32,       // that it is drawn at: nearer than the last one on the same mask
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

const REACH: f32 = 3.0;   // sigmas to each side: 99.7 % of the Gaussian, and the weights are normalised
const SPACING: f32 = 1.5; // sigmas of the source's own blur from tap to tap: ripples stay below 1e-3
const MAX_TAPS: f32 = 64.0; // to each side
const MAX_CROSSINGS: u32 = 6u;
const BISECTIONS: u32 = 8u; // to a texel, of a step of up to 256

// What maps blur by themselves, as variances in texels^2.
const SPLINE: f32 = 1.0 / 3.0; // the spline that the result is read through (gather.wgsl)
const BOX: f32 = 1.0 / 12.0;   // a texel of the irradiance, which is a mean over its area
const HALVING: f32 = 0.25;     // reading a larger map between its texels

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(screen_corner(i).xy, params.depth, 1.0);
}

// Whether a place is in the gutter of a chart, given by its id; what charts that are close have between them is the
// gutter of the nearer one.
fn leads_out_of(chart: u32, uv: vec2f) -> bool {
    let id = id_at(ids, uv);
    return id != 0u && (id & INSIDE) == 0u && (INSIDE | seams[max(id, 1u) - 1u].chart) == chart;
}

// Where one gets from `start`, inside a chart, by walking `step` over the surface.
fn walk(start: vec2f, step: vec2f) -> vec2f {
    let size = vec2f(textureDimensions(ids));
    var a = start;
    var b = start + step;
    for (var i = 0u; i < MAX_CROSSINGS; i++) {
        let chart = id_at(ids, a);
        let end = id_at(ids, b);
        if end == chart || chart == 0u {
            break;
        }
        var seam_id = chart;
        if (chart & INSIDE) != 0u { // else `a` is at a corner, in the gutter of the chart that it was led to
            var inside = 0.0; // the crossing, by bisection
            var outside = 1.0;
            for (var k = 0u; k < BISECTIONS; k++) {
                let middle = 0.5 * (inside + outside);
                if id_at(ids, mix(a, b, middle)) == chart {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            let at_border = mix(a, b, inside);
            // A texel further on, so as to arrive inside the neighbour and not on its rim.
            let beyond = mix(a, b, min(outside + 1.0 / length((b - a) * size), 1.0));
            a = select(mix(a, b, outside), beyond, leads_out_of(chart, beyond));
            seam_id = id_at(ids, a);
            if !leads_out_of(chart, a) { // charts that touch leave no room for their seams: stay
                return at_border;
            }
        }
        let seam = seams[seam_id - 1u];
        a = settled(ids, across(seam, a));
        b = across(seam, b);
    }
    return select(a, b, id_at(ids, a) == id_at(ids, b));
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Texel {
    let size = vec2f(textureDimensions(ids));
    let id = textureLoad(ids, vec2u(pixel.xy), 0).r;
    var home = pixel.xy / size;
    if id != 0u && (id & INSIDE) == 0u { // a texel of the gutter is one of the neighbour's
        home = settled(ids, across(seams[id - 1u], home));
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
    let texel = 1.0 / scale;
    let source_texel = texel / params.finer;
    let own = select(0.0, BOX, params.reached == 0.0) + select(0.0, HALVING, params.finer > 1.0);
    let reached = max(params.reached - SPLINE * source_texel * source_texel, 0.0) + own * source_texel * source_texel;
    let variance = params.variance - SPLINE * texel * texel - reached;
    let spacing = max(source_texel, SPACING * sqrt(reached));
    let spread = variance / (spacing * spacing);
    // Samples of a Gaussian much narrower than their spacing have less variance than it: three that have as much.
    let exponent = select(-0.5 / spread, log(0.5 * spread / (1.0 - spread)), spread < 0.25);
    var total = textureSampleLevel(source, linear_clamp, home, 0.0);
    // None where the Gaussian is narrower than a texel; nor where the mask hides what is drawn: on CPUs that runs on in the
    // lanes of its neighbours.
    var taps = 0.0;
    if id != 0u && total.a > 0.0 && variance > 0.0 {
        taps = clamp(ceil(REACH * sqrt(variance) / spacing), 1.0, MAX_TAPS);
    }
    // Apart, since on CPUs a branch costs all lanes what one of them takes: taps that stay in the chart, taps that may not.
    let clear = min(floor(u.w / (spacing * scale)), taps);
    for (var k = 1.0; k <= clear; k += 1.0) {
        let weight = exp(exponent * k * k);
        let step = texels_per_mm * (spacing * k / size);
        total += weight * textureSampleLevel(source, linear_clamp, home + step, 0.0);
        total += weight * textureSampleLevel(source, linear_clamp, home - step, 0.0);
    }
    for (var i = 0.0; i < 2.0 * (taps - clear); i += 1.0) { // there and back in turn
        let k = (clear + 1.0 + floor(0.5 * i)) * (1.0 - 4.0 * fract(0.5 * i));
        let step = texels_per_mm * (spacing * k / size);
        total += exp(exponent * k * k) * textureSampleLevel(source, linear_clamp, walk(home, step), 0.0);
    }
    return Texel(vec4f(total.rgb / max(total.a, 1e-4), f32(total.a > 0.0))); // alpha: 1 where the source has a value
}
