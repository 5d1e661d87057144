// The flux that enters at the samples, which are the leaves of the octree.

import package::mesh::{Vertex};
import package::point_cloud::tree::{Node, Entering};

@group(0) @binding(0) var<storage, read> points: array<Vertex>;
@group(0) @binding(1) var<storage, read> irradiance: array<vec4f>; // L_d at them
@group(0) @binding(2) var<storage, read> nodes: array<Node>;
@group(0) @binding(3) var<storage, read_write> entering: array<Entering>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let k = id.x;
    if k >= arrayLength(&nodes) {
        return;
    }
    let node = nodes[k];
    let flux = irradiance[node.first].rgb * node.area;
    // enter_nodes.wgsl then overwrites the inner nodes.
    entering[k] = Entering(points[node.first].position, -1.0, flux, node.next, points[node.first].normal);
}
