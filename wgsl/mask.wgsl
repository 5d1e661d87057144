// Masks: depth buffers in which texels of a map that have no value are in front of all that passes over the map draw, so
// that the depth test spares them. On CPUs a branch would not: it costs all lanes what one of them takes. Each pass draws
// nearer than the last one (Harris & Buck 2005, GPU Gems 2, 34.2.3; Jimenez & Gutierrez 2008, section 3).

const BEHIND: f32 = 0.999; // all that passes draw; a depth of 1 would fail against a cleared buffer

// More than 0 where a filter about `home`, or one about a place that it reads, meets a texel with a value.
fn covered_around(source: texture_2d<f32>, linear_clamp: sampler, home: vec2f, texel: vec2f) -> f32 {
    return textureSampleLevel(source, linear_clamp, home - texel, 0.0).a
        + textureSampleLevel(source, linear_clamp, home + vec2f(texel.x, -texel.y), 0.0).a
        + textureSampleLevel(source, linear_clamp, home + vec2f(-texel.x, texel.y), 0.0).a
        + textureSampleLevel(source, linear_clamp, home + texel, 0.0).a;
}
