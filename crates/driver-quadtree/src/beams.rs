//! Which beams hold samples of what is seen, besides those that the view's own rays belong to.
//!
//! Light on diffuse surfaces is the same from everywhere. Where it is not, drawing finds out and does
//! without ([`agreement`](crate::agreement)).
//!
//! Invariant: the choice is a function of the view, the sections and the set of samples so far.

use crate::Quadtree;
use holo_display::{End, beams_ending_on, beams_mostly_ending_on};
use holo_section::BeamKey;

/// Depths are known to 1.6 %, and walls of the scene may coincide with the section's.
const SLACK: f64 = 0.04;

/// Samples for each pixel of the picture that are asked for first. Many of them end elsewhere. How
/// this was chosen: docs/notes/quadtree.md.
const FIRST_SAMPLES: f64 = 2.0;

impl Quadtree {
    /// Returns the beams whose rays may end on what the picture shows, ordered by section and beam,
    /// each once. None while nothing is shown. Takes some 20 ms for each section.
    pub fn surface_beams(&self) -> Vec<BeamKey> {
        beams_ending_on(&self.sections, &self.points(), SLACK)
    }

    /// Returns the most useful of [`surface_beams`](Self::surface_beams), found in less time. A beam
    /// of a section has about `samples_per_beam(section)` stored samples; in all, the beams have two
    /// for each pixel.
    pub fn best_surface_beams(&self, samples_per_beam: impl Fn(u16) -> f64) -> Vec<BeamKey> {
        let most = FIRST_SAMPLES * self.covered.len() as f64;
        beams_mostly_ending_on(&self.sections, &self.points(), SLACK, most, samples_per_beam)
    }

    /// Returns distances from the eye of what is shown, scene units: one for each square of 4 × 4
    /// pixels in which anything is known. Takes a small part of the time of a drawing.
    pub fn depth(&self) -> Vec<f32> {
        self.depths().into_iter().map(|(.., depth)| depth).collect()
    }

    /// Returns points of the scene that the picture shows, spread over it.
    fn points(&self) -> Vec<End> {
        let point = |(column, row, depth): (usize, usize, f32)| {
            let (eye, along) = self.middle(column, row);
            End { point: eye + along * f64::from(depth), normal: None }
        };
        self.depths().into_iter().map(point).collect()
    }
}
