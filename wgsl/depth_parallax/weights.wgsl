// The table of a layer (wgsss/optics/mapped.py): weights of its Gaussians by share of its thickness and of its scattering.

import package::units::{Number};

const GAUSSIANS: u32 = 6u;
const REFLECTED: u32 = 0u;  // first rows of the weights of R for light from above,
const DOWNWARDS: u32 = 6u;  // of T for light from above
const UPWARDS: u32 = 12u;   // and of T for light from below
const FROM_BELOW: u32 = 18u; // row of the total of R for light from below

@group(1) @binding(20) var<storage, read> weights: array<vec4f>; // by row, then by share of scattering, then of thickness
@group(1) @binding(21) var<uniform> entries: vec2u;               // along the shares of thickness and of scattering

// A place in the table: the entries below, and the fractions towards the next ones.
struct Place {
    share: u32,
    color: vec3u,
    toward: vec4f, // rgb: of the scattering; a: of the thickness
}

fn place_at(share: Number, color: vec3f) -> Place {
    let last = vec4f(vec3f(f32(entries.y)), f32(entries.x)) - 1.0;
    let at = sqrt(clamp(vec4f(color, share), vec4f(0.0), vec4f(1.0))) * last;
    let low = min(floor(at), max(last - 1.0, vec4f(0.0)));
    return Place(u32(low.a), vec3u(low.rgb), at - low);
}

fn entry(row: u32, color: u32, share: u32) -> vec3f {
    return weights[(row * entries.y + color) * entries.x + share].rgb;
}

fn along_share(row: u32, color: u32, place: Place) -> vec3f {
    if entries.x == 1u {
        return entry(row, color, 0u);
    }
    return mix(entry(row, color, place.share), entry(row, color, place.share + 1u), place.toward.a);
}

// A row of the table at a place, linearly interpolated.
fn row_at(row: u32, place: Place) -> vec3f {
    if entries.y == 1u {
        return along_share(row, 0u, place);
    }
    var value = vec3f(0.0);
    for (var c = 0u; c < 3u; c++) {
        let low = along_share(row, place.color[c], place)[c];
        value[c] = mix(low, along_share(row, place.color[c] + 1u, place)[c], place.toward[c]);
    }
    return value;
}

// The sum of the weights of R or of T: the total.
fn total_at(first: u32, place: Place) -> vec3f {
    var sum = vec3f(0.0);
    for (var k = 0u; k < GAUSSIANS; k++) {
        sum += row_at(first + k, place);
    }
    return sum;
}
