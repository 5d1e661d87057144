// M_back of each pixel, interpolated between the vertices of the triangle that it shows.

import package::mesh::{Vertex, ObjectUniforms, color_after};
import package::screen::{is_hidden};
import package::targets::{RGBA32Float};

struct Params {
    world_to_clip: mat4x4f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> object: ObjectUniforms;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>; // of the render mesh
@group(0) @binding(3) var<storage, read> vertex_M_back: array<vec4f>; // W/m^2, by vertex of the mesh
@group(0) @binding(4) var gbuffer_id: texture_2d<f32>;
@group(0) @binding(5) var base_color: texture_2d<f32>;
@group(0) @binding(6) var depth: texture_depth_2d;

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) M_back: vec3f,
}

struct Pixel {
    @location(0) M_back: RGBA32Float,
}

@vertex
fn vs(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let x = object.object_to_world * vec4f(vertex.position, 1.0);
    return Varying(params.world_to_clip * x, vertex_M_back[vertex.welded].rgb);
}

@fragment
fn fs(in: Varying) -> Pixel {
    let texel = vec2u(in.clip.xy);
    if is_hidden(in.clip, depth) || u32(textureLoad(gbuffer_id, texel, 0).z) != object.id {
        discard;
    }
    return Pixel(vec4f(in.M_back * color_after(object, textureLoad(base_color, texel, 0).rgb), 1.0));
}
