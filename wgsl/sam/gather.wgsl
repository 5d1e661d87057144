// M_back of each row of entries: the sum of weight times irradiance over its entries (Maisch & Ropinski 2017, eq. 12),
// blended with M_back of the frame before (eq. 17).
//
// Row v is that of vertex v. Rows beyond the vertices are read only by neighbour_mixture.wgsl.

import package::sam::sender_map::{Entry};
import package::units::{Number};

struct Params {
    history_weight: Number, // share of the last frame's M_back in the result: 1 - alpha of eq. 17
    entries_per_row: u32,
    sender_count: u32,      // senders in `irradiance`; means follow them
    skipped_means: u32,     // means of nodes between the senders and the smoothed means; 0: entries read means of nodes
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rows: array<u32>; // indices of the rows that have entries
@group(0) @binding(2) var<storage, read> entries: array<Entry>; // of those rows, one row after the other
@group(0) @binding(3) var<storage, read> irradiance: array<vec4f>; // W/m^2: L_d of senders, means of nodes, smoothed means
@group(0) @binding(4) var<storage, read_write> history: array<vec4f>; // M_back of the last frame, by row
@group(0) @binding(5) var<storage, read_write> M_back: array<vec4f>; // W/m^2, by row

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&rows) {
        return;
    }
    let i = rows[id.x];
    let first = id.x * params.entries_per_row;
    var M = vec3f(0.0);
    for (var k = first; k < first + params.entries_per_row; k++) {
        let entry = entries[k];
        let sender = u32(max(entry.sender, 0)); // the weight of an unused entry is 0
        M += entry.weight * irradiance[sender + select(0u, params.skipped_means, sender >= params.sender_count)].rgb;
    }
    if params.history_weight > 0.0 {
        M = mix(M, history[i].rgb, params.history_weight);
    }
    history[i] = vec4f(M, 1.0);
    M_back[i] = vec4f(M, 1.0);
}
