// M_front at the pixels of one object: the weighted sum of its irradiance maps, each blurred with one Gaussian
// (Mikkelsen 2009, 3.4, step 4a).

import package::mesh::{color_after};
import package::per_object::{object, is_other_object, atlas_at, base_color_at};
import package::spline::{smooth_sample};
import package::targets::{RGBA32Float};

@group(0) @binding(0) var<uniform> weights: array<vec4f, 6>; // rgb of each Gaussian, narrowest first
@group(0) @binding(1) var linear_clamp: sampler;
@group(0) @binding(2) var blurred_0: texture_2d<f32>;
@group(0) @binding(3) var blurred_1: texture_2d<f32>;
@group(0) @binding(4) var blurred_2: texture_2d<f32>;
@group(0) @binding(5) var blurred_3: texture_2d<f32>;
@group(0) @binding(6) var blurred_4: texture_2d<f32>;
@group(0) @binding(7) var blurred_5: texture_2d<f32>;

struct Pixel {
    @location(0) M_front: RGBA32Float,
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let uv = atlas_at(texel);
    var M = weights[0].rgb * smooth_sample(blurred_0, linear_clamp, uv);
    M += weights[1].rgb * smooth_sample(blurred_1, linear_clamp, uv);
    M += weights[2].rgb * smooth_sample(blurred_2, linear_clamp, uv);
    M += weights[3].rgb * smooth_sample(blurred_3, linear_clamp, uv);
    M += weights[4].rgb * smooth_sample(blurred_4, linear_clamp, uv);
    M += weights[5].rgb * smooth_sample(blurred_5, linear_clamp, uv);
    return Pixel(vec4f(M * color_after(object, base_color_at(texel)), 1.0));
}
