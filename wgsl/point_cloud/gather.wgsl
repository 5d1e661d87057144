// M from an octree of samples (Jensen & Buhler 2002; Mikkelsen 2009, 3.2), split by where light enters (Maisch &
// Ropinski 2017, eq. 13, 14).

import package::mesh::{Surface, color_before, color_after};
import package::point_cloud::tree::{Entering};
import package::screen::{screen_corner, position_of_pixel};
import package::targets::{RGBA32Float};
import package::units::{Number, Length, Position, Direction};

struct Params {
    clip_to_world: mat4x4f,
    near: vec3f,     // share of L_d at x_o itself: what the samples stand too far apart for
    nearest: Length, // of the table's first entry
    farthest: Length, // of its last, 0
    steps: Number,   // of the table, per factor e of distance
}

// Of the length of a normal.
const ROUNDING: Number = 1e-6;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> surface: Surface;
@group(0) @binding(2) var where_seen: texture_2d<f32>;
@group(0) @binding(3) var normal: texture_2d<f32>;
@group(0) @binding(4) var base_color: texture_2d<f32>;
@group(0) @binding(5) var depth: texture_depth_2d;
@group(0) @binding(6) var irradiance: texture_2d<f32>;
@group(0) @binding(7) var<storage, read> table: array<vec4f>; // R_d over the logarithm of the distance; 0 beyond
@group(0) @binding(8) var<storage, read> entering: array<Entering>;

struct Pixel {
    @location(0) M_front: RGBA32Float,
    @location(1) M_back: RGBA32Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return screen_corner(i);
}

// R_d at the root of `squared`, by the nearest entry: they are a fraction of a percent apart.
fn reflectance(squared: f32) -> vec3f {
    let at = 0.5 * log(squared / (params.nearest * params.nearest)) * params.steps;
    let last = arrayLength(&table) - 1u;
    return table[min(u32(max(at + 0.5, 0.0)), last)].rgb;
}

// The share of a node whose normals, of this mean, turn away from n_o: as if their cosines were spread evenly about
// theirs. All or nothing for a sample, and nothing at a right angle.
fn facing_away(mean: vec3f, n_o: Direction) -> Number {
    let varied = max(1.0 - dot(mean, mean) - ROUNDING, 0.0);
    let spread = sqrt(1.5 * varied); // of even cosines whose variance is a half of that
    return clamp(0.5 * (spread - dot(mean, n_o) - ROUNDING) / max(spread, 1e-10), 0.0, 1.0);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if u32(textureLoad(where_seen, texel, 0).z) != surface.id {
        discard;
    }
    let seen = position_of_pixel(pixel.xy, textureLoad(depth, texel, 0), vec2f(textureDimensions(depth)), params.clip_to_world);
    let to_world = mat3x3f(surface.object_to_world[0].xyz, surface.object_to_world[1].xyz, surface.object_to_world[2].xyz);
    let x_o = (seen - surface.object_to_world[3].xyz) * to_world;
    let n_o = normalize(textureLoad(normal, texel, 0).xyz) * to_world;

    var M = vec3f(0.0);
    var back = vec3f(0.0);
    var k = 0u;
    // 1,250 turns at an epsilon of 0.3, and more as 1 / epsilon^2; lavapipe ends loops after 65,535.
    while k < arrayLength(&entering) {
        let node = entering[k];
        let to_node = node.position - x_o;
        let squared = dot(to_node, to_node);
        let beyond = params.farthest + node.radius;
        let stands = squared > node.reach * abs(node.reach) || squared > beyond * beyond; // for all below it
        let from_node = select(vec3f(0.0), reflectance(squared) * node.flux, stands);
        M += from_node;
        back += from_node * select(0.0, facing_away(node.normal, n_o), dot(to_node, n_o) < 0.0);
        k = select(k + 1u, node.next, stands);
        if node.next == 0u { // read where nothing is drawn: beside the edges of what is
            k = arrayLength(&entering);
        }
    }
    let texel_color = textureLoad(base_color, texel, 0).rgb;
    let at_x_o = params.near * color_before(surface, texel_color) * textureLoad(irradiance, texel, 0).rgb;
    let after = color_after(surface, texel_color);
    return Pixel(vec4f((at_x_o + M - back) * after, 1.0), vec4f(back * after, 1.0));
}
