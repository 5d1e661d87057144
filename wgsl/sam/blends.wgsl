// Mean irradiance over nodes of a tree that fades into the nodes beside them.

const NEIGHBOURS: u32 = 9u;

struct Blend {
    node: array<u32, NEIGHBOURS>,
    weight: array<f32, NEIGHBOURS>,
}

struct Params {
    means: u32,   // where the nodes' means begin in `irradiance`
    blended: u32, // where blends do
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> blends: array<Blend>;
@group(0) @binding(2) var<storage, read_write> irradiance: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&blends) {
        return;
    }
    var sum = vec4f(0.0);
    for (var k = 0u; k < NEIGHBOURS; k++) {
        sum += blends[id.x].weight[k] * irradiance[params.means + blends[id.x].node[k]];
    }
    irradiance[params.blended + id.x] = sum;
}
