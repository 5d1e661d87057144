// Light that has crossed an object, by the direction that it comes from and the local thickness (Barré-Brisebois &
// Bouchard 2011, "Code").

import package::units::{Number, Position, Direction, Irradiance};
import package::light::{incident};
import package::lights::{lights, environment_irradiance};

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

// The light of all lights and the environment that leaves x towards w_o, but for albedo and thickness.
fn light_out(transport: Transport, x: Position, n: Direction, w_o: Direction) -> Irradiance {
    var total = let_out_environment(transport) * environment_irradiance(-n, 1.0);
    for (var i = 0u; i < arrayLength(&lights); i++) {
        let at = incident(lights[i], x);
        total += at.irradiance * let_out(transport, at.direction, n, w_o);
    }
    return total;
}
