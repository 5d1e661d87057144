// M where light leaves at the point that it entered: the profile's total times L_d.

import package::mesh::{ObjectUniforms, color_before, color_after};
import package::rectangle::{rectangle_corner};
import package::targets::{RGBA32Float};

struct Params {
    total: vec3f, // of the diffusion profile
    rectangle: vec4f, // where the object may be
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var gbuffer_id: texture_2d<f32>;
@group(0) @binding(3) var base_color: texture_2d<f32>;
@group(0) @binding(4) var irradiance: texture_2d<f32>;

struct Pixel {
    @location(0) M_front: RGBA32Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return rectangle_corner(i, params.rectangle);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if u32(textureLoad(gbuffer_id, texel, 0).z) != object.id {
        discard;
    }
    let texel_color = textureLoad(base_color, texel, 0).rgb;
    let color = color_before(object, texel_color) * color_after(object, texel_color);
    return Pixel(vec4f(params.total * color * textureLoad(irradiance, texel, 0).rgb, 1.0));
}
