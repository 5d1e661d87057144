// Where a sender is, or a node over senders, in a mesh that deforms.

import package::units::{Position, Direction, Area};

struct Place {
    position: Position, // of a node: the mean, weighted by area
    area: Area,
    normal: Direction,  // of a sender; none of a node
    variance: Area,     // mean squared distance from `position` of what a node is over; 0 of a sender
}
