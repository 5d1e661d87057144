// Atlases as texture-space passes see them. Baked per mesh and map size (wgsss/bake/charts.py).

const INSIDE: u32 = 0x80000000u; // of a texel id: inside a chart, whose number the other bits hold; without it a seam + 1

// The affine map that unfolds the neighbour across a chart's border: a point just outside the chart goes to the point of
// the neighbouring chart that lies there on the surface. At an open border, to its own mirror image.
struct Seam {
    to_u: vec3f, // u' = dot(to_u, (u, v, 1))
    to_v: vec3f,
    chart: u32,   // that it leads out of
}

fn across(seam: Seam, uv: vec2f) -> vec2f {
    let p = vec3f(uv, 1.0);
    return vec2f(dot(seam.to_u, p), dot(seam.to_v, p));
}

fn id_at(ids: texture_2d<u32>, uv: vec2f) -> u32 {
    let size = vec2f(textureDimensions(ids));
    return textureLoad(ids, vec2u(clamp(uv * size, vec2f(0.0), size - 1.0)), 0).r;
}

// A place across a seam may lie in the rim of its chart, where no texel's centre is covered: the nearest one that is.
fn settled(ids: texture_2d<u32>, uv: vec2f) -> vec2f {
    if (id_at(ids, uv) & INSIDE) != 0u {
        return uv;
    }
    let size = vec2f(textureDimensions(ids));
    let corner = floor(uv * size - 0.5) + 0.5;
    var best = uv;
    var nearest = 9.0;
    for (var i = 0u; i < 4u; i++) {
        let texel = corner + vec2f(f32(i & 1u), f32(i >> 1u));
        let d = distance(texel, uv * size);
        if d < nearest && (id_at(ids, texel / size) & INSIDE) != 0u {
            nearest = d;
            best = texel / size;
        }
    }
    return best;
}
