//! Finds the cells and byte positions where a line meets a section.
//!
//! Invariant: a boundary belongs to exactly one side. A position on the border of two cells belongs
//! to the upper cell, one on a section's upper border to the last cell. A line that only touches
//! the section misses it.

use glam::DVec3;

use crate::cells::{CellIndex, CellPair, RayCoords, wall_directions};
use crate::section::{Section, StepMap};

/// Where a line meets a section. Points are `origin + t * direction` of that line.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct LineHit {
    /// The cells that the line crosses, in its direction.
    pub pair: CellPair,
    /// Its positions in these cells, rounded to bytes.
    pub coords: RayCoords,
    /// Where the line enters, in multiples of `direction`. Negative behind `origin`.
    pub entry_t: f64,
    /// Where it leaves; always greater than `entry_t`.
    pub exit_t: f64,
}

impl Section {
    /// Returns where the infinite line through `origin` along `direction` meets the section,
    /// forwards or backwards. The length of `direction` does not matter.
    ///
    /// `None` if the line misses, only touches an edge or corner, or is not finite. The stored ray
    /// nearest to the line is `ray(hit.pair, hit.coords)`. The line of a stored ray gives exactly
    /// its own pair and coordinates.
    pub fn line(&self, origin: DVec3, direction: DVec3) -> Option<LineHit> {
        let scale = direction.abs().max_element();
        if !origin.is_finite() || !direction.is_finite() || scale == 0.0 {
            return None;
        }
        let frame = self.frame;
        let from = snap_to_stored(frame, origin);
        // Scaled first, so that a tiny or huge direction neither underflows nor overflows.
        let along = frame.to_steps_vector(direction / scale);
        let (mut entry_t, mut exit_t) = (f64::NEG_INFINITY, f64::INFINITY);
        let (mut entry_wall, mut exit_wall) = (0u8, 0u8);
        for axis in 0..3 {
            let (position, slope, size) = (from[axis], along[axis], frame.size[axis]);
            if slope == 0.0 {
                if !(0.0..size).contains(&position) {
                    return None;
                }
                continue;
            }
            let (at_low, at_high) = (-position / slope, (size - position) / slope);
            let low_wall = 2 * axis as u8;
            let (near, far) = if slope > 0.0 {
                ((at_low, low_wall), (at_high, low_wall + 1))
            } else {
                ((at_high, low_wall + 1), (at_low, low_wall))
            };
            if near.0 > entry_t {
                (entry_t, entry_wall) = near;
            }
            if far.0 < exit_t {
                (exit_t, exit_wall) = far;
            }
        }
        let meets = entry_t < exit_t && entry_t.is_finite() && exit_t.is_finite();
        if !meets {
            return None;
        }
        let (entry, entry_bytes) = cell_at(frame, entry_wall, from + along * entry_t);
        let (exit, exit_bytes) = cell_at(frame, exit_wall, from + along * exit_t);
        Some(LineHit {
            pair: CellPair { entry, exit },
            coords: RayCoords([entry_bytes[0], entry_bytes[1], exit_bytes[0], exit_bytes[1]]),
            entry_t: entry_t / scale,
            exit_t: exit_t / scale,
        })
    }
}

/// Returns a world point in steps.
///
/// A point that may be a stored ray's entry or exit point, rounded to world coordinates, becomes
/// exactly that point. Otherwise the slope of a grazing ray multiplies the rounding error, and
/// moves the ray's other end by many byte positions.
fn snap_to_stored(frame: StepMap, world: DVec3) -> DVec3 {
    let steps = frame.to_steps(world);
    let uncertainty = frame.uncertainty(world);
    for axis in 0..3 {
        let wall = if steps[axis] < 0.5 * frame.size[axis] { 0.0 } else { frame.size[axis] };
        if (steps[axis] - wall).abs() > uncertainty[axis] {
            continue;
        }
        let mut snapped = steps.floor() + DVec3::splat(0.5);
        snapped[axis] = wall;
        if (snapped - steps).abs().cmple(uncertainty).all() {
            return snapped;
        }
    }
    steps
}

/// Returns the cell and byte position of a point on a wall. The point is in steps.
fn cell_at(frame: StepMap, wall: u8, point: DVec3) -> (CellIndex, [u8; 2]) {
    let (u, v) = wall_directions(wall);
    // Rounding may put a point just outside. Below 0 the conversion saturates.
    let step = |axis: usize| (point[axis] as u32).min(frame.size[axis] as u32 - 1);
    let (su, sv) = (step(u), step(v));
    (CellIndex { wall, u: (su >> 8) as u16, v: (sv >> 8) as u16 }, [su as u8, sv as u8])
}
