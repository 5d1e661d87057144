// Clusters of the points of a posed mesh: positions, normals and areas of reduced fans (Maisch & Ropinski 2017, eq. 16).

import package::mesh::{Vertex};
import package::sam::cluster::{Cluster};
import package::units::{Area};

@group(0) @binding(0) var<storage, read> points: array<Vertex>;
@group(0) @binding(1) var<storage, read> starts: array<u32>;  // index of each point's first corner in `corners`, and the end
@group(0) @binding(2) var<storage, read> corners: array<u32>; // three points for each triangle around a point
@group(0) @binding(3) var<storage, read_write> clusters: array<Cluster>; // of the points; those of tree nodes follow
@group(0) @binding(4) var<storage, read_write> area: array<f32>; // mm^2, of the points' fans

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
    clusters[i] = Cluster(points[i].position, total, points[i].normal, 0.0);
    area[i] = total;
}
