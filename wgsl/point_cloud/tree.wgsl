// The octree over a body's samples, in object space. A leaf is a sample; an inner node replaces its descendants.

import package::units::{Position, Direction, Length, Area, Number};

// The geometry of a node. Nodes are in depth-first order: the first child follows its parent, and `next` is the node
// after all descendants.
struct Node {
    low: Position, // with `high`: the box around its samples
    area: Area,
    high: Position,
    next: u32,
    centre: Position, // the mean of its samples, weighted by area
    first: u32,       // the first of its samples
}

// The light that enters at the samples of a node (Mikkelsen 2009, 3.2).
struct Entering {
    position: Position, // P_k, the mean weighted by flux
    reach: Length,      // points closer than this sum over the children instead; -1 for a leaf
    flux: vec3f,        // Phi_k, W/m^2 mm^2
    next: u32,          // as of the node
    normal: vec3f,      // the mean weighted by flux: shorter, the more the normals of the samples differ
}

// The weight of P_k, which is one for all channels.
fn brightness(flux: vec3f) -> Number {
    return flux.r + flux.g + flux.b;
}

// The distance from `x` to the farthest corner of a node's box.
fn farthest(node: Node, x: Position) -> Length {
    return length(max(x - node.low, node.high - x));
}
