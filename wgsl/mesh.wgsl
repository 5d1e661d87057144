// Vertices and objects as the shaders see them, and the textures that vary a material over a surface.

import package::units::{Number, Position, Direction};

struct Vertex {
    position: vec3f, // mm, object space
    u: Number,       // with v: texture coordinates of the mesh, for the material's textures
    normal: vec3f,
    v: Number,
    atlas: vec2f,    // unique texture coordinates, for texture-space passes
    welded: u32,     // vertex of the mesh, of which there may be several render vertices
    sky: Number,     // share of the environment's irradiance that the scene does not block
}

// Properties of an object that all its points share.
struct ObjectUniforms {
    object_to_world: mat4x4f, // a rigid motion
    base_color: vec3f,        // linear; multiplies the texture
    color_after: Number,      // share of the base colour applied after diffusion (Mikkelsen 2009, 3.5)
    specular: Number,         // scale of the specular lobe; multiplies the texture
    id: u32,                  // 1 and up; 0 is the background
    wrap: vec2u,              // how its textures continue beyond 0..1 along u and v: REPEAT, CLAMP or MIRROR
    nearest: u32,             // 1: its textures are not interpolated between texels
    normal_scale: Number,     // factor of the normal map's slopes
}

const REPEAT: u32 = 0u;
const CLAMP: u32 = 1u;
const MIRROR: u32 = 2u;

// The coordinates at which a sampler that repeats and interpolates reads the texture's value at uv. `size` is that of
// the texture, in texels.
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
        let half_texel = 0.5 / texels[axis]; // closer to the border, the sampler would mix in the other side
        at[axis] = clamp(at[axis], half_texel, 1.0 - half_texel);
    }
    if object.nearest == 1u {
        at = (floor(at * texels) + 0.5) / texels;
    }
    return at;
}

// The normal n perturbed by a tangent-space normal map. The tangents are derived from the screen-space derivatives of
// position and texture coordinates (Mikkelsen 2010), so that this works in fragment shaders only. `texel` is the map's
// value in 0..1; `slopes` scales its x and y.
fn bent_normal(n: Direction, x: Position, uv: vec2f, texel: vec3f, slopes: Number) -> Direction {
    let dx = dpdx(x);
    let dy = dpdy(x);
    let duvdx = dpdx(uv);
    let duvdy = dpdy(uv);
    let t_u = cross(dy, n) * duvdx.x + cross(n, dx) * duvdy.x;
    let t_v = cross(dy, n) * duvdx.y + cross(n, dx) * duvdy.y;
    let turned = select(-1.0, 1.0, dot(cross(dx, dy), n) > 0.0); // -1 where the surface is seen from inside
    let scale = turned * inverseSqrt(max(max(dot(t_u, t_u), dot(t_v, t_v)), 1e-30));
    var m = (texel * 255.0 - 128.0) / 127.0; // a byte of 128 means 0; green points up, v down
    m = vec3f(m.xy * slopes, m.z);
    return normalize(t_u * (scale * m.x) - t_v * (scale * m.y) + n * max(m.z, 1e-3));
}

// The share of the base colour applied before diffusion, col(x_i)^(1-a) (Mikkelsen 2009, 3.5). `texel` is the texture's
// value, times the colour of the vertices.
fn color_before(object: ObjectUniforms, texel: vec3f) -> vec3f {
    return pow(max(object.base_color * texel, vec3f(1e-6)), vec3f(1.0 - object.color_after));
}

// The share of the base colour applied after diffusion, col(x_o)^a.
fn color_after(object: ObjectUniforms, texel: vec3f) -> vec3f {
    return pow(max(object.base_color * texel, vec3f(1e-6)), vec3f(object.color_after));
}
