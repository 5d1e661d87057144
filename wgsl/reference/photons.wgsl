// Photons through a stack of plane layers. They enter at one point of the top, at a right angle or from a uniform sky.
//
// The method of Wang, Jacques & Zheng 1995 (MCML): free paths of random length, absorption of a share of the weight at
// each scattering, the phase function of Henyey and Greenstein, random choice between reflection and refraction at
// boundaries of different indices, and Russian roulette.
//
// In a medium that hardly absorbs, paths would be very long. Far from the boundaries light diffuses. There a photon
// leaps to a random point of a sphere. The centre of the sphere lies one transport mean free path ahead, and the weight
// is multiplied by x / sinh(x), x = sigma_tr * radius.
//
// A lane whose photon has ended takes the next one, so that no lane waits for the longest path. Lanes store their
// photon between dispatches, so that each dispatch is short. The random numbers of a photon depend on its number only,
// and tallies are integers, so that the result does not depend on the order of execution.

import package::fresnel::{fresnel_dielectric};
import package::units::{Length, Number, PI};
import package::random::{random_words, random_numbers};

const LANES: u32 = 64u;         // lanes per workgroup
const AT_ONCE: u32 = 4096u;     // steps of a lane in one dispatch; lavapipe ends loops after 65,535 iterations
const RINGS: u32 = 384u;
const TALLIES: u32 = 769u;      // per batch: rings of reflected photons, rings of transmitted photons, absorption
const ONE: f32 = 2097152.0;     // 2^21, the tally of a photon of weight 1; a batch has at most 1024 photons
const FAINT: Number = 1e-4;     // weight below which a photon survives with the probability SURVIVAL
const SURVIVAL: Number = 0.125;
const DEEP: Number = 24.0;      // smallest distance from the boundaries for a leap, in transport mean free paths
const MARGIN: Number = 8.0;     // smallest distance from the boundaries after a leap, in the same unit

override LEAPS: u32 = 0u;       // 1 if photons may leap in one of the layers
override SKY: u32 = 0u;         // 1 if photons enter from a uniform sky

struct Layer {
    sigma_t: Number,    // 1/mm
    absorbed: Number,   // share of the weight that is absorbed at a scattering
    g: Number,
    transport: Length,  // transport mean free path, 1 / sigma_t'; practically infinite if leaps would be wrong
    sigma_tr: Number,   // 1/mm
    thickness: Length,
    above: Number,      // index of the layer over that of the medium above
    below: Number,      // index of the layer over that of the medium below
}

struct Params {
    key: vec2u,       // key of the random numbers
    first: u32,       // number of the first photon
    end: u32,         // number after the last photon
    batch: u32,       // photons in a batch
    innermost: u32,   // the smallest resolved ring, as returned by `ring`
}

// A photon and its path so far.
struct Photon {
    p: vec3f,         // mm; z is the depth below the top of the layer
    weight: Number,   // 0 if it has ended
    w: vec3f,         // direction; 0 before it enters
    stock: Number,    // weight plus absorbed weight: 1, except for roulette
    number: u32,
    flight: u32,
    layer: u32,
}

struct Work {
    taken: atomic<u32>,    // number of photons started
    lanes: array<Photon>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> layers: array<Layer>;
@group(0) @binding(2) var<storage, read_write> work: Work;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> busy: array<u32>; // 1 for each lane that needs another dispatch

// Return the ring of a point: the leading bits of its squared radius. A factor of 2 in radius has 16 rings.
fn ring(x: Length, y: Length) -> u32 {
    return bitcast<u32>(x * x + y * y) >> 20u;
}

// Return the direction whose angle to the unit vector `w` has the cosine `cosine`, rotated about `w` by `turn`.
fn scattered(w: vec3f, cosine: Number, turn: Number) -> vec3f {
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let x = sine * cos(turn);
    let y = sine * sin(turn);
    let s = select(-1.0, 1.0, w.z >= 0.0);
    let a = -1.0 / (s + w.z); // the frame of Duff et al. 2017
    let b = w.x * w.y * a;
    let u = x * vec3f(1.0 + s * w.x * w.x * a, s * b, -s * w.x) + y * vec3f(b, s + w.y * w.y * a, -w.y) + cosine * w;
    return u * (1.5 - 0.5 * dot(u, u)); // normalises: rounding errors must not accumulate
}

// Return the direction below the top of a photon from a uniform sky, or 0 if the top reflects the photon.
fn entering(eta: Number, u: vec4f) -> vec3f {
    let outside = sqrt(u.x); // cosine
    if u.y < fresnel_dielectric(outside, eta) {
        return vec3f(0.0);
    }
    let sine = sqrt(max(1.0 - u.x, 0.0)) / eta;
    return vec3f(sine * cos(2.0 * PI * u.z), sine * sin(2.0 * PI * u.z), sqrt(1.0 - sine * sine));
}

@compute @workgroup_size(LANES)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let last = arrayLength(&layers) - 1u;
    var photon = work.lanes[id.x];
    var more = true;

