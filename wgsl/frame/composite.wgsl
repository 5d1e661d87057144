// Radiance towards the viewer (Maisch & Ropinski 2017, eq. 5): rho_dt(x_o, w_o) / pi (M_front + M_back) + specular.

import package::units::{PI};
import package::lights::{rho_dt_table};
import package::rho_dt::{rho_dt};
import package::per_object::{is_other_object, position_at, normal_at, specular_at, direction_to_viewer};
import package::targets::{RGBA32Float};

@group(0) @binding(0) var M_front: texture_2d<f32>;
@group(0) @binding(1) var M_back: texture_2d<f32>;   // or a single black texel
@group(0) @binding(2) var specular: texture_2d<f32>; // or a single black texel

struct Pixel {
    @location(0) radiance: RGBA32Float, // alpha: coverage
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let cosine = max(dot(normal_at(texel), direction_to_viewer(position_at(texel))), 0.0);
    let back = textureLoad(M_back, min(texel, textureDimensions(M_back) - 1u), 0).rgb;
    let reflected = textureLoad(specular, min(texel, textureDimensions(specular) - 1u), 0).rgb;
    let M = textureLoad(M_front, texel, 0).rgb + back;
    let diffuse = M * (rho_dt(rho_dt_table, cosine, specular_at(texel)) / PI);
    return Pixel(vec4f(diffuse + reflected, 1.0));
}
