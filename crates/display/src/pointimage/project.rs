//! Projection and tile sort (Walter et al. 2002, §3.2): every point to its pixel, in buckets by tile of the picture.
//!
//! Buckets are chains of chunks, so one pass is enough: no count beforehand, no second copy.
//!
//! Records carry colour and age: fetched later, point by point, they come from anywhere in the cache, which took longer than all
//! else in the z-buffer. A tile's z-buffer fits into the second cache many times.
//!
//! Always true: the result does not depend on the number of threads.

use super::huge::filled;
use super::isa::{Isa, Kernel};
use super::map::{Lens, Map, NEAREST};
use super::parallel;
use super::points::{FRESH, Points};
use super::prefetch::prefetch;
use super::truncate::truncate;
use std::ops::Range;

/// Pixels of a tile at most, unless one row has more: its z-buffer takes 128 kB. Tiles are whole rows, so that what they show is copied to
/// the planes in order. Projection and z-buffer took as long with 2¹² pixels at 512×512 and 8 % longer at 2048×2048 (twice as many
/// chains), with 2¹⁵ 13 % longer at 512×512.
const MOST_PIXELS: usize = 1 << 13;
/// Records of a chunk: 2 kB.
const CHUNK: usize = 128;
/// Points projected at a time; their number is a multiple.
pub(super) const BLOCK: usize = 256;
/// Records by which their memory is asked for before it is written: two cache lines.
const AHEAD: usize = 8;
// Tried: two or four chains a tile by turns, so that fewer wait for where the last record went (no faster at 512×512, a third slower at
// 2048×2048: more lines are written at a time); keeping that place in a register while points of one tile follow each other (twice as
// slow at 512×512: points of many frames lie between each other, and where the next one goes cannot be guessed).
/// End of a chain.
const END: u32 = u32::MAX;
/// In a key of a point that is not a sample of this very view. It is the sign of the depth, so fresh points win.
const OLD: u32 = 1 << 31;

/// A point that falls into a tile.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(16))]
pub(super) struct Record {
    /// Age, and from bit 8 the pixel in the tile.
    pub age_and_pixel: u32,
    pub colour: u32,
    pub slot: u32,
    /// Depth, as bits of an f32, negative for points that are not fresh.
    pub depth: u32,
}

const _: () = assert!(size_of::<Record>() == 16);

/// Chains of one thread's points.
#[derive(Debug, Default)]
struct Part {
    /// Where the next record of each tile goes; the last is the tile of points that are not seen.
    heads: Vec<u32>,
    /// The chunk after each.
    next: Vec<u32>,
    /// Where this part's chunks begin among all records.
    base: usize,
    chunks: usize,
}

/// Records by tile.
#[derive(Debug)]
pub(super) struct Buckets {
    records: Vec<Record>,
    parts: Vec<Part>,
    /// Points of each part.
    lengths: Vec<usize>,
    /// Rows of a tile: a power of two.
    pub tile_rows: usize,
}

impl Buckets {
    pub fn new(size: (usize, usize), points: usize, threads: usize) -> Self {
        let tile_rows = 1 << (MOST_PIXELS / size.0).max(1).ilog2();
        let count = size.1.div_ceil(tile_rows) + 1;
        let ranges = parallel::bands(points, BLOCK, threads);
        let mut base = 0;
        let mut parts = Vec::new();
        for range in &ranges {
            // One more than can be filled, so that what is fetched ahead exists.
            let chunks = count + range.len() / CHUNK + 2;
            parts.push(Part { heads: vec![0; count], next: vec![END; chunks], base, chunks });
            base += chunks * CHUNK;
        }
        let records = filled(Record::default(), base);
        Self { records, parts, lengths: ranges.iter().map(|range| range.len()).collect(), tile_rows }
    }

    /// Fills the chains; marks the points outside the picture as hidden.
    pub fn fill(&mut self, isa: Isa, map: &Map, size: (usize, usize), points: &mut Points) {
        match map {
            Map::Flat(lens) => self.fill_by(isa, lens, size, points),
            Map::Curved(lens) => self.fill_by(isa, lens, size, points),
        }
    }

    fn fill_by<L: Lens>(&mut self, isa: Isa, map: &L, size: (usize, usize), points: &mut Points) {
        let Self { records, parts, lengths, tile_rows } = self;
        let records = parallel::cut(records, parts.iter().map(|part| part.chunks * CHUNK));
        let hidden = parallel::cut(&mut points.is_hidden, lengths.iter().copied());
        let mut from = 0;
        let mut work = Vec::new();
        for (((part, records), is_hidden), length) in
            parts.iter_mut().zip(records).zip(hidden).zip(lengths.iter().copied())
        {
            let range = from..from + length;
            from += length;
            work.push(Project {
                map,
                size,
                tile_rows: *tile_rows,
                first: range.start as u32,
                position: [0, 1, 2].map(|axis| &points.position[axis][range.clone()]),
                colour: &points.colour[range.clone()],
                age: &points.age[range.clone()],
                flags: &points.flags[range],
                is_hidden,
                records,
                part,
            });
        }
        parallel::for_each(work, |kernel| isa.run(kernel));
    }

