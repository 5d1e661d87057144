// The light that leaves an object after crossing it, by its direction (Barré-Brisebois & Bouchard 2011, "Code").

import package::units::{Number, Position, Direction, Irradiance};
import package::light::{incident};
import package::lights::{lights, environment_irradiance};

struct Transport {
    distortion: Number, // fLTDistortion: how much the normal bends the light
    power: Number,      // iLTPower
    scale: Number,      // fLTScale
    ambient: Number,    // fLTAmbient
}

// fLTDot + fLTAmbient: the share of the light from w_i that leaves towards w_o, without thickness and attenuation.
fn let_out(transport: Transport, w_i: Direction, n: Direction, w_o: Direction) -> Number {
    let light = w_i + n * transport.distortion; // may be longer than 1: the product below saturates
    return pow(saturate(dot(w_o, -light)), transport.power) * transport.scale + transport.ambient;
}

// The same for the environment: all its light on the far side counts as if it came from straight behind.
fn let_out_environment(transport: Transport) -> Number {
    return transport.scale + transport.ambient;
}

// The light of all lights and the environment that leaves x towards w_o, without albedo and thickness.
fn light_out(transport: Transport, x: Position, n: Direction, w_o: Direction) -> Irradiance {
    var total = let_out_environment(transport) * environment_irradiance(-n, 1.0);
    for (var i = 0u; i < arrayLength(&lights); i++) {
        let at = incident(lights[i], x);
        total += at.irradiance * let_out(transport, at.direction, n, w_o);
    }
    return total;
}
