// Masks: depth buffers that make passes over a map skip the texels without a value. These texels have depth 0, so that
// the depth test rejects all that is drawn there. On CPUs a branch would save nothing, since all lanes of a vector take
// as long as the slowest. Each pass draws at a smaller depth than the last one (Harris & Buck 2005, GPU Gems 2, 34.2.3;
// Jimenez & Gutierrez 2008, section 3).

const BEHIND: f32 = 0.999; // depth of the other texels, behind all that passes draw; 1 would fail against a cleared buffer

// More than 0 if a filter of one texel around `home`, or around a texel that such a filter reads, reads a value.
fn covered_around(source: texture_2d<f32>, linear_clamp: sampler, home: vec2f, texel: vec2f) -> f32 {
    return textureSampleLevel(source, linear_clamp, home - texel, 0.0).a
        + textureSampleLevel(source, linear_clamp, home + vec2f(texel.x, -texel.y), 0.0).a
        + textureSampleLevel(source, linear_clamp, home + vec2f(-texel.x, texel.y), 0.0).a
        + textureSampleLevel(source, linear_clamp, home + texel, 0.0).a;
}