    for (var turn = 0u; turn < AT_ONCE; turn++) {
        if photon.weight == 0.0 {
            photon = Photon(vec3f(0.0), 1.0, vec3f(0.0, 0.0, f32(1u - SKY)), 1.0, params.first + atomicAdd(&work.taken, 1u), 0u, 0u);
            more = photon.number < params.end;
        }
        if !more {
            photon.weight = 0.0;
            break;
        }
        let here = layers[photon.layer];
        let words = random_words(vec4u(photon.number, photon.flight, params.key));
        let u = random_numbers(words);
        photon.flight++;
        if all(photon.w == vec3f(0.0)) {
            photon.w = entering(here.above, u);
            continue;
        }

        let down = photon.w.z > 0.0;
        let cosine = abs(photon.w.z);
        let free = -log(u.x) / here.sigma_t;
        let wall = select(photon.p.z, here.thickness - photon.p.z, down) / max(cosine, 1e-9);
        let room = min(photon.p.z, here.thickness - photon.p.z);
        let leap = LEAPS == 1u && room > DEEP * here.transport;
        let tally = (photon.number - params.first) / params.batch * TALLIES;
        var g = here.g;
        var share = here.absorbed;
        if leap {
            let radius = min(room - (MARGIN + 1.0) * here.transport, 1.0 / here.sigma_tr);
            photon.p += here.transport * photon.w + radius * scattered(photon.w, 2.0 * u.x - 1.0, 2.0 * PI * u.w);
            let x2 = radius * radius * here.sigma_tr * here.sigma_tr;
            let series = x2 / 6.0 * (1.0 + x2 / 20.0 * (1.0 + x2 / 42.0)); // of sinh(x) / x - 1
            share = series / (1.0 + series);
            g = 0.0;
        } else {
            photon.p += photon.w * min(free, wall);
        }
        if !leap && wall < free {
            let eta = select(here.above, here.below, down);
            // The squared cosine of the refracted ray, exact if the indices are equal.
            let squared = (1.0 - eta * eta) + eta * eta * cosine * cosine;
            let refracted = sqrt(max(squared, 0.0));
            let s = (eta * cosine - refracted) / (eta * cosine + refracted);
            let t = (cosine - eta * refracted) / (cosine + eta * refracted);
            if squared <= 0.0 || u.y < 0.5 * (s * s + t * t) {
                photon.w.z = -photon.w.z;
                photon.p.z = select(0.0, here.thickness, down);
            } else if photon.layer == select(0u, last, down) {
                let from_innermost = max(ring(photon.p.x, photon.p.y), params.innermost) - params.innermost;
                let hit = min(from_innermost, RINGS - 1u) + select(0u, RINGS, down);
                atomicAdd(&tallies[tally + hit], u32(photon.weight * ONE + 0.5));
                photon.stock -= photon.weight;
                photon.weight = 0.0;
            } else {
                photon.w = vec3f(eta * photon.w.xy, select(-refracted, refracted, down));
                photon.layer = select(photon.layer - 1u, photon.layer + 1u, down);
                photon.p.z = select(layers[photon.layer].thickness, 0.0, down);
            }
        } else {
            photon.weight -= photon.weight * share;
            if photon.weight < FAINT {
                let kept = select(0.0, photon.weight / SURVIVAL, f32(words.w & 7u) < 8.0 * SURVIVAL);
                photon.stock += kept - photon.weight;
                photon.weight = kept;
            }
            // The cosine of Henyey and Greenstein, in a form that allows g = 0.
            let v = 2.0 * u.y - 1.0;
            let q = 1.0 + g * v;
            let forward = (0.5 * g * (3.0 - g * g) + (1.0 + g * g) * v * (1.0 + 0.5 * g * v)) / (q * q);
            photon.w = scattered(photon.w, clamp(forward, -1.0, 1.0), 2.0 * PI * u.z);
        }
        if photon.weight == 0.0 {
            atomicAdd(&tallies[tally + 2u * RINGS], u32(max(photon.stock, 0.0) * ONE + 0.5));
        }
    }
    work.lanes[id.x] = photon;
    busy[id.x] = u32(more);
}
