// M where light leaves at the point where it entered: the profile's total reflectance times L_d.

import package::mesh::{color_before, color_after};
import package::per_object::{object, is_other_object, base_color_at};
import package::targets::{RGBA32Float};

@group(0) @binding(0) var<uniform> total: vec3f; // reflectance of the diffusion profile
@group(0) @binding(1) var irradiance: texture_2d<f32>;

struct Pixel {
    @location(0) M_front: RGBA32Float,
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let color = color_before(object, base_color_at(texel)) * color_after(object, base_color_at(texel));
    return Pixel(vec4f(total * color * textureLoad(irradiance, texel, 0).rgb, 1.0));
}
