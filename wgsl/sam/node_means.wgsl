// The mean irradiance of each node of a tree of senders, weighted by the areas of the senders' fans, bottom-up.
//
// One dispatch computes up to five levels. The four children of a node are next to each other, so that each workgroup
// computes all nodes above its own nodes of the first level.

struct Params {
    levels: array<vec4u, 6>, // x: index of a level's first node in `irradiance`, y: its nodes. The level below, then five
    starts_at_leaves: u32,   // 1: the first of the five levels holds the leaves, which are above senders
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> leaf_starts: array<u32>; // index of each leaf's first sender in `order`, and the end
@group(0) @binding(2) var<storage, read> order: array<u32>; // senders in the order of the tree
@group(0) @binding(3) var<storage, read> area: array<f32>; // mm^2, of the senders' fans
@group(0) @binding(4) var<storage, read_write> irradiance: array<vec4f>; // W/m^2; w: of a node, its area, mm^2

const WIDTH: u32 = 256u;
const LEVELS: u32 = 5u;

var<workgroup> sums: array<vec4f, WIDTH>; // irradiance times area; w: area

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
        if params.starts_at_leaves == 1u {
            for (var j = leaf_starts[k]; j < leaf_starts[k + 1u]; j++) {
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
