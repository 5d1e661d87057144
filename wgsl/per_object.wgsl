// Passes over the pixels of one object (`Frame.per_object`, wgsss/frame.py). This module owns the vertex shader, which
// draws a rectangle around the object, and the bindings of the object and of the g-buffer. A pass that imports it is
// given them by the frame, and binds those that it uses. Its fragment shader begins with
//
//     let texel = vec2u(pixel.xy);
//     if is_other_object(texel) {
//         discard;
//     }

import package::units::{Number, Position, Direction};
import package::mesh::{ObjectUniforms};
import package::screen::{position_of_pixel, direction_to_eye};

struct View {
    clip_to_world: mat4x4f,
    eye: vec4f,       // xyz, 1: the camera's position; xyz, 0: the direction towards it
    rectangle: vec4f, // left, bottom, right and top in clip space of a rectangle that the object is in
}

@group(1) @binding(0) var<uniform> view: View;
@group(1) @binding(1) var<uniform> object: ObjectUniforms;
@group(1) @binding(2) var gbuffer_id: texture_2d<f32>; // these four as frame/gbuffer.wgsl writes them
@group(1) @binding(3) var normal: texture_2d<f32>;
@group(1) @binding(4) var base_color: texture_2d<f32>;
@group(1) @binding(5) var depth: texture_depth_2d;

// Corner i, of six, of the two triangles that cover the rectangle.
@vertex
fn rectangle_corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    let right = i == 1u || i == 2u || i == 4u;
    let top = i == 2u || i == 4u || i == 5u;
    let r = view.rectangle;
    return vec4f(select(r.x, r.z, right), select(r.y, r.w, top), 0.0, 1.0);
}

// Whether a pixel shows another object, or none.
fn is_other_object(texel: vec2u) -> bool {
    return u32(textureLoad(gbuffer_id, texel, 0).z) != object.id;
}

// Where in the object's atlas a pixel is.
fn atlas_at(texel: vec2u) -> vec2f {
    return textureLoad(gbuffer_id, texel, 0).xy;
}

// The share of the environment's irradiance that the scene lets through to what a pixel shows.
fn sky_at(texel: vec2u) -> Number {
    return textureLoad(gbuffer_id, texel, 0).w;
}

// The position, normal, scale of the specular lobe and base colour of what a pixel shows. The base colour is that of
// map and vertices, which the shares in mesh.wgsl multiply by the object's.
fn position_at(texel: vec2u) -> Position {
    return position_of_pixel(vec2f(texel) + 0.5, depth, view.clip_to_world);
}

fn normal_at(texel: vec2u) -> Direction {
    return normalize(textureLoad(normal, texel, 0).xyz);
}

fn specular_at(texel: vec2u) -> Number {
    return textureLoad(normal, texel, 0).w;
}

fn base_color_at(texel: vec2u) -> vec3f {
    return textureLoad(base_color, texel, 0).rgb;
}

// The direction from x to the viewer, w_o.
fn direction_to_viewer(x: Position) -> Direction {
    return direction_to_eye(view.eye, x);
}
