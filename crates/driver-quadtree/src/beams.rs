//! Which beams hold samples of what is seen, besides those that the view's own rays belong to.
//!
//! Light on diffuse surfaces is the same from everywhere; where it is not, drawing finds out and does without
//! ([`wide`](super::wide)).
//!
//! Invariant: the choice is a function of the view, the sections and the samples so far, not of their order.

use super::Quadtree;
use holo_display::{End, beams_ending_on, beams_mostly_ending_on};
use holo_section::BeamId;

/// Depths are known to 1.6 %, and walls may coincide with the section's.
const SLACK: f64 = 0.04;

/// Samples that are asked for first, for each pixel of the picture: many of them end elsewhere. Of the cabin's bathroom, seen a tenth of a second before,
/// with 1, 1.5, 2, 3 and 4: 13.3, 14.0, 15.6, 14.4 and 11.9 dB, since more are not here by then; later, and in other views, they differ little.
const FIRST_SAMPLES: f64 = 2.0;

impl Quadtree {
    /// Beams whose rays may end on what the picture shows, ordered by section and beam, each once. None while nothing is shown.
    ///
    /// Takes some 20 ms for each section: to be asked once, when the view's own samples are here.
    pub fn surface_beams(&self) -> Vec<(u16, BeamId)> {
        beams_ending_on(&self.sections, &self.points(), SLACK)
    }

    /// Some of them, found in less time: those that hold most of what is of use. Ordered by section and beam, each once.
    ///
    /// `samples_of_beam(section)` is how many stored samples a beam of the section has, as far as that can be told: in all, the beams
    /// have some for each pixel.
    pub fn best_surface_beams(&self, samples_of_beam: impl Fn(u16) -> f64) -> Vec<(u16, BeamId)> {
        let most = FIRST_SAMPLES * f64::from(self.size.0) * f64::from(self.size.1);
        beams_mostly_ending_on(&self.sections, &self.points(), SLACK, most, samples_of_beam)
    }

    /// Distances from the eye of what is shown, of one in 4 × 4 pixels as far as anything is: a picture's, without drawing it.
    pub fn depth(&self) -> Vec<f32> {
        self.depths().map(|(.., depth)| depth).collect()
    }

    /// Points of the scene that the picture shows, spread over it.
    fn points(&self) -> Vec<End> {
        let point = |(column, row, depth): (u32, u32, f32)| {
            let (eye, along) = self.middle(column, row);
            End { point: eye + along * f64::from(depth), normal: None }
        };
        self.depths().map(point).collect()
    }
}
