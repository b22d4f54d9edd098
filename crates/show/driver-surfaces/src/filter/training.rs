//! Examples that the network learns from: squares of a view, and their light by other samples.

use super::network::{INPUTS, logarithms};
use super::passes::{GeometrySums, Passes, Second};
use super::{OfSquares, SCALES};
use crate::behind::BehindPanes;
use crate::estimate::LightSums;
use crate::gather::Gathered;
use crate::light_store::LightStore;
use crate::planes::Square;
use crate::squares::Squares;
use crate::view::SurfaceView;
use holo_display::Interrupt;

/// Quantities of one scale of an example.
const OF_SCALE: usize = 4 + INPUTS;

/// Quantities of an example:
/// - the factor from light to radiance (3), and the radiance to add (3);
/// - the number of other samples, and their mean light (3);
/// - the light of the widest neighbourhood (3);
/// - for each scale except the widest, its mean light (3), 1 if it has a sample, and the logarithms
///   of the network's inputs.
pub const EXAMPLE: usize = 13 + SCALES * OF_SCALE;

impl Gathered {
    /// Returns [`EXAMPLE`] quantities of every square whose number is a multiple of `every`.
    ///
    /// Squares are left out that show no surface, lie behind a pane, or have no samples in
    /// `others`. The samples of `others` must be independent of these.
    #[must_use]
    pub fn examples(
        &self,
        (view, store): (&SurfaceView, &LightStore),
        others: &Gathered,
        every: usize,
    ) -> Vec<f32> {
        let step = self.density(view).step(true, false);
        let squares = Squares::new(|pixel| view.seen[pixel], view.size, step);
        let sums = |of: &Gathered| {
            let sum = |at| Some((&view.seen[at], of.of_all_directions(at)));
            squares.sums(view.size, sum)
        };
        let own = OfSquares { towards_eye: sums(self), from_all: None };
        let (behind, interrupt) = (BehindPanes::default(), Interrupt::default());
        let passes = Passes::new(&squares, (view, store), &own, &behind, true, &interrupt);
        let Some((passes, GeometrySums::Halves(halves))) = passes else { return Vec::new() };
        let Some(Second { scales, details, .. }) = passes.second(halves, &interrupt) else {
            return Vec::new();
        };
        let refinement = passes.refinement(&scales, &details);
        let truths = sums(others);
        let mut examples = Vec::new();
        for at in (0..squares.size.1).flat_map(|row| passes.layout.squares(row)) {
            let Square { number, .. } = at;
            let (seen, truth) = (&squares.seen[number], LightSums::new(&truths[number]));
            let is_behind = view.way(seen).pane > 0.0;
            if number % every > 0 || !seen.is_surface() || is_behind || truth.count <= 0.0 {
                continue;
            }
            let Ok(widest) = refinement.choice.widest(at, scales[SCALES].at(at)) else { continue };
            let (factor, radiance) = view.paint(seen);
            examples.extend(factor.map(|factor| factor * view.unit()));
            examples.extend(radiance);
            examples.push(truth.count);
            examples.extend(truth.mean().to_array());
            examples.extend(widest.estimate.light.to_array());
            for (number, sums) in scales[..SCALES].iter().enumerate() {
                let narrow = LightSums::from(sums.at(at));
                examples.extend(narrow.mean().to_array());
                examples.push(f32::from(u8::from(narrow.count > 0.0)));
                examples.extend(logarithms(&refinement.inputs(at, &widest, number)));
            }
        }
        examples
    }
}
