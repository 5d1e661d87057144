// The light that reaches a point M below the surface on a straight line from K, where it enters: the reduced intensity
// L_ri(M) (Norberg 2010, 2.1.3).

import package::units::{Length, Number, Position, Direction, Radiance};
import package::mesh::{ObjectUniforms};
import package::light::{Light, Incident};
import package::lights::{rho_dt_table};
import package::rho_dt::{rho_dt};
import package::subsurface_texture_mapping::first_hit::{first_hit};
import package::subsurface_texture_mapping::interior::{refracted_cosine};
import package::subsurface_texture_mapping::layers::{Coefficients, coefficients_at, interfaces_at, MAPPED, MAX_LAYERS};
import package::subsurface_texture_mapping::layers::{share_below, mean_over};
import package::subsurface_texture_mapping::shell::{Shell, depth_below, uv_above, distance_along, normal_near};

const MARCH: u32 = 0u;
const EQ_14: u32 = 1u;
const EQ_20: u32 = 2u;

override LIGHT: u32 = 0u;         // how the optical depth is estimated: MARCH, EQ_14 or EQ_20
override LIGHT_STEPS: u32 = 4u;   // of MARCH
override SHADOW: bool = true;     // whether shadow maps give the distance from K to M
override REFRACTION: bool = true;

const UNREACHED: Length = 1e9;
const LEAST_COSINE: Number = 1e-3; // light enters where the surface faces it, if only just

// Light from one direction.
struct Ray {
    light: Light,
    at: Incident,       // at P, with shadows where the shadow map does not give the distance
    outside: vec3f,     // directions towards the light in the coordinates of the shell
    inside: vec3f,
    to_world: mat3x3f,  // from those coordinates
    origin: Position,   // P
    eta: Number,
    specular: Number,
    near: Length,       // an error of the shadow map that does not matter
    sky: bool,          // light of the environment, from the direction of the normal
}

// How light reaches M.
struct Arrival {
    distance: Length,  // |KM|
    top: vec3f,        // depths of the interfaces at K
    entering: Radiance,
    extra: vec3f,      // optical depth by MARCH, less that by eq. 14
}

// The optical depth from K to M by eq. 13 and 14: layers as thick as they are at K and M on average. Eq. 20 lacks the
// maximum of eq. 14 (Norberg 2010, 3.1.1).
fn optical_depth(k: array<vec3f, 4>, distance: Length, below: Length, at: vec3f, top: vec3f) -> vec3f {
    if below <= 0.0 {
        return vec3f(0.0);
    }
    let mean = 0.5 * (at + top);
    if LIGHT == EQ_20 {
        let per_mm = distance / below; // 1 / cos(theta)
        let left = vec4f(distance, vec3f(distance) - mean * per_mm);
        let thick = vec4f(mean.x, mean.y - mean.x, mean.z - mean.y, UNREACHED) * per_mm;
        let d = min(left, thick);
        return k[0] * d.x + k[1] * d.y + k[2] * d.z + k[3] * d.w;
    }
    return distance * mean_over(k, clamp((vec3f(below) - mean) / below, vec3f(0.0), vec3f(1.0)));
}

// The optical depth from K to M by LIGHT_STEPS segments, in each of which the interfaces are straight.
fn marched(object: ObjectUniforms, shell: Shell, entry: vec3f, m: vec3f, at: vec3f, top: vec3f, c: Coefficients) -> vec3f {
    let lift = depth_below(shell, entry); // 0 but for what the shadow map corrects
    var total = vec3f(0.0);
    var above = -top;
    var k_above = c.t;
    if MAPPED {
        k_above = coefficients_at(object, uv_above(shell, entry)).t;
    }
    for (var i = 1u; i <= LIGHT_STEPS; i++) {
        let f = f32(i) / f32(LIGHT_STEPS);
        let p = mix(entry, m, f);
        let below = depth_below(shell, p) - (1.0 - f) * lift;
        let uv = uv_above(shell, p);
        var here = at;
        var k_here = c.t;
        if i < LIGHT_STEPS {
            here = interfaces_at(object, uv);
            if MAPPED {
                k_here = coefficients_at(object, uv).t;
            }
        }
        var k = k_here;
        for (var j = 0u; j < MAX_LAYERS; j++) {
            k[j] = 0.5 * (k_above[j] + k_here[j]);
        }
        total += mean_over(k, share_below(above, vec3f(below) - here));
        above = vec3f(below) - here;
        k_above = k_here;
    }
    return total * (length(m - entry) / f32(LIGHT_STEPS));
}

fn arrival(object: ObjectUniforms, ray: Ray, shell: Shell, m: vec3f, below: Length, at: vec3f, c: Coefficients) -> Arrival {
    let straight = distance_along(shell, m, ray.inside);
    var distance = select(straight, UNREACHED, straight < 0.0);
    var cosine = max(dot(ray.outside, normal_near(shell, m + ray.inside * max(straight, 0.0))), LEAST_COSINE);
    if SHADOW && !ray.sky {
        let guess = max(straight, 0.0);
        let hit = first_hit(ray.light, ray.at, ray.origin + ray.to_world * (m + ray.inside * guess));
        if hit.known {
            let n = normal_near(shell, m + ray.inside * guess);
            let off = smoothstep(0.1, 0.5, abs(hit.ahead) / (abs(hit.ahead) + guess + ray.near));
            let bend = clamp(dot(ray.outside, n) / max(dot(ray.inside, n), 1e-3), 0.1, 1.0);
            distance = max(guess + hit.ahead * mix(bend, 1.0, max(off, smoothstep(0.1, 0.0, dot(ray.outside, n)))), 0.0);
            cosine = mix(cosine, hit.cosine, off);
        }
    }
    var entering = ray.at.irradiance;
    if REFRACTION && !ray.sky {
        let share = rho_dt(rho_dt_table, cosine, ray.specular);
        entering *= share * cosine / refracted_cosine(cosine, ray.eta);
    }
    var arriving = Arrival(distance, at, entering, vec3f(0.0));
    if distance < UNREACHED {
        let entry = m + ray.inside * distance;
        arriving.top = interfaces_at(object, uv_above(shell, entry));
        if LIGHT == MARCH && below > 0.0 {
            let total = marched(object, shell, entry, m, at, arriving.top, c);
            arriving.extra = total - optical_depth(c.t, distance, below, at, arriving.top);
        }
    }
    return arriving;
}
