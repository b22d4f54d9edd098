//! Projection and tile sort (Walter et al. 2002, §3.2).
//!
//! Every point is projected to its pixel and put into the bucket of its tile of the picture. The
//! z-buffer of one tile fits in the processor's cache.
//!
//! Records contain colour and age, because loading them later by slot would read memory in random
//! order (docs/notes/render-cache.md).

use std::ops::Range;

use holo_cpu::{Isa, Kernel};
use rayon::prelude::*;

use crate::map::Map;
use crate::points::{BLOCK, EMPTY, PointSlots};

/// Approximate number of tiles of a picture. A tile is a number of whole rows.
const TILES: usize = 64;
/// Least and largest number of pixels of a tile: 256 kB and 1 MB of z-buffer. A tile has at least
/// one row.
const LEAST_PIXELS: usize = 1 << 14;
const MOST_PIXELS: usize = 1 << 16;

/// Number of parts of the points. Each part has its own buckets, which one thread fills.
const PARTS: usize = 8;

/// A point that falls into the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProjectedPoint {
    /// Sorts the points of a pixel: samples of the current view first, then by depth, then by slot.
    /// The point with the least key is shown.
    pub key: u64,
    pub colour: u32,
    /// Age in the lowest 8 bits; above them, the number of the pixel in its tile.
    about: u32,
}

const _: () = assert!(size_of::<ProjectedPoint>() == 16);

impl ProjectedPoint {
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
    parts: Vec<Vec<Vec<ProjectedPoint>>>,
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
    pub fn fill(&mut self, points: &PointSlots, map: &Map, size: (usize, usize)) {
        let (length, shift) = (self.part_length, self.tile_rows.ilog2());
        self.parts.par_iter_mut().enumerate().for_each(|(part, tiles)| {
            tiles.iter_mut().for_each(Vec::clear);
            let slots = part * length..((part + 1) * length).min(points.capacity());
            each_seen(points, slots, map, size, |slot, column, row, depth| {
                let tile = row >> shift;
                let pixel = (row - (tile << shift)) * size.0 + column;
                let old = if points.is_fresh[slot] { 0 } else { ProjectedPoint::OLD };
                tiles[tile].push(ProjectedPoint {
                    key: old | u64::from(depth.to_bits()) << 32 | slot as u64,
                    colour: points.colour[slot],
                    about: (pixel as u32) << 8 | u32::from(points.age[slot]),
                });
            });
        });
    }

    /// Returns the records of a tile, in some lists.
    pub fn tile(&self, tile: usize) -> impl Iterator<Item = &Vec<ProjectedPoint>> {
        self.parts.iter().map(move |tiles| &tiles[tile])
    }
}

/// Calls `seen` with slot, column, row and depth of every point that falls into a picture of
/// `size` pixels. `slots` begins and ends at multiples of [`BLOCK`].
#[inline(always)]
pub(crate) fn each_seen(
    points: &PointSlots,
    slots: Range<usize>,
    map: &Map,
    size: (usize, usize),
    mut seen: impl FnMut(usize, usize, usize, f32),
) {
    let isa = Isa::best();
    let mut places = [[0.0; BLOCK]; 3];
    let mut inside = [0; BLOCK];
    for first in slots.step_by(BLOCK) {
        isa.run(Project { points, first, map, size, places: &mut places });
        let [columns, rows, depths] = &places;
        // First a list of the points inside, without branches, which processors cannot predict.
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

/// Projects [`BLOCK`] points from slot `first` on into a picture of `size` pixels. Writes columns,
/// rows and depths to `places`, with depth 0 for points outside the picture.
struct Project<'a> {
    points: &'a PointSlots,
    first: usize,
    map: &'a Map,
    size: (usize, usize),
    places: &'a mut [[f32; BLOCK]; 3],
}

impl Kernel for Project<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { points, first, map, size, places } = self;
        let axis = |axis: usize| &points.position[axis].as_chunks().0[first / BLOCK];
        map.project_all([axis(0), axis(1), axis(2)], places);
        let ages: &[u8; BLOCK] = &points.age.as_chunks().0[first / BLOCK];
        let (right, bottom) = (size.0 as f32, size.1 as f32);
        let [columns, rows, depths] = places;
        for i in 0..BLOCK {
            let (column, row) = (columns[i], rows[i]);
            let is_inside = (column >= 0.0) & (column < right) & (row >= 0.0) & (row < bottom);
            depths[i] = if is_inside & (ages[i] != EMPTY) { depths[i] } else { 0.0 };
        }
    }
}
