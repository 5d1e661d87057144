// Light that has crossed an object, by the direction that it comes from and the local thickness (Barré-Brisebois &
// Bouchard 2011, "Code").

import package::units::{Number, Direction};

struct Transport {
    distortion: Number, // fLTDistortion: how far the normal turns the light that is seen
    power: Number,      // iLTPower
    scale: Number,      // fLTScale
    ambient: Number,    // fLTAmbient
}

// fLTDot + fLTAmbient: what of a light in direction w_i leaves towards w_o, but for thickness and attenuation.
fn let_out(transport: Transport, w_i: Direction, n: Direction, w_o: Direction) -> Number {
    let light = w_i + n * transport.distortion; // longer than 1, so that the product may exceed 1 before it saturates
    return pow(saturate(dot(w_o, -light)), transport.power) * transport.scale + transport.ambient;
}

// The same of an environment, all of which that reaches the far side counts as if it came from straight behind.
fn let_out_environment(transport: Transport) -> Number {
    return transport.scale + transport.ambient;
}
