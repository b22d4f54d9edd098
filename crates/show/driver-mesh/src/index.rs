//! Where a walk to a direction begins: quadtrees on the faces of an octahedron (Larson & Simmons
//! 1999, §2.4.5).
//!
//! Each square of each level names a vertex in it, the one that came last. A search begins at the
//! smallest square, and goes to larger ones until one names a vertex.
//!
//! Invariant: a square names a vertex in it that has not been removed, or none.

use crate::direction::{BITS, GridDirection, STEPS};

/// Levels of squares. The finest has 4⁸ squares on each face, half of which contain directions. They
/// are 0.35° wide, about 5 pixels.
const LEVELS: u32 = 8;
/// A square without a vertex.
const NONE: u32 = u32::MAX;

/// A vertex near every direction.
pub struct DirectionIndex {
    /// For each level from 1: a vertex of each square, face by face and row by row.
    levels: Vec<Vec<u32>>,
}

impl Default for DirectionIndex {
    fn default() -> DirectionIndex {
        let squares = |level: u32| vec![NONE; 8 << (2 * level)];
        DirectionIndex { levels: (1..=LEVELS).map(squares).collect() }
    }
}

/// Returns the number of the square of a level with 4^`level` squares on each face.
pub fn square(direction: GridDirection, level: u32) -> usize {
    let last = STEPS - 1;
    let [x, y] = direction.place().map(|at| (at.min(last) >> (BITS - level)) as usize);
    (direction.face() << (2 * level)) + (x << level) + y
}

impl DirectionIndex {
    /// Adds a vertex.
    pub fn insert(&mut self, direction: GridDirection, vertex: u32) {
        for (level, squares) in (1..).zip(&mut self.levels) {
            squares[square(direction, level)] = vertex;
        }
    }

    /// Forgets a vertex.
    pub fn remove(&mut self, direction: GridDirection, vertex: u32) {
        for (level, squares) in (1..).zip(&mut self.levels) {
            let named = &mut squares[square(direction, level)];
            if *named == vertex {
                *named = NONE;
            }
        }
    }

    /// Returns a vertex near a direction; `None` if even the largest square around it names none.
    pub fn near(&self, direction: GridDirection) -> Option<u32> {
        let named = |level: u32| self.levels[level as usize - 1][square(direction, level)];
        (1..=LEVELS).rev().map(named).find(|&vertex| vertex != NONE)
    }
}
