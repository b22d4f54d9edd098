//! Whether the nodes of a mesh share it.

/// What is known about sharing a mesh.
#[derive(Clone, Copy)]
pub(super) enum Sharing {
    /// Each node has a copy.
    Copied,
    /// Nodes share it, but it is still to be read.
    Wanted,
    /// It is in the model, with this index.
    Read(u32),
}
