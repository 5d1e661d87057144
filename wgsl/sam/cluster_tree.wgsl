// The cluster of each node of a tree of senders, bottom-up, five levels in a dispatch as in node_means.wgsl.

import package::sam::cluster::{Cluster};
import package::units::{Position, Area};

struct Params {
    levels: array<vec4u, 6>, // x: index of a level's first node in `clusters`, y: its nodes. The level below, then five
    starts_at_leaves: u32,   // 1: the first of the five levels holds the leaves, which are above senders
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> leaf_starts: array<u32>; // index of each leaf's first sender in `order`, and the end
@group(0) @binding(2) var<storage, read> order: array<u32>; // senders in the order of the tree
@group(0) @binding(3) var<storage, read_write> clusters: array<Cluster>; // of the senders (read), then of the nodes

const WIDTH: u32 = 256u;
const LEVELS: u32 = 5u;
const LEAST: Area = 1e-20; // the smallest area as a weight: a node without area needs a position, too

var<workgroup> centres: array<vec4f, WIDTH>; // position; w: area
var<workgroup> normals: array<vec4f, WIDTH>; // normal; w: variance

fn store(level: u32, k: u32, centre: vec4f, normal: vec4f) {
    if k < params.levels[level].y {
        clusters[params.levels[level].x + k] = Cluster(centre.xyz, centre.w, normal.xyz, normal.w);
    }
}

fn squared(v: Position) -> Area {
    return dot(v, v);
}

@compute @workgroup_size(WIDTH)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) i: u32) {
    let k = WIDTH * group.x + i;
    var centre = vec4f(0.0);
    var normal = vec4f(0.0); // w: variance
    if k < params.levels[1].y {
        let is_leaf = params.starts_at_leaves == 1u;
        let first = select(params.levels[0].x + 4u * k, leaf_starts[k], is_leaf);
        let end = select(first + 4u, leaf_starts[k + 1u], is_leaf);
        for (var j = first; j < end; j++) {
            let child = clusters[select(j, order[j], is_leaf)];
            centre += max(child.area, LEAST) * vec4f(child.position, 1.0);
        }
        centre = vec4f(centre.xyz / centre.w, centre.w);
        for (var j = first; j < end; j++) {
            let child = clusters[select(j, order[j], is_leaf)];
            let variance = child.variance + squared(child.position - centre.xyz);
            normal += max(child.area, LEAST) / centre.w * vec4f(child.normal, variance);
        }
    }
    store(1u, k, centre, normal);
    centres[i] = centre;
    normals[i] = normal;
    for (var level = 2u; level <= LEVELS; level++) {
        let width = WIDTH >> (2u * level - 2u);
        workgroupBarrier();
        if i < width {
            centre = vec4f(0.0);
            normal = vec4f(0.0);
            for (var j = 4u * i; j < 4u * i + 4u; j++) {
                centre += centres[j].w * vec4f(centres[j].xyz, 1.0);
            }
            centre = vec4f(centre.xyz / max(centre.w, LEAST), centre.w);
            for (var j = 4u * i; j < 4u * i + 4u; j++) {
                let variance = normals[j].w + squared(centres[j].xyz - centre.xyz);
                normal += centres[j].w / max(centre.w, LEAST) * vec4f(normals[j].xyz, variance);
            }
            store(level, width * group.x + i, centre, normal);
        }
        workgroupBarrier();
        centres[i] = centre;
        normals[i] = normal;
    }
}
