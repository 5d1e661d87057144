// M by brute force: the sum of R_d(|x_i - x_o|) L_d(x_i) dA over samples of a surface (Maisch & Ropinski 2017, eq. 5).
//
// Samples are grouped in blocks. Each workgroup has a list of the blocks within the range of the profile from its
// receivers. Each block is summed on its own before it is added to the total, to limit rounding errors.

import package::profile_table::{entry_of, fraction_of};
import package::units::{Area, Irradiance, Number, Position, Direction};

const LANES: u32 = 64u;  // receivers per workgroup
const BLOCK: u32 = 256u; // samples per block

struct Params {
    first_entry: u32, // leading bits of the squared distance of the first row of the kernel
    first_group: u32, // number of the first workgroup of receivers in this dispatch
}

struct Sample {
    position: Position,
    normal: Direction,
    flux: Irradiance,  // L_d dA, W/m^2 mm^2
}

struct Receiver {
    position: Position,
    normal: Direction,
}

struct Sums {
    front: Irradiance,
    back: Irradiance,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> kernel: array<vec4f>; // 1/mm^2: for samples on the same side, then for others
@group(0) @binding(2) var<storage, read> samples: array<Sample>;
@group(0) @binding(3) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(4) var<storage, read> starts: array<u32>;   // where the list of each workgroup begins in `blocks`
@group(0) @binding(5) var<storage, read> blocks: array<u32>;
@group(0) @binding(6) var<storage, read_write> sums: array<Sums>;

@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let receiver = receivers[(params.first_group + group.x) * LANES + lane];
    let last = arrayLength(&kernel) / 2u - 2u;
    var total = Sums(vec3f(0.0), vec3f(0.0));
    for (var j = starts[group.x]; j < starts[group.x + 1u]; j++) {
        var part = Sums(vec3f(0.0), vec3f(0.0));
        for (var i = 0u; i < BLOCK; i++) {
            let sample = samples[blocks[j] * BLOCK + i];
            let d = sample.position - receiver.position;
            let squared = dot(d, d);
            let wanted = entry_of(squared, params.first_entry);
            let entry = min(wanted, last);
            let between = fraction_of(squared);
            let opposed = dot(sample.normal, receiver.normal) < 0.0;
            let is_back = opposed && dot(d, receiver.normal) < 0.0;
            let at = entry + select(0u, last + 2u, opposed);
            let R = mix(kernel[at], kernel[at + 1u], select(between, 1.0, wanted > last));
            let M = sample.flux * R.rgb;
            part.front += select(M, vec3f(0.0), is_back);
            part.back += select(vec3f(0.0), M, is_back);
        }
        total.front += part.front;
        total.back += part.back;
    }
    sums[group.x * LANES + lane] = total;
}
