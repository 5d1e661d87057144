// L_d at points on one object: its vertices, or any others. Normal maps, which need derivatives, are left out.

import package::mesh::{Vertex, ObjectUniforms, color_before, map_coordinates};
import package::light::{Light, ShadowView, incident, shadow, layer_towards};
import package::irradiance::{transmitted, transmitted_environment};

@group(0) @binding(0) var<uniform> object: ObjectUniforms;
@group(0) @binding(1) var<storage, read> points: array<Vertex>;
@group(0) @binding(2) var<storage, read> lights: array<Light>;
@group(0) @binding(3) var<storage, read> views: array<ShadowView>;
@group(0) @binding(4) var shadow_maps: texture_depth_2d_array;
@group(0) @binding(5) var compare_less: sampler_comparison;
@group(0) @binding(6) var rho_dt_table: texture_2d<f32>;
@group(0) @binding(7) var environment: texture_2d<f32>;
@group(0) @binding(8) var linear_wrap_u: sampler;
@group(0) @binding(9) var base_color_map: texture_2d<f32>;
@group(0) @binding(10) var specular_map: texture_2d<f32>;
@group(0) @binding(11) var linear_repeat: sampler;
@group(0) @binding(12) var<storage, read> colors: array<vec4f>; // of each point, or one for all
@group(0) @binding(13) var<storage, read_write> irradiance: array<vec4f>; // L_d times the base colour's share before diffusion

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&points) {
        return;
    }
    let point = points[id.x];
    let x = (object.object_to_world * vec4f(point.position, 1.0)).xyz;
    let n = normalize((object.object_to_world * vec4f(point.normal, 0.0)).xyz);
    let uv = vec2f(point.u, point.v);
    let color_at = map_coordinates(object, uv, textureDimensions(base_color_map));
    let texel = textureSampleLevel(base_color_map, linear_repeat, color_at, 0.0).rgb;
    let color = colors[min(id.x, arrayLength(&colors) - 1u)].rgb * texel;
    let specular_at = map_coordinates(object, uv, textureDimensions(specular_map));
    let specular = object.specular * textureSampleLevel(specular_map, linear_repeat, specular_at, 0.0).r;
    var total = transmitted_environment(environment, linear_wrap_u, n, point.sky);
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
        total += transmitted(at, n, specular, lit, rho_dt_table);
    }
    irradiance[id.x] = vec4f(color_before(object, color) * total, 1.0);
}
