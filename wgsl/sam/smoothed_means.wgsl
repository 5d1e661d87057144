// Smoothed means: weighted means of the irradiance of a tree node and of nodes beside it.

const NEIGHBOURS: u32 = 9u; // nodes of a smoothed mean, its own first

struct SmoothedMean {
    node: array<u32, NEIGHBOURS>,
    weight: array<f32, NEIGHBOURS>, // 0 beyond the nodes that it has
}

struct Params {
    first_node: u32,     // index of the first node's mean in `irradiance`
    first_smoothed: u32, // index of the first smoothed mean in `irradiance`
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> smoothed_means: array<SmoothedMean>;
@group(0) @binding(2) var<storage, read_write> irradiance: array<vec4f>; // W/m^2

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&smoothed_means) {
        return;
    }
    var sum = vec4f(0.0);
    for (var k = 0u; k < NEIGHBOURS; k++) {
        sum += smoothed_means[id.x].weight[k] * irradiance[params.first_node + smoothed_means[id.x].node[k]];
    }
    irradiance[params.first_smoothed + id.x] = sum;
}
