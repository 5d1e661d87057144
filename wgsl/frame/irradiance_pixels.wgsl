// L_d at the pixels of one object.

import package::mesh::{ObjectUniforms};
import package::light::{Light, ShadowView, incident, shadow, layer_towards};
import package::irradiance::{transmitted, transmitted_environment};
import package::screen::{position_of_pixel};
import package::rectangle::{rectangle_corner};
import package::targets::{RGBA32Float};

struct Params {
    clip_to_world: mat4x4f,
    rectangle: vec4f, // where the object may be
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var gbuffer_id: texture_2d<f32>;
@group(0) @binding(3) var normal: texture_2d<f32>;
@group(0) @binding(4) var depth: texture_depth_2d;
@group(0) @binding(5) var<storage, read> lights: array<Light>;
@group(0) @binding(6) var<storage, read> views: array<ShadowView>;
@group(0) @binding(7) var shadow_maps: texture_depth_2d_array;
@group(0) @binding(8) var compare_less: sampler_comparison;
@group(0) @binding(9) var rho_dt_table: texture_2d<f32>;
@group(0) @binding(10) var environment: texture_2d<f32>;
@group(0) @binding(11) var linear_wrap_u: sampler;

struct Pixel {
    @location(0) irradiance: RGBA32Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return rectangle_corner(i, params.rectangle);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    let seen = textureLoad(gbuffer_id, texel, 0);
    if u32(seen.z) != object.id {
        discard;
    }
    let x = position_of_pixel(pixel.xy, depth, params.clip_to_world);
    let n_specular = textureLoad(normal, texel, 0);
    let n = normalize(n_specular.xyz);
    var total = transmitted_environment(environment, linear_wrap_u, n, seen.w);
    for (var i = 0u; i < arrayLength(&lights); i++) {
        let light = lights[i];
        let at = incident(light, x);
        if dot(n, at.direction) <= 0.0 {
            continue;
        }
        var lit = 1.0;
        if light.views > 0u {
            let layer = layer_towards(light, -at.direction);
            lit = shadow(views[layer], layer, at, x, n, vec3f(0.0), vec3f(0.0), shadow_maps, compare_less);
        }
        total += transmitted(at, n, n_specular.w, lit, rho_dt_table);
    }
    return Pixel(vec4f(total, 1.0));
}
