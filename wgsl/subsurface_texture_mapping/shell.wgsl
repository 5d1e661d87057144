// The surface about a point P, as a quadric: depths below it, and distances from points below it along a ray. For a
// sphere and a cylinder all of these are exact; without curvature the quadric is the tangent plane (Norberg 2010,
// 2.1.3).
//
// Points and directions have three coordinates: along the two principal directions at P, and downwards along -n.

import package::units::{Length, Number};

struct Shell {
    k: vec3f,  // curvature along the principal directions, and the greater of them for the depth; 1/mm
    uv: vec2f, // texture coordinates at P
    du: vec2f, // gradient of u along the principal directions, 1/mm
    dv: vec2f, // gradient of v
}

// The eigenvector for the first of two eigenvalues of the matrix (a b; b d), as a rotation: cosine and sine.
fn principal_rotation(a: Number, b: Number, d: Number) -> vec2f {
    let angle = 0.5 * atan2(2.0 * b, a - d);
    return select(vec2f(cos(angle), sin(angle)), vec2f(1.0, 0.0), abs(b) + abs(a - d) < 1e-12);
}

// Twice the value of the quadric at m: 0 at the surface, above 0 below it.
fn quadric(shell: Shell, m: vec3f) -> Number {
    return 2.0 * m.z - dot(shell.k * m, m);
}

fn depth_below(shell: Shell, m: vec3f) -> Length {
    let a = quadric(shell, m);
    return a / (1.0 + sqrt(max(1.0 - shell.k.z * a, 0.0)));
}

// An angle's tangent x over 1 - k z as an arc length.
fn arc(k: Number, x: Length, z: Length) -> Length {
    let rest = 1.0 - k * z;
    let below = select(rest, 1e-6, abs(rest) < 1e-6);
    if abs(k * x) < 1e-4 * below {
        return x / below;
    }
    return atan2(k * x, below) / k;
}

// The texture coordinates of the point of the surface above m.
fn uv_above(shell: Shell, m: vec3f) -> vec2f {
    let foot = vec2f(arc(shell.k.x, m.x, m.z), arc(shell.k.y, m.y, m.z));
    return shell.uv + vec2f(dot(shell.du, foot), dot(shell.dv, foot));
}

// The distance from m to the surface along the direction d; below 0 where the ray does not reach it.
fn distance_along(shell: Shell, m: vec3f, d: vec3f) -> Length {
    let a = max(quadric(shell, m), 0.0);
    let b = dot(shell.k * m, d) - d.z;
    let q = dot(shell.k * d, d);
    let root = b * b + q * a;
    if root < 0.0 || (b <= 0.0 && q <= 0.0) {
        return -1.0;
    }
    if b > 0.0 {
        return a / (b + sqrt(root));
    }
    return (sqrt(root) - b) / q;
}

// The normal of the surface near m.
fn normal_near(shell: Shell, m: vec3f) -> vec3f {
    return normalize(vec3f(shell.k.xy * m.xy, shell.k.z * m.z - 1.0));
}
