// M from an octree of samples (Jensen & Buhler 2002; Mikkelsen 2009, 3.2), split by where light enters (Maisch &
// Ropinski 2017, eq. 13, 14).
//
// Neighbouring pixels need nearly the same nodes, so that a block of pixels traverses the octree together (Barnes
// 1990): a node replaces its descendants where it is small enough for the pixel nearest to it. Reading a node, which
// takes longer than summing its light, is done once for the block.

import package::mesh::{color_before, color_after};
import package::per_object::{object, gbuffer_id, is_other_object, position_at, normal_at, base_color_at};
import package::point_cloud::tree::{Entering};
import package::profile_table::{entries_of};
import package::units::{Number, Position, Direction};

struct Params {
    near: vec3f,       // share of L_d at x_o itself, for the part of the profile narrower than the spacing of samples
    unit: Number,      // of the table, 1/mm^2
    first_entry: u32,  // of the table (profile_table.wgsl)
}

override FIRST: u32 = 1u; // 1 for the first object, which clears the pixels that do not show it

const ROUNDING: Number = 1e-6; // error of the length of a normal
const TILE: u32 = 32u;       // width and height of a workgroup's pixels
const BLOCK: u32 = 4u;       // width and height of an invocation's pixels
const NOWHERE: Number = 1e9; // mm: too far for light to get there

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var irradiance: texture_2d<f32>;
@group(0) @binding(2) var<storage, read> table: array<u32>; // R_d over the squared distance; 0 in the last
@group(0) @binding(3) var<storage, read> entering: array<Entering>;
@group(0) @binding(4) var M_front: texture_storage_2d<rgba32float, write>;
@group(0) @binding(5) var M_back: texture_storage_2d<rgba32float, write>;

// x_o and n_o at 2 x 2 pixels, by component: vector instructions take as long for four pixels as for one.
struct Four {
    x: vec4f,
    y: vec4f,
    z: vec4f,
    n_x: vec4f,
    n_y: vec4f,
    n_z: vec4f,
}

// Sums at four pixels, one column each.
struct Sums {
    M: mat4x3f,
    back: mat4x3f, // the part of M from behind
}

// Whether a texel is in the image and shows the object.
fn is_visible(texel: vec2u) -> bool {
    return all(texel < textureDimensions(gbuffer_id)) && !is_other_object(texel);
}

fn corner_of(i: u32) -> vec2u {
    return vec2u(i & 1u, i >> 1u);
}

// The 2 x 2 pixels from `first` on. At pixels that do not show the object, x_o is NOWHERE.
fn four(first: vec2u) -> Four {
    let to_world = mat3x3f(object.object_to_world[0].xyz, object.object_to_world[1].xyz, object.object_to_world[2].xyz);
    var x: array<Position, 4>;
    var n: array<Direction, 4>;
    for (var i = 0u; i < 4u; i++) {
        let texel = first + corner_of(i);
        x[i] = vec3f(NOWHERE);
        if is_visible(texel) {
            let at = position_at(texel);
            x[i] = (at - object.object_to_world[3].xyz) * to_world;
            n[i] = normal_at(texel) * to_world;
        }
    }
    let across = transpose(mat4x3f(x[0], x[1], x[2], x[3]));
    let turned = transpose(mat4x3f(n[0], n[1], n[2], n[3]));
    return Four(across[0], across[1], across[2], turned[0], turned[1], turned[2]);
}

// Squared distances from a node to four pixels.
fn distances(node: Entering, at: Four) -> vec4f {
    let x = node.position.x - at.x;
    let y = node.position.y - at.y;
    let z = node.position.z - at.z;
    return x * x + y * y + z * z;
}

fn least(values: vec4f) -> f32 {
    return min(min(values.x, values.y), min(values.z, values.w));
}

// An entry of the table: three mantissas of 9 bits that share an exponent.
fn unpacked(entry: u32) -> vec3f {
    let bits = table[entry];
    return vec3f((vec3u(bits) >> vec3u(0u, 9u, 18u)) & vec3u(511u)) * bitcast<f32>(((bits >> 27u) + 87u) << 23u);
}

// R_d by squared distance, in the table's unit.
fn reflectances(squared: vec4f) -> mat4x3f {
    let entry = min(entries_of(squared, params.first_entry), vec4u(arrayLength(&table) - 1u));
    return mat4x3f(unpacked(entry.x), unpacked(entry.y), unpacked(entry.z), unpacked(entry.w));
}

