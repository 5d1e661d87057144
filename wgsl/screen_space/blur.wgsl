// One direction of a separable blur over the visible surface of one object (Jimenez et al. 2015, Separable Subsurface
// Scattering).
//
// The first direction runs along the rows of the image; the second is perpendicular to it on the surface. Taps read
// single pixels, with weights for the number of pixels that a millimetre of the surface spans there.

import package::units::{Length, Number, Position};
import package::mesh::{color_after};
import package::per_object::{view, object, base_color_at};
import package::targets::{RGBA32Float};

struct Params {
    scale: vec3f,   // factor of the result of the second direction
    coarsest: f32,  // pixels per mm at level 0
}

override DIRECTION: u32 = 0u; // or 1

struct Tap {
    weight: vec3f, // of each of the two pixels that the tap reads
    offset: f32,   // distance of these two pixels to both sides
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> taps: array<Tap>; // of all levels; the first of each level is that of the middle
@group(0) @binding(2) var source: texture_2d<f32>; // alpha: 1 - depth, 0 at pixels of other objects
@group(0) @binding(3) var slope: texture_2d<f32>;  // change of depth per pixel to the right and down
@group(0) @binding(4) var before: texture_2d<f32>; // M by the kernel's earlier terms, or a single black texel

struct Pixel {
    @location(0) blurred: RGBA32Float, // first direction: as source; second: M in W/m^2
}

const LEVELS: u32 = 448u; // enough for kernels that span the largest image
const LEVELS_PER_OCTAVE: u32 = 32u; // the kernel's width is off by 1 % at most

// A tap counts fully where the surface bends by up to 45 degrees from the tap before it. From 63 degrees on it is taken
// to lie on another surface: neither this tap nor those beyond count. The middle pixel replaces them, so that uniform
// light stays uniform.
const BEND_KEPT: Number = 1.0; // tangents of these angles
const BEND_LOST: Number = 2.0;

// The state of a traversal from the middle pixel to one side, tap by tap.
struct Walk {
    weight: Number,  // how much this tap counts, 0 to 1
    along: Length,   // distance from the middle, along the tangent plane there
    behind: Length,  // distance of the surface behind that plane
}

// Continue to a pixel, given its alpha in `source`. Steps are as `from_middle` returns them: `flat` leads there along
// the tangent plane, and `away` times `rise`, the difference of depth from the plane's, from there to the surface.
fn walked(walk: Walk, alpha: f32, flat: vec4f, rise: f32, away: vec4f, w: f32) -> Walk {
    let plane = flat.xyz / (w + flat.w);
    let step = flat + away * rise;
    let along = length(plane);
    let behind = sign(rise) * length(step.xyz / (w + step.w) - plane);
    let bend = abs(behind - walk.behind) / max(along - walk.along, 1e-9);
    let weight = select(1.0 - smoothstep(BEND_KEPT, BEND_LOST, bend), 0.0, alpha == 0.0);
    return Walk(min(walk.weight, weight), along, behind);
}

// Transform a step from the middle pixel to world space. x is the position of the middle and w its clip w; the xyz of
// the result, divided by w plus the w of the result, is the step in mm.
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
    let right = from_middle(view.clip_to_world[0] * per_pixel.x, x) + away * rises.x; // steps of one pixel along the tangent plane
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
        let there = textureLoad(source, texel + moved, 0); // 0 outside of the image
        let opposite = textureLoad(source, texel - moved, 0);
        let flat = f32(moved.x) * right + f32(moved.y) * down;
        let rise = dot(vec2f(moved), rises);
        ahead = walked(ahead, there.a, flat, middle.a - there.a - rise, away, here.w);
        back = walked(back, opposite.a, -flat, middle.a - opposite.a + rise, away, here.w);
        total += tap.weight * (mix(middle.rgb, there.rgb, ahead.weight) + mix(middle.rgb, opposite.rgb, back.weight));
    }
    if DIRECTION == 0u {
        return Pixel(vec4f(total, middle.a));
    }
    let color = params.scale * color_after(object, base_color_at(vec2u(texel)));
    let so_far = textureLoad(before, min(texel, vec2i(textureDimensions(before)) - 1), 0).rgb;
    return Pixel(vec4f(so_far + total * color, 1.0));
}
