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

// Random numbers above 0, up to 1, of random words. They do not tell a word's last bits.
fn random_numbers(words: vec4u) -> vec4f {
    return (vec4f(words) + 0.5) * 2.3283064365386963e-10; // 2^-32
}
