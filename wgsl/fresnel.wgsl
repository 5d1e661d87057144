// Reflection at a smooth dielectric boundary.

import package::units::{Number};

// Fresnel reflectance of unpolarised light from outside. `cos_i` is the cosine of the angle of incidence, `eta` the
// refractive index inside over that outside.
fn fresnel_dielectric(cos_i: Number, eta: Number) -> Number {
    let c = clamp(cos_i, 0.0, 1.0);
    let cos_t = sqrt(max(1.0 - (1.0 - c * c) / (eta * eta), 0.0));
    let perpendicular = (c - eta * cos_t) / (c + eta * cos_t);
    let parallel = (eta * c - cos_t) / (eta * c + cos_t);
    return 0.5 * (perpendicular * perpendicular + parallel * parallel);
}
