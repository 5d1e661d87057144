// Two tangents for a normal (Duff et al. 2017, "Building an orthonormal basis, revisited").

import package::units::{Direction};

struct Tangents {
    first: Direction,
    second: Direction,
}

fn tangents_of(n: Direction) -> Tangents {
    let side = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    return Tangents(vec3f(1.0 + side * n.x * n.x * a, side * b, -side * n.x), vec3f(b, side + n.y * n.y * a, -n.y));
}
