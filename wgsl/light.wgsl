// Lights as the shaders see them (wgsss/emitters.py). The bindings are in lights.wgsl.

import package::units::{Length, Number, Position, Direction, Irradiance, MM_PER_M};

const DIRECTIONAL: u32 = 0u;
const POINT: u32 = 1u;
const PATCH: u32 = 2u; // a small piece of a surface whose intensity falls with the cosine from its normal

struct Light {
    position: vec3f,  // mm; of a directional light the unit direction towards it
    kind: u32,
    power: vec3f,     // directional: irradiance, W/m^2; point: intensity, W/sr; patch: intensity along its normal, W/sr
    first_view: u32,  // index of the first of its shadow views
    normal: vec3f,    // of a patch
    views: u32,       // 0: casts no shadow, 1: one view of the whole scene, 6: a cube around the light
}

// The view of the scene from a light, of which a shadow map is drawn.
struct ShadowView {
    world_to_clip: mat4x4f,
    texel: Number,       // size of a shadow texel on a surface that faces the light: mm, or mm per mm of distance
    perspective: u32,
}

struct Incident {
    direction: Direction,    // w_i
    irradiance: Irradiance,  // on a surface that faces the light, without shadows
    distance: Length,        // 0 for directional lights
}

// The light that arrives at x.
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

// The index of the view of a cube, of six, that sees along `d` from the light: +x -x +y -y +z -z.
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

// The layer of the shadow maps that holds what a light sees along `d`.
fn layer_towards(light: Light, d: vec3f) -> u32 {
    return light.first_view + select(0u, cube_face(d), light.views == 6u);
}
