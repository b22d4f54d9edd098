//! Z-buffer, tile by tile (Walter et al. 2002, §3.2): of the points that fall into a pixel, the nearest.
//!
//! The z-buffer holds what a pixel shows, not where it is: it is copied to the planes in order.
//!
//! Always true: a pixel shows the nearest of its fresh points, else the nearest of the others; of equals, the first in the cache.

use super::colour;
use super::isa::{Isa, Kernel};
use super::parallel::{self, bands};
use super::planes::Planes;
use super::points::{HIDDEN, Points};
use super::prefetch::prefetch;
use super::project::{Buckets, Record};
use super::shared::states_as_atomic;
use std::hint::select_unpredictable;
use std::sync::atomic::AtomicU16;
use std::sync::atomic::Ordering::Relaxed;

/// Frames after which a tile says again which of its points are hidden. Said every frame, it took a third of the z-buffer's time, and
/// points live for tens of frames.
const TURNS: usize = 8;
/// Records of a cache line.
const LINE: usize = 4;
/// Pixels copied at a time.
const PIECE: usize = 64;
/// Farther than any point.
const FARTHEST: u32 = u32::MAX;

/// What is nearest in a pixel so far: two words, so that the nearer of two is a comparison and two choices.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct Nearest {
    /// From bit 32 the colour; below age and pixel, as in [`Record`].
    look: u64,
    /// From bit 32 the depth; below the slot. The least is shown.
    key: u64,
}

impl From<&Record> for Nearest {
    #[inline(always)]
    fn from(record: &Record) -> Self {
        Self {
            look: u64::from(record.colour) << 32 | u64::from(record.age_and_pixel),
            key: u64::from(record.depth) << 32 | u64::from(record.slot),
        }
    }
}

/// Rows of the point image that one thread fills, whole tiles.
struct Band<'a> {
    first_tile: usize,
    colour: &'a mut [u32],
    depth: &'a mut [u32],
    slot: &'a mut [u32],
    age: &'a mut [u8],
}

/// Fills the point image: colour, depth, point and age of every pixel.
///
/// Points that no pixel shows are marked as hidden, those of one tile in [`TURNS`] each `frame`.
pub(super) fn fill(isa: Isa, buckets: &Buckets, planes: &mut Planes, points: &mut Points, threads: usize, frame: u32) {
    let (width, height) = planes.size;
    let rows = bands(height, buckets.tile_rows, threads);
    let lengths = || rows.iter().map(|rows| rows.len() * width);
    let colour = parallel::cut(&mut planes.colour, lengths());
    let depth = parallel::cut(&mut planes.depth, lengths());
    let slot = parallel::cut(&mut planes.slot, lengths());
    let age = parallel::cut(&mut planes.age, lengths());
    let parts = rows.iter().zip(colour).zip(depth).zip(slot).zip(age);
    let parts = parts.map(|((((rows, colour), depth), slot), age)| Band {
        first_tile: rows.start / buckets.tile_rows,
        colour,
        depth,
        slot,
        age,
    });
    let nothing = Record { age_and_pixel: 0, colour: colour::NONE, slot: points.capacity() as u32, depth: FARTHEST };
    let nothing = Nearest::from(&nothing);
    let records = buckets.records();
    let states = states_as_atomic(&mut points.states);
    let tile_pixels = buckets.tile_rows * width;
    parallel::for_each(parts.collect(), |band: Band| {
        let mut nearest = vec![nothing; tile_pixels];
        let planes = band.colour.chunks_mut(tile_pixels).zip(band.depth.chunks_mut(tile_pixels));
        let planes = planes.zip(band.slot.chunks_mut(tile_pixels)).zip(band.age.chunks_mut(tile_pixels));
        for ((((colour, depth), slot), age), tile) in planes.zip(band.first_tile..) {
            let nearest = &mut nearest[..colour.len()];
            let mut chain = buckets.chain(tile).peekable();
            while let Some(chunk) = chain.next() {
                records[chain.peek().cloned().unwrap_or_default()].iter().step_by(LINE).for_each(prefetch);
                keep_nearest(&records[chunk], nearest);
            }
            if (tile + frame as usize).is_multiple_of(TURNS) {
                buckets.chain(tile).for_each(|chunk| hide(&records[chunk], nearest, states));
            }
            isa.run(Show { nearest, nothing, colour, depth, slot, age });
        }
    });
}

/// Says of points whether they are behind others. Each is in one tile only: no other thread changes its state.
fn hide(records: &[Record], nearest: &[Nearest], states: &[AtomicU16]) {
    const IS_HIDDEN: u16 = (HIDDEN as u16) << 8;
    for record in records {
        let pixel = nearest.get((record.age_and_pixel >> 8) as usize);
        let Some((state, pixel)) = states.get(record.slot as usize).zip(pixel) else { continue };
        let is_hidden = if pixel.key as u32 == record.slot { 0 } else { IS_HIDDEN };
        state.store(state.load(Relaxed) & !IS_HIDDEN | is_hidden, Relaxed);
    }
}

fn keep_nearest(records: &[Record], nearest: &mut [Nearest]) {
    for record in records {
        // Every record of a tile has a pixel of it.
        let Some(pixel) = nearest.get_mut((record.age_and_pixel >> 8) as usize) else { continue };
        let new = Nearest::from(record);
        // Whether a pixel has a nearer point already cannot be guessed: a branch, which compilers make of anything less than this,
        // doubled the time of the whole stage.
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
fn show(nearest: &[Nearest], colour: &mut [u32], depth: &mut [u32], slot: &mut [u32], age: &mut [u8]) {
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
