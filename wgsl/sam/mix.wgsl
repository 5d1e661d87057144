// M_back at the vertices as mixtures of what their entries and those of their neighbours gathered.

const ROWS: u32 = 7u;

struct Mix {
    row: array<u32, ROWS>,
    halves: array<u32, 5>, // two each: a weight for each row, and the tint
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
    for (var k = 0u; k < ROWS; k++) {
        M += unpack2x16float(mixes[id.x].halves[k / 2u])[k % 2u] * gathered[mixes[id.x].row[k]].rgb;
    }
    M *= vec3f(unpack2x16float(mixes[id.x].halves[3]).y, unpack2x16float(mixes[id.x].halves[4]));
    M_back[vertices[id.x]] = vec4f(M, 1.0);
}
