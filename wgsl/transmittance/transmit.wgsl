// The light that each emitter sends through one object to its pixels, by the thickness according to the shadow maps
// (Jimenez et al. 2010, Real-Time Realistic Skin Translucency).

import package::units::{Length, Number, Position, Direction, Irradiance};
import package::light::{Light, Incident, incident, layer_towards};
import package::lights::{lights, views, shadow_maps, rho_dt_table};
import package::rho_dt::{rho_dt};
import package::per_object::{is_other_object, position_at, normal_at, specular_at};
import package::profile_table::{root_entry};
import package::targets::{RGBA32Float};

struct Params {
    shrink: Length,   // distance by which x_o is moved below the surface where light grazes it
    reach: Length,    // thickness at the end of the table: no light passes through more
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> through: array<vec3f>; // T / total reflectance (profile_table.wgsl: root_entry)

struct Pixel {
    @location(0) arriving: RGBA32Float, // W/m^2
}

// The back is taken to have the normal -n. It receives light until that normal is this far beyond a right angle to the
// light, since real backs are not parallel to the front (Jimenez et al. 2010).
const WRAP: Number = 0.3;

// x_o is moved by this many shadow texels per unit of sine in addition to `shrink`. A lookup reaches 1.5 texels to each
// side: closer to the surface, x_o would lie outside of the object in some of them.
const SHRINK_TEXELS: Number = 2.0;

fn transmittance(d: Length) -> vec3f {
    let last = arrayLength(&through) - 1u;
    let s = root_entry(d, params.reach, last);
    let i = min(u32(s), last - 1u);
    return mix(through[i], through[i + 1u], s - f32(i));
}

// Weights of three texels by a quadratic B-spline centred `f` texels, -1/2 to 1/2, after the middle of the second.
fn spline(f: f32) -> vec3f {
    let a = 0.5 - f;
    let b = 0.5 + f;
    return vec3f(0.5 * a * a, 0.75 - f * f, 0.5 * b * b);
}

// The distance along the light's rays from where they first hit the scene to x_o; 0 where they hit nothing. It is a
// weighted mean over the rays around x_o, by weights that reproduce planes exactly.
fn thickness(light: Light, at: Incident, x_o: Position, n: Direction) -> Length {
    let first = views[light.first_view];
    let perspective = first.perspective != 0u;
    let texel = first.texel * select(1.0, at.distance, perspective);
    let cosine = dot(n, at.direction);
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let below = SHRINK_TEXELS * texel * sine;
    let grazing = params.shrink * sine * sine;
    let x = x_o - n * (below + grazing);
    // The part of the distance that moving x_o has cut off is added again: all of it for the shift by texels, so that
    // the thickness does not depend on the size of the map.
    let cut_off = below / max(-cosine, WRAP) - grazing * cosine;
    let layer = layer_towards(light, x - light.position);
    let to_clip = views[layer].world_to_clip;
    let clip = to_clip * vec4f(x, 1.0);
    // Along a ray, depth is linear in distance in a parallel view. In a perspective view it is p + q / w, with w
    // linear.
    let z_row = vec3f(to_clip[0].z, to_clip[1].z, to_clip[2].z);
    let w_row = vec3f(to_clip[0].w, to_clip[1].w, to_clip[2].w);
    let p = dot(z_row, w_row);
    let q = to_clip[3].z - p * to_clip[3].w;
    let here = clip.z / clip.w;
    let per_depth = 1.0 / length(z_row);
    let distance = length(x - light.position);
    let size = vec2f(textureDimensions(shadow_maps));
    let place = (vec2f(0.5, -0.5) * clip.xy / clip.w + 0.5) * size;
    let middle = floor(place);
    let across = spline(place.x - middle.x - 0.5);
    let along = spline(place.y - middle.y - 0.5);
    var total = 0.0;
    for (var j = 0; j < 3; j++) {
        for (var i = 0; i < 3; i++) {
            let there = clamp(vec2i(middle) + vec2i(i - 1, j - 1), vec2i(0), vec2i(size) - 1);
            let hit = textureLoad(shadow_maps, there, layer, 0);
            let parallel = (here - hit) * per_depth;
            let distance_inside = select(parallel, distance * (1.0 - q / ((hit - p) * clip.w)), perspective);
            total += across[i] * along[j] * clamp(distance_inside + cut_off, 0.0, params.reach);
        }
    }
    return total;
}

@fragment
fn fs(@builtin(position) pixel: vec4f) -> Pixel {
    let texel = vec2u(pixel.xy);
    if is_other_object(texel) {
        discard;
    }
    let x = position_at(texel);
    let n = normal_at(texel);
    var total = vec3f(0.0);
    for (var i = 0u; i < arrayLength(&lights); i++) {
        let light = lights[i];
        let at = incident(light, x);
        let cosine = max(WRAP - dot(n, at.direction), 0.0);
        if light.views == 0u || cosine == 0.0 {
            continue;
        }
        let entering = at.irradiance * (cosine * rho_dt(rho_dt_table, cosine, specular_at(texel)));
        total += entering * transmittance(thickness(light, at, x, n));
    }
    return Pixel(vec4f(total, 1.0));
}
