//! Projection and tile sort (Walter et al. 2002, §3.2): every point to its pixel, in buckets by
//! tile of the picture, so that a tile's part of the z-buffer stays in the processor's cache.
//!
//! Invariant: what a bucket holds does not depend on the number of threads.

use std::ops::Range;

use rayon::prelude::*;

use crate::map::Map;
use crate::planes::Key;
use crate::points::{BLOCK, EMPTY, Points};

/// Tiles of a picture, about. Tiles are whole rows.
const TILES: usize = 64;
/// Pixels of a tile, unless a single row has more: 64 kB and 512 kB of z-buffer.
const LEAST_PIXELS: usize = 1 << 13;
const MOST_PIXELS: usize = 1 << 16;

/// Parts of the points, each of which has buckets of its own that one thread fills.
const PARTS: usize = 16;

/// A point that falls into a tile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Record {
    /// Number of the pixel in its tile.
    pub pixel: u32,
    pub key: Key,
}

/// Records by tile.
#[derive(Debug)]
pub(crate) struct Buckets {
    /// Of each part of the points, of each tile.
    parts: Vec<Vec<Vec<Record>>>,
    /// Slots of a part.
    part_length: usize,
    pub tile_rows: usize,
}

impl Buckets {
    pub fn new((width, height): (usize, usize), capacity: usize) -> Self {
        let pixels = (width * height / TILES).clamp(LEAST_PIXELS, MOST_PIXELS);
        let tile_rows = (pixels / width).max(1);
        let tiles = height.div_ceil(tile_rows);
        let part_length = capacity.div_ceil(PARTS).next_multiple_of(BLOCK);
        let parts = capacity.div_ceil(part_length);
        Self { parts: vec![vec![Vec::new(); tiles]; parts], part_length, tile_rows }
    }

    /// Sorts all points that fall into the picture into the buckets of their tiles.
    pub fn fill(&mut self, points: &Points, map: &Map, size: (usize, usize)) {
        let (length, tile_rows) = (self.part_length, self.tile_rows);
        self.parts.par_iter_mut().enumerate().for_each(|(part, tiles)| {
            tiles.iter_mut().for_each(Vec::clear);
            let slots = part * length..((part + 1) * length).min(points.capacity());
            each_seen(points, slots, map, size, |slot, column, row, depth| {
                let (tile, row) = (row / tile_rows, row % tile_rows);
                let key = Key::new(depth, points.is_fresh[slot], slot);
                tiles[tile].push(Record { pixel: (row * size.0 + column) as u32, key });
            });
        });
    }

    /// Returns the records of a tile.
    pub fn tile(&self, tile: usize) -> impl Iterator<Item = &Record> {
        self.parts.iter().flat_map(move |tiles| &tiles[tile])
    }
}

/// Calls `seen` with slot, column, row and depth of every point that falls into a picture of
/// `size` pixels. `slots` begins and ends at multiples of [`BLOCK`].
#[inline(always)]
pub(crate) fn each_seen(
    points: &Points,
    slots: Range<usize>,
    map: &Map,
    (width, height): (usize, usize),
    mut seen: impl FnMut(usize, usize, usize, f32),
) {
    let (right, bottom) = (width as f32, height as f32);
    let blocks = points.position.each_ref().map(|axis| axis[slots.clone()].as_chunks::<BLOCK>().0);
    let mut found = [[0.0; BLOCK]; 3];
    for (number, first) in slots.step_by(BLOCK).enumerate() {
        map.project_all(blocks.map(|axis| &axis[number]), &mut found);
        let [columns, rows, depths] = &found;
        for i in 0..BLOCK {
            let (column, row, slot) = (columns[i], rows[i], first + i);
            // NaN is in no range.
            let is_inside = (column >= 0.0) & (column < right) & (row >= 0.0) & (row < bottom);
            if is_inside & (depths[i] > 0.0) & (points.age[slot] != EMPTY) {
                seen(slot, column as usize, row as usize, depths[i]);
            }
        }
    }
}
