//! A beam's importance: the world volume of the convex hull of its two cells (paper §2.2).
//!
//! The volume is exact. The hull of two cells of opposite walls is a sheared prism: cell area times
//! distance.
//!
//! For adjacent walls, scale the section so that its cells are unit cubes. Let `x` and `y` be the
//! distances from the edge that the walls share, and `z` the offset along it. The first cell is `x
//! = 0, y ∈ [i, i+1], z ∈ [0, 1]`. The second is `y = 0, x ∈ [j, j+1], z ∈ [s, s+1]`. Their hull is
//! the union over λ ∈ [0, 1] of the boxes `λ[j, j+1] × (1-λ)[i, i+1] × [λs, λs+1]`. A point (x, y)
//! lies in the boxes of some interval λ ∈ [λ₀, λ₁], and there the hull is `1 + s(λ₁-λ₀)` high. So
//! the volume is the projected area plus s ∫λ(1-λ)dλ, which is `(i+j+1)/2 + s/6`.

use crate::cells::CellPair;
use crate::section::Section;

/// The importances of all beams of a section. They are computed when needed, not stored per beam.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportanceTable {
    grid: [u32; 3],
    cell_volume: f64,
    total: f64,
}

impl ImportanceTable {
    /// Returns the table of a section.
    pub fn new(section: &Section) -> ImportanceTable {
        let grid = section.spec().grid;
        let n = grid.map(f64::from);
        let cell_volume = section.volume() / (n[0] * n[1] * n[2]);
        let mut total = 0.0;
        for axis in 0..3 {
            let (across, u, v) = (n[axis], n[(axis + 1) % 3], n[(axis + 2) % 3]);
            // Two directions between the opposite walls of this axis.
            total += 2.0 * (u * v).powi(2) * across;
            // Eight ordered pairs of adjacent walls share edges along this axis: Σ(i+j+1)/2 =
            // uv(u+v)/4 and Σ|k-l| = n(n²-1)/3.
            total += 8.0
                * (across.powi(2) * u * v * (u + v) / 4.0
                    + u * v * across * (across * across - 1.0) / 18.0);
        }
        ImportanceTable { grid, cell_volume, total: total * cell_volume }
    }

    /// Returns the world volume of the convex hull of the pair's cells.
    pub fn of(&self, pair: CellPair) -> f64 {
        let (a, b) = (pair.entry.axis(), pair.exit.axis());
        if a == b {
            return f64::from(self.grid[a]) * self.cell_volume;
        }
        let shared = 3 - a - b;
        let entry = cell_along(pair.entry);
        let exit = cell_along(pair.exit);
        // Each cell's distance from the shared edge, counted from the side on which the other wall
        // lies.
        let i = distance_from_side(entry[b], self.grid[b], pair.exit.side());
        let j = distance_from_side(exit[a], self.grid[a], pair.entry.side());
        let offset = entry[shared].abs_diff(exit[shared]);
        (f64::from(i + j + 1) / 2.0 + f64::from(offset) / 6.0) * self.cell_volume
    }

    /// Returns the sum over all beams.
    pub fn total(&self) -> f64 {
        self.total
    }
}

/// Returns the cell's index along each axis; 0 along the axis that crosses its wall.
fn cell_along(cell: crate::CellIndex) -> [u32; 3] {
    let (u, v) = cell.directions();
    let mut along = [0; 3];
    along[u] = u32::from(cell.u);
    along[v] = u32::from(cell.v);
    along
}

fn distance_from_side(index: u32, cells: u32, side: u8) -> u32 {
    if side == 0 { index } else { cells.saturating_sub(index + 1) }
}
