// The entries of a mesh that deforms where they are nodes: as much more as all that arrives from behind.

import package::sam::entries::{Entry};

struct Params {
    samples: u32, // entries of a vertex
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> at_rest: array<Entry>;
@group(0) @binding(2) var<storage, read> totals_at_rest: array<vec4f>;
@group(0) @binding(3) var<storage, read> totals: array<vec4f>; // of the vertices that have entries
@group(0) @binding(4) var<storage, read_write> entries: array<Entry>;

const MOST: f32 = 16.0; // what hardly anything reached at rest tells little of what does now

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&at_rest) {
        return;
    }
    let vertex = id.x / params.samples;
    let grown = totals[vertex].rgb / max(totals_at_rest[vertex].rgb, vec3f(1e-30));
    entries[id.x] = Entry(at_rest[id.x].weight * min(grown, vec3f(MOST)), at_rest[id.x].sender);
}
