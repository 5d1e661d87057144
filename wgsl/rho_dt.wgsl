// The table of rho_dt, the share of light that the surface does not reflect (Maisch & Ropinski 2017, eq. 3).
// frame/rho_dt.wgsl computes it.

import package::units::{Number};

const RHO_DT_ENTRIES: u32 = 64u;

// The cosine of entry i. Entries are denser towards grazing angles, where Fresnel reflection changes fastest.
fn rho_dt_cosine(i: u32) -> Number {
    let s = f32(i) / f32(RHO_DT_ENTRIES - 1u);
    return s * s;
}

// rho_dt for light at `cosine` from the normal and a specular lobe scaled by `specular`.
fn rho_dt(rho_dt_table: texture_2d<f32>, cosine: Number, specular: Number) -> Number {
    let s = sqrt(clamp(cosine, 0.0, 1.0)) * f32(RHO_DT_ENTRIES - 1u);
    let i = min(u32(s), RHO_DT_ENTRIES - 2u);
    let a = textureLoad(rho_dt_table, vec2u(i, 0u), 0).r;
    let b = textureLoad(rho_dt_table, vec2u(i + 1u, 0u), 0).r;
    return 1.0 - specular * (1.0 - mix(a, b, s - f32(i)));
}
