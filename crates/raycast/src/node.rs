//! Memory layout of the hierarchy: nodes of eight children in two cache lines, leaves of four triangles in three.
//!
//! Always true: a decoded box holds the box that was given, in exact arithmetic; an unused lane of a leaf holds NaN, which no
//! ray hits. An unused child has an empty box; rounding may let a ray from afar enter it, and names block 0, which does no harm.
//!
//! Tried: 32-bit boxes (224 bytes a node) and leaves of eight triangles: no difference beyond the noise of a busy machine, from 10³ to
//! 10⁶ triangles. Large pages by `madvise`: 0 to 5 % on 10⁶ triangles, not worth the unsafe code.

use bytemuck::Zeroable;
use glam::DVec3;

/// Children of a node.
pub(crate) const WIDTH: usize = 8;
/// Triangles of a leaf: with three vertices, 12 of the 16 lanes of a 512-bit register.
pub(crate) const LANES: usize = 4;
/// Most triangles of [`Few`]: a bit for each.
pub(crate) const FEW: usize = 64;
/// Triangles of a [`Row`].
pub(crate) const ROW: usize = 16;
/// Set in a child reference that names a leaf block; the other bits are an index.
pub(crate) const LEAF: u32 = 1 << 31;

/// Least step of a quantised box: smaller ones would meet subnormal numbers when divided by long directions.
const LEAST_STEP: f64 = f64::from_bits((1023 - 90) << 52);

/// Eight boxes, as bytes on a grid of their own, and what is in them.
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Where the bytes are 0, by axis.
    pub origin: [f32; 3],
    /// What one unit of a byte is, by axis: powers of two.
    pub step: [f32; 3],
    /// By axis: least, greatest and once more least coordinate, so that near and far are 16 consecutive bytes for either sign of
    /// a direction. A column per child.
    pub bounds: [[[u8; WIDTH]; 3]; 3],
    /// An index into the nodes, or [`LEAF`] and an index into the blocks.
    pub children: [u32; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 128);

impl Node {
    pub(crate) const EMPTY: Self = Self {
        origin: [0.0; 3],
        step: [0.0; 3],
        bounds: [[[255; WIDTH], [0; WIDTH], [255; WIDTH]]; 3],
        children: [LEAF; WIDTH],
    };

    /// Sets the boxes (least corner, greatest corner) of the first children, at most eight.
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
                // Division by a power of two is exact, and so is the difference up to 2⁻⁵³: far below the boxes' padding.
                let low = ((f64::from(low[axis]) - from) / step).floor() as u8;
                let high = ((f64::from(high[axis]) - from) / step).ceil() as u8;
                self.bounds[axis][0][slot] = low;
                self.bounds[axis][1][slot] = high;
                self.bounds[axis][2][slot] = low;
            }
        }
    }

    /// Least and greatest corner of a child's box, exactly; `None` if there is no such child.
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
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Block {
    /// Axis, vertex, lane; the fourth vertex does not exist and fills the register.
    pub vertices: [[[f32; LANES]; 4]; 3],
}

const _: () = assert!(size_of::<Block>() == 192);

impl Block {
    pub(crate) const EMPTY: Self = Self { vertices: [[[f32::NAN; LANES]; 4]; 3] };

    /// Index of a lane's triangle in the scene, kept where the first axis has no fourth vertex.
    #[inline(always)]
    pub(crate) fn id(&self, lane: usize) -> u32 {
        self.vertices[0][3][lane % LANES].to_bits()
    }

    /// The vertices of a lane's triangle.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        let lane = lane % LANES;
        let [x, y, z] = &self.vertices;
        let vertex = |i: usize| [x[i][lane], y[i][lane], z[i][lane]];
        [vertex(0), vertex(1), vertex(2)]
    }

    /// Puts triangle `id` into a lane.
    pub(crate) fn set(&mut self, lane: usize, id: u32, vertices: [[f32; 3]; 3]) {
        for (vertex, position) in vertices.iter().enumerate() {
            for (axis, coordinate) in position.iter().enumerate() {
                self.vertices[axis][vertex][lane] = *coordinate;
            }
        }
        self.vertices[0][3][lane] = f32::from_bits(id);
    }

    /// The triangle in a lane, if there is one.
    pub(crate) fn used(&self, lane: usize) -> Option<u32> {
        (!self.vertices[0][0][lane].is_nan()).then(|| self.id(lane))
    }
}

/// Sixteen triangles, the coordinates of each kind together.
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Row {
    /// Axis, vertex, lane.
    pub vertices: [[[f32; ROW]; 3]; 3],
}

/// At most [`FEW`] triangles, in the scene's order.
#[derive(Debug)]
pub(crate) struct Few {
    pub rows: Vec<Row>,
    /// Vertices by triangle.
    pub triangles: Vec<[[f32; 3]; 3]>,
}

impl Few {
    pub(crate) fn new(triangles: Vec<[[f32; 3]; 3]>) -> Option<Self> {
        if triangles.len() > FEW {
            return None;
        }
        let mut rows =
            vec![Row { vertices: [[[f32::NAN; ROW]; 3]; 3] }; triangles.len().div_ceil(ROW)];
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

/// A hierarchy ready for tracing. Root is node 0; no nodes if there are no triangles.
#[derive(Debug, Default)]
pub(crate) struct Hierarchy {
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
    /// Every triangle, if there are so few that testing them all takes less than finding out which.
    pub few: Option<Few>,
    /// Entries that a traversal's stack may need at most.
    pub stack_need: usize,
}
