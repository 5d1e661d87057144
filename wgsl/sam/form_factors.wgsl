// The integral of R_d over two reduced fans, which are given as quadrature points (Maisch & Ropinski 2017, eq. 11).
//
// Each point stands for a part of a fan and lies at its centroid. The mean squared distance between two parts is the
// squared distance of their points plus the extents of both; R_d is evaluated there.

import package::profile_table::{at_least_first, entry_of, fraction_of};
import package::units::{Area, Number, Position};

struct Params {
    first_entry: u32, // leading bits of the squared distance of the table's first entry
}

struct Point {
    position: Position,
    area: Area,
    extent: Area, // mean squared distance of the part from the point
}

// Some points of the receiver's fan, and all of the sender's, as ranges of `points`.
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
@group(0) @binding(4) var<storage, read_write> sums: array<vec4f>; // of R_d dA_i dA_o, mm^2, for each term

// R_d at a squared distance, by linear interpolation in the table.
fn reflectance(squared: Area) -> vec3f {
    let inside = at_least_first(squared, params.first_entry);
    let entry = min(entry_of(inside, params.first_entry), arrayLength(&table) - 2u);
    return mix(table[entry].rgb, table[entry + 1u].rgb, fraction_of(inside));
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
