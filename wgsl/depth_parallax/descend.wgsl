// The light that one layer reflects, and the light that enters the layer below it: the blurred maps of the light that
// enters the layer, by the weights of its R and T. Light goes back and forth between the layers: 1 / (1 - R' rho).

import package::depth_parallax::weights::{GAUSSIANS, REFLECTED, DOWNWARDS, FROM_BELOW, place_at, row_at};
import package::screen::{screen_corner};
import package::targets::{RGBA16Float};
import package::spline::{smooth_sample};
import package::units::{Length};

struct Params {
    absorption: vec3f, // sigma_a, 1/mm
    thickness: Length, // at a share of 1
    scattering: vec3f, // sigma_s', 1/mm, at a share of 1
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var amount: texture_2d<f32>; // of the layer, as maps.wgsl draws it
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var below: texture_2d<f32>;  // reflectance of the layers below, or a single black texel
@group(0) @binding(4) var above: texture_2d<f32>;  // optical depth of the layers above, or a single black texel
@group(0) @binding(5) var linear_clamp: sampler;
@group(0) @binding(6) var blurred_0: texture_2d<f32>;
@group(0) @binding(7) var blurred_1: texture_2d<f32>;
@group(0) @binding(8) var blurred_2: texture_2d<f32>;
@group(0) @binding(9) var blurred_3: texture_2d<f32>;
@group(0) @binding(10) var blurred_4: texture_2d<f32>;
@group(0) @binding(11) var blurred_5: texture_2d<f32>;

struct Texel {
    @location(0) reflected: RGBA16Float, // by this layer
    @location(1) entering: RGBA16Float,  // the layer below
    @location(2) optical: RGBA16Float,   // optical depth down to the layer below
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Texel {
    let texel = vec2u(pixel.xy);
    let share = textureLoad(amount, texel, 0);
    if share.a == 0.0 {
        discard;
    }
    let scattered = textureLoad(color, texel, 0).rgb;
    let place = place_at(share.r * share.g, scattered);
    let uv = pixel.xy / vec2f(textureDimensions(amount));
    var light = array(
        smooth_sample(blurred_0, linear_clamp, uv), smooth_sample(blurred_1, linear_clamp, uv),
        smooth_sample(blurred_2, linear_clamp, uv), smooth_sample(blurred_3, linear_clamp, uv),
        smooth_sample(blurred_4, linear_clamp, uv), smooth_sample(blurred_5, linear_clamp, uv));
    var reflected = vec3f(0.0);
    var entering = vec3f(0.0);
    for (var k = 0u; k < GAUSSIANS; k++) {
        reflected += row_at(REFLECTED + k, place) * light[k];
        entering += row_at(DOWNWARDS + k, place) * light[k];
    }
    let rho = textureLoad(below, min(texel, textureDimensions(below) - 1u), 0).rgb;
    entering /= 1.0 - row_at(FROM_BELOW, place) * rho;
    let sigma = params.absorption + params.scattering * scattered;
    let depth = textureLoad(above, min(texel, textureDimensions(above) - 1u), 0).rgb
        + sigma * (params.thickness * share.r * share.g);
    return Texel(vec4f(reflected, 1.0), vec4f(entering, 1.0), vec4f(min(depth, vec3f(6e4)), 1.0));
}
