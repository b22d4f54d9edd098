//! Which beams hold samples of what is seen, besides those that the view's own rays belong to.
//!
//! Light on a diffuse surface is the same from everywhere, so all rays that end on it are worth having: some hundred times as
//! many as pass near the eye.
//!
//! Invariant: the choice is a function of the view and the sections.

use super::Voronoi;
use super::surfaces::{Seen, Surfaces};
use holo_display::{BeamSearch, End, Search, beams_ending_on};
use std::sync::Arc;

/// For walls that coincide with the section's.
const SLACK: f64 = 0.01;

impl Voronoi {
    /// Returns a search for the beams whose rays may end on what the view sees. `None` if it sees
    /// nothing.
    pub fn surface_beams(&self, search: Search) -> Option<BeamSearch> {
        let (sections, points) = (Arc::clone(&self.sections), self.points());
        (!points.is_empty()).then(|| -> BeamSearch {
            Box::new(move || beams_ending_on(&sections, &points, SLACK, search))
        })
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
