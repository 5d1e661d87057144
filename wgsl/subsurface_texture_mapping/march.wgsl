// Subsurface texture mapping (Norberg 2010, 2.1 and 3.1; Francois et al. 2006): light that is scattered once, summed
// along the viewing ray below each pixel. M = pi L_inside / eta^2, so that the composite shows rho_dt L_inside / eta^2.

import package::units::{Length, Number, Direction, Radiance, PI};
import package::light::{Incident, incident};
import package::lights::{lights, rho_dt_table, visibility, environment_irradiance};
import package::mesh::{color_before, color_after};
import package::per_object::{object, is_other_object, position_at, normal_at, specular_at, sky_at, base_color_at};
import package::per_object::{direction_to_viewer};
import package::random::{random_words, random_numbers};
import package::rho_dt::{rho_dt};
import package::subsurface_texture_mapping::interior::{refracted};
import package::subsurface_texture_mapping::layers::{Coefficients, stack, coefficients_at, interfaces_at, layer_at, MAPPED};
import package::subsurface_texture_mapping::light_path::{Ray, Arrival, arrival, optical_depth};
import package::subsurface_texture_mapping::light_path::{LIGHT, EQ_20, SHADOW, REFRACTION};
import package::subsurface_texture_mapping::phase::{phase};
import package::subsurface_texture_mapping::shell::{Shell, depth_below, uv_above, principal_rotation};
import package::subsurface_texture_mapping::tangents::{tangents_of};
import package::targets::{RGBA32Float};

const SEGMENTS: u32 = 0u;
const MIDPOINT: u32 = 1u;
const PRINTED: u32 = 2u;
const WHITE: u32 = 1u;
const UV: u32 = 2u;
const UV_NOISE: Length = 0.25; // greatest offset along the surface
const OPAQUE: Number = 60.0;   // no optical depth is larger: exp(OPAQUE) is a finite number still
const LONGEST: Number = 8.0;   // optical depth at which the ray ends, at most

override STEPS: u32 = 10u;
override RULE: u32 = 0u;  // SEGMENTS, MIDPOINT or PRINTED
override NOISE: u32 = 0u; // 0, WHITE or UV

