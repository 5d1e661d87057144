// Sums of R_d over two fans, both as points that stand for parts of them (Maisch & Ropinski 2017, eq. 11).
//
// A part is taken as a point at its centroid with the squared distances to all of it: |x_i - x_o|^2 is on average that
// between the centroids and the mean squares of both parts' extents.

import package::units::{Area, Number, Position};

const SHIFT: u32 = 15u; // bits of a squared distance between the entries of the table: 256 for each time it doubles

struct Params {
    first_entry: u32, // of the table, as the leading bits of the squared distance
}

struct Point {
    position: Position,
    area: Area,
    extent: Area, // mean square of the distances to the centroid
}

// Some points of a receiver's fan and all of a sender's, as ranges of the points.
struct Term {
    o_first: u32,
    o_end: u32,
    i_first: u32,
    i_end: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> table: array<vec4f>; // R_d over the squared distance, 1/mm^2
@group(0) @binding(2) var<storage, read> points: array<Point>;
@group(0) @binding(3) var<storage, read> terms: array<Term>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec4f>; // of R_d dA_i dA_o, mm^2

fn reflectance(squared: Area) -> vec3f {
    let bits = max(bitcast<u32>(squared), params.first_entry << SHIFT);
    let entry = min((bits >> SHIFT) - params.first_entry, arrayLength(&table) - 2u);
    let between = f32(bits & ((1u << SHIFT) - 1u)) / f32(1u << SHIFT);
    return mix(table[entry].rgb, table[entry + 1u].rgb, between);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&terms) {
        return;
    }
    let term = terms[id.x];
    var sum = vec3f(0.0);
    for (var o = term.o_first; o < term.o_end; o++) {
        let a = points[o];
        var part = vec3f(0.0);
        for (var i = term.i_first; i < term.i_end; i++) {
            let b = points[i];
            let d = b.position - a.position;
            part += b.area * reflectance(dot(d, d) + a.extent + b.extent);
        }
        sum += a.area * part;
    }
    sums[id.x] = vec4f(sum, 0.0);
}
