// Where a sender is, or a node over senders, in a mesh that deforms.

import package::units::{Position, Area};

struct Place {
    position: Position, // of a node: the mean, weighted by area
    area: Area,
    normal: vec3f,      // of a node: the mean, the shorter the more those of its senders differ
    variance: Area,     // mean squared distance from `position` of what a node is over; 0 of a sender
}
