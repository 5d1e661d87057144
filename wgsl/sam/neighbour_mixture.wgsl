// M_back of each vertex as a weighted sum of what several rows of entries gathered: its own row and rows beside it.

const ROWS: u32 = 7u; // rows of a mixture

struct Mixture {
    row: array<u32, ROWS>,
    halves: array<u32, 5>, // ten 16-bit floats, two in each element: the weights of the rows, then the tint
}

@group(0) @binding(0) var<storage, read> vertices: array<u32>; // indices of the vertices that have entries
@group(0) @binding(1) var<storage, read> mixtures: array<Mixture>; // of those vertices
@group(0) @binding(2) var<storage, read> gathered: array<vec4f>; // W/m^2, by row: the output of gather.wgsl
@group(0) @binding(3) var<storage, read_write> M_back: array<vec4f>; // W/m^2, by vertex

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&vertices) {
        return;
    }
    var M = vec3f(0.0);
    for (var k = 0u; k < ROWS; k++) {
        M += unpack2x16float(mixtures[id.x].halves[k / 2u])[k % 2u] * gathered[mixtures[id.x].row[k]].rgb;
    }
    M *= vec3f(unpack2x16float(mixtures[id.x].halves[3]).y, unpack2x16float(mixtures[id.x].halves[4]));
    M_back[vertices[id.x]] = vec4f(M, 1.0);
}
