// The octree over a body's samples, in object space. A node is a sample or stands for the nodes below it.

import package::units::{Position, Direction, Length, Area, Number};

// What a node is by its place, light apart. Its children follow it, the first directly; what comes after all of them
// is `next`.
struct Node {
    low: Position, // the box around its samples
    area: Area,
    high: Position,
    next: u32,
    centre: Position, // the mean of its samples, weighted by area
    first: u32,       // the first of its samples
}

// What a node stands for (Mikkelsen 2009, 3.2), means being weighted by what enters at the samples.
struct Entering {
    position: Position, // P_k
    reach: Length,      // the distance below which its children are asked
    flux: vec3f,        // Phi_k, W/m^2 mm^2
    next: u32,
    normal: vec3f,      // the mean, the shorter the more the samples' differ
}

// By which P_k is weighted: the colours share one.
fn brightness(flux: vec3f) -> Number {
    return flux.r + flux.g + flux.b;
}

// The distance from `x` to the farthest corner of a node's box.
fn farthest(node: Node, x: Position) -> Length {
    return length(max(x - node.low, node.high - x));
}
