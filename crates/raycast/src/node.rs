//! Memory layout of the hierarchy: nodes of eight children, leaves of four triangles, both as structures of arrays.
//!
//! Always true: an unused child has an empty box that no ray enters; an unused lane of a leaf holds NaN, which no ray hits.
//! Four children a node were tried on the cabin: 4.4 to 5.3 M rays/s and core for either, no difference beyond the noise.

use bytemuck::Zeroable;

/// Children of a node.
pub(crate) const WIDTH: usize = 8;
/// Triangles of a leaf: one 128-bit register per coordinate.
pub(crate) const LANES: usize = 4;
/// Set in a child reference that names a leaf block; the other bits are an index.
pub(crate) const LEAF: u32 = 1 << 31;

/// Eight boxes and what is in them.
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Node {
    /// Rows 0 to 2: least x, y, z; rows 3 to 5: greatest x, y, z. A column per child.
    pub bounds: [[f32; WIDTH]; 6],
    /// An index into the nodes, or [`LEAF`] and an index into the blocks.
    pub children: [u32; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 224);

impl Node {
    pub(crate) const EMPTY: Self = Self {
        bounds: [
            [f32::INFINITY; WIDTH],
            [f32::INFINITY; WIDTH],
            [f32::INFINITY; WIDTH],
            [f32::NEG_INFINITY; WIDTH],
            [f32::NEG_INFINITY; WIDTH],
            [f32::NEG_INFINITY; WIDTH],
        ],
        children: [LEAF; WIDTH],
    };
}

/// Up to four triangles.
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Block {
    /// Vertex, axis, lane.
    pub vertices: [[[f32; LANES]; 3]; 3],
    /// Index of the triangle in the scene.
    pub ids: [u32; LANES],
}

const _: () = assert!(size_of::<Block>() == 160);

impl Block {
    pub(crate) const EMPTY: Self = Self { vertices: [[[f32::NAN; LANES]; 3]; 3], ids: [u32::MAX; LANES] };
}

/// A hierarchy ready for tracing. Root is node 0; no nodes if there are no triangles.
#[derive(Debug, Default)]
pub(crate) struct Hierarchy {
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
    /// Entries that a traversal's stack may need at most.
    pub stack_need: usize,
}