    /// All records.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Where a tile's records are.
    pub fn chain(&self, tile: usize) -> impl Iterator<Item = Range<usize>> {
        self.parts.iter().flat_map(move |part| {
            let mut chunk = tile as u32;
            let last = part.heads[tile] as usize;
            std::iter::from_fn(move || {
                let next = *part.next.get(chunk as usize)?;
                let start = chunk as usize * CHUNK;
                let end = if next == END { last } else { start + CHUNK };
                chunk = next;
                Some(part.base + start..part.base + end)
            })
        })
    }
}

struct Project<'a, L> {
    map: &'a L,
    size: (usize, usize),
    tile_rows: usize,
    first: u32,
    position: [&'a [f32]; 3],
    colour: &'a [u32],
    age: &'a [u8],
    flags: &'a [u8],
    is_hidden: &'a mut [u8],
    records: &'a mut [Record],
    part: &'a mut Part,
}

impl<L: Lens> Kernel for Project<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { map, size, tile_rows, first, position, colour, age, flags, is_hidden, records, part } = self;
        let trash = part.heads.len() as u32 - 1;
        let mut free = trash + 1;
        part.next.fill(END);
        for (tile, head) in part.heads.iter_mut().enumerate() {
            *head = (tile * CHUNK) as u32;
        }
        // The tile of unseen points stays where it is, and never looks full: each overwrites the last.
        part.heads[trash as usize] += 1;
        let heads = part.heads.as_mut_slice();
        let next = part.next.as_mut_slice();
        let mut found = [Record::default(); BLOCK];
        let mut tile_of = [0_u32; BLOCK];
        let (xs, ys, zs) = (position[0].as_chunks().0, position[1].as_chunks().0, position[2].as_chunks().0);
        let blocks =
            xs.iter().zip(ys).zip(zs).zip(colour.as_chunks().0).zip(age.as_chunks().0).zip(flags.as_chunks().0);
        let blocks = blocks.zip(is_hidden.as_chunks_mut().0).enumerate();
        for (block, ((((((x, y), z), colour), age), flags), is_hidden)) in blocks {
            let start = first + (block * BLOCK) as u32;
            place(map, size, tile_rows, start, [x, y, z], colour, age, flags, &mut found, &mut tile_of);
            hide(&tile_of, trash, is_hidden);
            for (record, &tile) in found.iter().zip(&tile_of) {
                let head = &mut heads[tile as usize];
                records[*head as usize] = *record;
                let mut next_head = *head + u32::from(tile != trash);
                if (next_head as usize).is_multiple_of(CHUNK) {
                    next[next_head as usize / CHUNK - 1] = free;
                    next_head = free * CHUNK as u32;
                    free += 1;
                }
                *head = next_head;
                // Lines of as many tiles as there are come from far: without this their stores waited one after another.
                prefetch(&records[next_head as usize + AHEAD]);
            }
        }
    }
}

/// Records and tiles of a block of points.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn place<L: Lens>(
    map: &L,
    size: (usize, usize),
    tile_rows: usize,
    start: u32,
    [x, y, z]: [&[f32; BLOCK]; 3],
    colour: &[u32; BLOCK],
    age: &[u8; BLOCK],
    flags: &[u8; BLOCK],
    found: &mut [Record; BLOCK],
    tile_of: &mut [u32; BLOCK],
) {
    let (width, height) = (size.0 as i32, size.1 as i32);
    let (right, bottom) = (width as f32, height as f32);
    let shift = tile_rows.ilog2();
    let trash = size.1.div_ceil(tile_rows) as u32;
    for i in 0..BLOCK {
        let (column, row, depth) = map.project([x[i], y[i], z[i]]);
        let seen = (NEAREST..f32::INFINITY).contains(&depth)
            & (column >= 0.0)
            & (column < right)
            & (row >= 0.0)
            & (row < bottom)
            & (age[i] != u8::MAX);
        let (column, row) = (truncate(column, right), truncate(row, bottom));
        let tile = row >> shift;
        let pixel = (row - (tile << shift)) * width + column;
        let old = if flags[i] & FRESH == 0 { OLD } else { 0 };
        tile_of[i] = if seen { tile as u32 } else { trash };
        found[i] = Record {
            age_and_pixel: (pixel as u32) << 8 | u32::from(age[i]),
            colour: colour[i],
            slot: start + i as u32,
            depth: depth.to_bits() | old,
        };
    }
}

/// Marks points outside the picture as hidden; of those in it, the z-buffer says.
#[inline(always)]
fn hide(tile_of: &[u32; BLOCK], trash: u32, is_hidden: &mut [u8; BLOCK]) {
    for i in 0..BLOCK {
        is_hidden[i] |= if tile_of[i] == trash { 1 } else { 0 };
    }
}
