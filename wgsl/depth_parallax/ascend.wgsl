// The light that leaves a layer at its top, as the viewer sees it: what the layer reflects, and the light from the layers
// below, blurred by its T and shifted by parallax.
//
// The shift follows the view ray, refracted at the surface by Snell's law, down to the mean depth of the last scattering
// event before the light leaves, (mu / sigma) (1 - exp(-sigma d / mu)). The ray reaches the bottom of a thin layer; in a
// thick one the light that is seen was scattered within a mean free path.

import package::depth_parallax::surface::{Varying, surface_at, texels_of, atlas_vertex};
import package::depth_parallax::weights::{UPWARDS, Place, place_at, row_at};
import package::targets::{RGBA16Float};
import package::spline::{smooth_sample};
import package::units::{Length, Number};
import package::walk::{walk};

struct Params {
    absorption: vec3f, // sigma_a, 1/mm
    thickness: Length, // at a share of 1
    scattering: vec3f, // sigma_s', 1/mm, at a share of 1
    eta: Number,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var amount: texture_2d<f32>; // of the layer, as maps.wgsl draws it
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var reflected: texture_2d<f32>; // by the layer
@group(0) @binding(4) var above: texture_2d<f32>;     // optical depth of the layers above, or a single black texel
@group(0) @binding(5) var linear_clamp: sampler;
@group(0) @binding(6) var blurred_0: texture_2d<f32>; // light that leaves the layers below
@group(0) @binding(7) var blurred_1: texture_2d<f32>;
@group(0) @binding(8) var blurred_2: texture_2d<f32>;
@group(0) @binding(9) var blurred_3: texture_2d<f32>;
@group(0) @binding(10) var blurred_4: texture_2d<f32>;
@group(0) @binding(11) var blurred_5: texture_2d<f32>;

struct Texel {
    @location(0) leaving: RGBA16Float,
}

const FARTHEST: Number = 20.0; // the tangent of the steepest ray, in a medium without refraction

// The light from the layers below that leaves at uv of the atlas.
fn light_at(uv: vec2f, place: Place) -> vec3f {
    return row_at(UPWARDS, place) * smooth_sample(blurred_0, linear_clamp, uv)
        + row_at(UPWARDS + 1u, place) * smooth_sample(blurred_1, linear_clamp, uv)
        + row_at(UPWARDS + 2u, place) * smooth_sample(blurred_2, linear_clamp, uv)
        + row_at(UPWARDS + 3u, place) * smooth_sample(blurred_3, linear_clamp, uv)
        + row_at(UPWARDS + 4u, place) * smooth_sample(blurred_4, linear_clamp, uv)
        + row_at(UPWARDS + 5u, place) * smooth_sample(blurred_5, linear_clamp, uv);
}

@fragment
fn fs(in: Varying) -> Texel {
    let surface = surface_at(in);
    let texel = vec2u(in.clip.xy);
    let size = vec2f(textureDimensions(amount));
    let uv = in.clip.xy / size;
    let share = textureLoad(amount, texel, 0);
    let scattered = textureLoad(color, texel, 0).rgb;
    let place = place_at(share.r * share.g, scattered);
    // The normal map tilts the surface, not the layers. A tilted normal that faces away from the viewer does not refract.
    let n = select(surface.n, surface.bent, dot(surface.bent, surface.w_o) > 0.0);
    let inside = refract(-surface.w_o, n, 1.0 / params.eta);
    let mu = max(-dot(inside, surface.n), 1e-3);
    let sideways = inside + surface.n * dot(surface.n, -inside);
    // Through a flat surface no ray is flatter than that of grazing light.
    let flattest = min(inverseSqrt(max(params.eta * params.eta - 1.0, 1e-6)), FARTHEST);
    let tangent = min(length(sideways) / mu, flattest);
    let along = select(vec3f(0.0), normalize(sideways), dot(sideways, sideways) > 1e-12) * tangent;
    let cosine = inverseSqrt(1.0 + tangent * tangent);
    let sigma = max((params.absorption + params.scattering * scattered) * share.g, vec3f(1e-9));
    let d = params.thickness * share.r;
    let before = textureLoad(above, min(texel, textureDimensions(above) - 1u), 0).rgb;
    let path = sigma * (d / cosine);
    // 1 - exp(-x) is x - x^2 / 2 where the difference would be rounding.
    let stopped = select(1.0 - exp(-path), path - 0.5 * path * path, path < vec3f(1e-3));
    let depth = cosine / sigma * stopped * exp(-before / cosine);
    let step = texels_of(surface, along) / size;
    var light = vec3f(0.0);
    if dot(surface.n, surface.w_o) > 0.0 { // the viewer sees no other texels
        let red = walk(uv, step * depth.r);
        if all(abs(depth.rg - depth.gb) * length(step * size) < vec2f(0.05)) {
            light = light_at(red, place);
        } else {
            let green = light_at(walk(uv, step * depth.g), place).g;
            light = vec3f(light_at(red, place).r, green, light_at(walk(uv, step * depth.b), place).b);
        }
    }
    return Texel(vec4f(textureLoad(reflected, texel, 0).rgb + light, 1.0));
}
