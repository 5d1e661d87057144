// M_back at the vertices: what their entries read (Maisch & Ropinski 2017, eq. 12), blended with what it was (eq. 17).
// Where vertices receive mixtures of it, there are rows of entries beyond theirs, too.

import package::sam::entries::{Entry};
import package::units::{Number};

struct Params {
    kept: Number, // share of what M_back was that stays, 1 - alpha
    samples: u32, // entries of a row
    senders: u32, // where means begin
    means: u32,   // of nodes: how many stand before the blends that entries read, where there are blends
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rows: array<u32>; // those that have entries
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read> irradiance: array<vec4f>; // L_d at the senders, then means, and their blends
@group(0) @binding(4) var<storage, read_write> last: array<vec4f>; // M_back as it was, from frame to frame
@group(0) @binding(5) var<storage, read_write> M_back: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&rows) {
        return;
    }
    let i = rows[id.x];
    let first = id.x * params.samples;
    var M = vec3f(0.0);
    for (var k = first; k < first + params.samples; k++) {
        let entry = entries[k];
        let sender = u32(max(entry.sender, 0)); // where there is none, the weight is 0
        M += entry.weight * irradiance[sender + select(0u, params.means, sender >= params.senders)].rgb;
    }
    if params.kept > 0.0 {
        M = mix(M, last[i].rgb, params.kept);
    }
    last[i] = vec4f(M, 1.0);
    M_back[i] = vec4f(M, 1.0);
}
