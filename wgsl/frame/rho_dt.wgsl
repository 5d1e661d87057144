// The table of rho_dt over the cosine (Maisch & Ropinski 2017, eq. 3): one minus the integral of the specular BRDF
// times the cosine over the hemisphere, by sampling the microfacets visible from w_o. Each sample contributes F G2 /
// G1.

import package::units::{Number};
import package::fresnel::{fresnel_dielectric};
import package::ggx::{ggx_masking, ggx_sample_visible, ggx_visibility};
import package::sampling::{hammersley};
import package::rho_dt::{RHO_DT_ENTRIES, rho_dt_cosine};

struct Params {
    alpha: Number, // GGX width
    eta: Number,   // refractive index inside over outside
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var rho_dt_table: texture_storage_2d<r32float, write>;

const SAMPLES: u32 = 1024u; // the error is below 1e-3 for roughness 0.1 to 1

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= RHO_DT_ENTRIES {
        return;
    }
    let cos_o = max(rho_dt_cosine(id.x), 1e-4);
    let w_o = vec3f(sqrt(1.0 - cos_o * cos_o), 0.0, cos_o);
    var reflected = 0.0;
    for (var i = 0u; i < SAMPLES; i++) {
        let h = ggx_sample_visible(w_o, params.alpha, hammersley(i, SAMPLES));
        let cos_i = reflect(-w_o, h).z;
        if cos_i > 0.0 {
            let g2 = 4.0 * cos_i * cos_o * ggx_visibility(cos_i, cos_o, params.alpha);
            reflected += fresnel_dielectric(dot(w_o, h), params.eta) * g2 / ggx_masking(cos_o, params.alpha);
        }
    }
    textureStore(rho_dt_table, vec2u(id.x, 0u), vec4f(1.0 - reflected / f32(SAMPLES)));
}
