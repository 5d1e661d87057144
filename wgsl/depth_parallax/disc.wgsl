// A blur by a disc of taps over the surface (Norberg 2010, 2.2.2), whose radius is that of a layer: one of several passes
// (3.2), each with a smaller radius.

import package::charts::{INSIDE, across, settled};
import package::screen::{screen_corner};
import package::targets::{RGBA16Float};
import package::units::{Length};
import package::walk::{ids, seams, walk};

struct Params {
    thickness: Length, // radius at a share of 1
    turn: vec2f,       // cosine and sine of the angle by which the disc is turned
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> disc: array<vec2f>; // offsets of the taps, of a disc of radius 1
@group(0) @binding(2) var source: texture_2d<f32>; // alpha: coverage
@group(0) @binding(3) var amount: texture_2d<f32>; // of the layer, as maps.wgsl draws it
@group(0) @binding(4) var linear_clamp: sampler;
@group(0) @binding(5) var gradient_u: texture_2d<f32>; // texels per mm
@group(0) @binding(6) var gradient_v: texture_2d<f32>;

struct Texel {
    @location(0) blurred: RGBA16Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Texel {
    let size = vec2f(textureDimensions(ids));
    let id = textureLoad(ids, vec2u(pixel.xy), 0).r;
    if id == 0u {
        discard;
    }
    var home = pixel.xy / size;
    if (id & INSIDE) == 0u { // a texel of the gutter has the neighbour's value
        home = settled(ids, across(seams[id - 1u], home));
    }
    let texel = vec2u(clamp(home * size, vec2f(0.0), size - 1.0));
    let u = textureLoad(gradient_u, texel, 0).xyz;
    let v = textureLoad(gradient_v, texel, 0).xyz;
    let along = normalize(u);
    let n = normalize(cross(u, v));
    let beside = cross(n, along);
    let share = textureSampleLevel(amount, linear_clamp, home, 0.0);
    let radius = params.thickness * share.r / max(share.a, 1e-4);
    var total = vec4f(0.0);
    for (var i = 0u; i < arrayLength(&disc); i++) {
        let p = radius * vec2f(dot(disc[i], vec2f(params.turn.x, -params.turn.y)), dot(disc[i], params.turn.yx));
        let step = vec2f(dot(u, along) * p.x + dot(u, beside) * p.y, dot(v, along) * p.x + dot(v, beside) * p.y);
        total += textureSampleLevel(source, linear_clamp, walk(home, step / size), 0.0);
    }
    return Texel(vec4f(total.rgb / max(total.a, 1e-4), f32(total.a > 0.0)));
}
