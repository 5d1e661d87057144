// One direction of a separable blur over the surface of one object, as it is seen (Jimenez et al. 2015, section 5).
//
// The first direction runs along the rows of the image, the second at right angles to it on the surface, whatever way
// that faces: the two tangents follow from the depth and its slope. Weights are of whole pixels, by how many of them
// a millimetre of the surface spans there.

import package::units::{Number, Position};
import package::mesh::{Surface, color_after};
import package::screen::{screen_corner, position_of_pixel};
import package::targets::{RGBA32Float};

struct Params {
    clip_to_world: mat4x4f,
    coarsest: f32,  // pixels per mm of level 0
    direction: u32, // 0 or 1
    scale: vec3f,   // of what comes out of the second direction
}

struct Tap {
    weight: vec3f,  // of each of the two pixels
    offset: Number, // pixels to either side
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> surface: Surface;
@group(0) @binding(2) var<storage, read> taps: array<Tap>; // of each level, the one in the middle first
@group(0) @binding(3) var source: texture_2d<f32>; // rgb; 1 - depth, 0 off the object
@group(0) @binding(4) var slope: texture_2d<f32>;
@group(0) @binding(5) var base_color: texture_2d<f32>;
@group(0) @binding(6) var before: texture_2d<f32>; // the kernel's terms so far, or a single black texel

struct Pixel {
    @location(0) diffused: RGBA32Float, // first direction: as source; second: M in W/m^2
}

const LEVELS: u32 = 448u;
const LEVELS_PER_OCTAVE: f32 = 32.0;

// A tap counts in full while it is within 20 degrees of the tangent plane and not at all from 45 degrees on: what is
// farther off lies round a bend or across a step. Its weight goes to the middle.
const SINE_KEPT: Number = 0.35;
const SINE_LOST: Number = 0.7;

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

// The way in clip space that `step` (pixels) and a change of depth make.
fn clip_step(step: vec2f, depth: f32) -> vec4f {
    let ndc = step * vec2f(2.0, -2.0) / vec2f(textureDimensions(source));
    return params.clip_to_world * vec4f(ndc, depth, 0.0);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2i(pixel.xy);
    let middle = textureLoad(source, texel, 0);
    if middle.a == 0.0 {
        discard;
    }
    let size = vec2f(textureDimensions(source));
    let ndc = vec2f(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y);
    let here = params.clip_to_world * vec4f(ndc, 1.0 - middle.a, 1.0);
    let x: Position = here.xyz / here.w;
    let rises = textureLoad(slope, texel, 0).rg;
    let to_right = clip_step(vec2f(1.0, 0.0), rises.x);
    let down = clip_step(vec2f(0.0, 1.0), rises.y);
    let t_x = (to_right.xyz - x * to_right.w) / here.w; // mm of the surface per pixel
    let t_y = (down.xyz - x * down.w) / here.w;
    let n = normalize(cross(t_x, t_y));
    var step = vec2f(1.0, 0.0); // pixels, one along the longer side
    var mm_per_step = length(t_x);
    if params.direction == 1u {
        let lean = -dot(t_x, t_y) / dot(t_x, t_x);
        let longer = max(abs(lean), 1.0);
        step = vec2f(lean, 1.0) / longer;
        mm_per_step = length(t_y + lean * t_x) / longer;
    }
    let level = round(LEVELS_PER_OCTAVE * -log2(params.coarsest * mm_per_step));
    let count = arrayLength(&taps) / LEVELS;
    let first = count * u32(clamp(level, 0.0, f32(LEVELS - 1u)));
    var total = taps[first].weight * middle.rgb;
    for (var i = 2u; i < 2u * count; i++) {
        let tap = taps[first + i / 2u];
        let moved = vec2i(round(step * tap.offset * (1.0 - 2.0 * f32(i & 1u))));
        let there = textureLoad(source, texel + moved, 0); // zeros outside of the image
        let way = clip_step(vec2f(moved), middle.a - there.a);
        let d = (way.xyz - x * way.w) / (here.w + way.w);
        let off = abs(dot(d, n)) / max(length(d), 1e-9);
        let kept = select(1.0 - smoothstep(SINE_KEPT, SINE_LOST, off), 0.0, there.a == 0.0);
        total += tap.weight * mix(middle.rgb, there.rgb, kept);
    }
    if params.direction == 0u {
        return Pixel(vec4f(total, middle.a));
    }
    let color = params.scale * color_after(surface, textureLoad(base_color, texel, 0).rgb);
    let so_far = textureLoad(before, min(texel, vec2i(textureDimensions(before)) - 1), 0).rgb;
    return Pixel(vec4f(so_far + total * color, 1.0));
}
