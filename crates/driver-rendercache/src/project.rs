//! Projection and tile sort (Walter et al. 2002, §3.2): every point to its pixel, in buckets by tile of the picture.
//!
//! Buckets are chains of chunks, so one pass is enough: no count beforehand, no second copy.
//!
//! Records carry colour and age: fetched later, point by point, they come from anywhere in the cache, which took longer than all
//! else in the z-buffer. A tile's z-buffer fits into the second cache many times.
//!
//! Always true: the result does not depend on the number of threads.

use super::colour;
use super::map::{BEYOND, Lens, Map};
use super::parallel;
use super::points::{Block, FRESH, HIDDEN, State};
use super::truncate::truncate;
use bytemuck::{Pod, Zeroable};
use holo_cpu::filled;
use holo_cpu::prefetch_at;
use holo_cpu::{Isa, Kernel};
use std::ops::Range;

/// Tiles of a picture, about. Tiles are whole rows, so that what they show is copied to the planes in order. Of 512 at 2048×2048
/// projection and z-buffer took a quarter longer than of 64: the ends of all their chains are written by turns.
const TILES: usize = 64;
/// Pixels of a tile at least: its z-buffer takes 128 kB. With half or a quarter of that nothing was faster at 512×512.
const LEAST_PIXELS: usize = 1 << 13;
/// Pixels of a tile at most, unless one row has more: 1 MB.
const MOST_PIXELS: usize = 1 << 16;
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
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct Record {
    /// Age, from bit [`Record::PIXEL`] the pixel in the tile.
    pub about: u32,
    pub colour: u32,
    pub slot: u32,
    /// Depth, as bits of an f32, negative for points that are not fresh.
    pub depth: u32,
}

const _: () = assert!(size_of::<Record>() == 16);

impl Record {
    pub const PIXEL: u32 = 8;
}

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
    /// The first chunk that no tile has.
    free: u32,
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
        let tile_pixels = (size.0 * size.1 / TILES).clamp(LEAST_PIXELS, MOST_PIXELS);
        let tile_rows = 1 << (tile_pixels / size.0).max(1).ilog2();
        let count = size.1.div_ceil(tile_rows) + 1;
        let ranges = parallel::bands(points, BLOCK, threads);
        let mut base = 0;
        let mut parts = Vec::new();
        for range in &ranges {
            // One more than can be filled, so that what is fetched ahead exists.
            let chunks = count + range.len() / CHUNK + 2;
            parts.push(Part {
                heads: vec![0; count],
                next: vec![END; chunks],
                base,
                chunks,
                free: 0,
            });
            base += chunks * CHUNK;
        }
        let records = filled(Record::default(), base);
        Self {
            records,
            parts,
            lengths: ranges.iter().map(|range| range.len()).collect(),
            tile_rows,
        }
    }

    /// The chains of each thread, empty, with the range of points that they are for.
    pub fn begin(&mut self) -> Vec<Chains<'_>> {
        let Self { records, parts, lengths, .. } = self;
        let records = parallel::cut(records, parts.iter().map(|part| part.chunks * CHUNK));
        let mut from = 0;
        let mut chains = Vec::new();
        for ((part, records), &length) in parts.iter_mut().zip(records).zip(&*lengths) {
            part.begin();
            chains.push(Chains { points: from..from + length, part, records });
            from += length;
        }
        chains
    }

    /// Points of each thread.
    pub fn lengths(&self) -> &[usize] {
        &self.lengths
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

/// What one thread fills.
pub(super) struct Chains<'a> {
    /// Slots that it is for.
    pub points: Range<usize>,
    part: &'a mut Part,
    records: &'a mut [Record],
}

/// Where points are seen.
#[derive(Clone, Copy)]
pub(super) struct Screen<'a> {
    pub map: &'a Map,
    pub size: (usize, usize),
    pub tile_rows: usize,
}

