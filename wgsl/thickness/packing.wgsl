// Translucency in the third target of a g-buffer of 8 bits a channel (Barré-Brisebois & Bouchard 2011, "Deferred Shading
// G-Buffer Setup"):
//
//              R8                G8                   B8             A8
//   grey       sky visibility    custom env. map      translucency   material ID
//   coloured   sky visibility    red                  green          material ID + blue
//
// Sky visibility and environment maps are other effects' and left 0 here. The translucent material's ID is the last one,
// so that blue fits above it. As the paper suggests, blue is scaled to what is left. Roots are stored, since equal steps
// of thickness show where it is dark.

import package::units::{Number};

const TRANSLUCENT: Number = 3.0; // material ID
const LEFT: Number = 252.0;      // of 255 steps, for blue

fn pack_grey(thickness: Number) -> vec4f {
    return vec4f(0.0, 0.0, sqrt(thickness), TRANSLUCENT / 255.0);
}

fn unpack_grey(texel: vec4f) -> vec3f {
    return vec3f(texel.b * texel.b);
}

fn pack_coloured(thickness: vec3f) -> vec4f {
    let root = sqrt(thickness);
    return vec4f(0.0, root.rg, (TRANSLUCENT + LEFT * root.b) / 255.0);
}

fn unpack_coloured(texel: vec4f) -> vec3f {
    let root = vec3f(texel.gb, (255.0 * texel.a - TRANSLUCENT) / LEFT);
    return root * root;
}
