// Where a distance lies in a table of a diffusion profile. `wgsss/optics/lookup.py` makes the tables.
//
// Most tables are indexed by the leading bits of the squared distance. The bits of a positive float, read as a whole
// number, grow with it: without the last SHIFT they count intervals whose widths grow in proportion to the distance,
// and no root or logarithm has to be computed. The first entry of a table is for the leading bits `first_entry`.

import package::units::{Area, Length, Number};

// The number of low bits that are left out: 2^(23 - SHIFT) = 256 entries for each doubling of the squared distance.
const SHIFT: u32 = 15u;

// The entry of a positive number, such as a squared distance. Smaller numbers than the first entry's have entry 0.
fn entry_of(number: Number, first_entry: u32) -> u32 {
    return max(bitcast<u32>(number) >> SHIFT, first_entry) - first_entry;
}

// As entry_of, for four numbers.
fn entries_of(numbers: vec4f, first_entry: u32) -> vec4u {
    return max(bitcast<vec4u>(numbers) >> vec4u(SHIFT), vec4u(first_entry)) - first_entry;
}

// How far a number is from the lower end of its entry's interval, 0, to the upper one, 1: the weight of the next entry
// in tables that are interpolated.
fn fraction_of(number: Number) -> Number {
    return f32(bitcast<u32>(number) & ((1u << SHIFT) - 1u)) / f32(1u << SHIFT);
}

// The number, or the lower end of the first entry's interval where that is larger.
fn at_least_first(number: Number, first_entry: u32) -> Number {
    return bitcast<f32>(max(bitcast<u32>(number), first_entry << SHIFT));
}

// The entry and, as its fraction, the weight of the next one, in a table with equal steps in log2 of the squared
// distance: `steps` for each doubling, from `low` = log2 of the first squared distance in mm^2 to the entry `last`.
fn log_entry(squared: Area, low: Number, steps: Number, last: u32) -> Number {
    return clamp((log2(max(squared, 1e-30)) - low) * steps, 0.0, f32(last) - 1e-3);
}

// The entry and, as its fraction, the weight of the next one, in a table with equal steps in the root of the distance,
// from 0 to the entry `last` at the distance `farthest`.
fn root_entry(distance: Length, farthest: Length, last: u32) -> Number {
    return sqrt(clamp(distance / farthest, 0.0, 1.0)) * f32(last);
}