struct Params {
    world_to_clip: mat4x4f,
    eta: Number,
    depth_max: Length,   // of the end of the ray
    extinction: Number,  // 1/mm: mean over layers and channels
    least: Number,       // 1/mm: the least of them
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var mesh_uv: texture_2d<f32>; // these three as surface.wgsl writes them
@group(0) @binding(2) var v_gradient: texture_2d<f32>;
@group(0) @binding(3) var curvatures: texture_2d<f32>;
@group(0) @binding(4) var back_faces: texture_depth_2d;

struct Pixel {
    @location(0) M: RGBA32Float,
}

// A point M on the viewing ray.
struct Node {
    t: Length,       // distance from P
    below: Length,   // depth
    at: vec3f,       // depths of the interfaces
    c: Coefficients,
    light: Arrival,
}

// The viewing ray below a pixel.
struct Sight {
    shell: Shell,
    inside: vec3f, // direction away from the viewer, in the coordinates of the shell
    light: Ray,
}

fn node_at(sight: Sight, t: Length) -> Node {
    let m = t * sight.inside;
    let below = max(depth_below(sight.shell, m), 0.0);
    let uv = uv_above(sight.shell, m);
    let at = interfaces_at(object, uv);
    let c = coefficients_at(object, uv);
    return Node(t, below, at, c, arrival(object, sight.light, sight.shell, m, below, at, c));
}

// How far, in depth of clip space, M lies in front of the face at which the ray leaves the body. Above 0 inside.
fn clearance(sight: Sight, t: Length) -> Number {
    let clip = params.world_to_clip * vec4f(sight.light.origin + sight.light.to_world * (t * sight.inside), 1.0);
    let size = vec2f(textureDimensions(back_faces));
    let place = vec2i((vec2f(0.5, -0.5) * clip.xy / clip.w + 0.5) * size);
    return textureLoad(back_faces, clamp(place, vec2i(0), vec2i(size) - 1), 0) - clip.z / clip.w;
}

// Radiance that a piece of a layer sends back along the ray: within it, all light falls exponentially.
struct Piece {
    radiance: Radiance,
    kept: vec3f,  // share of the radiance from below that passes it
    slope: vec3f, // of the light's optical depth, 1/mm
}

fn piece(a: Node, b: Node, from_share: Number, to_share: Number, turn: Number) -> Piece {
    let middle = 0.5 * (from_share + to_share);
    let j = layer_at(mix(a.below, b.below, middle), mix(a.at, b.at, middle));
    var k = a.c.t;
    var sigma_s = a.c.s[j];
    if MAPPED {
        for (var i = 0u; i < 4u; i++) {
            k[i] = 0.5 * (a.c.t[i] + b.c.t[i]);
        }
        sigma_s = 0.5 * (sigma_s + b.c.s[j]);
    }
    let along = (to_share - from_share) * (b.t - a.t);
    let first = optical_depth_between(k, a, b, from_share);
    let last = optical_depth_between(k, a, b, to_share);
    let out = k[j] * along;
    let all_of_it = out + last - first;
    let kept = exp(-out);
    // The mean of exp over the piece; a series where it hardly falls.
    let mean = select((1.0 - exp(-all_of_it)) / all_of_it, 1.0 - 0.5 * all_of_it, abs(all_of_it) < vec3f(1e-3));
    let entering = mix(a.light.entering, b.light.entering, middle);
    let source = sigma_s * phase(turn, stack.sigma_s[j].a) * entering * exp(-first);
    return Piece(source * mean * along, kept, (last - first) / max(along, 1e-9));
}

fn optical_depth_between(k: array<vec3f, 4>, a: Node, b: Node, share: Number) -> vec3f {
    let distance = mix(a.light.distance, b.light.distance, share);
    let at = mix(a.at, b.at, share);
    let top = mix(a.light.top, b.light.top, share);
    let extra = mix(a.light.extra, b.light.extra, share);
    let least = select(0.0, -OPAQUE, LIGHT == EQ_20);
    return clamp(optical_depth(k, distance, mix(a.below, b.below, share), at, top) + extra, vec3f(least), vec3f(OPAQUE));
}

// Where the ray crosses the interfaces between two nodes, in order: shares of the way, 1 for interfaces that it does not
// cross. The interfaces are straight in between.
fn crossings(a: Node, b: Node) -> vec3f {
    let first = vec3f(a.below) - a.at;
    let last = vec3f(b.below) - b.at;
    var at = select(vec3f(1.0), first / (first - last), first * last < vec3f(0.0));
    at = vec3f(min(at.x, at.y), max(at.x, at.y), at.z);
    at = vec3f(at.x, min(at.y, at.z), max(at.y, at.z));
    return vec3f(min(at.x, at.y), max(at.x, at.y), at.z);
}

// The sum by segments: nodes lie denser where more light comes from; between them, interfaces are straight, and each
// piece of a layer is integrated exactly. Below the last node the last layer goes on without end.
fn by_segments(sight: Sight, end: Length, shift: Number) -> Radiance {
    let turn = dot(sight.light.inside, sight.inside);
    let decay = clamp(params.extinction * end, 0.5, 6.0);
    let is_cut = clearance(sight, 0.0) > 0.0 || clearance(sight, 1e-3 * end) > 0.0;
    var radiance = vec3f(0.0);
    var carried = vec3f(1.0);
    var slope = vec3f(0.0);
    var left = max(clearance(sight, 0.0), 0.0);
    var a = node_at(sight, 0.0);
    for (var i = 1u; i <= STEPS; i++) {
        let fraction = (f32(i) - select(0.0, shift, i < STEPS)) / f32(STEPS);
        var t = -end * log(1.0 - fraction * (1.0 - exp(-decay))) / decay;
        let clear = clearance(sight, t);
        let leaves = is_cut && clear <= 0.0;
        if leaves {
            t = mix(a.t, t, left / max(left - clear, 1e-12));
        }
        left = clear;
        let b = node_at(sight, t);
        let at = crossings(a, b);
        var begin = 0.0;
        for (var j = 0u; j < 4u; j++) {
            let stop = select(1.0, at[min(j, 2u)], j < 3u);
            if stop > begin {
                let part = piece(a, b, begin, stop, turn);
                radiance += carried * part.radiance;
                carried *= part.kept;
                slope = part.slope;
                begin = stop;
            }
        }
        a = b;
        if leaves {
            return radiance;
        }
    }
    let j = layer_at(a.below, a.at);
    let reached = exp(-optical_depth_between(a.c.t, a, a, 1.0));
    let source = a.c.s[j] * phase(turn, stack.sigma_s[j].a) * a.light.entering * reached;
    return radiance + carried * source / max(a.c.t[j] + max(slope, vec3f(0.0)), vec3f(1e-6));
}

// The sum over equal steps: at the near end of each (Norberg 2010, 2.1.4), or in its middle.
fn by_steps(sight: Sight, end: Length, shift: Number) -> Radiance {
    let turn = dot(sight.light.inside, sight.inside);
    let is_cut = clearance(sight, 0.0) > 0.0 || clearance(sight, 1e-3 * end) > 0.0;
    let step = end / f32(STEPS);
    let offset = select(shift, 0.5 + shift, RULE == MIDPOINT);
    var radiance = vec3f(0.0);
    var carried = vec3f(1.0);
    for (var i = 0u; i < STEPS; i++) {
        let m = node_at(sight, (f32(i) + offset) * step);
        if is_cut && clearance(sight, m.t) < 0.0 && i > 0u {
            break;
        }
        let j = layer_at(m.below, m.at);
        let reached = exp(-optical_depth_between(m.c.t, m, m, 1.0));
        let kept = exp(-m.c.t[j] * step);
        let here = select(vec3f(1.0), exp(-m.c.t[j] * step * offset), vec3<bool>(RULE == MIDPOINT));
        radiance += carried * here * m.c.s[j] * phase(turn, stack.sigma_s[j].a) * m.light.entering * reached * step;
        carried *= kept;
    }
    return radiance;
}

// The surface about a pixel.
fn shell_at(texel: vec2u) -> Shell {
    let first = textureLoad(mesh_uv, texel, 0);
    let second = textureLoad(v_gradient, texel, 0).xy;
    let s = textureLoad(curvatures, texel, 0).xyz * select(0.0, 1.0, SHADOW);
    let turn = principal_rotation(s.x, s.y, s.z);
    let rotated = mat2x2f(turn.x, -turn.y, turn.y, turn.x); // columns; to the principal directions
    let mean = 0.5 * (s.x + s.z);
    let half = length(vec2f(0.5 * (s.x - s.z), s.y));
    let k = vec2f(mean + half, mean - half);
    return Shell(vec3f(k, select(k.y, k.x, abs(k.x) >= abs(k.y))), first.xy, rotated * first.zw, rotated * second);
}

// The axes of its coordinates in the world: the principal directions, and downwards.
fn axes_at(texel: vec2u, n: Direction) -> mat3x3f {
    let s = textureLoad(curvatures, texel, 0).xyz * select(0.0, 1.0, SHADOW);
    let turn = principal_rotation(s.x, s.y, s.z);
    let tangents = tangents_of(n);
    let first = turn.x * tangents.first + turn.y * tangents.second;
    let second = turn.x * tangents.second - turn.y * tangents.first;
    return mat3x3f(first, second, -n);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let x = position_at(texel);
    let n = normal_at(texel);
    let w_o = direction_to_viewer(x);
    let eta = select(1.0, params.eta, REFRACTION);
    let axes = axes_at(texel, n);
    let random = random_numbers(random_words(vec4u(texel, 0u, 0u)));
    var sight: Sight;
    sight.shell = shell_at(texel);
    sight.inside = -refracted(w_o, n, eta) * axes; // times the transpose
    let shift = select(0.0, random.x - 0.5, NOISE == WHITE);
    if NOISE == UV {
        let off = UV_NOISE * (2.0 * random.xy - 1.0);
        sight.shell.uv += vec2f(dot(sight.shell.du, off), dot(sight.shell.dv, off));
    }
    let end = min(params.depth_max / max(sight.inside.z, 0.05), LONGEST / params.least);
    var radiance = vec3f(0.0);
    for (var i = 0u; i <= arrayLength(&lights); i++) {
        let is_sky = i == arrayLength(&lights); // taken to come from the direction of the normal
        var ray: Ray;
        ray.sky = is_sky;
        if is_sky {
            ray.at = Incident(n, environment_irradiance(n, sky_at(texel)), 0.0);
        } else {
            ray.light = lights[i];
            ray.at = incident(ray.light, x);
            if !SHADOW {
                ray.at.irradiance *= visibility(ray.light, ray.at, x, n, vec3f(0.0), vec3f(0.0));
            }
        }
        if all(ray.at.irradiance <= vec3f(0.0)) {
            continue;
        }
        ray.outside = ray.at.direction * axes;
        ray.inside = refracted(ray.at.direction, n, eta) * axes;
        ray.to_world = axes;
        ray.origin = x;
        ray.eta = eta;
        ray.specular = specular_at(texel);
        ray.near = 0.1 * params.depth_max;
        sight.light = ray;
        if RULE == SEGMENTS {
            radiance += by_segments(sight, end, shift);
        } else {
            radiance += by_steps(sight, end, shift);
        }
    }
    let color = color_before(object, base_color_at(texel)) * color_after(object, base_color_at(texel));
    let crossed = select(rho_dt(rho_dt_table, max(dot(n, w_o), 0.0), specular_at(texel)), eta * eta, REFRACTION);
    return Pixel(vec4f(PI * color * radiance / max(crossed, 1e-3), 1.0));
}
