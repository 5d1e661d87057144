// Radiance towards the viewer (Maisch & Ropinski 2017, eq. 5): rho_dt(x_o, w_o) / pi (M_front + M_back) + specular.

import package::units::{PI};
import package::mesh::{ObjectUniforms};
import package::rho_dt::{rho_dt};
import package::screen::{position_of_pixel, direction_to_eye};
import package::rectangle::{rectangle_corner};
import package::targets::{RGBA32Float};

struct Params {
    clip_to_world: mat4x4f,
    eye: vec4f,
    rectangle: vec4f, // where the object may be
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var gbuffer_id: texture_2d<f32>;
@group(0) @binding(3) var normal: texture_2d<f32>;
@group(0) @binding(4) var depth: texture_depth_2d;
@group(0) @binding(5) var rho_dt_table: texture_2d<f32>;
@group(0) @binding(6) var M_front: texture_2d<f32>;
@group(0) @binding(7) var M_back: texture_2d<f32>;
@group(0) @binding(8) var specular: texture_2d<f32>;

struct Pixel {
    @location(0) radiance: RGBA32Float, // alpha: coverage
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
    let x = position_of_pixel(pixel.xy, depth, params.clip_to_world);
    let n_specular = textureLoad(normal, texel, 0);
    let cosine = max(dot(normalize(n_specular.xyz), direction_to_eye(params.eye, x)), 0.0);
    // What nothing was drawn for is a single black texel, loaded at its one place.
    let back = textureLoad(M_back, min(texel, textureDimensions(M_back) - 1u), 0).rgb;
    let reflected = textureLoad(specular, min(texel, textureDimensions(specular) - 1u), 0).rgb;
    let M = textureLoad(M_front, texel, 0).rgb + back;
    let diffuse = M * (rho_dt(rho_dt_table, cosine, n_specular.w) / PI);
    return Pixel(vec4f(diffuse + reflected, 1.0));
}
