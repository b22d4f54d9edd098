//! Z-buffer, tile by tile (Walter et al. 2002, §3.2): of the points that fall into a pixel, the nearest.
//!
//! Always true: a pixel shows the nearest of its fresh points, else the nearest of the others; of equals, the first in the cache.

use super::parallel::{self, bands};
use super::planes::Planes;
use super::points::{HIDDEN, Points};
use super::project::{Buckets, TILE};
use super::shared::as_atomic;
use std::sync::atomic::Ordering::Relaxed;

/// Farther than any point, at record 0.
const EMPTY: u64 = (u32::MAX as u64) << 32;

/// Rows of the point image that one thread fills, whole rows of tiles.
struct Band<'a> {
    first_tile_row: usize,
    colour: &'a mut [u32],
    depth: &'a mut [u32],
    slot: &'a mut [u32],
    age: &'a mut [u8],
}

/// Fills the point image: colour, depth, point and age of every pixel. Points that lose are marked as hidden.
pub(super) fn fill(buckets: &Buckets, planes: &mut Planes, points: &mut Points, threads: usize) {
    let (width, height) = planes.size;
    let rows = bands(height, TILE, threads);
    let lengths = || rows.iter().map(|rows| rows.len() * width);
    let colour = parallel::cut(&mut planes.colour, lengths());
    let depth = parallel::cut(&mut planes.depth, lengths());
    let slot = parallel::cut(&mut planes.slot, lengths());
    let age = parallel::cut(&mut planes.age, lengths());
    let parts = rows.iter().zip(colour).zip(depth).zip(slot).zip(age);
    let parts = parts.map(|((((rows, colour), depth), slot), age)| Band {
        first_tile_row: rows.start / TILE,
        colour,
        depth,
        slot,
        age,
    });
    let mapped = as_atomic(&mut points.mapped);
    parallel::for_each(parts.collect(), |mut band: Band| {
        let mut nearest = [EMPTY; TILE * TILE];
        for (row, tile_row) in (0..band.colour.len() / width).step_by(TILE).zip(band.first_tile_row..) {
            for tile_column in 0..buckets.tiles.0 {
                nearest.fill(EMPTY);
                let tile = tile_row * buckets.tiles.0 + tile_column;
                buckets.chain(tile).for_each(|range| {
                    for at in range {
                        let record = &buckets.records[at];
                        let pixel = &mut nearest[record.pixel_and_age as usize % (TILE * TILE)];
                        let key = u64::from(record.key) << 32 | at as u64;
                        let loser = (*pixel).max(key) as u32;
                        *pixel = (*pixel).min(key);
                        // Of a pixel's first point the loser is record 0, which names no point but the entry after the last.
                        mapped[buckets.records[loser as usize].slot as usize].store(HIDDEN, Relaxed);
                    }
                });
                band.show(&nearest, &buckets.records, row, tile_column * TILE, width);
            }
        }
    });
}

impl Band<'_> {
    /// Copies what a tile's pixels show to the planes.
    fn show(
        &mut self,
        nearest: &[u64; TILE * TILE],
        records: &[super::project::Record],
        row: usize,
        column: usize,
        width: usize,
    ) {
        let columns = TILE.min(width - column);
        let rows = TILE.min(self.colour.len() / width - row);
        for (y, nearest) in nearest.as_chunks::<TILE>().0.iter().enumerate().take(rows) {
            let at = (row + y) * width + column..(row + y) * width + column + columns;
            let colour = &mut self.colour[at.clone()];
            let depth = &mut self.depth[at.clone()];
            let slot = &mut self.slot[at.clone()];
            let age = &mut self.age[at];
            for ((((colour, depth), slot), age), key) in colour.iter_mut().zip(depth).zip(slot).zip(age).zip(nearest) {
                let record = &records[*key as u32 as usize];
                *colour = record.colour;
                *depth = record.key;
                *slot = record.slot;
                *age = (record.pixel_and_age >> 16) as u8;
            }
        }
    }
}
