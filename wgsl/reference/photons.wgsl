// Photons through a stack of plane layers, from a beam that has entered its top at a right angle.
//
// The method of Wang, Jacques and Zheng 1995 (MCML): flights of random length, a share of the weight absorbed at each
// scattering, Henyey and Greenstein's phase function, reflection or refraction by chance where indices differ, roulette.
//
// A workgroup follows one batch of photons and counts what becomes of them; a lane whose photon has ended takes the next
// one, so that lanes do not wait for the longest path. A photon's random numbers follow from its own number and tallies
// are integers, so that the result does not depend on which lane took which photon, or on how photons are dispatched.

import package::units::{Length, Number, PI};
import package::random::{random_numbers};

const LANES: u32 = 64u;
const BINS_PER_LANE: u32 = 6u;  // of each histogram
const BINS: u32 = 384u;         // LANES * BINS_PER_LANE
const ONE: f32 = 2097152.0;     // 2^21, the tally of a photon of full weight: batches are of at most 1024
const LONGEST: u32 = 262144u;   // flights; what is still inside after them counts as absorbed
const FAINT: Number = 1e-4;     // weight below which a photon lives on with a chance of SURVIVAL
const SURVIVAL: Number = 0.125;

struct Layer {
    sigma_t: Number,    // 1/mm
    absorbed: Number,   // share of the weight that a scattering takes
    g: Number,
    thickness: Length,
    above: Number,      // index over that of what lies above
    below: Number,      // index over that of what lies below
}

struct Params {
    key: vec2u,       // of the random numbers
    first: u32,       // number of the first photon
    end: u32,         // number after the last photon
    batch: u32,       // photons in a batch
    innermost: u32,   // the least radius told apart, as `ring` gives it
}

// A lane's share of its batch's histograms, which belong to all lanes.
struct Tally {
    reflected: array<atomic<u32>, BINS_PER_LANE>,
    transmitted: array<atomic<u32>, BINS_PER_LANE>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> layers: array<Layer>;
@group(0) @binding(2) var<storage, read_write> tallies: array<Tally>;
@group(0) @binding(3) var<storage, read_write> absorbed: array<u32>;

var<workgroup> taken: atomic<u32>;

// Rings by the leading bits of the squared radius: sixteen for each doubling of the radius, with edges that are exact.
fn ring(x: Length, y: Length) -> u32 {
    return bitcast<u32>(x * x + y * y) >> 20u;
}

// The direction of cosine `cosine` to `w`, a unit vector, turned about it by the angle `turn`.
fn scattered(w: vec3f, cosine: Number, turn: Number) -> vec3f {
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let x = sine * cos(turn);
    let y = sine * sin(turn);
    let s = select(-1.0, 1.0, w.z >= 0.0);
    let a = -1.0 / (s + w.z); // the frame of Duff et al. 2017
    let b = w.x * w.y * a;
    let u = x * vec3f(1.0 + s * w.x * w.x * a, s * b, -s * w.x) + y * vec3f(b, s + w.y * w.y * a, -w.y) + cosine * w;
    return u * (1.5 - 0.5 * dot(u, u)); // rounding must not add up over thousands of scatterings
}

@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    if lane == 0u {
        atomicStore(&taken, 0u); // not every driver clears it
    }
    workgroupBarrier();

    let start = params.first + group.x * params.batch;
    let end = min(start + params.batch, params.end);
    let last = arrayLength(&layers) - 1u;

    var inside = 0u;         // absorbed by this lane's photons
    var ended = true;
    var number = 0u;         // of the photon
    var flight = 0u;
    var layer = 0u;
    var p = vec3f(0.0);      // z is the depth below the top of the layer
    var w = vec3f(0.0);
    var weight = 0.0;
    var lost = 0.0;          // weight absorbed

    loop {
        if ended {
            number = start + atomicAdd(&taken, 1u);
            flight = 0u;
            layer = 0u;
            p = vec3f(0.0);
            w = vec3f(0.0, 0.0, 1.0);
            weight = 1.0;
            lost = 0.0;
            ended = false;
        }
        if number >= end {
            break;
        }
        let here = layers[layer];
        let u = random_numbers(vec4u(number, flight, params.key));
        flight++;

        let down = w.z > 0.0;
        let cosine = abs(w.z);
        let free = -log(u.x) / here.sigma_t;
        let wall = select(p.z, here.thickness - p.z, down) / max(cosine, 1e-9);
        p += w * min(free, wall);
        if wall < free {
            let eta = select(here.above, here.below, down);
            // cos^2 of the refracted ray; exact where indices are equal
            let squared = (1.0 - eta * eta) + eta * eta * cosine * cosine;
            let refracted = sqrt(max(squared, 0.0));
            let s = (eta * cosine - refracted) / (eta * cosine + refracted);
            let t = (cosine - eta * refracted) / (cosine + eta * refracted);
            if squared <= 0.0 || u.y < 0.5 * (s * s + t * t) {
                w.z = -w.z;
                p.z = select(0.0, here.thickness, down);
            } else {
                w = vec3f(eta * w.xy, select(-refracted, refracted, down));
                ended = layer == select(0u, last, down);
                if ended {
                    let bin = min(max(ring(p.x, p.y), params.innermost) - params.innermost, BINS - 1u);
                    let tally = group.x * LANES + bin / BINS_PER_LANE;
                    let amount = u32(weight * ONE + 0.5);
                    if down {
                        atomicAdd(&tallies[tally].transmitted[bin % BINS_PER_LANE], amount);
                    } else {
                        atomicAdd(&tallies[tally].reflected[bin % BINS_PER_LANE], amount);
                    }
                } else {
                    layer = select(layer - 1u, layer + 1u, down);
                    p.z = select(layers[layer].thickness, 0.0, down);
                }
            }
        } else {
            let part = weight * here.absorbed;
            lost += part;
            weight -= part;
            if weight < FAINT {
                weight = select(0.0, weight / SURVIVAL, u.w < SURVIVAL);
            }
            // Henyey and Greenstein's cosine, written so that g may be 0.
            let v = 2.0 * u.y - 1.0;
            let g = here.g;
            let forward = (0.5 * g * (3.0 - g * g) + (1.0 + g * g) * v * (1.0 + 0.5 * g * v)) / ((1.0 + g * v) * (1.0 + g * v));
            w = scattered(w, clamp(forward, -1.0, 1.0), 2.0 * PI * u.z);
            if flight >= LONGEST {
                lost += weight;
                weight = 0.0;
            }
            ended = weight == 0.0;
        }
        if ended {
            inside += u32(lost * ONE + 0.5);
        }
    }
    absorbed[group.x * LANES + lane] = inside;
}