// The share of a node's light that counts as M_back: the share of its normals that face away from n_o, where the node
// lies below the tangent plane at x_o, and else 0. The cosines between the normals and n_o are taken to be evenly
// distributed around their mean. The share of a sample is 0 or 1, and 0 at a right angle.
fn behind(node: Entering, at: Four) -> vec4f {
    let varied = max(1.0 - dot(node.normal, node.normal) - ROUNDING, 0.0);
    let spread = sqrt(1.5 * varied); // half-width of an even distribution with half of that variance
    let scale = 0.5 / max(spread, 1e-10);
    let cosine = node.normal.x * at.n_x + node.normal.y * at.n_y + node.normal.z * at.n_z;
    let away = clamp(scale * (spread - ROUNDING - cosine), vec4f(0.0), vec4f(1.0));
    let above = (node.position.x - at.x) * at.n_x + (node.position.y - at.y) * at.n_y + (node.position.z - at.z) * at.n_z;
    return select(vec4f(0.0), away, above < vec4f(0.0));
}

// The sums plus the light that arrives from a node at which `flux` enters.
fn added(sums: Sums, node: Entering, flux: vec3f, at: Four, squared: vec4f) -> Sums {
    let R = reflectances(squared);
    let M = mat4x3f(flux * R[0], flux * R[1], flux * R[2], flux * R[3]);
    let share = behind(node, at);
    return Sums(sums.M + M, sums.back + mat4x3f(share.x * M[0], share.y * M[1], share.z * M[2], share.w * M[3]));
}

fn store(first: vec2u, from_nodes: Sums) {
    var sums = from_nodes;
    for (var i = 0u; i < 4u; i++) {
        let texel = first + corner_of(i);
        let color = base_color_at(texel);
        let M = params.unit * sums.M[i] + params.near * color_before(object, color) * textureLoad(irradiance, texel, 0).rgb;
        let back = params.unit * sums.back[i];
        let after = color_after(object, color);
        if is_visible(texel) {
            textureStore(M_front, texel, vec4f((M - back) * after, 1.0));
            textureStore(M_back, texel, vec4f(back * after, 1.0));
        } else if FIRST == 1u {
            textureStore(M_front, texel, vec4f(0.0));
            textureStore(M_back, texel, vec4f(0.0));
        }
    }
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) i: u32) {
    // Consecutive invocations, eight of them on lavapipe, run in lockstep: their blocks lie next to each other.
    let block = vec2u((i & 3u) | ((i >> 1u) & 4u), ((i >> 2u) & 1u) | ((i >> 3u) & 6u));
    let first = TILE * tile.xy + BLOCK * block;
    let second = first + vec2u(2u, 0u);
    let third = first + vec2u(0u, 2u);
    let fourth = first + vec2u(2u, 2u);
    let a = four(first);
    let b = four(second);
    let c = four(third);
    let d = four(fourth);
    let nothing = Sums(mat4x3f(), mat4x3f());
    var from_a = nothing;
    var from_b = nothing;
    var from_c = nothing;
    var from_d = nothing;
    let end = arrayLength(&entering);
    let is_empty = least(min(min(a.x, b.x), min(c.x, d.x))) == NOWHERE;
    // About 1,600 iterations at an epsilon of 0.3, growing as 1 / epsilon^2. Lavapipe ends loops after 65,535.
    for (var k = select(0u, end, is_empty); k < end;) {
        let node = entering[k];
        let to_a = distances(node, a);
        let to_b = distances(node, b);
        let to_c = distances(node, c);
        let to_d = distances(node, d);
        let suffices = least(min(min(to_a, to_b), min(to_c, to_d))) > node.reach * abs(node.reach); // replaces its descendants
        let flux = select(vec3f(0.0), node.flux, suffices);
        from_a = added(from_a, node, flux, a, to_a);
        from_b = added(from_b, node, flux, b, to_b);
        from_c = added(from_c, node, flux, c, to_c);
        from_d = added(from_d, node, flux, d, to_d);
        k = select(k + 1u, node.next, suffices);
    }
    store(first, from_a);
    store(second, from_b);
    store(third, from_c);
    store(fourth, from_d);
}
