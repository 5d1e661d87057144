// Write the thickness of one object into a target of a g-buffer with 8 bits per channel (packing.wgsl).

import package::mesh::{Vertex, ObjectUniforms};
import package::screen::{is_hidden};
import package::local_thickness::packing::{pack_grey, pack_coloured};
import package::targets::{RGBA8Unorm};

override COLOURED: bool = true;
override BITS: u32 = 0u; // of each channel of the colour that hold `which`

struct Params {
    world_to_clip: mat4x4f,
    which: u32, // number of the material's parameters
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> thickness: array<vec4f>; // by vertex of the mesh
@group(0) @binding(4) var depth: texture_depth_2d;

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) thickness: vec3f,
}

struct Pixel {
    @location(0) stored: RGBA8Unorm,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let x = object.object_to_world * vec4f(vertex.position, 1.0);
    return Varying(params.world_to_clip * x, thickness[vertex.welded].rgb);
}

@fragment
fn fs(in: Varying) -> Pixel {
    if is_hidden(in.clip, depth) {
        discard;
    }
    if COLOURED {
        return Pixel(pack_coloured(in.thickness, params.which, BITS));
    }
    return Pixel(pack_grey(in.thickness.g, params.which, BITS));
}
