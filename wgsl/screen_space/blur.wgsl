// One direction of a separable blur over the surface of one object, as it is seen (Jimenez et al. 2015, Separable Subsurface Scattering).
//
// The first direction runs along the rows of the image, the second at right angles to it on the surface, whatever way
// that faces. Weights are of whole pixels, by how many of them a millimetre of the surface spans there.

import package::units::{Length, Number, Position};
import package::mesh::{color_after};
import package::per_object::{view, object, base_color_at};
import package::targets::{RGBA32Float};

struct Params {
    scale: vec3f,   // of what comes out of the second direction
    coarsest: f32,  // pixels per mm of level 0
}

override DIRECTION: u32 = 0u; // or 1

struct Tap {
    weight: vec3f, // of each of the two pixels
    offset: f32,   // pixels to either side
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> taps: array<Tap>; // of each level, the one in the middle first
@group(0) @binding(2) var source: texture_2d<f32>; // alpha: 1 - depth, 0 off the object
@group(0) @binding(3) var slope: texture_2d<f32>;  // of the depth, per pixel to the right and down
@group(0) @binding(4) var before: texture_2d<f32>; // M by the kernel's terms so far, or a single black texel

struct Pixel {
    @location(0) blurred: RGBA32Float, // first direction: as source; second: M in W/m^2
}

const LEVELS: u32 = 448u; // to where a kernel spans the largest image
const LEVELS_PER_OCTAVE: u32 = 32u; // it is 1 % too wide or too narrow at most

// A tap counts in full where the surface has bent away by up to 45 degrees since the tap before it, and not at all from
// 63 degrees on: this is a step to another surface. Nor does any tap beyond. Their weight goes to the middle, so that
// uniform light stays uniform.
const TURN_KEPT: Number = 1.0;
const TURN_LOST: Number = 2.0;

// A walk from the middle to one side, tap by tap.
struct Walk {
    kept: Number,  // how much a tap here counts
    gone: Length,  // from the middle, were the surface the plane that it is there
    off: Length,   // how far behind that plane it is
}

// On to a pixel where source's alpha is `seen`. The way there is in clip space, seen from the middle (`from_middle`):
// `flat` on the plane, and `rise` by how much the depth differs from its.
fn walked(walk: Walk, seen: f32, flat: vec4f, rise: f32, away: vec4f, w: f32) -> Walk {
    let plane = flat.xyz / (w + flat.w);
    let way = flat + away * rise;
    let gone = length(plane);
    let off = sign(rise) * length(way.xyz / (w + way.w) - plane);
    let turn = abs(off - walk.off) / max(gone - walk.gone, 1e-9);
    let kept = select(1.0 - smoothstep(TURN_KEPT, TURN_LOST, turn), 0.0, seen == 0.0);
    return Walk(min(walk.kept, kept), gone, off);
}

// A step in clip space turned so that its xyz, over w + its own w, is the way in mm from x, whose clip w is w.
fn from_middle(step: vec4f, x: Position) -> vec4f {
    return vec4f(step.xyz - x * step.w, step.w);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2i(pixel.xy);
    let middle = textureLoad(source, texel, 0);
    if middle.a == 0.0 {
        discard;
    }
    let per_pixel = vec2f(2.0, -2.0) / vec2f(textureDimensions(source));
    let here = view.clip_to_world * vec4f(pixel.xy * per_pixel + vec2f(-1.0, 1.0), 1.0 - middle.a, 1.0);
    let x = here.xyz / here.w;
    let rises = textureLoad(slope, texel, 0).rg;
    let away = from_middle(view.clip_to_world[2], x);
    let right = from_middle(view.clip_to_world[0] * per_pixel.x, x) + away * rises.x; // pixel by pixel on the plane
    let down = from_middle(view.clip_to_world[1] * per_pixel.y, x) + away * rises.y;
    let t_x = right.xyz / here.w; // mm per pixel
    let t_y = down.xyz / here.w;
    var step = vec2f(1.0, 0.0); // to the next pixel, along the rows or along the columns
    if DIRECTION == 1u {
        let lean = -dot(t_x, t_y) / dot(t_x, t_x);
        step = vec2f(lean, 1.0) / max(abs(lean), 1.0);
    }
    let level = -f32(LEVELS_PER_OCTAVE) * log2(params.coarsest * length(step.x * t_x + step.y * t_y));
    let count = arrayLength(&taps) / LEVELS;
    let first = count * u32(clamp(round(level), 0.0, f32(LEVELS - 1u)));
    var total = taps[first].weight * middle.rgb;
    var ahead = Walk(1.0, 0.0, 0.0);
    var back = ahead;
    for (var k = first + 1u; k < first + count; k++) {
        let tap = taps[k];
        let moved = vec2i(round(step * tap.offset));
        let there = textureLoad(source, texel + moved, 0); // zeros outside of the image
        let opposite = textureLoad(source, texel - moved, 0);
        let flat = f32(moved.x) * right + f32(moved.y) * down;
        let rise = dot(vec2f(moved), rises);
        ahead = walked(ahead, there.a, flat, middle.a - there.a - rise, away, here.w);
        back = walked(back, opposite.a, -flat, middle.a - opposite.a + rise, away, here.w);
        total += tap.weight * (mix(middle.rgb, there.rgb, ahead.kept) + mix(middle.rgb, opposite.rgb, back.kept));
    }
    if DIRECTION == 0u {
        return Pixel(vec4f(total, middle.a));
    }
    let color = params.scale * color_after(object, base_color_at(vec2u(texel)));
    let so_far = textureLoad(before, min(texel, vec2i(textureDimensions(before)) - 1), 0).rgb;
    return Pixel(vec4f(so_far + total * color, 1.0));
}
