// The radiance of the environment averaged over the specular lobe around each mirror direction, as seen along the
// normal.

import package::units::{Number, PI};
import package::ggx::{ggx_distribution};
import package::sampling::{direction_of_lat_long, direction_of_map};

struct Params {
    alpha: Number,
    root: Number, // square root of the radiance that a value of 1 means
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var environment: texture_2d<f32>;
@group(0) @binding(2) var reflection: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(reflection);
    if any(id.xy >= size) {
        return;
    }
    let r = direction_of_map(id.xy, size);
    let source = textureDimensions(environment);
    // A lobe narrower than a texel of the environment could fall between texels.
    let alpha = max(params.alpha, 2.0 / f32(source.y));
    var total = vec3f(0.0);
    var weights = 0.0;
    for (var j = 0u; j < source.y; j++) {
        let sine = sin(PI * (f32(j) + 0.5) / f32(source.y));
        for (var i = 0u; i < source.x; i++) {
            let w_i = direction_of_lat_long((vec2f(vec2u(i, j)) + 0.5) / vec2f(source));
            let cosine = dot(r, w_i);
            if cosine > 0.0 {
                let weight = ggx_distribution(sqrt(0.5 + 0.5 * cosine), alpha) * cosine * sine;
                total += textureLoad(environment, vec2u(i, j), 0).rgb * weight;
                weights += weight;
            }
        }
    }
    textureStore(reflection, id.xy, vec4f(total / max(weights, 1e-9) / (params.root * params.root), params.root));
}
