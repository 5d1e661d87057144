// The points of a posed mesh: where they are, and the areas of their reduced fans (Maisch & Ropinski 2017, eq. 16).

import package::mesh::{Vertex};
import package::sam::place::{Place};
import package::units::{Area};

@group(0) @binding(0) var<storage, read> points: array<Vertex>;
@group(0) @binding(1) var<storage, read> starts: array<u32>;  // of a point's triangles in `corners`, and their end
@group(0) @binding(2) var<storage, read> corners: array<u32>; // points at the triangles' corners
@group(0) @binding(3) var<storage, read_write> places: array<Place>; // nodes follow
@group(0) @binding(4) var<storage, read_write> area: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = id.x;
    if i >= arrayLength(&points) {
        return;
    }
    var total: Area = 0.0;
    for (var j = starts[i]; j < starts[i + 1u]; j += 3u) {
        let a = points[corners[j]].position;
        let b = points[corners[j + 1u]].position;
        let c = points[corners[j + 2u]].position;
        total += length(cross(b - a, c - a)) / 6.0;
    }
    places[i] = Place(points[i].position, total, points[i].normal, 0.0);
    area[i] = total;
}
