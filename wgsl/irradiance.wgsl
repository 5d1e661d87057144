// Transmitted irradiance L_d (Maisch & Ropinski 2017, eq. 4): the one function behind the maps at texels, at vertices
// and at pixels.

import package::units::{Number, Position, Direction, Irradiance};
import package::light::{Light, Incident, ShadowView};
import package::rho_dt::{rho_dt};
import package::sampling::{map_of_direction};

// L_d of one light at x, given the share `lit` of it that shadows leave.
fn transmitted(at: Incident, n: Direction, specular: Number, lit: Number, rho_dt_table: texture_2d<f32>) -> Irradiance {
    let cosine = max(dot(n, at.direction), 0.0);
    return at.irradiance * (cosine * lit * rho_dt(rho_dt_table, cosine, specular));
}

// L_d of the environment, of which a share `sky` arrives: prefiltered over normals with the cosine and rho_dt.
fn transmitted_environment(environment: texture_2d<f32>, linear_wrap_u: sampler, n: Direction, sky: Number) -> Irradiance {
    let at = map_of_direction(n, textureDimensions(environment));
    let received = textureSampleLevel(environment, linear_wrap_u, at, 0.0);
    return sky * received.a * received.a * received.rgb;
}
