// What each vertex would receive in light of 1 everywhere: the sum of all form factors from its back side, over the nodes
// of the tree of senders that are small enough for their distance (Barnes & Hut 1986).

import package::sam::place::{Place};
import package::sam::profile::{log_entry};
import package::units::{Number, Length};

struct Params {
    levels: array<vec4u, 16>, // where they begin in `places`, the finest first
    top: u32,                 // the level of the root
    low: Number,              // of the table: log2 of a squared distance, mm^2
    steps: Number,            // of the table, each time that squares double
}

const OPENING: Number = 0.15; // of a node's root mean square radius over its distance, at most
const ROUNDING: Number = 1e-6;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> places: array<Place>; // of the senders, which are the vertices, then of the nodes
@group(0) @binding(2) var<storage, read> table: array<vec4f>;  // log2 of R_d
@group(0) @binding(3) var<storage, read> vertices: array<u32>; // those that receive
@group(0) @binding(4) var<storage, read_write> totals: array<vec4f>;

// The share of `spread` about a mean that is below 0, as if all were spread evenly.
fn share_below(mean: Number, spread: Number) -> Number {
    return clamp((spread - mean) / (2.0 * spread), 0.0, 1.0);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&vertices) {
        return;
    }
    let x_o = places[vertices[id.x]].position;
    let n_o = places[vertices[id.x]].normal;
    let last = arrayLength(&table) - 1u;
    var total = vec3f(0.0);
    var level = params.top;
    var k = 0u;
    while level <= params.top {
        let node = places[params.levels[level].x + k];
        let between = node.position - x_o;
        let squared = dot(between, between);
        if level > 0u && node.variance > OPENING * OPENING * squared {
            level--;
            k = 4u * k;
            continue;
        }
        // Of a node whose normals differ, or that lies on both sides of the horizon, a part is behind (eq. 13, 14).
        let turned = sqrt(1.5 * max(1.0 - dot(node.normal, node.normal), 0.0)) + ROUNDING;
        let away = share_below(dot(node.normal, n_o), turned) * share_below(dot(between, n_o), sqrt(node.variance) + ROUNDING);
        let at = log_entry(squared + node.variance, params.low, params.steps, last);
        let i = u32(at);
        total += node.area * away * exp2(mix(table[i].rgb, table[i + 1u].rgb, at - f32(i)));
        while k % 4u == 3u && level < params.top {
            k /= 4u;
            level++;
        }
        k++;
        if level == params.top {
            break;
        }
    }
    totals[id.x] = vec4f(total, 1.0);
}
