// Lights as the shaders see them, and their shadows.

import package::units::{Length, Number, Position, Direction, Irradiance, MM_PER_M};

const DIRECTIONAL: u32 = 0u;
const POINT: u32 = 1u;
const PATCH: u32 = 2u; // a small piece of a surface that emits by the cosine

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

// How far the receiver is lifted along its normal, in shadow texels per unit of sine: the filter below reaches 1.5
// texels, over which a plane's depth rises by that many texels times the tangent. More would let light leak.
const LIFT_TEXELS: Number = 2.0;

// The share of light that reaches the parallelogram about x with sides dx and dy, at least a tent of 3 x 3 shadow texels.
// Each lookup filters 2 x 2 of them; where the sides are long, there are up to 4 x 4 lookups.
fn shadow(view: ShadowView, layer: u32, at: Incident, x: Position, n: Direction, dx: vec3f, dy: vec3f,
          shadow_maps: texture_depth_2d_array, compare_less: sampler_comparison) -> Number {
    let texel = view.texel * select(1.0, at.distance, view.perspective != 0u);
    let cosine = dot(n, at.direction);
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let lifted = x + n * (LIFT_TEXELS * texel * sine) + at.direction * (0.5 * texel);
    let middle = view.world_to_clip * vec4f(lifted, 1.0);
    let along_x = view.world_to_clip * vec4f(dx, 0.0);
    let along_y = view.world_to_clip * vec4f(dy, 0.0);
    let texel_uv = 1.0 / f32(textureDimensions(shadow_maps).x);
    let lookups = clamp(ceil(0.5 * max(length(dx), length(dy)) / texel), 2.0, 4.0);
    var lit = 0.0;
    for (var j = 0.5; j < lookups; j += 1.0) {
        for (var i = 0.5; i < lookups; i += 1.0) {
            let s = vec2f(i, j) / lookups - 0.5;
            let clip = middle + s.x * along_x + s.y * along_y;
            let p = clip.xyz / clip.w;
            let uv = vec2f(0.5 + 0.5 * p.x, 0.5 - 0.5 * p.y) + 2.0 * texel_uv * s;
            lit += textureSampleCompareLevel(shadow_maps, compare_less, uv, layer, p.z);
        }
    }
    return lit / (lookups * lookups);
}
