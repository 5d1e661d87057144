// The entries of a mesh that deforms (Maisch & Ropinski 2017, section 3.4): form factors follow areas and distances, and
// an entry moves on to a neighbour of its sender that has a larger form factor.

import package::profile_table::{log_entry};
import package::sam::cluster::{Cluster};
import package::sam::sender_map::{Entry};
import package::units::{Number, Area};

struct Params {
    low: Number,          // log2 of the table's first squared distance, mm^2
    steps: Number,        // steps of the table for each doubling of the squared distance
    entries_per_row: u32,
    first_receiver: u32,  // index of the first receiver in `clusters`; 0 where receivers are the senders
    restart: u32,         // 1: start from the senders at rest, not from those of the last frame
    equal_areas: u32,     // 1: senders stand for equal areas, and the area of a cluster is that of the face around it
}

const MOST_MOVES: u32 = 8u;  // of an entry in one frame
const BETTER: Number = 1e-4; // least relative gain for which an entry moves: less may be rounding
const SLACK: Number = 1e-4;  // tolerance of eq. 13 and 14 for rounding: the best senders are often at the limit

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rest_entries: array<Entry>; // as baked
@group(0) @binding(2) var<storage, read> rest_clusters: array<Cluster>; // of senders and receivers at rest
@group(0) @binding(3) var<storage, read> clusters: array<Cluster>; // of the same as posed
@group(0) @binding(4) var<storage, read> neighbours: array<u32>; // index of each sender's first neighbour in this array, then the neighbours
@group(0) @binding(5) var<storage, read> table: array<vec4f>; // log2 of R_d, 1/mm^2, over log2 of squared distances
@group(0) @binding(6) var<storage, read_write> current: array<i32>; // senders of the entries, from frame to frame
@group(0) @binding(7) var<storage, read> vertices: array<u32>; // indices of the vertices that have entries
@group(0) @binding(8) var<storage, read_write> entries: array<Entry>; // as posed

// log2 of R_d at the distance between two clusters.
fn log_reflectance(sender: Cluster, receiver: Cluster) -> vec3f {
    let between = sender.position - receiver.position;
    let last = arrayLength(&table) - 1u;
    let at = log_entry(dot(between, between), params.low, params.steps, last);
    let i = u32(at);
    return mix(table[i].rgb, table[i + 1u].rgb, at - f32(i));
}

fn log_ratio(area: Area, other: Area) -> Number {
    return log2(max(area, 1e-30) / max(other, 1e-30));
}

// Whether a sender is on the back side of a receiver (eq. 13, 14). `slack`: the sine and the cosine by which it may be
// in front.
fn is_behind(sender: Cluster, receiver: Cluster, slack: Number) -> bool {
    let between = sender.position - receiver.position;
    return dot(between, receiver.normal) < slack * length(between) && dot(sender.normal, receiver.normal) < slack;
}

// The form factor of `sender` as posed, from that of the entry's sender at rest: times the ratios of R_d and of areas.
// Ratios are differences of logarithms, since R_d may vanish.
fn form_factor(entry: Entry, sender: i32, receiver: u32) -> vec3f {
    let slack = select(-SLACK, SLACK, sender == entry.sender);
    if !is_behind(clusters[sender], clusters[receiver], slack) {
        return vec3f(0.0);
    }
    let at_rest = log_reflectance(rest_clusters[sender], rest_clusters[receiver]);
    var growth = log_ratio(clusters[sender].area, rest_clusters[sender].area) + log_reflectance(clusters[sender], clusters[receiver]) - at_rest;
    if sender != entry.sender {
        // First to the form factor of `sender` at rest. If it was on the back side, it was at most that of the entry's
        // sender, which would not have been chosen otherwise.
        var change = at_rest - log_reflectance(rest_clusters[entry.sender], rest_clusters[receiver]);
        if params.equal_areas == 0u {
            change += log_ratio(rest_clusters[sender].area, rest_clusters[entry.sender].area);
        }
        growth += select(change, min(change, vec3f(0.0)), is_behind(rest_clusters[sender], rest_clusters[receiver], 0.0));
    }
    return entry.weight * exp2(growth);
}

// The index of the entry, of those from `first` on, that has this sender; `first + params.entries_per_row`: none has.
fn find_entry(sender: i32, first: u32) -> u32 {
    var e = first;
    while e < first + params.entries_per_row && current[e] != sender {
        e++;
    }
    return e;
}

// Whether the form factor K is larger than `best`, summed over the channels.
fn is_better(K: vec3f, best: vec3f) -> bool {
    return dot(K - (1.0 + BETTER) * best, vec3f(1.0)) > 0.0;
}

// Move entries back to their senders at rest where these are the best again: they may be too far away for `climb`. If
// another entry has such a sender by now, the two exchange theirs.
fn return_to_rest_senders(first: u32, receiver: u32) {
    for (var e = first; e < first + params.entries_per_row; e++) {
        let entry = rest_entries[e];
        if entry.sender < 0 || entry.sender == current[e] {
            continue;
        }
        let from_rest = form_factor(entry, entry.sender, receiver);
        if !is_better(form_factor(entry, current[e], receiver), from_rest) {
            let other = find_entry(entry.sender, first);
            if other < first + params.entries_per_row {
                current[other] = current[e];
            }
            current[e] = entry.sender;
        }
    }
}

// Move an entry from neighbour to neighbour while the form factor grows, to senders that no other entry of the row has.
fn climb(e: u32, first: u32, receiver: u32) {
    let entry = rest_entries[e];
    var best = form_factor(entry, current[e], receiver);
    for (var moves = 0u; moves < MOST_MOVES; moves++) {
        let here = current[e];
        for (var j = neighbours[here]; j < neighbours[here + 1]; j++) {
            let neighbour = i32(neighbours[j]);
            let K = form_factor(entry, neighbour, receiver);
            if is_better(K, best) && find_entry(neighbour, first) == first + params.entries_per_row {
                current[e] = neighbour;
                best = K;
            }
        }
        if current[e] == here {
            return;
        }
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.y > 0u || id.x >= arrayLength(&vertices) {
        return; // the grid has the size of `entries`; one thread does a whole row
    }
    let first = id.x * params.entries_per_row;
    let receiver = params.first_receiver + vertices[id.x];
    if params.restart == 1u {
        for (var e = first; e < first + params.entries_per_row; e++) {
            current[e] = rest_entries[e].sender;
        }
    }
    return_to_rest_senders(first, receiver);
    for (var e = first; e < first + params.entries_per_row; e++) {
        let entry = rest_entries[e];
        if entry.sender < 0 {
            entries[e] = entry;
            continue;
        }
        climb(e, first, receiver);
        entries[e] = Entry(form_factor(entry, current[e], receiver), current[e]);
    }
}
