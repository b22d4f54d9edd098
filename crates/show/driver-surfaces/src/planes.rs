//! Quantities of the squares of a picture, each in an array of its own, and sums over neighbours.
//! The loops work on many squares at once.
//!
//! Invariant: results depend neither on the processor nor on the number of threads.

use crate::squares::alike_at;
use holo_cpu::{Isa, Kernel};
use rayon::prelude::*;
use std::f32::consts::SQRT_2;
use std::ops::Range;

/// Number of squares around one.
pub(crate) const AROUND: usize = 8;

/// Directions to these squares: columns and rows.
const SIDES: [(isize, isize); AROUND] =
    [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

/// Greatest distance from an edge that is distinguished, squares.
const FARTHEST: f32 = 32.0;

/// Weights of the squares around one, by direction, if they show the same surface.
const KERNEL: [f32; AROUND] = [0.25, 0.5, 0.25, 0.5, 0.5, 0.25, 0.5, 0.25];

/// `N` quantities of each square. Each row of the picture is an array of its own, and stores one
/// quantity after the other. All threads take memory for their rows: the kernel clears it, which
/// takes half as long as everything else.
#[derive(Clone)]
pub(crate) struct SquarePlanes<const N: usize> {
    width: usize,
    rows: Vec<Box<[f32]>>,
}

/// Points (3), unit normals (3), widths and numbers of light of the squares' surfaces; all 0 for a
/// square without a surface.
pub(crate) type Geometry = SquarePlanes<8>;

/// Weights of the 8 squares around each square.
pub(crate) type Weights = SquarePlanes<AROUND>;

/// A quantity by which two squares may differ. It lowers their weights for each other.
#[derive(Clone, Copy)]
pub(crate) struct Difference<'a> {
    pub values: &'a SquarePlanes<1>,
    /// Difference of the values from which weights are 0.
    pub limit: f32,
}

impl<const N: usize> SquarePlanes<N> {
    /// Returns planes of this size. `fill` receives each row's number and its values, which are 0.
    fn by_rows(
        (width, height): (usize, usize),
        fill: impl Fn(usize, [&mut [f32]; N]) + Sync,
    ) -> Self {
        let row = |y: usize| {
            let mut row = vec![0.0; N * width].into_boxed_slice();
            fill(y, parts(&mut row, width));
            row
        };
        Self { width, rows: (0..height).into_par_iter().map(row).collect() }
    }

    /// Returns a row.
    fn row(&self, y: usize) -> [&[f32]; N] {
        let row = &self.rows[y];
        std::array::from_fn(|plane| &row[plane * self.width..][..self.width])
    }

    /// Returns the quantities of a square.
    #[inline]
    pub fn at(&self, Square { column, row, .. }: Square) -> [f32; N] {
        let row = &self.rows[row];
        std::array::from_fn(|plane| row[plane * self.width + column])
    }
}

/// A square: its number, and where it lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Square {
    pub number: usize,
    pub column: usize,
    pub row: usize,
}

/// Splits a row's values by quantity.
fn parts<const N: usize>(row: &mut [f32], width: usize) -> [&mut [f32]; N] {
    let mut parts = row.chunks_exact_mut(width);
    std::array::from_fn(|_| parts.next().unwrap_or_default())
}

/// The squares of a picture: their number, and the range in each row that contains all surfaces.
pub(crate) struct SquareLayout {
    pub size: (usize, usize),
    pub occupied: Vec<Range<usize>>,
}

/// A part of a row, and the squares at a distance from it in one direction.
struct Stretch {
    side: usize,
    own: Range<usize>,
    /// The row of these squares. `other` has their columns.
    row: usize,
    other: Range<usize>,
}

impl SquareLayout {
    /// Returns the squares of a row within the range that contains all its surfaces.
    pub fn squares(&self, row: usize) -> impl Iterator<Item = Square> {
        let width = self.size.0;
        let square = move |column| Square { number: row * width + column, column, row };
        self.occupied[row].clone().map(square)
    }

    /// Returns planes with the result of `find` for each square. Squares outside the occupied
    /// ranges are 0.
    pub fn planes<const N: usize>(
        &self,
        find: impl Fn(Square) -> [f32; N] + Sync,
    ) -> SquarePlanes<N> {
        SquarePlanes::by_rows(self.size, |y, mut row| {
            for square in self.squares(y) {
                for (plane, value) in row.iter_mut().zip(find(square)) {
                    plane[square.column] = value;
                }
            }
        })
    }

    /// Returns the part of a row for each direction in which squares at this distance are inside
    /// the picture.
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

