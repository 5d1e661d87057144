// Phase functions, 1/sr. `cosine` is that of the angle by which light turns.

import package::units::{Number, PI};

override SCHLICK: bool = false;

// Henyey & Greenstein 1941.
fn henyey_greenstein(cosine: Number, g: Number) -> Number {
    let d = max(1.0 + g * g - 2.0 * g * cosine, 1e-9);
    return (1.0 - g * g) / (4.0 * PI * d * sqrt(d));
}

// Norberg 2010, eq. 3, with the parameter by which Schlick approximates Henyey and Greenstein (Blasi et al. 1993).
fn schlick(cosine: Number, g: Number) -> Number {
    let k = 1.55 * g - 0.55 * g * g * g;
    let d = 1.0 - k * cosine;
    return (1.0 - k * k) / (4.0 * PI * d * d);
}

fn phase(cosine: Number, g: Number) -> Number {
    if SCHLICK {
        return schlick(cosine, g);
    }
    return henyey_greenstein(cosine, g);
}
