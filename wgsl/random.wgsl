// Random numbers by hashing: the number for a key does not depend on which invocation computes it, or when.

import package::units::{Number};

// Four random words from a key of four words (Jarzynski & Olano 2020, "Hash functions for GPU rendering": pcg4d).
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

// Random numbers greater than 0 and at most 1, from random words. They do not depend on the last bits of a word.
fn random_numbers(words: vec4u) -> vec4f {
    return (vec4f(words) + 0.5) * 2.3283064365386963e-10; // 2^-32
}
