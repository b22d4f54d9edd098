//! Which beams hold samples of what is seen, besides those that the view's own rays belong to.
//!
//! Light on diffuse surfaces is the same from everywhere; where it is not, drawing finds out and does without
//! ([`wide`](super::wide)).
//!
//! Invariant: the choice is a function of the view, the sections and the samples so far, not of their order.

use super::Quadtree;
use crate::ending::{End, beams_ending_on};
use holo_section::BeamId;

/// One point is taken from each square of so many pixels a side.
const APART: usize = 4;
/// Depths are known to 1.6 %, and walls may coincide with the section's.
const SLACK: f64 = 0.04;

impl Quadtree {
    /// Beams whose rays may end on what the picture shows, ordered by section and beam, each once. None while nothing is shown.
    ///
    /// Takes a drawing and some 20 ms for each section: to be asked once, when the view's own samples are here.
    pub fn surface_beams(&self) -> Vec<(u16, BeamId)> {
        beams_ending_on(&self.sections, &self.points(), SLACK)
    }

    /// Points of the scene that the picture shows, spread over it.
    fn points(&self) -> Vec<End> {
        let depth = self.draw().depth;
        let width = self.size.0 as usize;
        let shown = self.middles().zip(depth).enumerate().filter_map(|(pixel, ((eye, along), depth))| {
            let apart = (pixel % width).is_multiple_of(APART) && (pixel / width).is_multiple_of(APART);
            (apart && depth > 0.0 && depth.is_finite())
                .then(|| End { point: eye + along * f64::from(depth), normal: None })
        });
        shown.collect()
    }
}
