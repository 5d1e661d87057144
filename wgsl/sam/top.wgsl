// For each receiver, the senders on its back side (Maisch & Ropinski 2017, eq. 13, 14) that contribute most. Their
// contributions are compared by A_i R_d(d), with d the root mean square distance between the two reduced fans.
//
// A group of neighbouring receivers visits blocks of senders in falling order of an upper bound of their contributions.
// It stops where this bound is below the smallest contribution that its receivers have found. Each invocation serves
// four receivers, as one vec4f: on a CPU device four take no longer than one.

import package::profile_table::{entry_of};
import package::units::{Area, Direction, Number, Position};

const GROUP: u32 = 32u;         // largest number of receivers in a group, and of senders in a block
const PER_INVOCATION: u32 = 4u; // receivers
// Loop turns after which an invocation stops; the next dispatch goes on. lavapipe ends loops after 65,535 turns, which
// it counts over nested loops and over the eight invocations that run in step.
const TURNS: u32 = 6000u;

struct Params {
    count: u32,        // senders to find for each receiver
    first_entry: u32,  // leading bits of the squared distance of the first entry of R_d
    reflectances: u32, // entries of R_d in `tables`; its inverse follows
    first_reach: u32,  // leading bits of the R_d of the first entry of the inverse
}

struct Vertex {
    position: Position,
    area: Area, // of the reduced fan
    normal: Direction,
    extent: Area, // of the fan: mean squared distance from its centroid
    centre: Position, // the centroid of the fan
}

// A range of the vertices.
struct Block {
    first: u32,
    end: u32,
    area: Area, // of the largest fan
}

// The candidates of a group of receivers, as a range. The group is itself a block.
struct List {
    group: u32,
    first: u32,
    end: u32,
}

struct Candidate {
    block: u32,
    bound: Number, // upper bound of what a vertex of the block contributes to a receiver of the group
}

struct Entry {
    sender: u32,
    share: Number, // area times R_d, summed over the channels; 0 for no sender
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> tables: array<f32>;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> blocks: array<Block>;
@group(0) @binding(4) var<storage, read> lists: array<List>;
@group(0) @binding(5) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(6) var<storage, read_write> cursors: array<u32>; // of each invocation: GROUP times the candidate, plus the sender
@group(0) @binding(7) var<storage, read_write> entries: array<Entry>; // `count` for each receiver, in falling order

// R_d, summed over the channels, 1/mm^2.
fn reflectance(squared: Area) -> Number {
    return tables[min(entry_of(squared, params.first_entry), params.reflectances - 1u)];
}

// The squared distance beyond which R_d is smaller than R.
fn reach(R: Number) -> Area {
    return tables[min(params.reflectances + entry_of(R, params.first_reach), arrayLength(&tables) - 1u)];
}

// Insert a sender into the sorted entries of a receiver, which end before `end`. The last one drops out.
fn insert(entry: Entry, end: u32) {
    var slot = end - 1u;
    for (var k = 1u; k < params.count && entries[slot - 1u].share < entry.share; k++) {
        entries[slot] = entries[slot - 1u];
        slot -= 1u;
    }
    entries[slot] = entry;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x / (GROUP / PER_INVOCATION) >= arrayLength(&lists) {
        return;
    }
    let list = lists[id.x / (GROUP / PER_INVOCATION)];
    let own = blocks[list.group];
    let first = own.first + PER_INVOCATION * (id.x % (GROUP / PER_INVOCATION));
    if first >= own.end {
        return;
    }
    // The four receivers. Coordinates are transposed: x[0] has the first coordinate of all four.
    let o = min(vec4u(first) + vec4u(0u, 1u, 2u, 3u), vec4u(own.end - 1u));
    let a = vertices[o.x];
    let b = vertices[o.y];
    let c = vertices[o.z];
    let d = vertices[o.w];
    let x = transpose(mat4x3f(a.position, b.position, c.position, d.position));
    let n = transpose(mat4x3f(a.normal, b.normal, c.normal, d.normal));
    let centre = transpose(mat4x3f(a.centre, b.centre, c.centre, d.centre));
    let extent = vec4f(a.extent, b.extent, c.extent, d.extent);
    let ends = params.count * (vec4u(PER_INVOCATION * id.x) + vec4u(1u, 2u, 3u, 4u));
    // The smallest share among the entries of each receiver: a sender must exceed it.
    var least = vec4f(entries[ends.x - 1u].share, entries[ends.y - 1u].share, entries[ends.z - 1u].share, entries[ends.w - 1u].share);
    let candidate_count = list.end - list.first;
    var turns = 0u;
    var visited = cursors[id.x] / GROUP;
    var offset = cursors[id.x] % GROUP;
    while visited < candidate_count && turns < TURNS {
        let candidate = candidates[list.first + visited];
        if all(least >= vec4f(candidate.bound)) {
            visited = candidate_count;
            break;
        }
        let block = blocks[candidate.block];
        let needed = least / block.area;
        var within = vec4f(reach(needed.x), reach(needed.y), reach(needed.z), reach(needed.w));
        var i = block.first + offset;
        for (; i < block.end && turns < TURNS; i++) {
            let sender = vertices[i];
            let dx = vec4f(sender.centre.x) - centre[0];
            let dy = vec4f(sender.centre.y) - centre[1];
            let dz = vec4f(sender.centre.z) - centre[2];
            let squared = dx * dx + dy * dy + dz * dz + extent + vec4f(sender.extent);
            let height = (sender.position.x - x[0]) * n[0] + (sender.position.y - x[1]) * n[1] + (sender.position.z - x[2]) * n[2];
            let cosine = sender.normal.x * n[0] + sender.normal.y * n[1] + sender.normal.z * n[2];
            let passes = (squared < within) & (height < vec4f(0.0)) & (cosine < vec4f(0.0));
            turns += 1u;
            // A loop without turns instead of a condition: lavapipe runs the body of a condition that holds nowhere.
            for (var k = select(PER_INVOCATION, 0u, any(passes)); k < PER_INVOCATION; k++) {
                let share = sender.area * reflectance(squared[k]);
                turns += 1u;
                if passes[k] && share > least[k] {
                    insert(Entry(i, share), ends[k]);
                    turns += params.count;
                    least[k] = entries[ends[k] - 1u].share;
                    within[k] = reach(least[k] / block.area);
                }
            }
        }
        visited += select(0u, 1u, i == block.end);
        offset = select(i - block.first, 0u, i == block.end);
    }
    cursors[id.x] = GROUP * visited + offset;
}
