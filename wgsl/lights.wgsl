// The lights of a scene, their shadows, and the irradiance that they cause. This module owns the bindings: a pass that
// imports it is given them by the frame (`Frame.light_bindings`, wgsss/frame.py), and binds those that it uses.

import package::units::{Number, Position, Direction, Irradiance};
import package::light::{Light, ShadowView, Incident, incident, layer_towards};
import package::rho_dt::{rho_dt};
import package::sampling::{map_of_direction};

// Loops over the lights end at arrayLength. If the count were a uniform, lavapipe would compile a shader for each draw.
@group(1) @binding(8) var<storage, read> lights: array<Light>; // all but environments
@group(1) @binding(9) var<storage, read> views: array<ShadowView>;
@group(1) @binding(10) var shadow_maps: texture_depth_2d_array; // one layer for each view
@group(1) @binding(11) var compare_less: sampler_comparison;
@group(1) @binding(12) var rho_dt_table: texture_2d<f32>; // of the object's surface (rho_dt.wgsl)
@group(1) @binding(13) var environment: texture_2d<f32>; // L_d by normal (frame/prefilter_irradiance.wgsl)
@group(1) @binding(14) var linear_wrap_u: sampler;

// The receiver is lifted along its normal by this many shadow texels per unit of sine. The filter reaches 1.5 texels,
// over which a plane's depth rises by that many texels times the tangent; lifting it farther would let light leak.
const LIFT_TEXELS: Number = 2.0;

// A side of the filtered area in the view's normalised coordinates: that of `side` (mm), but at least the two texels
// that one lookup spans; along `otherwise` where the side is a point. `texels` is the size of the map, -1 to 1 in these
// coordinates.
fn side_of_filter(view: ShadowView, side: vec3f, at: vec3f, w: f32, otherwise: vec3f, texels: f32) -> vec3f {
    let clip = view.world_to_clip * vec4f(side, 0.0);
    let d = (clip.xyz - at * clip.w) / w;
    let size = length(d.xy);
    let least = 4.0 / texels;
    return select(d * max(1.0, least / max(size, 1e-9)), least * otherwise, size < 1e-6);
}

// The share of light that reaches the parallelogram about x with sides dx and dy, filtered over at least 3 x 3 shadow
// texels. Each lookup filters 2 x 2 texels, and lookups are at most 1.5 texels apart as long as 4 x 4 of them suffice.
fn shadow(view: ShadowView, layer: u32, at: Incident, x: Position, n: Direction, dx: vec3f, dy: vec3f) -> Number {
    let texel = view.texel * select(1.0, at.distance, view.perspective != 0u);
    let cosine = dot(n, at.direction);
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let lifted = x + n * (LIFT_TEXELS * texel * sine) + at.direction * (0.5 * texel);
    let clip = view.world_to_clip * vec4f(lifted, 1.0);
    let middle = clip.xyz / clip.w;
    let texels = f32(textureDimensions(shadow_maps).x);
    let across = side_of_filter(view, dx, middle, clip.w, vec3f(1.0, 0.0, 0.0), texels);
    let along = side_of_filter(view, dy, middle, clip.w, vec3f(0.0, 1.0, 0.0), texels);
    let lookups = clamp(ceil(texels * max(length(across.xy), length(along.xy)) / 3.0), 2.0, 4.0);
    var lit = 0.0;
    for (var j = 0.5; j < lookups; j += 1.0) {
        for (var i = 0.5; i < lookups; i += 1.0) {
            let p = middle + (i / lookups - 0.5) * across + (j / lookups - 0.5) * along;
            let uv = vec2f(0.5 + 0.5 * p.x, 0.5 - 0.5 * p.y);
            lit += textureSampleCompareLevel(shadow_maps, compare_less, uv, layer, p.z);
        }
    }
    return lit / (lookups * lookups);
}

// The share of a light that reaches the parallelogram about x with sides dx and dy; 1 where the light casts no shadows.
fn visibility(light: Light, at: Incident, x: Position, n: Direction, dx: vec3f, dy: vec3f) -> Number {
    if light.views == 0u {
        return 1.0;
    }
    let layer = layer_towards(light, -at.direction);
    return shadow(views[layer], layer, at, x, n, dx, dy);
}

// L_d of the environment, of which the scene lets the share `sky` through: prefiltered with the cosine and rho_dt.
fn environment_irradiance(n: Direction, sky: Number) -> Irradiance {
    let at = map_of_direction(n, textureDimensions(environment));
    let received = textureSampleLevel(environment, linear_wrap_u, at, 0.0);
    return sky * received.a * received.a * received.rgb;
}

// The transmitted irradiance L_d of all lights and the environment (Maisch & Ropinski 2017, eq. 4), mean over the
// parallelogram about x with sides dx and dy. `specular` scales the specular lobe.
fn transmitted_irradiance(x: Position, n: Direction, specular: Number, sky: Number, dx: vec3f, dy: vec3f) -> Irradiance {
    var total = environment_irradiance(n, sky);
    for (var i = 0u; i < arrayLength(&lights); i++) {
        let light = lights[i];
        let at = incident(light, x);
        let cosine = max(dot(n, at.direction), 0.0);
        if dot(n, at.direction) <= 0.0 {
            continue;
        }
        let lit = visibility(light, at, x, n, dx, dy);
        total += at.irradiance * (cosine * lit * rho_dt(rho_dt_table, cosine, specular));
    }
    return total;
}
