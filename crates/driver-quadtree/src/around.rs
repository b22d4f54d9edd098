//! The leaves around the pixels of a tile, laid out in rows of numbers: one for each pixel of a row.

use super::paint::TILE;
use super::surface::Surface;

/// A number for each pixel of a row of a tile.
pub(super) type Row = [f32; TILE];

/// The leaves that a row of pixels is read from: of each pixel, one.
#[derive(Clone, Copy)]
pub(super) struct Leaves {
    pub weight: Row,
    pub weight_squared: Row,
    pub mean: [Row; 4],
    pub first: [i32; TILE],
    pub last: [i32; TILE],
    /// Whether the leaf has several surfaces that may be read from (0: no), of which this is one.
    pub many: [u32; TILE],
}

pub(super) const NO_LEAVES: Leaves = Leaves {
    weight: [0.0; TILE],
    weight_squared: [0.0; TILE],
    mean: [[0.0; TILE]; 4],
    first: [0; TILE],
    last: [0; TILE],
    many: [0; TILE],
};

impl Leaves {
    #[inline(always)]
    pub fn set(&mut self, at: usize, surface: Option<&Surface>, many: bool) {
        self.many[at] = u32::from(many);
        if let Some(surface) = surface {
            self.weight[at] = surface.weight;
            self.weight_squared[at] = surface.weight_squared_of_shown();
            self.mean.iter_mut().zip(surface.mean).for_each(|(mean, own)| mean[at] = own);
            (self.first[at], self.last[at]) =
                (i32::from(surface.bins.first), i32::from(surface.bins.last));
        } else {
            // Of no weight, so any finite mean does.
            (self.weight[at], self.weight_squared[at]) = (0.0, 0.0);
            self.mean.iter_mut().for_each(|mean| mean[at] = 0.0);
        }
    }

    /// Of these leaves of a level, from the one before the first of a tile on: those that the pixels lie in, and those beside them, as
    /// [`Neighbours`] counts them for a tile's first pixel.
    #[inline(always)]
    pub fn pair(&self, first: usize, level: usize) -> Pair {
        // Sizes that are known make them moves of whole rows: place by place they took a quarter of the time of finding colours.
        match level {
            1 => self.moved(Small::<2>),
            2 => self.moved(Small::<4>),
            3 => self.moved(Small::<8>),
            4 => self.moved(Small::<TILE>),
            // All pixels lie in one half of one leaf.
            _ => self.moved(Large { beside: if first & (1 << (level - 1)) == 0 { 0 } else { 2 } }),
        }
    }

    #[inline(always)]
    fn moved(&self, moves: impl Moves) -> Pair {
        let mut pair = Pair { own: NO_LEAVES, beside: NO_LEAVES };
        let Pair { own, beside } = &mut pair;
        moves.row(&self.weight, &mut own.weight, &mut beside.weight);
        moves.row(&self.weight_squared, &mut own.weight_squared, &mut beside.weight_squared);
        for (from, (own, beside)) in self.mean.iter().zip(own.mean.iter_mut().zip(&mut beside.mean))
        {
            moves.row(from, own, beside);
        }
        moves.row(&self.first, &mut own.first, &mut beside.first);
        moves.row(&self.last, &mut own.last, &mut beside.last);
        moves.row(&self.many, &mut own.many, &mut beside.many);
        pair
    }
}

/// How a row of leaves becomes those that pixels lie in and those beside them.
trait Moves: Copy {
    fn row<T: Copy>(self, from: &[T; TILE], own: &mut [T; TILE], beside: &mut [T; TILE]);
}

/// Leaves of so many pixels, of which a tile holds some whole ones.
#[derive(Clone, Copy)]
struct Small<const SIZE: usize>;

impl<const SIZE: usize> Moves for Small<SIZE> {
    #[inline(always)]
    fn row<T: Copy>(self, from: &[T; TILE], own: &mut [T; TILE], beside: &mut [T; TILE]) {
        for at in 0..TILE / SIZE {
            own[at * SIZE..][..SIZE].fill(from[at + 1]);
            beside[at * SIZE..][..SIZE / 2].fill(from[at]);
            beside[at * SIZE + SIZE / 2..][..SIZE / 2].fill(from[at + 2]);
        }
    }
}

/// Leaves of which one holds the tile, in one of its halves.
#[derive(Clone, Copy)]
struct Large {
    beside: usize,
}

impl Moves for Large {
    #[inline(always)]
    fn row<T: Copy>(self, from: &[T; TILE], own: &mut [T; TILE], beside: &mut [T; TILE]) {
        own.fill(from[1]);
        beside.fill(from[self.beside]);
    }
}

/// Of one row of leaves, those that the pixels of a row lie in, and those beside them.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    pub own: Leaves,
    pub beside: Leaves,
}

/// Which leaves the pixels of a row or column are read from, counted from the one before the first, and their bilinear weights.
pub(super) struct Neighbours {
    pub own: [usize; TILE],
    pub beside: [usize; TILE],
    pub weights: [Row; 2],
}

impl Neighbours {
    #[inline(always)]
    pub fn new(first: usize, level: usize) -> Self {
        let size = 1_usize << level;
        let mut neighbours = Self { own: [0; TILE], beside: [0; TILE], weights: [[0.0; TILE]; 2] };
        for at in 0..TILE {
            let pixel = first + at;
            let offset = (2 * (pixel & (size - 1)) + 1) as f32 / (2 * size) as f32 - 0.5;
            let own = (pixel >> level) - (first >> level) + 1;
            neighbours.own[at] = own;
            neighbours.beside[at] = if offset < 0.0 { own - 1 } else { own + 1 };
            neighbours.weights[0][at] = 1.0 - offset.abs();
            neighbours.weights[1][at] = offset.abs();
        }
        neighbours
    }
}
