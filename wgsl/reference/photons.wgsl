// Photons through a stack of plane layers, from a beam that has entered its top at a right angle, or from a sky that
// shines on a point of it evenly.
//
// The method of Wang, Jacques and Zheng 1995 (MCML): flights of random length, a share of the weight absorbed at each
// scattering, Henyey and Greenstein's phase function, reflection or refraction by chance where indices differ, roulette.
//
// In a medium that absorbs next to nothing paths would have no end. Deep inside of it a photon leaps: far from boundaries
// light diffuses, so that it leaves a sphere about the point that its path tends to, a transport mean free path ahead,
// anywhere with equal likelihood, and with its weight times x / sinh(x), x = sigma_tr * radius.
//
// A lane whose photon has ended takes the next one, so that lanes do not wait for the longest path. Lanes keep what they
// do from one dispatch to the next, so that none takes long. A photon's random numbers follow from its own number and
// tallies are integers, so that the result does not depend on which lane took which photon, or when.

import package::fresnel::{fresnel_dielectric};
import package::units::{Length, Number, PI};
import package::random::{random_words, random_numbers};

const LANES: u32 = 64u;         // of a workgroup
const AT_ONCE: u32 = 4096u;     // flights of a lane in one dispatch; lavapipe ends a shader's loops after 65,535 turns
const RINGS: u32 = 384u;
const TALLIES: u32 = 769u;      // of a batch: rings of what is reflected, of what is transmitted, what is absorbed
const ONE: f32 = 2097152.0;     // 2^21, the tally of a photon of full weight: batches are of at most 1024
const FAINT: Number = 1e-4;     // weight below which a photon lives on with a chance of SURVIVAL
const SURVIVAL: Number = 0.125;
const DEEP: Number = 24.0;      // transport mean free paths from the boundaries of a layer from which a photon leaps
const MARGIN: Number = 8.0;     // that a leap keeps from them

override LEAPS: u32 = 0u;       // 1 where there is a layer to leap in
override SKY: u32 = 0u;         // 1 where light comes from everywhere above

struct Layer {
    sigma_t: Number,    // 1/mm
    absorbed: Number,   // share of the weight that a scattering takes
    g: Number,
    transport: Length,  // transport mean free path, 1 / sigma_t'; endless where leaps would be wrong
    sigma_tr: Number,   // 1/mm
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

// A photon on its way.
struct Photon {
    p: vec3f,         // mm; z is the depth below the top of the layer
    weight: Number,   // 0 once it has ended
    w: vec3f,         // direction; 0 before it has entered
    stock: Number,    // weight and what was absorbed of it: 1, but for roulette
    number: u32,
    flight: u32,
    layer: u32,
}

struct Work {
    taken: atomic<u32>,    // photons begun
    lanes: array<Photon>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> layers: array<Layer>;
@group(0) @binding(2) var<storage, read_write> work: Work;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> busy: array<u32>; // lanes that want another dispatch

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

// The direction in which a photon from an even sky enters: 0 where the top reflects it, and the next is to be tried.
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
            // The squared cosine of the refracted ray, exact where indices are equal.
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
            // Henyey and Greenstein's cosine, written so that g may be 0.
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
