// Random numbers by hashing: the same for the same key, whoever asks and in whichever order.

import package::units::{Number};

// Four random words for a key of four (Jarzynski and Olano 2020, "Hash functions for GPU rendering": pcg4d).
fn random_words(key: vec4u) -> vec4u {
    var v = key * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Four random numbers above 0, up to 1.
fn random_numbers(key: vec4u) -> vec4f {
    return (vec4f(random_words(key)) + 0.5) * 2.3283064365386963e-10; // 2^-32
}
