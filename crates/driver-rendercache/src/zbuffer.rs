//! Z-buffer, tile by tile (Walter et al. 2002, §3.2): of the points that fall into a pixel, the nearest.
//!
//! The z-buffer holds what a pixel shows, not where it is: it is copied to the planes in order.
//!
//! Always true: a pixel shows the nearest of its fresh points, else the nearest of the others; of equals, the first in the cache.

use super::colour;
use super::points::HIDDEN;
use super::project::{Buckets, Record};
use holo_cpu::filled;
use holo_cpu::prefetch_at;
use holo_cpu::{Isa, Kernel};
use std::hint::select_unpredictable;
use std::sync::atomic::AtomicU16;
use std::sync::atomic::Ordering::Relaxed;

/// Frames after which a tile says again which of its points are hidden. Said every frame, it took a third of the z-buffer's time, and
/// points live for tens of frames.
const TURNS: usize = 16;
/// Records of a cache line.
const LINE: usize = 4;
/// Pixels copied at a time.
const PIECE: usize = 64;
/// Farther than any point.
const FARTHEST: u32 = u32::MAX;

/// What is nearest in a pixel so far: two words, so that the nearer of two is a comparison and two choices.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
struct Nearest {
    /// From bit 32 the colour; below what else [`Record`] says.
    look: u64,
    /// From bit 32 the depth; below the slot. The least is shown.
    key: u64,
}

impl From<&Record> for Nearest {
    #[inline(always)]
    fn from(record: &Record) -> Self {
        // Two loads instead of four.
        let words: [u64; 2] = bytemuck::cast(*record);
        let [look, key] = if cfg!(target_endian = "big") {
            words.map(|word| word.rotate_left(32))
        } else {
            words
        };
        Self { look, key }
    }
}

/// What a tile of the point image is filled from.
#[derive(Clone, Copy)]
pub(super) struct Fill<'a> {
    pub isa: Isa,
    pub buckets: &'a Buckets,
    pub states: &'a [AtomicU16],
    pub frame: u32,
}

/// Rows of the point image.
pub(super) struct Rows<'a> {
    pub colour: &'a mut [u32],
    pub depth: &'a mut [u32],
    pub slot: &'a mut [u32],
    pub age: &'a mut [u8],
}

/// The z-buffer of a tile.
#[derive(Debug)]
pub(super) struct Scratch {
    nearest: Vec<Nearest>,
    nothing: Nearest,
}

impl Scratch {
    /// For tiles of so many pixels at most; pixels without a point show `no_slot`.
    pub fn new(tile_pixels: usize, no_slot: u32) -> Self {
        let nothing = Record { about: 0, colour: colour::NONE, slot: no_slot, depth: FARTHEST };
        let nothing = Nearest::from(&nothing);
        Self { nearest: filled(nothing, tile_pixels), nothing }
    }
}

impl Fill<'_> {
    /// Fills a tile: colour, depth, point and age of every pixel.
    ///
    /// Points that no pixel shows are marked as hidden, those of one tile in [`TURNS`] each frame.
    pub fn tile(self, tile: usize, rows: Rows, scratch: &mut Scratch) {
        let Self { isa, buckets, states, frame } = self;
        let Rows { colour, depth, slot, age } = rows;
        let records = buckets.records();
        let nearest = &mut scratch.nearest[..colour.len()];
        let mut chain = buckets.chain(tile).peekable();
        while let Some(chunk) = chain.next() {
            let next = chain.peek().map_or(0, |next| next.start);
            // Line by line: all of the next chunk at once is more than a processor can ask for at a time.
            let (lines, rest) = records[chunk].as_chunks::<LINE>();
            for (line, ahead) in lines.iter().zip((next..).step_by(LINE)) {
                prefetch_at(records, ahead);
                keep_nearest(line, nearest);
            }
            keep_nearest(rest, nearest);
        }
        if (tile + frame as usize).is_multiple_of(TURNS) {
            buckets.chain(tile).for_each(|chunk| hide(&records[chunk], nearest, states));
        }
        isa.run(Show { nearest, nothing: scratch.nothing, colour, depth, slot, age });
    }
}

/// Says of points whether they are behind others. Each is in one tile only: no other thread changes its state.
fn hide(records: &[Record], nearest: &[Nearest], states: &[AtomicU16]) {
    const IS_HIDDEN: u16 = (HIDDEN as u16) << 8;
    for record in records {
        let Some(pixel) = nearest.get((record.about >> Record::PIXEL) as usize) else { continue };
        let Some(state) = states.get(record.slot as usize) else { continue };
        let is_hidden = if pixel.key as u32 == record.slot { 0 } else { IS_HIDDEN };
        state.store(state.load(Relaxed) & !IS_HIDDEN | is_hidden, Relaxed);
    }
}

#[inline(always)]
fn keep_nearest(records: &[Record], nearest: &mut [Nearest]) {
    for record in records {
        let new = Nearest::from(record);
        // Every record of a tile has a pixel of it.
        let Some(pixel) = nearest.get_mut(new.look as u32 as usize >> Record::PIXEL) else {
            continue;
        };
        // Whether a pixel has a nearer point already cannot be guessed: a branch, which compilers make of anything less than this, made
        // the whole stage take 45 % longer.
        let is_nearer = new.key < pixel.key;
        pixel.look = select_unpredictable(is_nearer, new.look, pixel.look);
        pixel.key = select_unpredictable(is_nearer, new.key, pixel.key);
    }
}

/// Copies what a tile's pixels show to the planes, and empties its z-buffer for the next.
struct Show<'a> {
    nearest: &'a mut [Nearest],
    nothing: Nearest,
    colour: &'a mut [u32],
    depth: &'a mut [u32],
    slot: &'a mut [u32],
    age: &'a mut [u8],
}

impl Kernel for Show<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { nearest, nothing, colour, depth, slot, age } = self;
        let pieces = colour.chunks_mut(PIECE).zip(depth.chunks_mut(PIECE));
        let pieces = pieces.zip(slot.chunks_mut(PIECE)).zip(age.chunks_mut(PIECE));
        for (nearest, (((colour, depth), slot), age)) in nearest.chunks_mut(PIECE).zip(pieces) {
            if nearest.len() == PIECE {
                // Of known length: no remainders.
                let (colour, depth) = (&mut colour[..PIECE], &mut depth[..PIECE]);
                show(&nearest[..PIECE], colour, depth, &mut slot[..PIECE], &mut age[..PIECE]);
            } else {
                show(nearest, colour, depth, slot, age);
            }
            nearest.fill(nothing);
        }
    }
}

#[inline(always)]
fn show(
    nearest: &[Nearest],
    colour: &mut [u32],
    depth: &mut [u32],
    slot: &mut [u32],
    age: &mut [u8],
) {
    let count = nearest.len();
    let (colour, depth) = (&mut colour[..count], &mut depth[..count]);
    let (slot, age) = (&mut slot[..count], &mut age[..count]);
    for x in 0..count {
        let Nearest { look, key } = nearest[x];
        let at = (key >> 32) as u32;
        colour[x] = (look >> 32) as u32;
        depth[x] = if at == FARTHEST { 0 } else { at };
        slot[x] = key as u32;
        age[x] = look as u8;
    }
}