    /// Returns weights by geometry, lowered by a difference. `step` is the side of a square,
    /// pixels.
    pub fn weights(
        &self,
        geometry: &Geometry,
        step: usize,
        distance: usize,
        lowered_by: Option<Difference>,
    ) -> Weights {
        let isa = Isa::best();
        SquarePlanes::by_rows(self.size, |y, weights| {
            let here = geometry.row(y);
            for Stretch { side, own, row, other } in self.stretches(y, distance) {
                let weights = &mut weights[side][own.clone()];
                isa.run(Alike {
                    here: here.map(|plane| &plane[own.clone()]),
                    there: geometry.row(row).map(|plane| &plane[other.clone()]),
                    weights,
                    step: step as f32,
                    distance: distance as f32,
                    kernel: KERNEL[side],
                });
                if let Some(difference) = lowered_by {
                    isa.run(difference.of((y, own), (row, other), weights));
                }
            }
        })
    }

    /// Returns the binary logarithm of 1 + the distance from an edge, in squares, for each square.
    /// `weights` are those at distance 1.
    pub fn edge_distances(&self, weights: &Weights) -> SquarePlanes<1> {
        let (width, height) = self.size;
        let mut distances = vec![FARTHEST; width * height];
        for square in (0..height).flat_map(|row| self.squares(row)) {
            let differs = |(weight, kernel): (f32, f32)| kernel == 0.5 && weight < 0.5 * kernel;
            if weights.at(square).into_iter().zip(KERNEL).any(differs) {
                distances[square.number] = 0.0;
            }
        }
        // One pass from the top left and one from the bottom right find all distances.
        spread(&mut distances, width);
        distances.reverse();
        spread(&mut distances, width);
        distances.reverse();
        self.planes(|square| [(1.0 + distances[square.number]).log2()])
    }

    /// Returns the quantities of each square plus the weighted quantities of the 8 squares around
    /// it. A difference lowers the weights.
    pub fn widened<const N: usize>(
        &self,
        of_squares: &SquarePlanes<N>,
        distance: usize,
        weights: &Weights,
        lowered_by: Option<Difference>,
    ) -> SquarePlanes<N> {
        let isa = Isa::best();
        SquarePlanes::by_rows(self.size, |y, mut sums| {
            let (own_row, weights) = (of_squares.row(y), weights.row(y));
            sums.iter_mut().zip(own_row).for_each(|(sums, own)| sums.copy_from_slice(own));
            let mut lowered = vec![0.0; if lowered_by.is_some() { self.size.0 } else { 0 }];
            for Stretch { side, own, row, other } in self.stretches(y, distance) {
                let mut weights = &weights[side][own.clone()];
                if let Some(difference) = lowered_by {
                    // Computing them again takes less time than storing them for all squares.
                    let lowered = &mut lowered[..weights.len()];
                    lowered.copy_from_slice(weights);
                    isa.run(difference.of((y, own.clone()), (row, other.clone()), lowered));
                    weights = lowered;
                }
                for (sums, more) in sums.iter_mut().zip(of_squares.row(row)) {
                    isa.run(Adding {
                        sums: &mut sums[own.clone()],
                        more: &more[other.clone()],
                        weights,
                    });
                }
            }
        })
    }
}

impl<'a> Difference<'a> {
    /// Returns what lowers the weights that one stretch of squares has for another. A stretch is a
    /// row and its columns.
    fn of<'w>(
        &self,
        (row, own): (usize, Range<usize>),
        (other_row, other): (usize, Range<usize>),
        weights: &'w mut [f32],
    ) -> Lowering<'w>
    where
        'a: 'w,
    {
        let ([here], [there]) = (self.values.row(row), self.values.row(other_row));
        Lowering { here: &here[own], there: &there[other], weights, limit: self.limit }
    }
}

/// Lowers each distance to what the squares to the left and above allow.
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

/// Computes weights of the squares in one direction by the places of their surfaces.
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

/// Lowers weights of the squares in one direction by the difference of a value.
struct Lowering<'a> {
    here: &'a [f32],
    there: &'a [f32],
    weights: &'a mut [f32],
    limit: f32,
}

impl Kernel for Lowering<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let values = self.here.iter().zip(self.there);
        for (weight, (here, there)) in self.weights.iter_mut().zip(values) {
            let differ = (here - there) / self.limit;
            let same = (1.0 - differ * differ).max(0.0);
            *weight *= same * same;
        }
    }
}

/// Adds one quantity of the squares in one direction, by weight.
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
    fn a_square_is_widened_by_weighted_squares_inside_the_picture() {
        let size @ (width, height) = (7, 5);
        let occupied = vec![0..7, 2..5, 0..0, 6..7, 0..7];
        let layout = SquareLayout { size, occupied: occupied.clone() };
        let full = SquareLayout { size, occupied: vec![0..width; height] };
        let value = |number: usize| [number as f32 + 1.0, -2.0];
        let values = full.planes(|square| value(square.number));
        let weight = |number: usize| std::array::from_fn(|side| (number * 8 + side) as f32);
        let weights = full.planes(|square| weight(square.number));
        for distance in [1, 2, 4, 64] {
            let wide = layout.widened(&values, distance, &weights, None);
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
