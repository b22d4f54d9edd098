//! Memory layout of the hierarchy: nodes of eight children in two cache lines, leaves of four
//! triangles in three.
//!
//! Invariants: in exact arithmetic, a decoded box contains the box that was encoded. An unused
//! lane of a leaf holds NaN, which no ray hits. An unused child has an empty box. Rounding may let
//! a ray from far away enter it; it refers to block 0, which is harmless.
//!
//! Other layouts were tried: docs/notes/ray-casting.md.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use holo_mapped::Array;

/// Stack of ordinary hierarchies. It is small because it is cleared for every ray. Half of it
/// gained 1 to 2 %, but is too small for 10⁶ triangles.
pub(crate) const SMALL_STACK: usize = 96;
/// Stack of the deepest hierarchies that are accepted.
pub(crate) const LARGE_STACK: usize = 512;

/// Number of children of a node.
pub(crate) const WIDTH: usize = 8;
/// Number of triangles of a leaf: with three vertices they take 12 of the 16 lanes of a 512-bit
/// register.
pub(crate) const LANES: usize = 4;
/// Most triangles of a [`SmallScene`]: one bit each.
pub(crate) const FEW: usize = 64;
/// Number of triangles of a [`TriangleRow`].
pub(crate) const ROW: usize = 16;
/// Set in a reference to a leaf block; the other bits are an index.
pub(crate) const LEAF: u32 = 1 << 31;

/// Least step of a quantised box. Smaller steps would become subnormal when divided by long
/// directions.
const LEAST_STEP: f64 = f64::from_bits((1023 - 90) << 52);

/// Eight boxes, as bytes on the node's own grid, and references to their contents.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    /// The coordinates of byte 0, by axis.
    pub origin: [f32; 3],
    /// The size of one unit of a byte, by axis: a power of two.
    pub step: [f32; 3],
    /// Three rows by axis: least, greatest and again least coordinate of each child. Near and far
    /// bounds are thus 16 consecutive bytes for either sign of a direction.
    pub bounds: [[[u8; WIDTH]; 3]; 3],
    /// The index of a node, or [`LEAF`] and the index of a block.
    pub children: [u32; WIDTH],
}

const _: () = assert!(size_of::<WideNode>() == 128);

impl WideNode {
    pub(crate) const EMPTY: Self = Self {
        origin: [0.0; 3],
        step: [0.0; 3],
        bounds: [[[255; WIDTH], [0; WIDTH], [255; WIDTH]]; 3],
        children: [LEAF; WIDTH],
    };

    /// Sets the boxes (least corner, greatest corner) of the first children; at most eight.
    pub(crate) fn set_boxes(&mut self, boxes: &[([f32; 3], [f32; 3])]) {
        for axis in 0..3 {
            let origin = boxes.iter().fold(f32::INFINITY, |least, b| least.min(b.0[axis]));
            let end = boxes.iter().fold(f32::NEG_INFINITY, |most, b| most.max(b.1[axis]));
            let from = f64::from(origin);
            let mut step = LEAST_STEP;
            while (f64::from(end) - from) / step > 255.0 {
                step *= 2.0;
            }
            self.origin[axis] = origin;
            self.step[axis] = step as f32;
            for (slot, (low, high)) in boxes.iter().enumerate() {
                // Division by a power of two is exact. So is the difference up to 2⁻⁵³, far below
                // the boxes' padding.
                let low = ((f64::from(low[axis]) - from) / step).floor() as u8;
                let high = ((f64::from(high[axis]) - from) / step).ceil() as u8;
                self.bounds[axis][0][slot] = low;
                self.bounds[axis][1][slot] = high;
                self.bounds[axis][2][slot] = low;
            }
        }
    }

    /// Returns the exact least and greatest corner of a child's box; `None` for an unused child.
    pub(crate) fn child_box(&self, slot: usize) -> Option<(DVec3, DVec3)> {
        let at = |row: usize| {
            let corner = |axis: usize| {
                f64::from(self.origin[axis])
                    + f64::from(self.bounds[axis][row][slot]) * f64::from(self.step[axis])
            };
            DVec3::new(corner(0), corner(1), corner(2))
        };
        (self.bounds[0][0][slot] <= self.bounds[0][1][slot]).then(|| (at(0), at(1)))
    }
}

