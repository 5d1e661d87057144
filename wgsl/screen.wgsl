// Passes over the pixels of the screen.

import package::units::{Position, Direction};

// Corner i of the triangle that covers the screen.
fn screen_corner(i: u32) -> vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// The position of the surface at a pixel, given the pixel's centre.
fn position_of_pixel(pixel: vec2f, depth: texture_depth_2d, clip_to_world: mat4x4f) -> Position {
    let size = vec2f(textureDimensions(depth));
    let ndc = vec2f(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y);
    let x = clip_to_world * vec4f(ndc, textureLoad(depth, vec2u(pixel), 0), 1.0);
    return x.xyz / x.w;
}

// The direction from x to the viewer. `eye`: xyz, 1: the camera's position; xyz, 0: the direction towards it.
fn direction_to_eye(eye: vec4f, x: Position) -> Direction {
    return normalize(eye.xyz - x * eye.w);
}

const SAME: f32 = 1e-5; // depths that differ by less belong to one surface

// Whether a fragment, by its @builtin(position), lies behind the surface in the depth buffer.
fn is_hidden(place: vec4f, depth: texture_depth_2d) -> bool {
    return place.z > textureLoad(depth, vec2u(place.xy), 0) + SAME;
}
