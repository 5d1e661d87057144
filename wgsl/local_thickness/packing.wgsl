// The layout of translucency in the third target of a g-buffer with 8 bits per channel (Barré-Brisebois & Bouchard
// 2011, "Deferred Shading G-Buffer Setup"):
//
//              R8                G8                   B8             A8
//   grey       sky visibility    custom env. map      translucency   material ID
//   coloured   sky visibility    red                  green          material ID + blue
//
// Sky visibility and the environment map belong to other effects and are 0 here. The ID of the translucent material is
// the last one, so that blue fits above it; as the paper suggests, blue is scaled to the remaining steps. Square roots
// of the thickness are stored, since equal steps of the thickness itself would be visible where it is dark.
//
// Where the materials of a frame have different parameters, the lowest bits of the colour are the number of a pixel's
// parameters: one bit each of red and green, or two of grey.

import package::units::{Number};
import package::targets::{RGBA8Unorm};

const TRANSLUCENT: Number = 3.0; // material ID
const LEFT: Number = 252.0;      // steps that remain for blue

// The value of a channel whose lowest `bits` are `low` and whose other bits are a number from 0 to 1.
fn pack(number: Number, low: u32, bits: u32) -> Number {
    return f32((u32(round(number * f32(255u >> bits))) << bits) | low) / 255.0;
}

fn unpack(channel: Number, bits: u32) -> Number {
    return f32(u32(round(255.0 * channel)) >> bits) / f32(255u >> bits);
}

fn unpack_low(channel: Number, bits: u32) -> u32 {
    return u32(round(255.0 * channel)) & ((1u << bits) - 1u);
}

fn pack_grey(thickness: Number, which: u32, bits: u32) -> RGBA8Unorm {
    return vec4f(0.0, 0.0, pack(sqrt(thickness), which, bits), TRANSLUCENT / 255.0);
}

fn unpack_grey(texel: vec4f, bits: u32) -> vec3f {
    let root = unpack(texel.b, bits);
    return vec3f(root * root);
}

fn pack_coloured(thickness: vec3f, which: u32, bits: u32) -> RGBA8Unorm {
    let root = sqrt(thickness);
    let red = pack(root.r, which & 1u, bits);
    let green = pack(root.g, which >> 1u, bits);
    return vec4f(0.0, red, green, (TRANSLUCENT + LEFT * root.b) / 255.0);
}

fn unpack_coloured(texel: vec4f, bits: u32) -> vec3f {
    let root = vec3f(unpack(texel.g, bits), unpack(texel.b, bits), (255.0 * texel.a - TRANSLUCENT) / LEFT);
    return root * root;
}
