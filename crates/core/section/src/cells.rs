//! Names of cells, cell pairs, beams and positions in cells, and the dense numbering of beams.
//!
//! A wall is `2 * axis + side`; side 0 passes through the section's origin. The cell directions u
//! and v of a wall are the next two axes in cyclic order.
//!
//! Beams are numbered in blocks, one for each ordered pair of different walls, in the order (entry
//! wall, exit wall). Inside a block, a beam's number is `(entry cell) * (cells of the exit wall) +
//! (exit cell)`. A cell's number is `v * (cells along u) + u`.

use bytemuck::{Pod, Zeroable};

/// A beam's number within its section. Numbers are dense: from 0 to one less than
/// [`beam_count`](crate::Section::beam_count).
#[derive(Copy, Clone, Eq, PartialEq, Hash, Ord, PartialOrd, Debug, Default)]
pub struct BeamId(pub u64);

/// One cell of one wall of a section.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Ord, PartialOrd, Debug)]
pub struct CellIndex {
    /// Wall, 0 to 5: `2 * axis + side`, where side 0 passes through the section's origin.
    pub wall: u8,
    /// Cell along the wall's first direction, axis `(axis + 1) % 3`.
    pub u: u16,
    /// Cell along the wall's second direction, axis `(axis + 2) % 3`.
    pub v: u16,
}

impl CellIndex {
    /// Returns the axis that crosses the wall, 0 to 2.
    pub fn axis(self) -> usize {
        usize::from(self.wall / 2) % 3
    }

    /// Returns 0 for the wall through the section's origin, 1 for the one opposite.
    pub fn side(self) -> u8 {
        self.wall & 1
    }

    /// Returns the axes of the wall's two cell directions.
    pub fn directions(self) -> (usize, usize) {
        wall_directions(self.wall)
    }
}

/// Returns the axes of a wall's two cell directions. The first axes of walls 0 to 5 are 1 1 2 2 0
/// 0, the second ones 2 2 0 0 1 1.
pub(crate) fn wall_directions(wall: u8) -> (usize, usize) {
    let axis = usize::from(wall / 2);
    ((axis + 1) % 3, (axis + 2) % 3)
}

/// The two cells that a ray passes, in its direction: a beam. Their walls always differ.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Ord, PartialOrd, Debug)]
pub struct CellPair {
    /// Where rays enter the section.
    pub entry: CellIndex,
    /// Where rays leave it.
    pub exit: CellIndex,
}

/// The positions of a ray in its two cells: entry u and v, then exit u and v.
///
/// A byte is a step of 1/256 of a cell and stands for the middle of it: corner + (byte + ½)/256 ·
/// edge.
#[repr(transparent)]
#[derive(Copy, Clone, Eq, PartialEq, Hash, Ord, PartialOrd, Debug, Default, Pod, Zeroable)]
pub struct RayCoords(pub [u8; 4]);

/// The dense numbering of a grid's beams.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Numbering {
    grid: [u64; 3],
    /// First number of the block of each (entry wall, exit wall), at index `6 * entry + exit`. The
    /// last entry is the number of beams.
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
        // The last block that starts at or before the beam is not empty, because the beam is in it.
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
            for number in 0..expected {
                let pair = numbering.cells(BeamId(number)).unwrap();
                assert!(numbering.contains(pair));
                assert_eq!(numbering.beam(pair), BeamId(number));
                assert!(pairs.insert(pair));
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
}
