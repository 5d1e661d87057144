// The senders of largest A_i R_d(|x_i - x_o|) on the back side of each receiver (Maisch & Ropinski 2017, eq. 13, 14).
//
// Groups of receivers that lie near each other look at blocks of senders in the order of the most that any vertex of a
// block can give to any of the group, and stop where that is less than what they have. Each invocation serves four
// receivers: what is done for one takes no longer for four.

import package::units::{Area, Direction, Number, Position};

const GROUP: u32 = 32u;    // receivers, and senders of a block, at most
const FOUR: u32 = 4u;      // receivers of an invocation
const SHIFT: u32 = 15u;    // bits that the entries of the tables leave out
// After which an invocation leaves off: lavapipe ends loops after 65,535 turns, those of nested ones and of the eight
// invocations that walk in step together.
const TURNS: u32 = 6000u;

struct Params {
    kept: u32,         // senders of a receiver
    first_entry: u32,  // of R, as the leading bits of the squared distance
    reflectances: u32, // entries of R in the tables
    first_reach: u32,  // of the squared distances after them, as the leading bits of R
}

struct Vertex {
    position: Position,
    area: Area,
    normal: Direction,
    extent: Area, // of the fan: mean square of the distances to its centroid
    centre: Position, // the fan's centroid
}

struct Block {
    first: u32,
    end: u32,
    area: Area, // the largest fan's
}

// What a group looks at, as a range of the candidates. The group is a block itself.
struct List {
    group: u32,
    first: u32,
    end: u32,
}

struct Candidate {
    block: u32,
    most: Number, // share of the irradiance of one in the block that reaches one in the group, at most
}

struct Entry {
    sender: u32,
    share: Number, // of its irradiance, all channels together
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> tables: array<f32>;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> blocks: array<Block>;
@group(0) @binding(4) var<storage, read> lists: array<List>;
@group(0) @binding(5) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(6) var<storage, read_write> cursors: array<u32>; // of the invocations: GROUP for each candidate
@group(0) @binding(7) var<storage, read_write> entries: array<Entry>; // of the receivers, the best first

// R_d of all channels, 1/mm^2.
fn reflectance(squared: Area) -> Number {
    let wanted = max(bitcast<u32>(squared) >> SHIFT, params.first_entry) - params.first_entry;
    return tables[min(wanted, params.reflectances - 1u)];
}

// The square of the distance beyond which R is less.
fn reach(R: Number) -> Area {
    let wanted = max(bitcast<u32>(R) >> SHIFT, params.first_reach) - params.first_reach;
    return tables[min(params.reflectances + wanted, arrayLength(&tables) - 1u)];
}

// Puts a sender among those of a receiver, whose slots end before `end`.
fn enter(entry: Entry, end: u32) {
    var slot = end - 1u;
    for (var k = 1u; k < params.kept && entries[slot - 1u].share < entry.share; k++) {
        entries[slot] = entries[slot - 1u];
        slot -= 1u;
    }
    entries[slot] = entry;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x / (GROUP / FOUR) >= arrayLength(&lists) {
        return;
    }
    let list = lists[id.x / (GROUP / FOUR)];
    let own = blocks[list.group];
    let first = own.first + FOUR * (id.x % (GROUP / FOUR));
    if first >= own.end {
        return;
    }
    let o = min(vec4u(first) + vec4u(0u, 1u, 2u, 3u), vec4u(own.end - 1u));
    let a = vertices[o.x];
    let b = vertices[o.y];
    let c = vertices[o.z];
    let d = vertices[o.w];
    let x = transpose(mat4x3f(a.position, b.position, c.position, d.position));
    let n = transpose(mat4x3f(a.normal, b.normal, c.normal, d.normal));
    let middle = transpose(mat4x3f(a.centre, b.centre, c.centre, d.centre));
    let extent = vec4f(a.extent, b.extent, c.extent, d.extent);
    let ends = params.kept * (vec4u(FOUR * id.x) + vec4u(1u, 2u, 3u, 4u));
    var least = vec4f(entries[ends.x - 1u].share, entries[ends.y - 1u].share, entries[ends.z - 1u].share, entries[ends.w - 1u].share);
    let end = list.end - list.first;
    var turns = 0u;
    var seen = cursors[id.x] / GROUP;
    var offset = cursors[id.x] % GROUP;
    while seen < end && turns < TURNS {
        let candidate = candidates[list.first + seen];
        if all(least >= vec4f(candidate.most)) {
            seen = end;
            break;
        }
        let block = blocks[candidate.block];
        let needed = least / block.area;
        var within = vec4f(reach(needed.x), reach(needed.y), reach(needed.z), reach(needed.w));
        var i = block.first + offset;
        for (; i < block.end && turns < TURNS; i++) {
            let sender = vertices[i];
            let away = vec4f(sender.centre.x) - middle[0];
            let up = vec4f(sender.centre.y) - middle[1];
            let along = vec4f(sender.centre.z) - middle[2];
            let squared = away * away + up * up + along * along + extent + vec4f(sender.extent);
            let above = (sender.position.x - x[0]) * n[0] + (sender.position.y - x[1]) * n[1] + (sender.position.z - x[2]) * n[2];
            let cosine = sender.normal.x * n[0] + sender.normal.y * n[1] + sender.normal.z * n[2];
            let passes = (squared < within) & (above < vec4f(0.0)) & (cosine < vec4f(0.0));
            turns += 1u;
            // A loop, since lavapipe goes through the bodies of conditions that hold nowhere.
            for (var k = select(FOUR, 0u, any(passes)); k < FOUR; k++) {
                let share = sender.area * reflectance(squared[k]);
                turns += 1u;
                if passes[k] && share > least[k] {
                    enter(Entry(i, share), ends[k]);
                    turns += params.kept;
                    least[k] = entries[ends[k] - 1u].share;
                    within[k] = reach(least[k] / block.area);
                }
            }
        }
        seen += select(0u, 1u, i == block.end);
        offset = select(i - block.first, 0u, i == block.end);
    }
    cursors[id.x] = GROUP * seen + offset;
}
