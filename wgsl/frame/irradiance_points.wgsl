// L_d at points on one object, such as its vertices. Normal maps, which need derivatives, are not applied.

import package::mesh::{Vertex, ObjectUniforms, color_before, map_coordinates};
import package::lights::{transmitted_irradiance};

@group(0) @binding(0) var<uniform> object: ObjectUniforms;
@group(0) @binding(1) var<storage, read> points: array<Vertex>;
@group(0) @binding(2) var base_color_map: texture_2d<f32>;
@group(0) @binding(3) var specular_map: texture_2d<f32>;
@group(0) @binding(4) var linear_repeat: sampler;
@group(0) @binding(5) var<storage, read> colors: array<vec4f>; // of each point, or one for all
@group(0) @binding(6) var<storage, read_write> irradiance: array<vec4f>; // L_d times the share of the base colour before diffusion

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
    let L_d = transmitted_irradiance(x, n, specular, point.sky, vec3f(0.0), vec3f(0.0));
    irradiance[id.x] = vec4f(color_before(object, color) * L_d, 1.0);
}
