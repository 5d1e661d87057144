// M_back at the vertices of a mesh that deforms: the sum over all that is behind each, over the nodes of a tree that are
// small enough for their distance (Barnes & Hut 1986), and over the vertices below those that never are.

import package::sam::place::{Place};
import package::profile_table::{log_entry};
import package::units::{Number, Area};

struct Params {
    levels: array<vec4u, 16>, // where they begin in `places`, the finest first
    top: u32,                 // the level of the root
    low: Number,              // of the table: log2 of a squared distance, mm^2
    steps: Number,            // of the table, each time that squares double
    kept: Number,             // share of what M_back was that stays (Maisch & Ropinski 2017, eq. 17)
}

override OPENING: Number = 0.15; // of a node's root mean square radius over its distance, at most
const ACROSS: Number = 0.7;   // of that, where a node is on both sides of a horizon
const IN_FRONT: Number = 1.5; // spreads by which a mean is above a horizon, as all of it then is
const ROUNDING: Number = 1e-6;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> places: array<Place>;  // of the vertices, then of the nodes
@group(0) @binding(2) var<storage, read> irradiance: array<vec4f>; // L_d at those, and its means over these
@group(0) @binding(3) var<storage, read> table: array<vec4f>; // log2 of R_d
@group(0) @binding(4) var<storage, read> starts: array<u32>; // of the finest level's nodes in `order`, and its end
@group(0) @binding(5) var<storage, read> order: array<u32>; // vertices: what is near each other walks alike
@group(0) @binding(6) var<storage, read> scale: array<vec4f>; // of a vertex: what its form factors are, over what they are taken for
@group(0) @binding(7) var<storage, read_write> last: array<vec4f>; // M_back as it was, from frame to frame
@group(0) @binding(8) var<storage, read_write> M_back: array<vec4f>;

// The mean squares of how much normals differ from that of a place, along one axis, and of how high it reaches.
fn spreads(place: Place) -> vec2f {
    return vec2f(1.5 * max(1.0 - dot(place.normal, place.normal), 0.0), place.variance);
}

// Where a place is to the horizons of eq. 13 and 14: behind both, if negative.
fn above(place: Place, receiver: Place) -> vec2f {
    return vec2f(dot(place.normal, receiver.normal), dot(place.position - receiver.position, receiver.normal));
}

fn squared_distance(place: Place, receiver: Place) -> Area {
    let between = place.position - receiver.position;
    return dot(between, between);
}

// What arrives of light of 1. Of a place on both sides of a horizon a part is behind, as if it were spread evenly; of one
// on the horizon itself, where rounding would decide, one half.
fn form_factor(place: Place, receiver: Place) -> vec3f {
    let spread = sqrt(spreads(place)) + ROUNDING;
    let behind = clamp(0.5 - 0.5 * above(place, receiver) / spread, vec2f(0.0), vec2f(1.0));
    let end = arrayLength(&table) - 1u;
    let at = log_entry(squared_distance(place, receiver), params.low, params.steps, end);
    let i = u32(at);
    return place.area * behind.x * behind.y * exp2(mix(table[i].rgb, table[i + 1u].rgb, at - f32(i)));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&order) {
        return;
    }
    let vertex = order[id.x];
    let receiver = places[vertex];
    var M = vec3f(0.0);
    var level = params.top;
    var k = 0u;
    while level <= params.top {
        let i = params.levels[level].x + k;
        let node = places[i];
        let over = above(node, receiver) * abs(above(node, receiver));
        let spread = spreads(node);
        if all(over <= IN_FRONT * IN_FRONT * spread + ROUNDING * ROUNDING) {
            let opening = OPENING * select(ACROSS, 1.0, all(over <= -spread));
            if node.variance <= opening * opening * squared_distance(node, receiver) {
                M += form_factor(node, receiver) * irradiance[i].rgb;
            } else if level > 0u {
                level--;
                k = 4u * k;
                continue;
            } else {
                for (var j = starts[k]; j < starts[k + 1u]; j++) {
                    M += form_factor(places[order[j]], receiver) * irradiance[order[j]].rgb;
                }
            }
        }
        while k % 4u == 3u && level < params.top {
            k /= 4u;
            level++;
        }
        k++;
        if level == params.top {
            break;
        }
    }
    M *= scale[vertex].rgb;
    M = mix(M, last[vertex].rgb, params.kept);
    last[vertex] = vec4f(M, 1.0);
    M_back[vertex] = vec4f(M, 1.0);
}
