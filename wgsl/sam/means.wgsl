// The mean irradiance over the nodes of a tree, weighted by area, bottom-up: five levels at once, the four children of a
// node being next to each other.

struct Params {
    levels: array<vec4u, 6>, // where they begin in `irradiance`, and how many nodes they have: what is below, and five
    finest: u32,             // 1 where the first of the five is the finest level, whose nodes are over senders
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<u32>; // of the finest level's nodes in `order`, and its end
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> area: array<f32>; // of the senders
@group(0) @binding(4) var<storage, read_write> irradiance: array<vec4f>; // of a node: its mean, and its area

const WIDTH: u32 = 256u;
const LEVELS: u32 = 5u;

var<workgroup> sums: array<vec4f, WIDTH>; // of irradiance times area, and of area

fn store(level: u32, k: u32, sum: vec4f) {
    if k < params.levels[level].y {
        irradiance[params.levels[level].x + k] = vec4f(sum.rgb / max(sum.w, 1e-30), sum.w);
    }
}

@compute @workgroup_size(WIDTH)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) i: u32) {
    let k = WIDTH * group.x + i;
    var sum = vec4f(0.0);
    if k < params.levels[1].y {
        if params.finest == 1u {
            for (var j = starts[k]; j < starts[k + 1u]; j++) {
                sum += area[order[j]] * vec4f(irradiance[order[j]].rgb, 1.0);
            }
        } else {
            for (var j = 4u * k; j < 4u * k + 4u; j++) {
                let child = irradiance[params.levels[0].x + j];
                sum += child.w * vec4f(child.rgb, 1.0);
            }
        }
    }
    store(1u, k, sum);
    sums[i] = sum;
    for (var level = 2u; level <= LEVELS; level++) {
        let width = WIDTH >> (2u * level - 2u);
        workgroupBarrier();
        if i < width {
            sum = sums[4u * i] + sums[4u * i + 1u] + sums[4u * i + 2u] + sums[4u * i + 3u];
            store(level, width * group.x + i, sum);
        }
        workgroupBarrier();
        sums[i] = sum;
    }
}
