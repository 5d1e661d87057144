// Light reflected at the surface of one object: the GGX lobe of each light, and the prefiltered environment.

import package::units::{Number};
import package::light::{incident};
import package::lights::{lights, rho_dt_table, linear_wrap_u, visibility};
import package::ggx::{ggx_brdf};
import package::rho_dt::{rho_dt};
import package::sampling::{map_of_direction};
import package::per_object::{is_other_object, position_at, normal_at, specular_at, sky_at, direction_to_viewer};
import package::targets::{RGBA32Float};

struct Params {
    alpha: Number, // GGX width
    eta: Number,   // refractive index inside over outside
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var reflection: texture_2d<f32>; // by mirror direction (prefilter_reflection.wgsl)

struct Pixel {
    @location(0) specular: RGBA32Float, // radiance
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let x = position_at(texel);
    let n = normal_at(texel);
    let w_o = direction_to_viewer(x);
    // The lobe reflects the share 1 - rho_dt of the light; the prefiltered environment is the mean radiance over the
    // lobe. The share of the environment that the scene does not block is that of the whole hemisphere, not of the
    // lobe.
    let towards = map_of_direction(reflect(-w_o, n), textureDimensions(reflection));
    let mirrored = textureSampleLevel(reflection, linear_wrap_u, towards, 0.0);
    let share = 1.0 - rho_dt(rho_dt_table, max(dot(n, w_o), 0.0), 1.0);
    var total = sky_at(texel) * mirrored.a * mirrored.a * mirrored.rgb * share;
    for (var i = 0u; i < arrayLength(&lights); i++) {
        let light = lights[i];
        let at = incident(light, x);
        let f_r = ggx_brdf(n, at.direction, w_o, params.alpha, params.eta);
        if f_r <= 0.0 {
            continue;
        }
        let lit = visibility(light, at, x, n, vec3f(0.0), vec3f(0.0));
        total += at.irradiance * (f_r * dot(n, at.direction) * lit);
    }
    return Pixel(vec4f(total * specular_at(texel), 1.0));
}
