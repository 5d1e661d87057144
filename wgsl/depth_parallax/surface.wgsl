// The surface at a texel of the atlas, for passes that draw an object's triangles there.

import package::mesh::{Vertex, ObjectUniforms, bent_normal, map_coordinates};
import package::screen::{direction_to_eye};
import package::units::{Direction, Length, Number, Position};

@group(1) @binding(24) var<uniform> object: ObjectUniforms;
@group(1) @binding(25) var<storage, read> vertices: array<Vertex>;
@group(1) @binding(26) var normal_map: texture_2d<f32>;
@group(1) @binding(27) var linear_repeat: sampler;
@group(1) @binding(28) var<uniform> eye: vec4f; // xyz, 1: the camera's position; xyz, 0: the direction towards it

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
}

@vertex
fn atlas_vertex(@builtin(vertex_index) i: u32) -> Varying {
    let vertex = vertices[i];
    let clip = vec4f(2.0 * vertex.atlas.x - 1.0, 1.0 - 2.0 * vertex.atlas.y, 0.0, 1.0);
    let x = object.object_to_world * vec4f(vertex.position, 1.0);
    let n = object.object_to_world * vec4f(vertex.normal, 0.0);
    return Varying(clip, x.xyz, n.xyz, vec2f(vertex.u, vertex.v));
}

// The surface, and the steps on it.
struct Surface {
    n: Direction,      // normal of the surface
    bent: Direction,   // normal with the normal map
    w_o: Direction,    // to the viewer
    to_u: vec3f,       // gradients of the atlas coordinates, texels per mm
    to_v: vec3f,
}

// Call it in uniform control flow: it has derivatives.
fn surface_at(in: Varying) -> Surface {
    let n = normalize(in.normal);
    let at = map_coordinates(object, in.uv, textureDimensions(normal_map));
    let bent = bent_normal(n, in.position, in.uv, textureSample(normal_map, linear_repeat, at).xyz, object.normal_scale);
    let right = dpdx(in.position); // a texel to the right and down, in the plane of the smooth normal
    let down = dpdy(in.position);
    let r = right - n * dot(n, right);
    let d = down - n * dot(n, down);
    let rr = dot(r, r);
    let rd = dot(r, d);
    let dd = dot(d, d);
    let area = max(rr * dd - rd * rd, 1e-30);
    return Surface(n, bent, direction_to_eye(eye, in.position), (dd * r - rd * d) / area, (rr * d - rd * r) / area);
}

// The step in texels along a vector of mm.
fn texels_of(surface: Surface, step: vec3f) -> vec2f {
    return vec2f(dot(surface.to_u, step), dot(surface.to_v, step));
}
