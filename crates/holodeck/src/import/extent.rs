//! The section that suits captured rays, if none is stated.
//!
//! Invariant: all eyes are inside.

use anyhow::{Context, Result};
use glam::DVec3;
use holo_server::CapturedRay;

use crate::config::SectionTable;

/// Share of the points beyond each side of the box: stray depths, and views through doors.
const BEYOND: f64 = 0.01;

/// Points count as at most this multiple of their median distance away, so that the view out of a
/// window makes no room larger.
const FARTHEST: f64 = 4.0;

/// Margin of the box, as a share of its diagonal.
const MARGIN: f64 = 0.01;

/// Least side of the box, as a share of its diagonal.
const FLATTEST: f64 = 0.05;

/// Collects rays, of which it keeps some.
#[derive(Default)]
pub struct RayExtent {
    eyes: Vec<DVec3>,
    /// Rays that hit something.
    hits: Vec<CapturedRay>,
}

impl RayExtent {
    /// Adds a ray.
    pub fn add(&mut self, ray: CapturedRay) {
        // Nearly all rays of a panorama have one eye.
        if self.eyes.last() != Some(&ray.eye) {
            self.eyes.push(ray.eye);
        }
        if ray.distance.is_finite() {
            self.hits.push(ray);
        }
    }

    /// Returns a box around all eyes and nearly everything near that they saw, with sides along the
    /// axes.
    ///
    /// # Errors
    /// If no ray has hit anything.
    pub fn section(mut self) -> Result<SectionTable> {
        let middle = self.hits.len() / 2;
        let by_distance = |a: &CapturedRay, b: &CapturedRay| a.distance.total_cmp(&b.distance);
        let median = (middle < self.hits.len())
            .then(|| self.hits.select_nth_unstable_by(middle, by_distance).1.distance)
            .context(
                "every pixel shows the sky, so no section suits them: state one (--section)",
            )?;
        let end = |ray: &CapturedRay| ray.eye + ray.direction * ray.distance.min(FARTHEST * median);
        let ends: Vec<DVec3> = self.hits.iter().map(end).collect();
        let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            let mut along: Vec<f64> = ends.iter().map(|end| end[axis]).collect();
            let eyes = self.eyes.iter().map(|eye| eye[axis]);
            low[axis] = { eyes.clone() }.fold(quantile(&mut along, BEYOND), f64::min);
            high[axis] = eyes.fold(quantile(&mut along, 1.0 - BEYOND), f64::max);
        }
        let diagonal = low.distance(high);
        let lacking = (DVec3::splat(FLATTEST * diagonal) - (high - low)).max(DVec3::ZERO);
        let grown = lacking / 2.0 + DVec3::splat(MARGIN * diagonal);
        let (low, sides) = (low - grown, high - low + 2.0 * grown);
        let axes = [DVec3::X * sides.x, DVec3::Y * sides.y, DVec3::Z * sides.z];
        Ok(SectionTable {
            name: None,
            origin: low.to_array(),
            axes: axes.map(|axis| axis.to_array()),
            grid: None,
            exterior: false,
            geometry: None,
            portals: None,
        })
    }
}

/// Returns the value below which this share of the values lies.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = ((values.len() - 1) as f64 * share).round() as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays from a place in a room of 6 × 4 × 3 to its walls. Every 200th leaves it by a window.
    fn room(eye: DVec3) -> impl Iterator<Item = CapturedRay> {
        (0..4000).map(move |number| {
            let unit = |salt: f64| (f64::from(number) * salt).fract() - 0.5;
            let direction = DVec3::new(unit(0.618034), unit(0.414214), unit(0.732051)).normalize();
            let room = DVec3::new(6.0, 4.0, 3.0);
            let walls = (0..3).map(|axis| {
                let wall = if direction[axis] > 0.0 { room[axis] } else { 0.0 };
                (wall - eye[axis]) / direction[axis]
            });
            let wall = walls.fold(f64::INFINITY, f64::min);
            let distance = if number % 200 == 0 { 1e5 } else { wall };
            CapturedRay { eye, direction, distance, radiance: [1.0; 3] }
        })
    }

    #[test]
    fn a_room_is_found_and_what_is_seen_out_of_its_window_makes_it_no_larger() {
        let mut extent = RayExtent::default();
        let eyes = [DVec3::new(1.0, 2.0, 1.6), DVec3::new(5.0, 2.0, 1.6)];
        eyes.into_iter().flat_map(room).for_each(|ray| extent.add(ray));
        let section = extent.section().unwrap();
        let found = DVec3::from_array(section.origin);
        let sides = [section.axes[0][0], section.axes[1][1], section.axes[2][2]];
        let margin = 0.02 * DVec3::new(6.0, 4.0, 3.0).length();
        assert!(found.abs().max_element() < margin, "{found}");
        for (side, room) in sides.into_iter().zip([6.0, 4.0, 3.0]) {
            assert!((room..room + 2.0 * margin).contains(&side), "{side} {room}");
        }
    }

    #[test]
    fn eyes_are_inside_even_if_all_they_saw_is_on_one_side() {
        let mut extent = RayExtent::default();
        for number in 0..100 {
            let direction = DVec3::new(1.0, 0.001 * f64::from(number), 0.0).normalize();
            let (eye, radiance) = (DVec3::ZERO, [1.0; 3]);
            extent.add(CapturedRay { eye, direction, distance: 4.0, radiance });
        }
        let section = extent.section().unwrap();
        let high = |axis: usize| section.origin[axis] + section.axes[axis][axis];
        assert!((0..3).all(|axis| section.origin[axis] < 0.0 && high(axis) > 0.0), "{section:?}");
        assert!(section.axes[2][2] >= 0.05 * 4.0, "it has a height");
        let mut sky = RayExtent::default();
        let (eye, direction, radiance) = (DVec3::ZERO, DVec3::Z, [1.0; 3]);
        sky.add(CapturedRay { eye, direction, distance: f64::INFINITY, radiance });
        assert!(sky.section().unwrap_err().to_string().contains("--section"));
    }
}
