// The first point that a light's rays hit, by its shadow map.

import package::units::{Length, Number, Position, Direction};
import package::light::{Light, ShadowView, Incident, layer_towards};
import package::lights::{shadow_maps, views};

const TOLERANCE: Number = 0.3; // texels
const BENT: Number = 4.0;      // texels by which four depths on one surface may be off a plane
const STEEPEST: Number = 20.0; // slope of a surface that is seen as one

struct FirstHit {
    ahead: Length,  // how far the first hit lies from x towards the light; below 0 behind x
    cosine: Number, // of the angle between the surface there and the light
    known: bool,    // whether the light's rays hit anything
}

// The depths of the four texels about x are interpolated as distances along the ray, which is exact on planes.
fn first_hit(light: Light, at: Incident, x: Position) -> FirstHit {
    if light.views == 0u {
        return FirstHit(0.0, 1.0, false);
    }
    let layer = layer_towards(light, -at.direction);
    let view = views[layer];
    let clip = view.world_to_clip * vec4f(x, 1.0);
    let towards = view.world_to_clip * vec4f(at.direction, 0.0);
    let size = vec2f(textureDimensions(shadow_maps));
    let place = (vec2f(0.5, -0.5) * clip.xy / clip.w + 0.5) * size - 0.5;
    let corner = vec2i(floor(place));
    let part = fract(place);
    var hits: array<f32, 4>;
    var total = 0.0;
    var sum = 0.0;
    var nearest = 0.0;
    var greatest = 0.0;
    for (var i = 0; i < 4; i++) {
        let step = vec2i(i & 1, i >> 1u);
        let texel = clamp(corner + step, vec2i(0), vec2i(size) - 1);
        let d = textureLoad(shadow_maps, texel, layer, 0);
        hits[i] = (d * clip.w - clip.z) / (towards.z - d * towards.w);
        let sides = select(1.0 - part, part, step == vec2i(1));
        let weight = select(0.0, sides.x * sides.y, d < 1.0);
        if weight > greatest {
            greatest = weight;
            nearest = hits[i];
        }
        sum += weight * hits[i];
        total += weight;
    }
    let texel = view.texel * select(1.0, at.distance, view.perspective != 0u);
    let slope = 0.5 * vec2f(hits[1] - hits[0] + hits[3] - hits[2], hits[2] - hits[0] + hits[3] - hits[1]) / texel;
    let steepness = length(slope);
    let bent = abs(hits[0] - hits[1] - hits[2] + hits[3]);
    var ahead = sum / max(total, 1e-6);
    if bent > BENT * texel || steepness > STEEPEST {
        ahead = nearest; // at an outline, where the mean would lie between two surfaces
    }
    // Within the accuracy of the map, x is the first hit.
    let off = max(abs(ahead) - TOLERANCE * texel * (1.0 + min(steepness, STEEPEST)), 0.0);
    return FirstHit(sign(ahead) * off, inverseSqrt(1.0 + steepness * steepness), total > 1e-3);
}
