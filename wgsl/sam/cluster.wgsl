// A cluster: one sender, or all senders below a node of a tree, of a posed mesh. In object space.

import package::units::{Position, Area};

struct Cluster {
    position: Position, // of a node: the mean position of its senders, weighted by area
    area: Area,         // of all fans together
    normal: vec3f,      // of a node: the mean normal, weighted by area; shorter if the normals differ more
    variance: Area,     // mean squared distance of the senders from `position`; 0 for one sender
}
