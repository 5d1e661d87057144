// Where the nodes of a tree are, bottom-up, five levels at once as in means.wgsl.

import package::sam::place::{Place};
import package::units::{Position, Area};

struct Params {
    levels: array<vec4u, 6>, // where they begin in `places`, and how many nodes they have: what is below, and five
    finest: u32,             // 1 where the first of the five is the finest level, whose nodes are over senders
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<u32>; // of the finest level's nodes in `order`, and its end
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read_write> places: array<Place>;

const WIDTH: u32 = 256u;
const LEVELS: u32 = 5u;
const LEAST: Area = 1e-20; // a node without an area is somewhere, too

var<workgroup> middles: array<vec4f, WIDTH>; // position, area
var<workgroup> turned: array<vec4f, WIDTH>;  // normal, variance

fn store(level: u32, k: u32, middle: vec4f, normal: vec4f) {
    if k < params.levels[level].y {
        places[params.levels[level].x + k] = Place(middle.xyz, middle.w, normal.xyz, normal.w);
    }
}

fn squared(v: Position) -> Area {
    return dot(v, v);
}

@compute @workgroup_size(WIDTH)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) i: u32) {
    let k = WIDTH * group.x + i;
    var middle = vec4f(0.0);
    var normal = vec4f(0.0); // and the variance
    if k < params.levels[1].y {
        let is_finest = params.finest == 1u;
        let first = select(params.levels[0].x + 4u * k, starts[k], is_finest);
        let end = select(first + 4u, starts[k + 1u], is_finest);
        for (var j = first; j < end; j++) {
            let place = places[select(j, order[j], is_finest)];
            middle += max(place.area, LEAST) * vec4f(place.position, 1.0);
        }
        middle = vec4f(middle.xyz / middle.w, middle.w);
        for (var j = first; j < end; j++) {
            let place = places[select(j, order[j], is_finest)];
            let variance = place.variance + squared(place.position - middle.xyz);
            normal += max(place.area, LEAST) / middle.w * vec4f(place.normal, variance);
        }
    }
    store(1u, k, middle, normal);
    middles[i] = middle;
    turned[i] = normal;
    for (var level = 2u; level <= LEVELS; level++) {
        let width = WIDTH >> (2u * level - 2u);
        workgroupBarrier();
        if i < width {
            middle = vec4f(0.0);
            normal = vec4f(0.0);
            for (var j = 4u * i; j < 4u * i + 4u; j++) {
                middle += middles[j].w * vec4f(middles[j].xyz, 1.0);
            }
            middle = vec4f(middle.xyz / max(middle.w, LEAST), middle.w);
            for (var j = 4u * i; j < 4u * i + 4u; j++) {
                let variance = turned[j].w + squared(middles[j].xyz - middle.xyz);
                normal += middles[j].w / max(middle.w, LEAST) * vec4f(turned[j].xyz, variance);
            }
            store(level, width * group.x + i, middle, normal);
        }
        workgroupBarrier();
        middles[i] = middle;
        turned[i] = normal;
    }
}
