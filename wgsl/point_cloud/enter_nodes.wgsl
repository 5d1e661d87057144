// The light of the inner nodes at one height of the octree, from that of their children.

import package::point_cloud::tree::{Node, Entering, brightness, farthest};
import package::units::{Number, Length};

struct Params {
    epsilon: Number,  // largest ratio of a node's size to its distance (Mikkelsen 2009, eq. 42)
    farthest: Length, // distance beyond which no light arrives
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> chosen: array<u32>; // the nodes of this height
@group(0) @binding(3) var<storage, read_write> entering: array<Entering>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&chosen) {
        return;
    }
    let k = chosen[id.x];
    let node = nodes[k];
    var flux = vec3f(0.0);
    var moment = vec3f(0.0);
    var normal = vec3f(0.0);
    for (var child = k + 1u; child < node.next; child = nodes[child].next) {
        let below = entering[child];
        let weight = brightness(below.flux);
        flux += below.flux;
        moment += weight * (below.position - node.centre);
        normal += weight * below.normal;
    }
    let lit = brightness(flux) > 0.0; // the position of a node without light does not matter
    let weight = select(1.0, brightness(flux), lit);
    let position = node.centre + moment / weight;
    let radius = farthest(node, position);
    // A node that contains x_o is never used as a whole; a node too far away for light to arrive always is.
    let reach = min(max(sqrt(node.area) / params.epsilon, radius), params.farthest + radius);
    entering[k] = Entering(position, reach, flux, node.next, normal / weight);
}
