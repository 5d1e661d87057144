// The layers below the surface: where they meet, and their coefficients (Norberg 2010, 2.1.2). This module owns the
// bindings.

import package::units::{Length, Number};
import package::mesh::{ObjectUniforms, map_coordinates};

const MAX_LAYERS: u32 = 4u;

override MAPPED: bool = false; // whether coefficients vary over the surface

struct Stack {
    sigma_s: array<vec4f, 4>, // rgb: 1/mm; alpha: g, the mean cosine
    sigma_t: array<vec4f, 4>, // rgb: 1/mm; 0 of layers that are absent
    unit: vec4f,              // rgb: mm, factors of the texture of interfaces
    absent: vec4f,            // rgb: 0, or FAR for interfaces that do not exist
}

@group(1) @binding(20) var<uniform> stack: Stack;
@group(1) @binding(21) var interfaces: texture_2d<f32>;   // depth of each interface, in `unit`
@group(1) @binding(22) var tints: texture_2d_array<f32>;  // of each layer: factor of sigma_s; alpha: share that is present
@group(1) @binding(23) var linear_repeat: sampler;

// The coefficients of all layers at a place, 1/mm.
struct Coefficients {
    s: array<vec3f, 4>,
    t: array<vec3f, 4>,
}

// The depths of the interfaces, from the top down.
fn interfaces_at(object: ObjectUniforms, uv: vec2f) -> vec3f {
    let at = map_coordinates(object, uv, textureDimensions(interfaces));
    return textureSampleLevel(interfaces, linear_repeat, at, 0.0).xyz * stack.unit.xyz + stack.absent.xyz;
}

fn coefficients_at(object: ObjectUniforms, uv: vec2f) -> Coefficients {
    var c: Coefficients;
    let at = map_coordinates(object, uv, textureDimensions(tints));
    for (var j = 0u; j < MAX_LAYERS; j++) {
        c.s[j] = stack.sigma_s[j].rgb;
        c.t[j] = stack.sigma_t[j].rgb;
        if MAPPED {
            let tint = textureSampleLevel(tints, linear_repeat, at, j, 0.0);
            let sigma_a = c.t[j] - c.s[j];
            c.s[j] *= tint.rgb * tint.a;
            c.t[j] = c.s[j] + sigma_a * tint.a;
        }
    }
    return c;
}

// The number of interfaces above a depth: the layer there.
fn layer_at(depth_here: Length, at: vec3f) -> u32 {
    let below = vec3f(depth_here) >= at;
    return select(0u, 1u, below.x) + select(0u, 1u, below.y) + select(0u, 1u, below.z);
}

// The share of a segment that lies below each interface. `first` and `last` are the depths of its ends below the
// interfaces, which are linear between.
fn share_below(first: vec3f, last: vec3f) -> vec3f {
    let positive = max(first, vec3f(0.0)) + max(last, vec3f(0.0));
    let all_of_it = abs(first) + abs(last);
    return select(positive / all_of_it, vec3f(1.0), all_of_it <= vec3f(0.0));
}

// The mean of a coefficient over a segment, given what `share_below` returns for it.
fn mean_over(k: array<vec3f, 4>, below: vec3f) -> vec3f {
    return k[0] * (1.0 - below.x) + k[1] * (below.x - below.y) + k[2] * (below.y - below.z) + k[3] * below.z;
}
