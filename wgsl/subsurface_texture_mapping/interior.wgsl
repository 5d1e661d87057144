// Directions of light inside the body.

import package::units::{Number, Direction};

// The direction inside, away from the surface and towards the light, of light from the direction w (Snell). Where w is
// below the horizon, the light enters elsewhere, at a point that faces it more: the direction tends to w itself.
fn refracted(w: Direction, n: Direction, eta: Number) -> Direction {
    let cosine = dot(w, n);
    var along = w - n * cosine;
    if cosine <= 0.0 {
        along = along / max(length(along), 1e-6);
    }
    along = along / eta;
    let inside = along + n * sqrt(max(1.0 - dot(along, along), 0.0));
    // No branch on eta: for branches on uniforms, lavapipe compiles a shader for each draw.
    return select(normalize(mix(inside, w, smoothstep(0.0, 0.7, -cosine))), w, eta == 1.0);
}

// The cosine inside of light at a cosine outside.
fn refracted_cosine(cosine: Number, eta: Number) -> Number {
    return sqrt(max(1.0 - (1.0 - cosine * cosine) / (eta * eta), 0.0));
}
