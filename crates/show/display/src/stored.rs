//! Stored samples in camera coordinates: sections relative to the eye, and decoded distance codes.
//!
//! Invariant: the eye is subtracted first, in double precision, so sections far from the origin
//! lose no precision.

use crate::Camera;
use glam::DVec3;
use holo_section::{CellIndex, Section, distance};

/// Steps of a ray coordinate in a cell: one for each value of a byte.
const STEPS: f64 = 256.0;

/// Decoded distances by code, in units of the section's diagonal. A look-up is faster than
/// computing a power.
pub struct DistanceTable(Vec<f32>);

impl Default for DistanceTable {
    fn default() -> Self {
        Self::new()
    }
}

impl DistanceTable {
    /// Decodes every code.
    pub fn new() -> Self {
        Self((0..=u16::MAX).map(|code| distance::decode(code, 1.0) as f32).collect())
    }

    /// Returns the distance of a code, in diagonals; infinite for rays that hit nothing.
    #[inline(always)]
    pub fn of(&self, code: u16) -> f64 {
        f64::from(self.0.get(usize::from(code)).copied().unwrap_or(f32::INFINITY))
    }
}

/// A section in camera coordinates.
#[derive(Clone, Debug)]
pub struct PlacedSection {
    origin: DVec3,
    axes: [DVec3; 3],
    /// The side of one cell along each axis.
    cells: [DVec3; 3],
    /// The section's diagonal, scene units.
    pub diagonal: f64,
    /// True if another section contains the eye and this one does not. An object that this
    /// section's rays do not hit may then stand between the section and the eye.
    pub is_elsewhere: bool,
}

impl PlacedSection {
    /// Returns a section in a camera's coordinates.
    pub fn new(section: &Section, camera: &Camera) -> Self {
        let spec = section.spec();
        let axes = spec.axes.map(|axis| camera.to_camera(DVec3::from_array(axis)));
        let cells = [0, 1, 2].map(|axis| axes[axis] / f64::from(spec.grid[axis]));
        let origin = camera.to_camera(DVec3::from_array(spec.origin) - camera.eye);
        Self { origin, axes, cells, diagonal: section.diagonal(), is_elsewhere: false }
    }

    /// Returns the cell's point for ray coordinates (0, 0), and the vector of one step along each
    /// coordinate. A coordinate means the middle of its step.
    pub fn cell(&self, cell: CellIndex) -> (DVec3, DVec3, DVec3) {
        let axis = usize::from(cell.wall >> 1);
        let (first, second) = [(1, 2), (2, 0), (0, 1)][axis];
        let corner = self.origin
            + self.axes[axis] * f64::from(cell.wall & 1)
            + self.cells[first] * f64::from(cell.u)
            + self.cells[second] * f64::from(cell.v);
        let (u_step, v_step) = (self.cells[first] / STEPS, self.cells[second] / STEPS);
        (corner + 0.5 * (u_step + v_step), u_step, v_step)
    }
}
