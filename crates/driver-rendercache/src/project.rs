//! Projection and tile sort (Walter et al. 2002, §3.2).
//!
//! Every point goes to its pixel, in a bucket for its tile of the picture. The z-buffer of one tile
//! fits in the processor's cache.
//!
//! Records carry colour and age. Fetched later by slot, they would come from anywhere in the cache
//! of points (docs/notes/render-cache.md).

use std::ops::Range;

use holo_cpu::{Isa, Kernel};
use rayon::prelude::*;

use crate::map::Map;
use crate::points::{BLOCK, EMPTY, Points};

/// Tiles of a picture, about. A tile is some whole rows.
const TILES: usize = 64;
/// Pixels of a tile, unless a single row has more: 256 kB and 1 MB of z-buffer.
const LEAST_PIXELS: usize = 1 << 14;
const MOST_PIXELS: usize = 1 << 16;

/// Parts of the points, each of which has buckets of its own that one thread fills.
const PARTS: usize = 8;

/// A point that falls into the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Record {
    /// The least key of a pixel's points is that of the nearest fresh one, else of the nearest one;
    /// of equally near ones, of the first in the cache.
    pub key: u64,
    pub colour: u32,
    /// Age in the lowest 8 bits, the number of the pixel in its tile above.
    about: u32,
}

const _: () = assert!(size_of::<Record>() == 16);

impl Record {
    /// No point.
    pub const NONE: Self = Self { key: u64::MAX, colour: crate::colour::NONE, about: 0 };
    /// In a key: the point is not a sample of the current view.
    const OLD: u64 = 1 << 63;

    /// Returns the slot, in 32 bits.
    pub fn slot(&self) -> u32 {
        self.key as u32
    }

    /// Returns the depth: negative if the point is not a sample of the current view.
    pub fn depth(&self) -> f32 {
        f32::from_bits((self.key >> 32) as u32)
    }

    /// Returns the number of the pixel in its tile.
    pub fn pixel(&self) -> usize {
        (self.about >> 8) as usize
    }

    pub fn age(&self) -> u8 {
        self.about as u8
    }
}

/// Records by tile.
#[derive(Debug)]
pub(crate) struct Buckets {
    /// The records of each part of the points, by tile.
    parts: Vec<Vec<Vec<Record>>>,
    /// Slots of a part.
    part_length: usize,
    /// Rows of a tile: a power of two.
    pub tile_rows: usize,
}

impl Buckets {
    pub fn new((width, height): (usize, usize), capacity: usize) -> Self {
        let pixels = (width * height / TILES).clamp(LEAST_PIXELS, MOST_PIXELS);
        let tile_rows = 1 << (pixels / width).max(1).ilog2();
        let tiles = height.div_ceil(tile_rows);
        let part_length = capacity.div_ceil(PARTS).next_multiple_of(BLOCK);
        let parts = capacity.div_ceil(part_length);
        Self { parts: vec![vec![Vec::new(); tiles]; parts], part_length, tile_rows }
    }

    /// Sorts all points that fall into the picture into the buckets of their tiles.
    pub fn fill(&mut self, points: &Points, map: &Map, size: (usize, usize)) {
        let (length, shift) = (self.part_length, self.tile_rows.ilog2());
        self.parts.par_iter_mut().enumerate().for_each(|(part, tiles)| {
            tiles.iter_mut().for_each(Vec::clear);
            let slots = part * length..((part + 1) * length).min(points.capacity());
            each_seen(points, slots, map, size, |slot, column, row, depth| {
                let tile = row >> shift;
                let pixel = (row - (tile << shift)) * size.0 + column;
                let old = if points.is_fresh[slot] { 0 } else { Record::OLD };
                tiles[tile].push(Record {
                    key: old | u64::from(depth.to_bits()) << 32 | slot as u64,
                    colour: points.colour[slot],
                    about: (pixel as u32) << 8 | u32::from(points.age[slot]),
                });
            });
        });
    }

    /// Returns the records of a tile, in some lists.
    pub fn tile(&self, tile: usize) -> impl Iterator<Item = &Vec<Record>> {
        self.parts.iter().map(move |tiles| &tiles[tile])
    }
}

/// Calls `seen` with slot, column, row and depth of every point that falls into a picture of
/// `size` pixels. `slots` begins and ends at multiples of [`BLOCK`].
#[inline(always)]
pub(crate) fn each_seen(
    points: &Points,
    slots: Range<usize>,
    map: &Map,
    size: (usize, usize),
    mut seen: impl FnMut(usize, usize, usize, f32),
) {
    let isa = Isa::best();
    let mut block = Block { place: [[0.0; BLOCK]; 3], pixel: [[0; BLOCK]; 2] };
    let mut inside = [0; BLOCK];
    for first in slots.step_by(BLOCK) {
        isa.run(Project { points, first, map, size, block: &mut block });
        let Block { place: [_, _, depths], pixel: [columns, rows] } = &block;
        // First a list of those inside, without branches: processors cannot foretell which they
        // are.
        let mut count = 0;
        for (i, &depth) in depths.iter().enumerate() {
            inside[count] = i;
            count += usize::from(depth > 0.0);
        }
        for &i in &inside[..count] {
            seen(first + i, columns[i] as usize, rows[i] as usize, depths[i]);
        }
    }
}

/// Some points as a picture shows them.
struct Block {
    /// Column, row and depth; depth 0 outside the picture.
    place: [[f32; BLOCK]; 3],
    /// Whole columns and rows.
    pixel: [[u32; BLOCK]; 2],
}

/// Projects the points from slot `first` on into a picture of `size` pixels.
struct Project<'a> {
    points: &'a Points,
    first: usize,
    map: &'a Map,
    size: (usize, usize),
    block: &'a mut Block,
}

impl Kernel for Project<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { points, first, map, size, block: Block { place, pixel } } = self;
        let axis = |axis: usize| &points.position[axis].as_chunks().0[first / BLOCK];
        map.project_all([axis(0), axis(1), axis(2)], place);
        let ages: &[u8; BLOCK] = &points.age.as_chunks().0[first / BLOCK];
        let (right, bottom) = (size.0 as f32, size.1 as f32);
        let ([columns, rows, depths], [whole_columns, whole_rows]) = (place, pixel);
        for i in 0..BLOCK {
            let (column, row) = (columns[i], rows[i]);
            let is_inside = (column >= 0.0) & (column < right) & (row >= 0.0) & (row < bottom);
            depths[i] = if is_inside & (ages[i] != EMPTY) { depths[i] } else { 0.0 };
            (whole_columns[i], whole_rows[i]) = (whole(column), whole(row));
        }
    }
}

/// Returns the whole part of a number from 0 to 2²².
///
/// A cast would do, but it also handles NaN and infinities, and so is not compiled for many numbers
/// at a time.
#[inline(always)]
fn whole(number: f32) -> u32 {
    /// From here on there are no fractions, and the mantissa is the number above it.
    const LARGE: f32 = 8_388_608.0;
    let nearest = (number + LARGE) - LARGE;
    let whole = if nearest > number { nearest - 1.0 } else { nearest };
    (whole + LARGE).to_bits() & 0x7f_ffff
}
