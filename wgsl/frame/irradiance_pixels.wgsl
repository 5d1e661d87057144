// L_d at the pixels of one object.

import package::lights::{transmitted_irradiance};
import package::per_object::{is_other_object, position_at, normal_at, specular_at, sky_at};
import package::targets::{RGBA32Float};

struct Pixel {
    @location(0) irradiance: RGBA32Float, // W/m^2
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let x = position_at(texel);
    let nowhere = vec3f(0.0); // shadows are those at the pixel's centre
    let L_d = transmitted_irradiance(x, normal_at(texel), specular_at(texel), sky_at(texel), nowhere, nowhere);
    return Pixel(vec4f(L_d, 1.0));
}
