//! Stored samples in camera coordinates: sections placed before the eye, and distance codes decoded.
//!
//! Invariant: positions are relative to the eye, in double precision, before anything is
//! subtracted, so sections far from the origin lose nothing.

use crate::Camera;
use glam::DVec3;
use holo_section::{CellIndex, Section, distance};

/// Steps of a ray coordinate in a cell.
const STEPS: f64 = 256.0;

/// Decoded distances in units of the section's diagonal, by code: a look-up is cheaper than a
/// power.
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

    /// Distance in diagonals; infinite for nothing.
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
    /// One cell along each axis.
    cells: [DVec3; 3],
    /// The section's diagonal, scene units.
    pub diagonal: f64,
    /// Whether the eye is in another section and not in this one. This one's rays do not know what
    /// stands before it.
    pub is_elsewhere: bool,
}

impl PlacedSection {
    /// Places a section before a camera.
    pub fn new(section: &Section, camera: &Camera) -> Self {
        let spec = section.spec();
        let axes = spec.axes.map(|axis| camera.to_camera(DVec3::from_array(axis)));
        let cells = [0, 1, 2].map(|axis| axes[axis] / f64::from(spec.grid[axis]));
        let origin = camera.to_camera(DVec3::from_array(spec.origin) - camera.eye);
        Self { origin, axes, cells, diagonal: section.diagonal(), is_elsewhere: false }
    }

    /// Returns the cell's point for coordinates (0, 0), and a step of each coordinate. A point lies
    /// in the middle of its step.
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
