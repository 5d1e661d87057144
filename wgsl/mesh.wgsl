// Meshes as the shaders see them, and the maps that vary a material over a surface.

import package::units::{Number, Position, Direction};

struct Vertex {
    position: vec3f, // mm, object space
    u: Number,       // the mesh's own texture coordinates, for its maps
    normal: vec3f,
    v: Number,
    atlas: vec2f,    // unique texture coordinates, for texture-space passes
    welded: u32,     // the vertex of the welded topology
    sky: Number,     // share of the environment's irradiance that the scene lets through
}

// What is the same over an object in all passes of a frame.
struct ObjectUniforms {
    object_to_world: mat4x4f, // rigid
    base_color: vec3f,        // linear; multiplies the map
    color_after: Number,      // share of the base colour applied after diffusion (Mikkelsen 2009, 3.5)
    specular: Number,         // scale of the specular lobe; multiplies the map
    id: u32,                  // 1 and up; 0 is the background
    wrap: vec2u,              // what its maps show beyond 0..1 along u and v: REPEAT, CLAMP or MIRROR
    nearest: u32,             // 1 where its maps are not interpolated between texels
    normal_scale: Number,     // of the normal map's slopes
}

const REPEAT: u32 = 0u;
const CLAMP: u32 = 1u;
const MIRROR: u32 = 2u;

// Where to sample a map of `size` texels for texture coordinates uv, with a sampler that repeats and interpolates.
fn map_coordinates(object: ObjectUniforms, uv: vec2f, size: vec2u) -> vec2f {
    var at = uv;
    let texels = vec2f(size);
    for (var axis = 0u; axis < 2u; axis++) {
        if object.wrap[axis] == REPEAT {
            continue;
        }
        if object.wrap[axis] == MIRROR {
            let folded = at[axis] - 2.0 * floor(at[axis] / 2.0);
            at[axis] = min(folded, 2.0 - folded);
        }
        let half_texel = 0.5 / texels[axis]; // closer to the border, the other side would be mixed in
        at[axis] = clamp(at[axis], half_texel, 1.0 - half_texel);
    }
    if object.nearest == 1u {
        at = (floor(at * texels) + 0.5) / texels;
    }
    return at;
}

// The normal bent by a tangent-space normal map, without stored tangents: the frame follows from the derivatives of
// position and texture coordinates (Mikkelsen 2010). `texel` is the map's sample in 0..1; `slopes` scales its x and y.
// Fragment stage only.
fn bent_normal(n: Direction, x: Position, uv: vec2f, texel: vec3f, slopes: Number) -> Direction {
    let dx = dpdx(x);
    let dy = dpdy(x);
    let duvdx = dpdx(uv);
    let duvdy = dpdy(uv);
    let t_u = cross(dy, n) * duvdx.x + cross(n, dx) * duvdy.x;
    let t_v = cross(dy, n) * duvdx.y + cross(n, dx) * duvdy.y;
    let turned = select(-1.0, 1.0, dot(cross(dx, dy), n) > 0.0); // whether x and y run as they do on the outside
    let scale = turned * inverseSqrt(max(max(dot(t_u, t_u), dot(t_v, t_v)), 1e-30));
    var m = (texel * 255.0 - 128.0) / 127.0; // a byte of 128 is no slope; green points up, v down
    m = vec3f(m.xy * slopes, m.z);
    return normalize(t_u * (scale * m.x) - t_v * (scale * m.y) + n * max(m.z, 1e-3));
}

// The base colour's share before diffusion, col(x_i)^(1-a) (Mikkelsen 2009, 3.5). `texel` is the map's sample.
fn color_before(object: ObjectUniforms, texel: vec3f) -> vec3f {
    return pow(max(object.base_color * texel, vec3f(1e-6)), vec3f(1.0 - object.color_after));
}

// The base colour's share after diffusion, col(x_o)^a.
fn color_after(object: ObjectUniforms, texel: vec3f) -> vec3f {
    return pow(max(object.base_color * texel, vec3f(1e-6)), vec3f(object.color_after));
}
