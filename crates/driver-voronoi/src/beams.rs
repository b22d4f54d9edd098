//! Which beams hold samples of what is seen, besides those that the view's own rays belong to.
//!
//! Light on a diffuse surface is the same from everywhere, so all rays that end on it are worth having: some hundred times as
//! many as pass near the eye.
//!
//! Invariant: the choice is a function of the view and the sections.

use super::Voronoi;
use super::surfaces::{Seen, Surfaces};
use holo_display::{End, beams_ending_on, beams_mostly_ending_on};
use holo_section::BeamKey;

/// Beams that are asked for first: of a holodeck filled for a minute they hold some samples for each pixel of a small picture, and are
/// read in some hundredths of a second.
const FIRST_BEAMS: f64 = 8_000.0;

/// For walls that coincide with the section's.
const SLACK: f64 = 0.01;

impl Voronoi {
    /// Beams whose rays may end on what the view sees, ordered by section and beam, each once.
    pub fn surface_beams(&self) -> Vec<BeamKey> {
        beams_ending_on(&self.sections, &self.points(), SLACK)
    }

    /// Some of them, found in less time: those that hold most of what is of use. Ordered by section and beam, each once.
    pub fn best_surface_beams(&self) -> Vec<BeamKey> {
        beams_mostly_ending_on(&self.sections, &self.points(), SLACK, FIRST_BEAMS, |_| 1.0)
    }

    /// Surface points of the picture and their normals, in the scene.
    fn points(&self) -> Vec<End> {
        let turn = |v: glam::Vec3| {
            let v = v.as_dvec3();
            self.camera.right * v.x + self.camera.up * v.y + self.camera.forward * v.z
        };
        let points = |Surfaces { seen, images, .. }: &Surfaces| -> Vec<End> {
            let there = seen.iter().filter(|seen| !seen.is_sky());
            let place = |seen: &Seen| {
                let image = images.get(usize::from(seen.image))?;
                let (point, normal) = image.back(seen.position, seen.normal);
                Some(End { point: turn(point) + self.camera.eye, normal: Some(turn(normal)) })
            };
            there.filter_map(place).collect()
        };
        self.layers.iter().flat_map(|layer| points(&layer.surfaces)).collect()
    }
}
