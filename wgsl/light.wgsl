// Lights as the shaders see them, and their shadows.

import package::units::{Length, Number, Position, Direction, Irradiance, MM_PER_M};

const DIRECTIONAL: u32 = 0u;
const POINT: u32 = 1u;
const PATCH: u32 = 2u; // a small piece of a surface that emits by the cosine

// Loops over lights end at arrayLength: were it a uniform, lavapipe would compile, and keep, a shader for each draw.
struct Light {
    position: vec3f,  // mm; of a directional light the unit direction towards it
    kind: u32,
    power: vec3f,     // directional: irradiance, W/m^2; point: intensity, W/sr; patch: intensity along its normal, W/sr
    first_view: u32,  // of its shadow views
    normal: vec3f,    // of a patch
    views: u32,       // 0: casts no shadow, 1: one view of the whole scene, 6: a cube around the light
}

struct ShadowView {
    world_to_clip: mat4x4f,
    texel: Number,       // size of a shadow texel on a surface that faces the light: mm, or mm per mm of distance
    perspective: u32,
}

struct Incident {
    direction: Direction,    // w_i
    irradiance: Irradiance,  // on a surface that faces the light, not shadowed
    distance: Length,
}

fn incident(light: Light, x: Position) -> Incident {
    if light.kind == DIRECTIONAL {
        return Incident(light.position, light.power, 0.0);
    }
    let to_light = light.position - x;
    let distance = max(length(to_light), 1e-6);
    let w_i = to_light / distance;
    let metres = distance / MM_PER_M;
    var e = light.power / (metres * metres);
    if light.kind == PATCH {
        e *= max(-dot(light.normal, w_i), 0.0);
    }
    return Incident(w_i, e, distance);
}

// Which of the six views of a cube sees along `d` from the light: +x -x +y -y +z -z.
fn cube_face(d: vec3f) -> u32 {
    let a = abs(d);
    if a.x >= a.y && a.x >= a.z {
        return select(1u, 0u, d.x > 0.0);
    }
    if a.y >= a.z {
        return select(3u, 2u, d.y > 0.0);
    }
    return select(5u, 4u, d.z > 0.0);
}

// The shadow view of a light, as a layer of the shadow maps, that sees along `d` from it.
fn layer_towards(light: Light, d: vec3f) -> u32 {
    return light.first_view + select(0u, cube_face(d), light.views == 6u);
}

// How far the receiver is lifted along its normal, in shadow texels per unit of sine: the filter below reaches 1.5
// texels, over which a plane's depth rises by that many texels times the tangent. More would let light leak.
const LIFT_TEXELS: Number = 2.0;

// A side of the area filtered, in the view's normalised coordinates: that of `side` (mm), and at least two texels, the
// reach of a lookup, if need be along `otherwise`. `texels` is the size of the map, -1 to 1 in these coordinates.
fn side_of_filter(view: ShadowView, side: vec3f, at: vec3f, w: f32, otherwise: vec3f, texels: f32) -> vec3f {
    let clip = view.world_to_clip * vec4f(side, 0.0);
    let d = (clip.xyz - at * clip.w) / w;
    let size = length(d.xy);
    let least = 4.0 / texels;
    return select(d * max(1.0, least / max(size, 1e-9)), least * otherwise, size < 1e-6);
}

// The share of light that reaches the parallelogram about x with sides dx and dy, at least a tent of 3 x 3 shadow texels.
// Each lookup filters 2 x 2 of them, and they are at most 1.5 apart as long as 4 x 4 lookups reach.
fn shadow(view: ShadowView, layer: u32, at: Incident, x: Position, n: Direction, dx: vec3f, dy: vec3f,
          shadow_maps: texture_depth_2d_array, compare_less: sampler_comparison) -> Number {
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
