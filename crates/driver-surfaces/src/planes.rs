//! Quantities of the squares of a picture, each in an array of its own, and sums over neighbours.
//! The loops work on many squares at once.
//!
//! Invariant: results do not depend on the processor, nor on the number of threads.

use crate::squares::alike_at;
use holo_cpu::{Isa, Kernel};
use rayon::prelude::*;
use std::f32::consts::SQRT_2;
use std::ops::Range;

/// The number of squares around one.
pub(crate) const AROUND: usize = 8;

/// The directions of these squares: columns and rows.
const SIDES: [(isize, isize); AROUND] =
    [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

/// Distance from an edge that counts as far, squares.
const FARTHEST: f32 = 32.0;

/// The weight of a square at each side whose surface is the same.
const KERNEL: [f32; AROUND] = [0.25, 0.5, 0.25, 0.5, 0.5, 0.25, 0.5, 0.25];

/// `N` quantities of each square. A row's values of one quantity follow each other.
#[derive(Clone)]
pub(crate) struct Planes<const N: usize> {
    width: usize,
    values: Vec<f32>,
}

/// Points (3), unit normals (3), widths and numbers of light of what squares see; all 0 where there is
/// no surface.
pub(crate) type Geometry = Planes<8>;

/// The weights of the squares around each.
pub(crate) type Weights = Planes<AROUND>;

impl<const N: usize> Planes<N> {
    /// Returns planes of this size: `fill` gets each row's number and its values, all 0.
    fn by_rows(
        (width, height): (usize, usize),
        fill: impl Fn(usize, [&mut [f32]; N]) + Sync,
    ) -> Self {
        let mut values = vec![0.0; N * width * height];
        values
            .par_chunks_mut(N * width)
            .enumerate()
            .for_each(|(y, row)| fill(y, parts(row, width)));
        Self { width, values }
    }

    /// Returns a row.
    fn row(&self, y: usize) -> [&[f32]; N] {
        let row = &self.values[N * self.width * y..][..N * self.width];
        std::array::from_fn(|plane| &row[plane * self.width..][..self.width])
    }

    /// Returns the quantities of a square.
    #[inline]
    pub fn at(&self, Square { column, row, .. }: Square) -> [f32; N] {
        std::array::from_fn(|plane| self.values[(N * row + plane) * self.width + column])
    }
}

/// A square: its number, and where it lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Square {
    pub number: usize,
    pub column: usize,
    pub row: usize,
}

/// Returns the planes of a row.
fn parts<const N: usize>(row: &mut [f32], width: usize) -> [&mut [f32]; N] {
    let mut parts = row.chunks_exact_mut(width);
    std::array::from_fn(|_| parts.next().unwrap_or_default())
}

/// A picture's squares: their number, and in each row those between which all surfaces lie.
pub(crate) struct Layout {
    pub size: (usize, usize),
    pub occupied: Vec<Range<usize>>,
}

/// A part of a row, and the squares at one side of it.
struct Stretch {
    side: usize,
    own: Range<usize>,
    /// The row of those at the side, and their columns.
    row: usize,
    other: Range<usize>,
}

impl Layout {
    /// Returns the squares of a row between which all its surfaces lie.
    pub fn squares(&self, row: usize) -> impl Iterator<Item = Square> {
        let width = self.size.0;
        let square = move |column| Square { number: row * width + column, column, row };
        self.occupied[row].clone().map(square)
    }

    /// Returns planes with what `find` returns for each square. They are 0 where no surface is.
    pub fn planes<const N: usize>(&self, find: impl Fn(Square) -> [f32; N] + Sync) -> Planes<N> {
        Planes::by_rows(self.size, |y, mut row| {
            for square in self.squares(y) {
                for (plane, value) in row.iter_mut().zip(find(square)) {
                    plane[square.column] = value;
                }
            }
        })
    }

