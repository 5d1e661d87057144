// M_back at the pixels of one object, from the thickness that a g-buffer has.

import package::mesh::{ObjectUniforms};
import package::light::{Light, incident};
import package::irradiance::{transmitted_environment};
import package::screen::{position_of_pixel, direction_to_eye};
import package::local_thickness::packing::{unpack_grey, unpack_coloured, unpack_low};
import package::local_thickness::transport::{Transport, let_out, let_out_environment};
import package::rectangle::{rectangle_corner};
import package::targets::{RGBA32Float};

override COLOURED: bool = true;
override BITS: u32 = 0u; // of each channel of the colour, which tell the parameters

struct Params {
    clip_to_world: mat4x4f,
    eye: vec4f,
    albedo: vec3f, // cDiffuseAlbedo, but for the base colour's map
    rectangle: vec4f, // where the object may be
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> transports: array<Transport>; // that materials have
@group(0) @binding(2) var<uniform> object: ObjectUniforms;
@group(0) @binding(3) var<storage, read> lights: array<Light>;
@group(0) @binding(4) var environment: texture_2d<f32>;
@group(0) @binding(5) var linear_wrap_u: sampler;
@group(0) @binding(6) var gbuffer_id: texture_2d<f32>;
@group(0) @binding(7) var normal: texture_2d<f32>;
@group(0) @binding(8) var base_color: texture_2d<f32>;
@group(0) @binding(9) var depth: texture_depth_2d;
@group(0) @binding(10) var stored: texture_2d<f32>;

struct Pixel {
    @location(0) M_back: RGBA32Float,
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
    let n = normalize(textureLoad(normal, texel, 0).xyz);
    let w_o = direction_to_eye(params.eye, x);
    let packed = textureLoad(stored, texel, 0);
    var thickness = unpack_grey(packed, BITS);
    var which = unpack_low(packed.b, BITS);
    if COLOURED {
        thickness = unpack_coloured(packed, BITS);
        which = unpack_low(packed.g, BITS) | (unpack_low(packed.b, BITS) << BITS);
    }
    let transport = transports[which];
    var light_out = let_out_environment(transport) * transmitted_environment(environment, linear_wrap_u, -n, 1.0);
    for (var i = 0u; i < arrayLength(&lights); i++) {
        let at = incident(lights[i], x);
        light_out += at.irradiance * let_out(transport, at.direction, n, w_o);
    }
    let albedo = params.albedo * textureLoad(base_color, texel, 0).rgb;
    return Pixel(vec4f(albedo * light_out * thickness, 1.0));
}
