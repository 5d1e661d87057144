// One direction of a Gaussian blur over the surface, in the atlas (Mikkelsen 2009, 3.4; d'Eon & Luebke 2007, 14.5).
//
// The two directions of the separable blur must agree on both sides of a seam. They are derived from the normal and an
// axis in object space, not from the atlas. The distance between taps is in mm on the surface; the gradients of the
// atlas coordinates convert it to texels, for any stretch and orientation of the chart. A tap that leaves its chart
// continues in the neighbouring chart, as the seams unfold it.

import package::units::{Area};
import package::charts::{INSIDE, across, settled};
import package::screen::{screen_corner};
import package::targets::{RGBA16Float};
import package::walk::{ids, seams, walk};

struct Params {
    axis: vec3f,      // object space; direction 0 is perpendicular to it and to the normal
    direction: u32,   // 0 or 1
    variance: Area,   // of the Gaussian
    reached: Area,    // variance of the Gaussian that the source is already blurred with; 0 for the irradiance
    finer: f32,       // texels of the source per texel of the target
    depth: f32,       // at which the target is drawn: smaller than that of the last pass with the same mask
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var source: texture_2d<f32>; // may be larger than the target
@group(0) @binding(2) var linear_clamp: sampler;
@group(0) @binding(3) var gradient_u: texture_2d<f32>; // texels per mm; in w the distance to the chart's border in texels
@group(0) @binding(4) var gradient_v: texture_2d<f32>;

struct Texel {
    @location(0) blurred: RGBA16Float,
}

const REACH: f32 = 3.0;   // sigmas to each side, 99.7 % of the Gaussian; the weights are normalised
const SPACING: f32 = 1.5; // between taps, in sigmas of the source's own blur: the error stays below 1e-3
const MAX_TAPS: f32 = 64.0; // to each side

// Variances, in texels^2, of blurs that sampling adds.
const SPLINE: f32 = 1.0 / 3.0; // of the B-spline with which gather.wgsl reads the result
const BOX: f32 = 1.0 / 12.0;   // of the irradiance map, whose texels are means over their areas
const HALVING: f32 = 0.25;     // of bilinear reads of a larger map

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(screen_corner(i).xy, params.depth, 1.0);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Texel {
    let size = vec2f(textureDimensions(ids));
    let id = textureLoad(ids, vec2u(pixel.xy), 0).r;
    var home = pixel.xy / size;
    if id != 0u && (id & INSIDE) == 0u { // a texel of the gutter has the neighbour's value
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
    // Taps at a spacing much wider than the Gaussian have less variance than it. Then three taps with its variance are
    // used.
    let exponent = select(-0.5 / spread, log(0.5 * spread / (1.0 - spread)), spread < 0.25);
    var total = textureSampleLevel(source, linear_clamp, home, 0.0);
    // No taps where the Gaussian is narrower than a texel, nor where the mask hides the texel: on CPUs, lanes next to
    // visible texels run as well.
    var taps = 0.0;
    if id != 0u && total.a > 0.0 && variance > 0.0 {
        taps = clamp(ceil(REACH * sqrt(variance) / spacing), 1.0, MAX_TAPS);
    }
    // Two loops, for taps that certainly stay in the chart and for the others, since on CPUs a branch that one lane
    // takes costs all lanes its time.
    let clear = min(floor(u.w / (spacing * scale)), taps);
    for (var k = 1.0; k <= clear; k += 1.0) {
        let weight = exp(exponent * k * k);
        let step = texels_per_mm * (spacing * k / size);
        total += weight * textureSampleLevel(source, linear_clamp, home + step, 0.0);
        total += weight * textureSampleLevel(source, linear_clamp, home - step, 0.0);
    }
    for (var i = 0.0; i < 2.0 * (taps - clear); i += 1.0) { // forwards and backwards in turn
        let k = (clear + 1.0 + floor(0.5 * i)) * (1.0 - 4.0 * fract(0.5 * i));
        let step = texels_per_mm * (spacing * k / size);
        total += exp(exponent * k * k) * textureSampleLevel(source, linear_clamp, walk(home, step), 0.0);
    }
    return Texel(vec4f(total.rgb / max(total.a, 1e-4), f32(total.a > 0.0))); // alpha: 1 where the source has a value
}
