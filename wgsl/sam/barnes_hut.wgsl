// M_back at the vertices of a posed mesh as a sum over its whole back side (Maisch & Ropinski 2017, eq. 12).
//
// Each vertex walks down a tree over all vertices. A node that is small for its distance counts as one cluster (Barnes &
// Hut 1986); below leaves that are too large for that, the vertices are summed one by one.

import package::profile_table::{log_entry};
import package::sam::cluster::{Cluster};
import package::units::{Number, Area};

struct Params {
    levels: array<vec4u, 16>, // x: index of a level's first node in `clusters`; the leaves first
    root_level: u32,
    low: Number,              // log2 of the table's first squared distance, mm^2
    steps: Number,            // steps of the table for each doubling of the squared distance
    history_weight: Number,   // share of the last frame's M_back in the result: 1 - alpha of eq. 17
}

override OPENING: Number = 0.15; // largest ratio of a cluster's root mean square radius to its distance
const STRADDLING: Number = 0.7;  // factor of OPENING for a cluster that lies on both sides of a horizon
const IN_FRONT: Number = 1.5;    // standard deviations above a horizon from where on a whole cluster is in front
const ROUNDING: Number = 1e-6;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>; // of the vertices, then of the nodes
@group(0) @binding(2) var<storage, read> irradiance: array<vec4f>; // W/m^2: L_d at the vertices, then means of the nodes
@group(0) @binding(3) var<storage, read> table: array<vec4f>; // log2 of R_d, 1/mm^2, over log2 of squared distances
@group(0) @binding(4) var<storage, read> leaf_starts: array<u32>; // index of each leaf's first vertex in `order`, and the end
@group(0) @binding(5) var<storage, read> order: array<u32>; // vertices in the order of the tree: neighbours walk alike
@group(0) @binding(6) var<storage, read> scale: array<vec4f>; // by vertex: exact sum of its form factors over this sum, at rest
@group(0) @binding(7) var<storage, read_write> history: array<vec4f>; // M_back of the last frame, by vertex
@group(0) @binding(8) var<storage, read_write> M_back: array<vec4f>; // W/m^2, by vertex

// The two horizons of a receiver are the limits of eq. 13 and 14. x stands for the normals, y for the positions.

// Mean squared deviations of a cluster's senders from its mean: of normals along one axis, of positions in mm^2.
fn variances(cluster: Cluster) -> vec2f {
    return vec2f(1.5 * max(1.0 - dot(cluster.normal, cluster.normal), 0.0), cluster.variance);
}

// How far a cluster's mean is above the horizons: n_i . n_o and (x_i - x_o) . n_o. Both negative: on the back side.
fn height(cluster: Cluster, receiver: Cluster) -> vec2f {
    return vec2f(dot(cluster.normal, receiver.normal), dot(cluster.position - receiver.position, receiver.normal));
}

fn squared_distance(cluster: Cluster, receiver: Cluster) -> Area {
    let between = cluster.position - receiver.position;
    return dot(between, between);
}

// The form factor of a cluster: its area on the back side times R_d. Of a cluster on both sides of a horizon, the share
// below is that of an even distribution; of a cluster exactly on it, where rounding would decide, one half.
fn form_factor(cluster: Cluster, receiver: Cluster) -> vec3f {
    let spread = sqrt(variances(cluster)) + ROUNDING;
    let behind = clamp(0.5 - 0.5 * height(cluster, receiver) / spread, vec2f(0.0), vec2f(1.0));
    let end = arrayLength(&table) - 1u;
    let at = log_entry(squared_distance(cluster, receiver), params.low, params.steps, end);
    let i = u32(at);
    return cluster.area * behind.x * behind.y * exp2(mix(table[i].rgb, table[i + 1u].rgb, at - f32(i)));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&order) {
        return;
    }
    let vertex = order[id.x];
    let receiver = clusters[vertex];
    var M = vec3f(0.0);
    var level = params.root_level;
    var k = 0u; // the node of the level
    while level <= params.root_level {
        let i = params.levels[level].x + k;
        let node = clusters[i];
        let signed_square = height(node, receiver) * abs(height(node, receiver));
        let variance = variances(node);
        if all(signed_square <= IN_FRONT * IN_FRONT * variance + ROUNDING * ROUNDING) {
            let opening = OPENING * select(STRADDLING, 1.0, all(signed_square <= -variance));
            if node.variance <= opening * opening * squared_distance(node, receiver) {
                M += form_factor(node, receiver) * irradiance[i].rgb;
            } else if level > 0u {
                level--;
                k = 4u * k;
                continue;
            } else {
                for (var j = leaf_starts[k]; j < leaf_starts[k + 1u]; j++) {
                    M += form_factor(clusters[order[j]], receiver) * irradiance[order[j]].rgb;
                }
            }
        }
        while k % 4u == 3u && level < params.root_level { // up, from the last child of a node
            k /= 4u;
            level++;
        }
        k++;
        if level == params.root_level {
            break;
        }
    }
    M *= scale[vertex].rgb;
    M = mix(M, history[vertex].rgb, params.history_weight);
    history[vertex] = vec4f(M, 1.0);
    M_back[vertex] = vec4f(M, 1.0);
}
