// The entries of a mesh that deforms (Maisch & Ropinski 2017, 3.4): form factors follow areas and distances, and senders
// give way to better neighbours.

import package::sam::entries::{Entry};
import package::sam::place::{Place};
import package::profile_table::{log_entry};
import package::units::{Number, Area};

struct Params {
    low: Number,    // of the table: log2 of a squared distance, mm^2
    steps: Number,  // of the table, each time that squares double
    samples: u32,   // entries of a vertex
    receivers: u32, // where the vertices begin among the places
    anew: u32,      // 1: from the senders at rest
    even: u32,      // 1 where senders stand for equal areas, those of places being their faces'
}

const MOST_MOVES: u32 = 8u;  // of an entry in a frame
const BETTER: Number = 1e-4; // by less, it is not worth moving for what rounding may be
const SLACK: Number = 1e-4;  // nor for what rounding puts behind: the best are often at the limit

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> at_rest: array<Entry>;
@group(0) @binding(2) var<storage, read> rest: array<Place>;      // of senders and receivers
@group(0) @binding(3) var<storage, read> places: array<Place>;    // now
@group(0) @binding(4) var<storage, read> adjacency: array<u32>;   // where each vertex's neighbours begin, then those
@group(0) @binding(5) var<storage, read> table: array<vec4f>;     // log2 of R_d
@group(0) @binding(6) var<storage, read_write> moved: array<i32>; // the senders, from frame to frame
@group(0) @binding(7) var<storage, read> vertices: array<u32>;    // those that have entries
@group(0) @binding(8) var<storage, read_write> entries: array<Entry>;

// log2 of R_d at the distance of a place.
fn log_reflected(place: Place, receiver: Place) -> vec3f {
    let between = place.position - receiver.position;
    let last = arrayLength(&table) - 1u;
    let at = log_entry(dot(between, between), params.low, params.steps, last);
    let i = u32(at);
    return mix(table[i].rgb, table[i + 1u].rgb, at - f32(i));
}

fn log_ratio(area: Area, other: Area) -> Number {
    return log2(max(area, 1e-30) / max(other, 1e-30));
}

// `slack`: how far beyond the limits of eq. 13 and 14, as a sine and a cosine.
fn is_behind(place: Place, receiver: Place, slack: Number) -> bool {
    let between = place.position - receiver.position;
    return dot(between, receiver.normal) < slack * length(between) && dot(place.normal, receiver.normal) < slack;
}

// The form factor from `sender`, from that of the entry at rest. In logarithms, nothing is divided by what vanishes.
fn form_factor(entry: Entry, sender: i32, receiver: u32) -> vec3f {
    let slack = select(-SLACK, SLACK, sender == entry.sender);
    if !is_behind(places[sender], places[receiver], slack) {
        return vec3f(0.0);
    }
    let was = log_reflected(rest[sender], rest[receiver]);
    var grown = log_ratio(places[sender].area, rest[sender].area) + log_reflected(places[sender], places[receiver]) - was;
    if sender != entry.sender {
        // At rest it had as much more as its area and distance tell; but what could be seen was less, or it would have
        // been chosen.
        var more = was - log_reflected(rest[entry.sender], rest[receiver]);
        if params.even == 0u {
            more += log_ratio(rest[sender].area, rest[entry.sender].area);
        }
        grown += select(more, min(more, vec3f(0.0)), is_behind(rest[sender], rest[receiver], 0.0));
    }
    return entry.weight * exp2(grown);
}

// Which of a vertex's entries has this sender; `first + params.samples`, where none has.
fn holder(sender: i32, first: u32) -> u32 {
    var e = first;
    while e < first + params.samples && moved[e] != sender {
        e++;
    }
    return e;
}

fn is_better(K: vec3f, best: vec3f) -> bool {
    return dot(K - (1.0 + BETTER) * best, vec3f(1.0)) > 0.0;
}

// What was best at rest may be so again, and be too far away to be found. Who holds it meanwhile takes what is left.
fn go_home(first: u32, receiver: u32) {
    for (var e = first; e < first + params.samples; e++) {
        let entry = at_rest[e];
        if entry.sender < 0 || entry.sender == moved[e] {
            continue;
        }
        let home = form_factor(entry, entry.sender, receiver);
        if !is_better(form_factor(entry, moved[e], receiver), home) {
            let other = holder(entry.sender, first);
            if other < first + params.samples {
                moved[other] = moved[e];
            }
            moved[e] = entry.sender;
        }
    }
}

// The best vertex for an entry that is uphill from its sender and that no other entry has.
fn climb(e: u32, first: u32, receiver: u32) {
    let entry = at_rest[e];
    var best = form_factor(entry, moved[e], receiver);
    for (var moves = 0u; moves < MOST_MOVES; moves++) {
        let here = moved[e];
        for (var j = adjacency[here]; j < adjacency[here + 1]; j++) {
            let neighbour = i32(adjacency[j]);
            let there = form_factor(entry, neighbour, receiver);
            if is_better(there, best) && holder(neighbour, first) == first + params.samples {
                moved[e] = neighbour;
                best = there;
            }
        }
        if moved[e] == here {
            return;
        }
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.y > 0u || id.x >= arrayLength(&vertices) {
        return; // what is dispatched has the size of `entries`
    }
    let first = id.x * params.samples;
    let receiver = params.receivers + vertices[id.x];
    if params.anew == 1u {
        for (var e = first; e < first + params.samples; e++) {
            moved[e] = at_rest[e].sender;
        }
    }
    go_home(first, receiver);
    for (var e = first; e < first + params.samples; e++) {
        let entry = at_rest[e];
        if entry.sender < 0 {
            entries[e] = entry;
            continue;
        }
        climb(e, first, receiver);
        entries[e] = Entry(form_factor(entry, moved[e], receiver), moved[e]);
    }
}
