// The specular lobe: microfacets with the GGX distribution (Walter et al. 2007) and Smith's height-correlated shadowing
// (Heitz 2014). `alpha` is the squared roughness; cosines are those of angles from the shading normal.

import package::units::{Number, Direction, PI};
import package::fresnel::{fresnel_dielectric};

// Density of microfacet normals, 1/sr.
fn ggx_distribution(cos_h: Number, alpha: Number) -> Number {
    let a2 = alpha * alpha;
    let d = cos_h * cos_h * (a2 - 1.0) + 1.0;
    return a2 / (PI * d * d);
}

// Smith's masking of one direction, G1.
fn ggx_masking(cos_o: Number, alpha: Number) -> Number {
    let a2 = alpha * alpha;
    return 2.0 * cos_o / (cos_o + sqrt(a2 + (1.0 - a2) * cos_o * cos_o));
}

// G2 / (4 cos_i cos_o), Smith's height-correlated form.
fn ggx_visibility(cos_i: Number, cos_o: Number, alpha: Number) -> Number {
    let a2 = alpha * alpha;
    let i = cos_o * sqrt(a2 + (1.0 - a2) * cos_i * cos_i);
    let o = cos_i * sqrt(a2 + (1.0 - a2) * cos_o * cos_o);
    return 0.5 / max(i + o, 1e-7);
}

// The specular BRDF f_r, 1/sr.
fn ggx_brdf(n: Direction, w_i: Direction, w_o: Direction, alpha: Number, eta: Number) -> Number {
    let cos_i = dot(n, w_i);
    let cos_o = dot(n, w_o);
    if cos_i <= 0.0 || cos_o <= 0.0 {
        return 0.0;
    }
    let h = normalize(w_i + w_o);
    let f = fresnel_dielectric(dot(w_o, h), eta);
    return f * ggx_distribution(dot(n, h), alpha) * ggx_visibility(cos_i, cos_o, alpha);
}

// A random microfacet normal among those visible from w_o (Heitz 2018), in the frame whose z axis is the shading
// normal.
fn ggx_sample_visible(w_o: Direction, alpha: Number, u: vec2f) -> Direction {
    let v = normalize(vec3f(alpha * w_o.xy, w_o.z));
    let length2 = dot(v.xy, v.xy);
    let t1 = select(vec3f(1.0, 0.0, 0.0), vec3f(-v.y, v.x, 0.0) * inverseSqrt(max(length2, 1e-20)), length2 > 0.0);
    let t2 = cross(v, t1);
    let r = sqrt(u.x);
    let phi = 2.0 * PI * u.y;
    let p1 = r * cos(phi);
    let s = 0.5 * (1.0 + v.z);
    let p2 = (1.0 - s) * sqrt(max(1.0 - p1 * p1, 0.0)) + s * r * sin(phi);
    let h = p1 * t1 + p2 * t2 + sqrt(max(1.0 - p1 * p1 - p2 * p2, 0.0)) * v;
    return normalize(vec3f(alpha * h.xy, max(h.z, 1e-6)));
}
