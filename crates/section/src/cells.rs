//! Names of cells, cell pairs, beams and positions in cells, and the dense numbering of beams.
//!
//! A wall is `2 * axis + side`; side 0 passes through the section's origin. The cell directions u and v of a wall are
//! the next two axes in cyclic order.
//!
//! Numbering: one block of beams for each ordered pair of different walls, in the order (entry wall, exit wall); inside
//! a block `(entry cell) * (cells of the exit wall) + (exit cell)`, a cell being `v * (cells along u) + u`.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// A beam's number within its section: dense, from 0 to [`beam_count`](crate::Section::beam_count) - 1.
#[derive(
    Copy, Clone, Eq, PartialEq, Hash, Ord, PartialOrd, Debug, Default, Serialize, Deserialize,
)]
pub struct BeamId(pub u64);

/// One cell of one wall of a section.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Ord, PartialOrd, Debug, Serialize, Deserialize)]
pub struct CellIndex {
    /// Wall, 0 to 5: `2 * axis + side`, where side 0 passes through the section's origin.
    pub wall: u8,
    /// Cell along the wall's first direction, axis `(axis + 1) % 3`.
    pub u: u16,
    /// Cell along the wall's second direction, axis `(axis + 2) % 3`.
    pub v: u16,
}

impl CellIndex {
    /// The axis that crosses the wall, 0 to 2.
    pub fn axis(self) -> usize {
        usize::from(self.wall / 2) % 3
    }

    /// 0 for the wall through the section's origin, 1 for the one opposite.
    pub fn side(self) -> u8 {
        self.wall & 1
    }

    /// The axes of the wall's two cell directions.
    pub fn directions(self) -> (usize, usize) {
        wall_directions(self.wall)
    }
}

/// The axes of a wall's two cell directions: {1,1,2,2,0,0} and {2,2,0,0,1,1} for walls 0 to 5.
pub(crate) fn wall_directions(wall: u8) -> (usize, usize) {
    let axis = usize::from(wall / 2);
    ((axis + 1) % 3, (axis + 2) % 3)
}

/// The two cells that a ray passes, in its direction: a beam. Their walls always differ.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Ord, PartialOrd, Debug, Serialize, Deserialize)]
pub struct CellPair {
    /// Where rays come into the section.
    pub entry: CellIndex,
    /// Where rays leave it.
    pub exit: CellIndex,
}

/// Position of a ray in its two cells, in 256ths of a cell: entry u, v, exit u, v. Each stands for the middle of its
/// step: corner + (byte + ½)/256 · edge.
#[repr(transparent)]
#[derive(
    Copy,
    Clone,
    Eq,
    PartialEq,
    Hash,
    Ord,
    PartialOrd,
    Debug,
    Default,
    Pod,
    Zeroable,
    Serialize,
    Deserialize,
)]
pub struct RayCoords(pub [u8; 4]);

impl From<[u8; 4]> for RayCoords {
    fn from(bytes: [u8; 4]) -> Self {
        RayCoords(bytes)
    }
}

impl From<RayCoords> for [u8; 4] {
    fn from(coords: RayCoords) -> Self {
        coords.0
    }
}

/// Dense numbering of the beams of a grid.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Numbering {
    grid: [u64; 3],
    /// First number of the block of each (entry wall, exit wall), at `6 * entry + exit`; the last entry is the number
    /// of beams.
    first: [u64; 37],
}

impl Numbering {
    pub(crate) fn new(grid: [u32; 3]) -> Self {
        let mut numbering = Numbering { grid: grid.map(u64::from), first: [0; 37] };
        for block in 0..36u8 {
            let (entry, exit) = (block / 6, block % 6);
            let beams = if entry == exit {
                0
            } else {
                numbering.cells_of(entry) * numbering.cells_of(exit)
            };
            numbering.first[usize::from(block) + 1] = numbering.first[usize::from(block)] + beams;
        }
        numbering
    }

    fn cells_of(&self, wall: u8) -> u64 {
        let (u, v) = wall_directions(wall);
        self.grid[u] * self.grid[v]
    }

    pub(crate) fn beam_count(&self) -> u64 {
        self.first[36]
    }

    pub(crate) fn contains(&self, pair: CellPair) -> bool {
        let inside = |cell: CellIndex| {
            let (u, v) = cell.directions();
            cell.wall < 6 && u64::from(cell.u) < self.grid[u] && u64::from(cell.v) < self.grid[v]
        };
        inside(pair.entry) && inside(pair.exit) && pair.entry.wall != pair.exit.wall
    }

