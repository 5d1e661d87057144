// M_back of one light at the pixels of one object: the irradiance blurred with each Gaussian at x_i, where the light's
// rays first hit the object, attenuated by the distance from there to x_o (Mikkelsen 2009, 3.4 and figure 10).

import package::units::{Length, Number, Position, Direction, Irradiance};
import package::mesh::{color_after};
import package::light::{ShadowView, cube_face};
import package::per_object::{object, is_other_object, position_at, normal_at, base_color_at};
import package::targets::{RGBA32Float};

override VIEWS: u32 = 1u; // of the light: 1 of the whole scene, or the 6 of a cube

struct Params {
    light: vec4f,               // xyz, 1: its position; xyz, 0: the direction towards it
    gaussians: array<vec4f, 6>, // rgb: weight; alpha: variance, mm^2
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> views: array<ShadowView>;
@group(0) @binding(2) var entry: texture_2d_array<f32>;
@group(0) @binding(3) var entry_normal: texture_2d_array<f32>;
@group(0) @binding(4) var entry_atlas: texture_2d_array<f32>;
@group(0) @binding(5) var linear_clamp: sampler;
@group(0) @binding(6) var blurred_0: texture_2d<f32>;
@group(0) @binding(7) var blurred_1: texture_2d<f32>;
@group(0) @binding(8) var blurred_2: texture_2d<f32>;
@group(0) @binding(9) var blurred_3: texture_2d<f32>;
@group(0) @binding(10) var blurred_4: texture_2d<f32>;
@group(0) @binding(11) var blurred_5: texture_2d<f32>;
@group(0) @binding(12) var so_far: texture_2d<f32>; // M_back of the lights before this one, or a single black texel

struct Pixel {
    @location(0) M_back: RGBA32Float,
}

// Light that enters within this many sigmas of a Gaussian from x_o is partly in M_front already; farther away, it
// counts fully.
const FADED: Number = 4.0;
const OPPOSED: Number = 1e-3; // least denominator where normals are opposed

// Distances from x_i to x_o.
struct Path {
    through: Length, // through the object, as the Gaussians take it
    over: Length,    // an estimate of the distance along the surface
}

// Through the object, the distance is corrected to that of x_o from the tangent plane at x_i (Mikkelsen 2009, figure
// 10), as far as the normals are opposed, as they are on a level slab (d'Eon & Luebke 2007, 14.5.7).
//
// Along the surface, the distance is the straight one where the normals are equal, and infinite where they are opposed.
// The atlas would give it within one chart only, which would make the borders of charts visible.
//
// x_i is up to a texel away from x_o's own ray. The distance along the ray is that to the tangent plane at x_i; on the
// same sheet `beside` is subtracted, since otherwise lit points would lie behind themselves.
fn path_between(x_i: Position, n_i: Direction, x_o: Position, n_o: Direction, w_i: Direction) -> Path {
    let alike = dot(n_i, n_o);
    let beside = length(cross(x_i - x_o, w_i));
    let below = max(dot(x_i - x_o, n_i), 0.0);
    let distance = min(length(x_i - x_o), below / max(dot(n_i, w_i), 1e-6));
    let through = mix(distance, below, clamp(-alike, 0.0, 1.0));
    let over = max(distance - beside * max(alike, 0.0), 0.0) / max(0.5 + 0.5 * alike, OPPOSED);
    return Path(through, over);
}

// M_back by one Gaussian: rgb of k is its weight, alpha its variance.
fn contribution(blurred: texture_2d<f32>, linear_clamp: sampler, uv: vec2f, k: vec4f, path: Path) -> Irradiance {
    let attenuation = exp(-0.5 * path.through * path.through / k.w) * smoothstep(0.0, FADED, path.over * inverseSqrt(k.w));
    return k.rgb * attenuation * textureSampleLevel(blurred, linear_clamp, uv, 0.0).rgb;
}

// Weights of three texels by a quadratic B-spline centred at `f`, 0 to 1, within the second.
fn spline(f: f32) -> vec3f {
    let g = 1.0 - f;
    return vec3f(0.5 * g * g, 0.5 + f * g, 0.5 * f * f);
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let x_o = position_at(texel);
    let n_o = normal_at(texel);
    let w_i = normalize(params.light.xyz - x_o * params.light.w);
    let layer = select(0u, cube_face(-w_i), VIEWS == 6u);
    let clip = views[layer].world_to_clip * vec4f(x_o, 1.0);
    let size = vec2f(textureDimensions(entry));
    let place = (vec2f(0.5, -0.5) * clip.xy / clip.w + 0.5) * size;
    let across = spline(fract(place.x));
    let along = spline(fract(place.y));
    var M = vec3f(0.0);
    var counted = 0.0;
    for (var i = 0u; i < 9u; i++) { // one by one: atlas coordinates of different charts cannot be interpolated
        let step = vec2u(i % 3u, i / 3u);
        let at = clamp(vec2i(floor(place)) + vec2i(step) - 1, vec2i(0), vec2i(size) - 1);
        let x_i = textureLoad(entry, at, layer, 0);
        let n_i = textureLoad(entry_normal, at, layer, 0).xyz;
        let uv = textureLoad(entry_atlas, at, layer, 0).xy;
        let path = path_between(x_i.xyz, n_i, x_o, n_o, w_i);
        var sum = contribution(blurred_0, linear_clamp, uv, params.gaussians[0], path);
        sum += contribution(blurred_1, linear_clamp, uv, params.gaussians[1], path);
        sum += contribution(blurred_2, linear_clamp, uv, params.gaussians[2], path);
        sum += contribution(blurred_3, linear_clamp, uv, params.gaussians[3], path);
        sum += contribution(blurred_4, linear_clamp, uv, params.gaussians[4], path);
        sum += contribution(blurred_5, linear_clamp, uv, params.gaussians[5], path);
        let weight = across[step.x] * along[step.y] * x_i.w;
        M += weight * sum;
        counted += weight; // rays that miss the object do not count
    }
    M *= color_after(object, base_color_at(texel)) / max(counted, 1e-6);
    let others = textureLoad(so_far, min(texel, textureDimensions(so_far) - 1u), 0).rgb;
    return Pixel(vec4f(others + M, 1.0));
}
