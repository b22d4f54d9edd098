//! Z-buffer, tile by tile (Walter et al. 2002, §3.2): of the points that fall into a pixel, the nearest.
//!
//! Always true: a pixel shows the nearest of its fresh points, else the nearest of the others; of equals, the first in the cache.

use super::parallel::{self, bands};
use super::planes::Planes;
use super::points::Points;
use super::prefetch::prefetch;
use super::project::{Buckets, Record, TILE};
use super::shared::as_atomic;
use std::sync::atomic::Ordering::Relaxed;

/// Frames after which a tile says again which of its points are hidden. Said every frame, it took a third of the z-buffer's time, and
/// points live for tens of frames.
const TURNS: usize = 8;
/// Records of a cache line.
const LINE: usize = 4;
/// Farther than any point; the lower half says which of the records it is.
const FARTHEST: u64 = (u32::MAX as u64) << 32;

/// Rows of the point image that one thread fills, whole rows of tiles.
struct Band<'a> {
    first_tile_row: usize,
    colour: &'a mut [u32],
    depth: &'a mut [u32],
    slot: &'a mut [u32],
    age: &'a mut [u8],
}

/// Fills the point image: colour, depth, point and age of every pixel.
///
/// Points that no pixel shows are marked as hidden, those of one tile in [`TURNS`] each `frame`.
pub(super) fn fill(buckets: &Buckets, planes: &mut Planes, points: &mut Points, threads: usize, frame: u32) {
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
    let records = buckets.records();
    let nothing = records.len() as u64 - 1;
    let is_hidden = as_atomic(&mut points.is_hidden);
    parallel::for_each(parts.collect(), |mut band: Band| {
        let mut nearest = [FARTHEST; TILE * TILE];
        for (row, tile_row) in (0..band.colour.len() / width).step_by(TILE).zip(band.first_tile_row..) {
            for tile_column in 0..buckets.tiles.0 {
                let tile = tile_row * buckets.tiles.0 + tile_column;
                nearest.fill(FARTHEST | nothing);
                let mut chain = buckets.chain(tile).peekable();
                while let Some(chunk) = chain.next() {
                    records[chain.peek().cloned().unwrap_or_default()].iter().step_by(LINE).for_each(prefetch);
                    for (record, at) in records[chunk.clone()].iter().zip(chunk.start as u64..) {
                        let pixel = &mut nearest[record.pixel_and_age as usize % (TILE * TILE)];
                        // No branch: whether a pixel has a nearer point already cannot be guessed.
                        *pixel = (*pixel).min(u64::from(record.depth) << 32 | at);
                    }
                }
                band.show(&nearest, records, row, tile_column * TILE, width);
                if (tile_row + tile_column + frame as usize).is_multiple_of(TURNS) {
                    let all = buckets.chain(tile).flat_map(|chunk| &records[chunk]);
                    all.for_each(|record| is_hidden[record.slot as usize].store(1, Relaxed));
                    let seen = nearest.iter().map(|&key| records[key as u32 as usize].slot);
                    seen.for_each(|slot| is_hidden[slot as usize].store(0, Relaxed));
                }
            }
        }
    });
}

impl Band<'_> {
    /// Copies what a tile's pixels show to the planes. A pixel without a point shows the entry after the last.
    fn show(&mut self, nearest: &[u64; TILE * TILE], records: &[Record], row: usize, column: usize, width: usize) {
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
                *depth = record.depth;
                *slot = record.slot;
                *age = (record.pixel_and_age >> 16) as u8;
            }
        }
    }
}
