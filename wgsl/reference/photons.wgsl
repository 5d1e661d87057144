import package::units::{Length, Number, PI};
import package::random::{random_numbers};

const LANES: u32 = 64u;         // of a workgroup
const AT_ONCE: u32 = 4096u;     // flights of a lane in one dispatch; lavapipe ends a shader's loops after 65,535 turns
const RINGS: u32 = 384u;
const TALLIES: u32 = 769u;      // of a batch: rings of what is reflected, of what is transmitted, what is absorbed
const ONE: f32 = 2097152.0;     // 2^21, the tally of a photon of full weight: batches are of at most 1024
const LONGEST: u32 = 1048576u;  // flights; what is still inside after them counts as absorbed
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

// A photon on its way.
struct Photon {
    p: vec3f,         // mm; z is the depth below the top of the layer
    weight: Number,   // 0 once it has ended
    w: vec3f,         // direction
    absorbed: Number, // weight lost
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

@compute @workgroup_size(LANES)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let last = arrayLength(&layers) - 1u;
    var photon = work.lanes[id.x];
    var more = true;

    for (var turn = 0u; turn < AT_ONCE; turn++) {
        if photon.weight == 0.0 {
            photon = Photon(vec3f(0.0), 1.0, vec3f(0.0, 0.0, 1.0), 0.0, params.first + atomicAdd(&work.taken, 1u), 0u, 0u);
            more = photon.number < params.end;
        }
        if !more {
            photon.weight = 0.0;
            break;
        }
        let here = layers[photon.layer];
        let u = random_numbers(vec4u(photon.number, photon.flight, params.key));
        photon.flight++;

        let down = photon.w.z > 0.0;
        let cosine = abs(photon.w.z);
        let free = -log(u.x) / here.sigma_t;
        let wall = select(photon.p.z, here.thickness - photon.p.z, down) / max(cosine, 1e-9);
        photon.p += photon.w * min(free, wall);
        let tally = (photon.number - params.first) / params.batch * TALLIES;
        if wall < free {
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
                photon.weight = 0.0;
            } else {
                photon.w = vec3f(eta * photon.w.xy, select(-refracted, refracted, down));
                photon.layer = select(photon.layer - 1u, photon.layer + 1u, down);
                photon.p.z = select(layers[photon.layer].thickness, 0.0, down);
            }
        } else {
            let part = photon.weight * here.absorbed;
            photon.absorbed += part;
            photon.weight -= part;
            if photon.weight < FAINT {
                photon.weight = select(0.0, photon.weight / SURVIVAL, u.w < SURVIVAL);
            }
            if photon.flight >= LONGEST {
                photon.absorbed += photon.weight;
                photon.weight = 0.0;
            }
            // Henyey and Greenstein's cosine, written so that g may be 0.
            let v = 2.0 * u.y - 1.0;
            let g = here.g;
            let q = 1.0 + g * v;
            let forward = (0.5 * g * (3.0 - g * g) + (1.0 + g * g) * v * (1.0 + 0.5 * g * v)) / (q * q);
            photon.w = scattered(photon.w, clamp(forward, -1.0, 1.0), 2.0 * PI * u.z);
        }
        if photon.weight == 0.0 {
            atomicAdd(&tallies[tally + 2u * RINGS], u32(photon.absorbed * ONE + 0.5));
        }
    }
    work.lanes[id.x] = photon;
    busy[id.x] = u32(more);
}
