//! Sums of squares over ever wider neighbourhoods (à-trous).

use super::sums::Sum;
use crate::planes::{Difference, Square, SquareLayout, Weights};

/// Returns the sums of all scales, from the squares' own sums to the widest.
pub(super) fn all(layout: &SquareLayout, of_squares: Sum, weights: &[Weights]) -> Vec<Sum> {
    let mut scales = vec![of_squares];
    for (scale, weights) in weights.iter().enumerate() {
        scales.push(layout.widened(&scales[scale], 1 << scale, weights, None));
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
///
/// Both halves go from scale to scale together, so that only one scale of each takes memory.
pub(super) fn by_halves(
    layout: &SquareLayout,
    of_squares: &Sum,
    weights: &[Weights],
    lowered_by: [Option<Difference>; 2],
) -> Vec<Sum> {
    let mut of_halves = halves(layout, of_squares);
    let mut scales = vec![of_squares.clone()];
    for (scale, weights) in weights.iter().enumerate() {
        for (half, by) in of_halves.iter_mut().zip(lowered_by) {
            *half = layout.widened(half, 1 << scale, weights, by);
        }
        let of_halves = of_halves.each_ref();
        scales.push(layout.planes(|at| added(of_halves, at)));
    }
    scales
}

/// Returns the sums of both halves at a square.
pub(super) fn added([even, odd]: [&Sum; 2], at: Square) -> [f32; 5] {
    let (mut sum, more) = (even.at(at), odd.at(at));
    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    sum
}
