// Smooth lookups in maps over an atlas.

// The value of a map by the cubic B-spline, as four bilinear lookups. With bilinear interpolation alone, a Gaussian
// about as narrow as a texel would be wrong by a few per cent between the texels. The spline blurs, but equally
// everywhere, and texture_space/blur.wgsl subtracts its variance. Texels without a value do not count.
fn smooth_sample(map: texture_2d<f32>, linear_clamp: sampler, uv: vec2f) -> vec3f {
    let size = vec2f(textureDimensions(map));
    let p = uv * size - 0.5;
    let f = fract(p);
    let g = 1.0 - f;
    let w0 = g * g * g / 6.0;
    let w1 = (4.0 - 6.0 * f * f + 3.0 * f * f * f) / 6.0;
    let w3 = f * f * f / 6.0;
    let low = w0 + w1; // of the two texels on the lower side
    let a = (floor(p) - 0.5 + w1 / low) / size;
    let b = (floor(p) + 1.5 + w3 / (1.0 - low)) / size;
    let upper = mix(textureSampleLevel(map, linear_clamp, b, 0.0),
                    textureSampleLevel(map, linear_clamp, vec2f(a.x, b.y), 0.0), low.x);
    let lower = mix(textureSampleLevel(map, linear_clamp, vec2f(b.x, a.y), 0.0),
                    textureSampleLevel(map, linear_clamp, a, 0.0), low.x);
    let mean = mix(upper, lower, low.y);
    return mean.rgb / max(mean.a, 1e-4);
}
