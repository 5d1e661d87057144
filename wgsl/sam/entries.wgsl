// A spatial adjacency map as the shaders see it (Maisch & Ropinski 2017, 4.1).

// What a vertex receives through the object from one sender.
struct Entry {
    weight: vec3f, // of the sender's irradiance
    sender: i32,   // a sender or, behind all of them, a node; negative where there is none
}
