// The entry of a Spatial Adjacency Map (Maisch & Ropinski 2017, section 4.1).

// What a receiver reads of one sender.
struct Entry {
    weight: vec3f, // share of the sender's irradiance that arrives, per channel
    sender: i32,   // index into the irradiance buffer: a sender or, behind all senders, a mean; -1: the entry is unused
}
