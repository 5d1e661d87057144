// Point sets, and textures over all directions.

import package::units::{Number, Direction, PI};

// Point i of n of the Hammersley set in the unit square.
fn hammersley(i: u32, n: u32) -> vec2f {
    return vec2f((f32(i) + 0.5) / f32(n), f32(reverseBits(i)) * 2.3283064365386963e-10); // 2^-32
}

// The direction at a point of a latitude-longitude map: v = 0 is +y, u = 1/2 is -z, and u grows towards +x.
fn direction_of_lat_long(uv: vec2f) -> Direction {
    let theta = PI * uv.y;
    let phi = 2.0 * PI * (uv.x - 0.5);
    return vec3f(sin(theta) * sin(phi), cos(theta), -sin(theta) * cos(phi));
}

// The inverse of direction_of_lat_long.
fn lat_long_of_direction(d: Direction) -> vec2f {
    return vec2f(0.5 + atan2(d.x, -d.z) / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
}

// The direction of a texel of a smooth function of direction. This is a latitude-longitude map whose first and last
// rows lie at the poles, so that interpolation includes the values there.
fn direction_of_map(texel: vec2u, size: vec2u) -> Direction {
    let row = f32(texel.y) + select(0.0, 0.5, size.y == 1u);
    return direction_of_lat_long(vec2f((f32(texel.x) + 0.5) / f32(size.x), row / f32(max(size.y - 1u, 1u))));
}

// The texture coordinates of a direction in such a map.
fn map_of_direction(d: Direction, size: vec2u) -> vec2f {
    let uv = lat_long_of_direction(d);
    return vec2f(uv.x, (uv.y * f32(size.y - 1u) + 0.5) / f32(size.y));
}

// An orthonormal frame whose last column is n (Duff et al. 2017).
fn frame_about(n: Direction) -> mat3x3f {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat3x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y), n);
}