    pub(crate) fn beam(&self, pair: CellPair) -> BeamId {
        let flat = |cell: CellIndex| {
            u64::from(cell.v) * self.grid[cell.directions().0] + u64::from(cell.u)
        };
        let block = (usize::from(pair.entry.wall) * 6 + usize::from(pair.exit.wall)).min(35);
        BeamId(
            self.first[block] + flat(pair.entry) * self.cells_of(pair.exit.wall) + flat(pair.exit),
        )
    }

    pub(crate) fn cells(&self, beam: BeamId) -> Option<CellPair> {
        if beam.0 >= self.beam_count() {
            return None;
        }
        // The last block that starts at or before the beam is never an empty one, as beams follow it.
        let block = self.first.partition_point(|&first| first <= beam.0) - 1;
        let (entry_wall, exit_wall) = ((block / 6) as u8, (block % 6) as u8);
        let within = beam.0 - self.first[block];
        let cell = |wall: u8, flat: u64| {
            let along_u = self.grid[wall_directions(wall).0];
            CellIndex { wall, u: (flat % along_u) as u16, v: (flat / along_u) as u16 }
        };
        let exit_cells = self.cells_of(exit_wall);
        Some(CellPair {
            entry: cell(entry_wall, within / exit_cells),
            exit: cell(exit_wall, within % exit_cells),
        })
    }
}

/// Orders the cell pairs of a section so that beams with neighbouring cells at both ends come near each other: the pair
/// of walls, then the bits of the four cell indices interleaved (Morton order). Distinct pairs have distinct keys.
pub(crate) fn locality_key(pair: CellPair) -> u64 {
    let walls = u64::from(pair.entry.wall) * 6 + u64::from(pair.exit.wall);
    let indices = [pair.entry.v, pair.exit.v, pair.entry.u, pair.exit.u];
    // Grids are at most 64 cells a side, so 6 bits hold an index.
    let mut key = walls;
    for bit in (0..6).rev() {
        for index in indices {
            key = key << 1 | u64::from(index >> bit & 1);
        }
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn numbers_are_dense_and_invertible() {
        for grid in [[1, 1, 1], [3, 4, 5], [2, 1, 6], [4, 4, 4]] {
            let numbering = Numbering::new(grid);
            let [w, d, h] = grid.map(u64::from);
            let expected = 2 * (w * w * d * d + w * w * h * h + d * d * h * h)
                + 8 * (w * w * d * h + w * d * d * h + w * d * h * h);
            assert_eq!(numbering.beam_count(), expected);
            let mut pairs = HashSet::new();
            let mut keys = HashSet::new();
            for number in 0..expected {
                let pair = numbering.cells(BeamId(number)).unwrap();
                assert!(numbering.contains(pair));
                assert_eq!(numbering.beam(pair), BeamId(number));
                assert!(pairs.insert(pair));
                assert!(keys.insert(locality_key(pair)));
            }
            assert_eq!(numbering.cells(BeamId(expected)), None);
            assert_eq!(numbering.cells(BeamId(u64::MAX)), None);
        }
        assert_eq!(Numbering::new([3, 4, 5]).beam_count(), 7298);
        assert_eq!(Numbering::new([64; 3]).beam_count(), 30 * 64u64.pow(4));
    }

    #[test]
    fn wall_directions_are_those_of_the_original_file_format() {
        let all: Vec<_> = (0..6).map(wall_directions).collect();
        assert_eq!(all, [(1, 2), (1, 2), (2, 0), (2, 0), (0, 1), (0, 1)]);
    }

    #[test]
    fn the_locality_order_keeps_blocks_of_neighbours_together() {
        // Every aligned block of 4⁴ beams of a wall pair is contiguous in the order.
        let numbering = Numbering::new([8; 3]);
        let mut keyed: Vec<(u64, CellPair)> = (0..numbering.beam_count())
            .map(|b| numbering.cells(BeamId(b)).unwrap())
            .map(|p| (locality_key(p), p))
            .collect();
        keyed.sort_by_key(|&(key, _)| key);
        for block in keyed.chunks(256) {
            let name = |p: CellPair| {
                (
                    p.entry.wall,
                    p.exit.wall,
                    p.entry.u / 4,
                    p.entry.v / 4,
                    p.exit.u / 4,
                    p.exit.v / 4,
                )
            };
            assert!(block.iter().all(|&(_, p)| name(p) == name(block[0].1)));
        }
    }
}
