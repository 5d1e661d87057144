// M_back at the pixels of one object, from the thickness in a g-buffer (gbuffer.wgsl).

import package::local_thickness::packing::{unpack_grey, unpack_coloured, unpack_low};
import package::local_thickness::transport::{Transport, light_out};
import package::per_object::{is_other_object, position_at, normal_at, base_color_at, direction_to_viewer};
import package::targets::{RGBA32Float};

override COLOURED: bool = true;
override BITS: u32 = 0u; // of each channel of the colour that number the parameters

@group(0) @binding(0) var<uniform> albedo: vec3f; // cDiffuseAlbedo, without the base colour of the g-buffer
@group(0) @binding(1) var<storage, read> transports: array<Transport>; // the parameters of the materials
@group(0) @binding(2) var stored: texture_2d<f32>;

struct Pixel {
    @location(0) M_back: RGBA32Float,
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let packed = textureLoad(stored, texel, 0);
    var thickness = unpack_grey(packed, BITS);
    var which = unpack_low(packed.b, BITS);
    if COLOURED {
        thickness = unpack_coloured(packed, BITS);
        which = unpack_low(packed.g, BITS) | (unpack_low(packed.b, BITS) << BITS);
    }
    let x = position_at(texel);
    let light = light_out(transports[which], x, normal_at(texel), direction_to_viewer(x));
    return Pixel(vec4f(albedo * base_color_at(texel) * light * thickness, 1.0));
}
