//! Finds beams that the view does not cross but whose samples end on visible surfaces.
//!
//! Light on diffuse surfaces is the same from everywhere. Where it is not, drawing leaves such
//! samples out ([`agreement`](crate::agreement)).
//!
//! Invariant: the choice is a function of the view, the sections and the set of samples so far.

use crate::Quadtree;
use holo_display::{BeamSearch, Search, VisibleEnd, beams_ending_on};
use std::sync::Arc;

/// Relative slack of distances. Depths are known to 1.6 %, and walls of the scene may coincide with
/// the section's.
const SLACK: f64 = 0.04;

impl Quadtree {
    /// Returns a search for the beams whose rays may end on what the picture shows. `None` if the
    /// picture shows nothing. The search takes about 20 ms for each section.
    pub fn surface_beams(&self, search: Search) -> Option<BeamSearch> {
        let (sections, points) = (Arc::clone(&self.sections), self.points());
        (!points.is_empty()).then(|| -> BeamSearch {
            Box::new(move || beams_ending_on(&sections, &points, SLACK, search))
        })
    }

    /// Returns distances from the eye to the visible surfaces, in scene units. There is one for
    /// each square of 4 × 4 pixels with a known surface. It takes a small part of the time of a
    /// drawing.
    pub fn depth(&self) -> Vec<f32> {
        self.depths().into_iter().map(|(.., depth)| depth).collect()
    }

    /// Returns points of the scene that the picture shows, spread over it.
    fn points(&self) -> Vec<VisibleEnd> {
        let point = |(column, row, depth): (usize, usize, f32)| {
            let (eye, along) = self.middle(column, row);
            VisibleEnd { point: eye + along * f64::from(depth), normal: None }
        };
        self.depths().into_iter().map(point).collect()
    }
}
