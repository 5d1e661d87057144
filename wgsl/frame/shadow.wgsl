// A shadow map: the depth of an object as seen from a light.

import package::mesh::{Vertex};

struct Params {
    object_to_clip: mat4x4f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;

@vertex
fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return params.object_to_clip * vec4f(vertices[i].position, 1.0);
}
