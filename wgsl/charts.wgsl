// The charts of an atlas, for passes in texture space. wgsss/bake/charts.py bakes them for each mesh and map size.
//
// Each texel has an id: INSIDE plus the number of the chart that covers its centre; in the gutter around a chart the
// number of a seam + 1; elsewhere 0.

const INSIDE: u32 = 0x80000000u;

// A border edge of a chart and the affine map that leads across it: from a point just outside the chart to the point of
// the neighbouring chart at the same place of the surface. At an open border it leads back into the chart, to the
// mirror image.
struct Seam {
    to_u: vec3f, // u' = dot(to_u, (u, v, 1))
    to_v: vec3f,
    chart: u32,   // id inside the chart that the edge belongs to
}

// The point on the other side of a seam.
fn across(seam: Seam, uv: vec2f) -> vec2f {
    let p = vec3f(uv, 1.0);
    return vec2f(dot(seam.to_u, p), dot(seam.to_v, p));
}

fn id_at(ids: texture_2d<u32>, uv: vec2f) -> u32 {
    let size = vec2f(textureDimensions(ids));
    return textureLoad(ids, vec2u(clamp(uv * size, vec2f(0.0), size - 1.0)), 0).r;
}

// uv, or the nearest centre of a texel inside a chart if the texel at uv is not: close to a chart's border, a point
// across a seam may lie in a texel whose centre the chart does not cover.
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