impl Chains<'_> {
    /// Adds points, the slots from `first` on; marks those outside the picture as hidden. A multiple of [`BLOCK`].
    pub fn add(
        &mut self,
        isa: Isa,
        screen: Screen,
        first: usize,
        blocks: &[Block],
        states: &mut [State],
    ) {
        match screen.map {
            Map::Flat(lens) => self.add_by(isa, lens, screen, first, blocks, states),
            Map::Cut(lens) => self.add_by(isa, lens, screen, first, blocks, states),
            Map::Curved(lens) => self.add_by(isa, lens, screen, first, blocks, states),
        }
    }

    fn add_by<L: Lens>(
        &mut self,
        isa: Isa,
        map: &L,
        screen: Screen,
        first: usize,
        blocks: &[Block],
        states: &mut [State],
    ) {
        let Screen { size, tile_rows, .. } = screen;
        let Chains { part, records, .. } = self;
        isa.run(Project {
            map,
            size,
            tile_rows,
            first: first as u32,
            blocks,
            states,
            records,
            part,
        });
    }
}

impl Part {
    fn begin(&mut self) {
        self.next[..self.heads.len()].fill(END);
        for (tile, head) in self.heads.iter_mut().enumerate() {
            *head = (tile * CHUNK) as u32;
        }
        self.free = self.heads.len() as u32;
    }
}

struct Project<'a, L> {
    map: &'a L,
    size: (usize, usize),
    tile_rows: usize,
    first: u32,
    blocks: &'a [Block],
    states: &'a mut [State],
    records: &'a mut [Record],
    part: &'a mut Part,
}

impl<L: Lens> Kernel for Project<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { map, size, tile_rows, first, blocks, states, records, part } = self;
        let Part { heads, next, free, .. } = part;
        let (heads, next) = (heads.as_mut_slice(), next.as_mut_slice());
        let trash = heads.len() - 1;
        let mut found = [Record::default(); BLOCK];
        let mut tile_of = [0_u32; BLOCK];
        let pairs = blocks.iter().zip(states.as_chunks_mut().0);
        for ((points, states), start) in pairs.zip((first..).step_by(BLOCK)) {
            place(map, size, tile_rows, start, points, states, &mut found, &mut tile_of);
            hide(&tile_of, trash as u32, states);
            for (record, &tile) in found.iter().zip(&tile_of) {
                let head = &mut heads[tile as usize];
                records[*head as usize] = *record;
                *head += 1;
                // Lines of as many tiles as there are come from far: without this their stores waited one after another.
                prefetch_at(records, *head as usize + AHEAD);
                if (*head as usize).is_multiple_of(CHUNK) {
                    if tile as usize == trash {
                        // Points that are not seen overwrite each other.
                        *head -= CHUNK as u32;
                    } else {
                        next[*head as usize / CHUNK - 1] = *free;
                        next[*free as usize] = END;
                        *head = *free * CHUNK as u32;
                        *free += 1;
                    }
                }
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
    points: &Block,
    states: &[State; BLOCK],
    found: &mut [Record; BLOCK],
    tile_of: &mut [u32; BLOCK],
) {
    let (width, height) = (size.0 as i32, size.1 as i32);
    let (right, bottom) = (width as f32, height as f32);
    let shift = tile_rows.ilog2();
    let trash = size.1.div_ceil(tile_rows) as u32;
    let [x, y, z] = &points.position;
    let (nearest, farthest) = (map.nearest(), map.farthest());
    for i in 0..BLOCK {
        let (column, row, depth) = map.project([x[i], y[i], z[i]]);
        let state = states[i];
        let seen = (nearest..f32::INFINITY).contains(&depth)
            & (column >= 0.0)
            & (column < right)
            & (row >= 0.0)
            & (row < bottom)
            & !state.is_empty();
        let (column, row) = (truncate(column, right), truncate(row, bottom));
        let tile = row >> shift;
        let pixel = (row - (tile << shift)) * width + column;
        let old = if state.has(FRESH) { 0 } else { OLD };
        let is_black = L::CLIPS && depth > farthest;
        tile_of[i] = if seen { tile as u32 } else { trash };
        found[i] = Record {
            about: (pixel as u32) << Record::PIXEL | u32::from(state.age()),
            colour: if is_black { colour::BLACK } else { points.colour[i] },
            slot: start + i as u32,
            depth: if is_black { BEYOND } else { depth }.to_bits() | old,
        };
    }
}

/// Marks points outside the picture as hidden; of those in it, the z-buffer says.
#[inline(always)]
fn hide(tile_of: &[u32; BLOCK], trash: u32, states: &mut [State; BLOCK]) {
    for i in 0..BLOCK {
        states[i].0 |= if tile_of[i] == trash { u16::from(HIDDEN) << 8 } else { 0 };
    }
}