/// Up to four triangles.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct TriangleBlock {
    /// Indexed by axis, vertex and lane. The fourth vertex does not exist and fills the register.
    pub vertices: [[[f32; LANES]; 4]; 3],
}

const _: () = assert!(size_of::<TriangleBlock>() == 192);

impl TriangleBlock {
    pub(crate) const EMPTY: Self = Self { vertices: [[[f32::NAN; LANES]; 4]; 3] };

    /// Returns the scene's index of a lane's triangle. It is stored in the unused fourth vertex.
    #[inline(always)]
    pub(crate) fn id(&self, lane: usize) -> u32 {
        self.vertices[0][3][lane % LANES].to_bits()
    }

    /// Returns the vertices of a lane's triangle.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        let lane = lane % LANES;
        let [x, y, z] = &self.vertices;
        let vertex = |i: usize| [x[i][lane], y[i][lane], z[i][lane]];
        [vertex(0), vertex(1), vertex(2)]
    }

    /// Stores triangle `id` in a lane.
    pub(crate) fn set(&mut self, lane: usize, id: u32, vertices: [[f32; 3]; 3]) {
        for (vertex, position) in vertices.iter().enumerate() {
            for (axis, coordinate) in position.iter().enumerate() {
                self.vertices[axis][vertex][lane] = *coordinate;
            }
        }
        self.vertices[0][3][lane] = f32::from_bits(id);
    }

    /// Returns the index of the triangle in a lane, if there is one.
    pub(crate) fn used(&self, lane: usize) -> Option<u32> {
        (!self.vertices[0][0][lane].is_nan()).then(|| self.id(lane))
    }
}

/// Sixteen triangles as a structure of arrays.
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct TriangleRow {
    /// Indexed by axis, vertex and lane.
    pub vertices: [[[f32; ROW]; 3]; 3],
}

/// All triangles of a scene with at most [`FEW`] of them, in the scene's order.
#[derive(Debug)]
pub(crate) struct SmallScene {
    pub rows: Vec<TriangleRow>,
    /// Vertices, indexed by triangle.
    pub triangles: Vec<[[f32; 3]; 3]>,
}

impl SmallScene {
    pub(crate) fn new(triangles: Vec<[[f32; 3]; 3]>) -> Option<Self> {
        if triangles.len() > FEW {
            return None;
        }
        let mut rows = vec![
            TriangleRow { vertices: [[[f32::NAN; ROW]; 3]; 3] };
            triangles.len().div_ceil(ROW)
        ];
        for (i, vertices) in triangles.iter().enumerate() {
            for (vertex, position) in vertices.iter().enumerate() {
                for (axis, coordinate) in position.iter().enumerate() {
                    rows[i / ROW].vertices[axis][vertex][i % ROW] = *coordinate;
                }
            }
        }
        Some(Self { rows, triangles })
    }
}

/// The hierarchy. The root is node 0; without triangles there are no nodes.
#[derive(Debug, Default)]
pub(crate) struct Hierarchy {
    pub nodes: Array<WideNode>,
    pub blocks: Array<TriangleBlock>,
    /// All triangles, if there are so few that testing all is faster than traversal.
    pub few: Option<SmallScene>,
    /// Most entries that a traversal puts on its stack.
    pub stack_need: usize,
}

impl Hierarchy {
    /// Returns nodes and blocks as slices, so that a query finds out only once where they are.
    #[inline(always)]
    pub(crate) fn slices(&self) -> HierarchySlices<'_> {
        HierarchySlices { nodes: &self.nodes, blocks: &self.blocks }
    }
}

/// The arrays of a hierarchy.
#[derive(Clone, Copy)]
pub(crate) struct HierarchySlices<'a> {
    pub nodes: &'a [WideNode],
    pub blocks: &'a [TriangleBlock],
}