    /// Returns the parts of a row that have squares at this distance inside the picture.
    fn stretches(&self, y: usize, distance: usize) -> impl Iterator<Item = Stretch> {
        let ((width, height), occupied) = (self.size, self.occupied[y].clone());
        SIDES.into_iter().enumerate().filter_map(move |(side, (across, down))| {
            let shift = across * distance as isize;
            let row = y.checked_add_signed(down * distance as isize).filter(|row| *row < height)?;
            let begin = occupied.start.max(shift.min(0).unsigned_abs());
            let end = occupied.end.min(width.saturating_sub(shift.max(0).unsigned_abs()));
            let at = |column: usize| column.checked_add_signed(shift);
            (begin < end).then_some(())?;
            Some(Stretch { side, own: begin..end, row, other: at(begin)?..at(end)? })
        })
    }

    /// Returns weights by geometry alone. `step` is the side of a square in pixels.
    pub fn weights(&self, geometry: &Geometry, step: usize, distance: usize) -> Weights {
        let isa = Isa::best();
        Planes::by_rows(self.size, |y, weights| {
            let here = geometry.row(y);
            for Stretch { side, own, row, other } in self.stretches(y, distance) {
                isa.run(Alike {
                    here: here.map(|plane| &plane[own.clone()]),
                    there: geometry.row(row).map(|plane| &plane[other.clone()]),
                    weights: &mut weights[side][own],
                    step: step as f32,
                    distance: distance as f32,
                    kernel: KERNEL[side],
                });
            }
        })
    }

    /// Returns the weights of all scales, each lowered by how much a value differs.
    pub fn all_weights_by(
        &self,
        weights: &[Weights],
        values: &Planes<1>,
        difference: f32,
    ) -> Vec<Weights> {
        let lowered = |(scale, weights): (usize, &Weights)| {
            self.weights_by(weights, 1 << scale, values, difference)
        };
        weights.iter().enumerate().map(lowered).collect()
    }

    /// Returns for each square the binary logarithm of 1 + its distance from an edge, in squares.
    /// `weights` are those of the squares beside each.
    pub fn edge_distances(&self, weights: &Weights) -> Planes<1> {
        let (width, height) = self.size;
        let mut distances = vec![FARTHEST; width * height];
        for square in (0..height).flat_map(|row| self.squares(row)) {
            let differs = |(weight, kernel): (f32, f32)| kernel == 0.5 && weight < 0.5 * kernel;
            if weights.at(square).into_iter().zip(KERNEL).any(differs) {
                distances[square.number] = 0.0;
            }
        }
        // Once from the top left, once from the bottom right.
        spread(&mut distances, width);
        distances.reverse();
        spread(&mut distances, width);
        distances.reverse();
        self.planes(|square| [(1.0 + distances[square.number]).log2()])
    }

    /// Returns weights lowered by how much a value differs. They are 0 where it differs by
    /// `difference`.
    pub fn weights_by(
        &self,
        weights: &Weights,
        distance: usize,
        values: &Planes<1>,
        difference: f32,
    ) -> Weights {
        let isa = Isa::best();
        Planes::by_rows(self.size, |y, by_value| {
            let ([here], before) = (values.row(y), weights.row(y));
            for Stretch { side, own, row, other } in self.stretches(y, distance) {
                isa.run(Differing {
                    here: &here[own.clone()],
                    there: &values.row(row)[0][other],
                    before: &before[side][own.clone()],
                    weights: &mut by_value[side][own],
                    difference,
                });
            }
        })
    }

    /// Returns the quantities of each square plus those of the squares around it, by weight.
    pub fn widened<const N: usize>(
        &self,
        of_squares: &Planes<N>,
        distance: usize,
        weights: &Weights,
    ) -> Planes<N> {
        let isa = Isa::best();
        Planes::by_rows(self.size, |y, mut sums| {
            let (own_row, weights) = (of_squares.row(y), weights.row(y));
            sums.iter_mut().zip(own_row).for_each(|(sums, own)| sums.copy_from_slice(own));
            for Stretch { side, own, row, other } in self.stretches(y, distance) {
                for (sums, more) in sums.iter_mut().zip(of_squares.row(row)) {
                    isa.run(Adding {
                        sums: &mut sums[own.clone()],
                        more: &more[other.clone()],
                        weights: &weights[side][own.clone()],
                    });
                }
            }
        })
    }
}

