// L_d of the environment for every normal (Maisch & Ropinski 2017, eq. 4), without shadows.

import package::units::{Number, PI};
import package::rho_dt::{rho_dt};
import package::sampling::{direction_of_lat_long, direction_of_map};

struct Params {
    specular: Number,
    root: Number, // square root of the irradiance that a value of 1 means
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var environment: texture_2d<f32>;
@group(0) @binding(2) var rho_dt_table: texture_2d<f32>;
@group(0) @binding(3) var irradiance: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(irradiance);
    if any(id.xy >= size) {
        return;
    }
    let n = direction_of_map(id.xy, size);
    let source = textureDimensions(environment);
    var total = vec3f(0.0);
    var cosines = 0.0;
    for (var j = 0u; j < source.y; j++) {
        let sine = sin(PI * (f32(j) + 0.5) / f32(source.y)); // the texel's solid angle, up to a factor
        for (var i = 0u; i < source.x; i++) {
            let w_i = direction_of_lat_long((vec2f(vec2u(i, j)) + 0.5) / vec2f(source));
            let cosine = dot(n, w_i);
            if cosine > 0.0 {
                total += textureLoad(environment, vec2u(i, j), 0).rgb * (cosine * sine * rho_dt(rho_dt_table, cosine, params.specular));
                cosines += cosine * sine;
            }
        }
    }
    // The integral of the cosine is pi. Dividing by the sum of the cosines corrects the error of the grid.
    textureStore(irradiance, id.xy, vec4f(total * (PI / max(cosines, 1e-9)) / (params.root * params.root), params.root));
}
