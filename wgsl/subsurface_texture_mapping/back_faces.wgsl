// The depth of the nearest face of an object that is seen from inside: where the viewing rays leave the body.

import package::mesh::{Vertex};
import package::targets::{R32Float};

struct Params {
    object_to_clip: mat4x4f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;

struct Pixel {
    @location(0) seen: R32Float, // 1
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return params.object_to_clip * vec4f(vertices[i].position, 1.0);
}

@fragment
fn fs(@builtin(position) place: vec4f, @builtin(front_facing) front: bool) -> Pixel {
    if front {
        discard;
    }
    return Pixel(1.0);
}
