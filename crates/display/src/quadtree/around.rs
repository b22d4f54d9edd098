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
            self.weight_squared[at] = surface.weight_squared;
            self.mean.iter_mut().zip(surface.mean).for_each(|(mean, own)| mean[at] = own);
            (self.first[at], self.last[at]) = (i32::from(surface.bins.0), i32::from(surface.bins.1));
        } else {
            // Of no weight, so any finite mean does.
            (self.weight[at], self.weight_squared[at]) = (0.0, 0.0);
            self.mean.iter_mut().for_each(|mean| mean[at] = 0.0);
        }
    }

    /// For each pixel the leaf at the place that is given.
    #[inline(always)]
    pub fn spread(&self, places: &[usize; TILE]) -> Self {
        let mut spread = NO_LEAVES;
        for (at, place) in places.iter().map(|place| place % TILE).enumerate() {
            spread.weight[at] = self.weight[place];
            spread.weight_squared[at] = self.weight_squared[place];
            spread.mean.iter_mut().zip(&self.mean).for_each(|(to, from)| to[at] = from[place]);
            spread.first[at] = self.first[place];
            spread.last[at] = self.last[place];
            spread.many[at] = self.many[place];
        }
        spread
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
