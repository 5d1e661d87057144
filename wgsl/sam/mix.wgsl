// M_back at the vertices as mixtures of what they and their neighbours gathered.

const NEIGHBOURS: u32 = 7u;

struct Mix {
    vertex: array<u32, NEIGHBOURS>,
    halves: array<u32, 5>, // two each: a weight for each vertex, and the tint
}

@group(0) @binding(0) var<storage, read> vertices: array<u32>; // those that have entries
@group(0) @binding(1) var<storage, read> mixes: array<Mix>;
@group(0) @binding(2) var<storage, read> gathered: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> M_back: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&vertices) {
        return;
    }
    var M = vec3f(0.0);
    for (var k = 0u; k < NEIGHBOURS; k++) {
        M += unpack2x16float(mixes[id.x].halves[k / 2u])[k % 2u] * gathered[mixes[id.x].vertex[k]].rgb;
    }
    M *= vec3f(unpack2x16float(mixes[id.x].halves[3]).y, unpack2x16float(mixes[id.x].halves[4]));
    M_back[vertices[id.x]] = vec4f(M, 1.0);
}
