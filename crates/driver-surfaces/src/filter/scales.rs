//! Sums of squares over ever wider neighbourhoods (à-trous).

use super::Sum;
use crate::planes::{Layout, Square, Weights};

/// Returns the sums of all scales, from the squares' own sums to the widest.
pub(super) fn all(layout: &Layout, of_squares: Sum, weights: &[Weights]) -> Vec<Sum> {
    let mut scales = vec![of_squares];
    for (scale, weights) in weights.iter().enumerate() {
        scales.push(layout.widened(&scales[scale], 1 << scale, weights));
    }
    scales
}

/// Returns sums in which every other square is 0, and those in which the other squares are.
pub(super) fn halves(layout: &Layout, of_squares: &Sum) -> [Sum; 2] {
    [0, 1].map(|half| {
        let is_in_half = |at: Square| (at.row + at.column) % 2 == half;
        layout.planes(|at| if is_in_half(at) { of_squares.at(at) } else { [0.0; 5] })
    })
}

/// Returns the sums of all scales, with weights of its own for each half of the squares.
pub(super) fn by_halves(
    layout: &Layout,
    of_squares: &Sum,
    [even, odd]: [&[Weights]; 2],
) -> Vec<Sum> {
    let [of_even, of_odd] = halves(layout, of_squares);
    both(layout, &all(layout, of_even, even), &all(layout, of_odd, odd))
}

/// Returns the sums of both halves, for each scale.
pub(super) fn both(layout: &Layout, even: &[Sum], odd: &[Sum]) -> Vec<Sum> {
    let added = |(even, odd): (&Sum, &Sum)| {
        layout.planes(|at| {
            let (mut sum, more) = (even.at(at), odd.at(at));
            sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
            sum
        })
    };
    even.iter().zip(odd).map(added).collect()
}