/// Lowers distances to what those of the squares before allow: to the left and above.
fn spread(distances: &mut [f32], width: usize) {
    for number in 0..distances.len() {
        let column = number % width;
        let mut least = distances[number];
        let mut through = |by: usize, length: f32| {
            if let Some(before) = number.checked_sub(by) {
                least = least.min(distances[before] + length);
            }
        };
        through(width, 1.0);
        if column > 0 {
            through(1, 1.0);
            through(width + 1, SQRT_2);
        }
        if column + 1 < width {
            through(width - 1, SQRT_2);
        }
        distances[number] = least;
    }
}

/// Weighs squares at one side by where their surfaces lie.
struct Alike<'a> {
    here: [&'a [f32]; 8],
    there: [&'a [f32]; 8],
    weights: &'a mut [f32],
    step: f32,
    distance: f32,
    kernel: f32,
}

impl Kernel for Alike<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let count = self.weights.len();
        let [x, y, z, across, down, along, width, light] = self.here.map(|plane| &plane[..count]);
        let [x2, y2, z2, across2, down2, along2, _, light2] =
            self.there.map(|plane| &plane[..count]);
        for (i, weight) in self.weights.iter_mut().enumerate() {
            let wide = width[i] * self.step;
            let kernel = if light[i] == light2[i] { self.kernel } else { 0.0 };
            *weight = kernel
                * alike_at(
                    ([x[i], y[i], z[i]], [across[i], down[i], along[i]]),
                    ([x2[i], y2[i], z2[i]], [across2[i], down2[i], along2[i]]),
                    wide,
                    8.0 * wide * self.distance,
                );
        }
    }
}

/// Weighs squares at one side by how much a value differs.
struct Differing<'a> {
    here: &'a [f32],
    there: &'a [f32],
    before: &'a [f32],
    weights: &'a mut [f32],
    difference: f32,
}

impl Kernel for Differing<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let values = self.here.iter().zip(self.there).zip(self.before);
        for (weight, ((here, there), before)) in self.weights.iter_mut().zip(values) {
            let differ = (here - there) / self.difference;
            let same = (1.0 - differ * differ).max(0.0);
            *weight = before * (same * same);
        }
    }
}

/// Adds one quantity of the squares at one side.
struct Adding<'a> {
    sums: &'a mut [f32],
    more: &'a [f32],
    weights: &'a [f32],
}

impl Kernel for Adding<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for ((sum, more), weight) in self.sums.iter_mut().zip(self.more).zip(self.weights) {
            *sum += weight * more;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_square_takes_those_around_it_inside_the_picture_by_weight() {
        let size @ (width, height) = (7, 5);
        let occupied = vec![0..7, 2..5, 0..0, 6..7, 0..7];
        let layout = Layout { size, occupied: occupied.clone() };
        let full = Layout { size, occupied: vec![0..width; height] };
        let value = |number: usize| [number as f32 + 1.0, -2.0];
        let values = full.planes(|square| value(square.number));
        let weight = |number: usize| std::array::from_fn(|side| (number * 8 + side) as f32);
        let weights = full.planes(|square| weight(square.number));
        for distance in [1, 2, 4, 64] {
            let wide = layout.widened(&values, distance, &weights);
            for square in (0..height).flat_map(|row| full.squares(row)) {
                let Square { number, column: x, row: y } = square;
                let mut expected = value(number);
                for (side, (across, down)) in SIDES.into_iter().enumerate() {
                    let shifted =
                        |at: usize, by: isize| at.checked_add_signed(by * distance as isize);
                    let (Some(x2), Some(y2)) = (shifted(x, across), shifted(y, down)) else {
                        continue;
                    };
                    if x2 < width && y2 < height && occupied[y].contains(&x) {
                        let more = value(y2 * width + x2);
                        (0..2).for_each(|n| expected[n] += weight(number)[side] * more[n]);
                    }
                }
                assert_eq!(wide.at(square), expected, "{x} {y} at {distance}");
            }
        }
    }
}
