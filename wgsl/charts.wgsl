// Atlases as texture-space passes see them. Baked per mesh and map size (wgsss/bake/charts.py).

const INSIDE: u32 = 0x80000000u; // of a texel id: inside a chart, whose number the other bits hold; without it a seam + 1

// The affine map that unfolds the neighbour across a chart's border: a point just outside the chart goes to the point of
// the neighbouring chart that lies there on the surface. At an open border, to its own mirror image.
struct Seam {
    to_u: vec3f, // u' = dot(to_u, (u, v, 1))
    to_v: vec3f,
}

fn across(seam: Seam, uv: vec2f) -> vec2f {
    let p = vec3f(uv, 1.0);
    return vec2f(dot(seam.to_u, p), dot(seam.to_v, p));
}
