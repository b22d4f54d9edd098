//! Sums of squares over ever wider neighbourhoods (à-trous).

use super::Sum;
use crate::planes::{Difference, Square, SquareLayout, Weights};

/// Returns the sums of all scales, from the squares' own sums to the widest. A difference lowers
/// the weights.
pub(super) fn all(
    layout: &SquareLayout,
    of_squares: Sum,
    weights: &[Weights],
    lowered_by: Option<Difference>,
) -> Vec<Sum> {
    let mut scales = vec![of_squares];
    for (scale, weights) in weights.iter().enumerate() {
        scales.push(layout.widened(&scales[scale], 1 << scale, weights, lowered_by));
    }
    scales
}

/// Returns sums in which every other square is 0, and those in which the other squares are.
pub(super) fn halves(layout: &SquareLayout, of_squares: &Sum) -> [Sum; 2] {
    [0, 1].map(|half| {
        let is_in_half = |at: Square| (at.row + at.column) % 2 == half;
        layout.planes(|at| if is_in_half(at) { of_squares.at(at) } else { [0.0; 5] })
    })
}

/// Returns the sums of all scales. Each half of the squares has a difference of its own.
pub(super) fn by_halves(
    layout: &SquareLayout,
    of_squares: &Sum,
    weights: &[Weights],
    [even, odd]: [Option<Difference>; 2],
) -> Vec<Sum> {
    let [of_even, of_odd] = halves(layout, of_squares);
    both(layout, &all(layout, of_even, weights, even), &all(layout, of_odd, weights, odd))
}

/// Returns the sums of both halves, for each scale.
pub(super) fn both(layout: &SquareLayout, even: &[Sum], odd: &[Sum]) -> Vec<Sum> {
    let added = |(even, odd): (&Sum, &Sum)| {
        layout.planes(|at| {
            let (mut sum, more) = (even.at(at), odd.at(at));
            sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
            sum
        })
    };
    even.iter().zip(odd).map(added).collect()
}
