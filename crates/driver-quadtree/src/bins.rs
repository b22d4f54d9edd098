//! Exact sums of samples, by pixel and depth bin.
//!
//! Invariants:
//! - Every sum is exact ([`sums`](super::sums)), so the same samples give the same bits whatever their order and batches.
//! - A pixel keeps its [`BINS_KEPT`] nearest bins and the sums of those are complete: at the time a sample arrives, its
//!   bin is refused only if [`BINS_KEPT`] nearer bins are already known, and evicted only when that many are. Known bins
//!   never go away but for nearer ones, so a bin once refused or evicted is not among the nearest at the end; and a bin
//!   that is among the nearest at the end was never refused nor evicted.
//! - Memory is at most [`BINS_KEPT`] × (2 cache lines + 6 bytes) a pixel, one cache line where sums are not large; beyond one bin of each
//!   pixel it grows only with the bins really met.

use super::sums::{Colour, High, Kept, Packed, Summed, Sums};
use holo_cpu::{filled, prefetch, reserved, zeroed};
use bytemuck::{Zeroable, cast};
use std::ops::Range;

/// Nearest depth bins kept for each pixel. A pixel rarely sees more than two surfaces.
pub(crate) const BINS_KEPT: usize = 4;
/// Depth bins to each doubling of the distance.
pub(crate) const BINS_AN_OCTAVE: u16 = 32;
/// Bin of samples that hit nothing: beyond every other, adjacent to none.
pub(crate) const FAR: u16 = u16::MAX - 1;
/// No bin.
pub(crate) const NONE: u16 = u16::MAX;
/// Bits cut from a squared distance as f32: 4 of its mantissa stay, so 16 bins to each doubling of the square, 32 to each
/// doubling of the distance; the widest bin is 3.1 %, the narrowest 1.6 %.
const BIN_SHIFT: u32 = 19;

/// Logarithmic depth bin of a squared distance from the eye.
#[inline(always)]
pub(crate) fn depth_bin(distance_squared: f64) -> u16 {
    // Positive floats sort as their bits do, and the bits are a logarithm good enough for bins.
    ((distance_squared as f32).to_bits() >> BIN_SHIFT) as u16
}

/// Distance at the middle of a bin; infinity for [`FAR`].
pub(crate) fn bin_distance(bin: u16) -> f32 {
    bin_distance_squared(bin).sqrt()
}

/// Its square.
#[inline(always)]
pub(crate) fn bin_distance_squared(bin: u16) -> f32 {
    if bin >= FAR {
        f32::INFINITY
    } else {
        f32::from_bits((u32::from(bin) << BIN_SHIFT) | 1 << (BIN_SHIFT - 1))
    }
}

/// The bins of one pixel, nearest first.
type Slots = [u16; BINS_KEPT];

/// Where the sums of all but the nearest of them are.
type Places = [u32; BINS_KEPT - 1];

const EMPTY: Slots = [NONE; BINS_KEPT];

/// Sums by their place.
#[derive(Clone)]
struct Store {
    packed: Vec<Packed>,
    /// Of no meaning where there are none; empty as long as there never were any.
    high: Vec<High>,
}

impl Store {
    fn new(packed: Vec<Packed>) -> Self {
        Self { packed, high: Vec::new() }
    }

    #[inline(always)]
    fn get(&self, place: usize) -> Kept<'_> {
        let packed = &self.packed[place];
        Kept { packed, high: if packed.has_high() { self.high.get(place) } else { None } }
    }

    fn set(&mut self, place: usize, sums: &Sums) {
        let (packed, high) = sums.packed();
        self.packed[place] = packed;
        if packed.has_high() {
            if self.high.is_empty() {
                self.high = zeroed(self.packed.len());
            } else if self.high.len() <= place {
                self.high.resize(self.packed.len(), High::zeroed());
            }
            self.high[place] = high;
        }
    }

    fn push(&mut self, sums: &Sums) {
        self.packed.push(Packed::zeroed());
        self.set(self.packed.len() - 1, sums);
    }

    #[inline(always)]
    fn add(&mut self, place: usize, colour: &Colour, weight: u32, near: Option<usize>) {
        if !self.packed[place].add(colour, weight, near) {
            self.add_wide(place, colour, weight, near);
        }
    }

    #[cold]
    #[inline(never)]
    fn add_wide(&mut self, place: usize, colour: &Colour, weight: u32, near: Option<usize>) {
        let mut sums = self.get(place).sums();
        sums.add(colour, weight, near);
        self.set(place, &sums);
    }

    #[inline(always)]
    fn prefetch(&self, place: usize) {
        self.packed.get(place).into_iter().for_each(prefetch);
    }
}

/// The bins of all pixels.
#[derive(Clone)]
pub(crate) struct PixelBins {
    slots: Vec<Slots>,
    /// Apart: few pixels have several bins, and what is asked for of all of them stays in the caches.
    places: Vec<Places>,
    /// Of each pixel's nearest bin, pixel by pixel: they are read in this order, and a sample's are asked for by its pixel alone.
    /// Of no meaning where there is none.
    nearest: Store,
    /// Of all others: most pixels see one surface.
    further: Store,
    is_empty: bool,
}

impl PixelBins {
    pub fn new(pixels: usize) -> Self {
        // Growing would move what is there.
        Self {
            slots: filled(EMPTY, pixels),
            places: zeroed(pixels),
            nearest: Store::new(zeroed(pixels)),
            further: Store::new(reserved(pixels)),
            is_empty: true,
        }
    }

    pub fn clear(&mut self) {
        self.slots.fill(EMPTY);
        self.further.packed.clear();
        self.is_empty = true;
    }

    #[inline(always)]
    pub fn add(
        &mut self,
        pixel: usize,
        bin: u16,
        colour: &Colour,
        weight: u32,
        near: Option<usize>,
    ) {
        let slots = &self.slots[pixel];
        let rank = slots.iter().position(|&kept| bin <= kept).unwrap_or(BINS_KEPT);
        if rank == BINS_KEPT {
            return;
        }
        if slots[rank] != bin {
            self.make_room(pixel, rank, bin);
        }
        match rank.checked_sub(1) {
            None => self.nearest.add(pixel, colour, weight, near),
            Some(rank) => self.further.add(self.places[pixel][rank] as usize, colour, weight, near),
        }
    }

    /// Gives a pixel a bin without samples, which has this rank among its own.
    #[inline(never)]
    fn make_room(&mut self, pixel: usize, rank: usize, bin: u16) {
        const LAST: usize = BINS_KEPT - 1;
        self.is_empty = false;
        let (slots, places) = (&mut self.slots[pixel], &mut self.places[pixel]);
        if slots[0] == NONE {
            slots[0] = bin;
            self.nearest.packed[pixel] = Packed::zeroed();
            return;
        }
        let mut sums = Sums::default();
        if rank == 0 {
            sums = self.nearest.get(pixel).sums();
            self.nearest.packed[pixel] = Packed::zeroed();
        }
        let place = if slots[LAST] == NONE {
            self.further.push(&sums);
            (self.further.packed.len() - 1) as u32
        } else {
            let place = places[LAST - 1];
            self.further.set(place as usize, &sums);
            place
        };
        slots.copy_within(rank..LAST, rank + 1);
        slots[rank] = bin;
        let rank = rank.saturating_sub(1);
        places.copy_within(rank..LAST - 1, rank + 1);
        places[rank] = place;
    }

    /// Asks for what [`prefetch_further`](Self::prefetch_further) needs, and for the sums of the nearest bin.
    #[inline(always)]
    pub fn prefetch_pixel(&self, pixel: usize) {
        self.slots.get(pixel).into_iter().for_each(prefetch);
        self.nearest.prefetch(pixel);
    }

    /// Asks for the sums of a pixel's bin, if they are there already and not of the nearest.
    #[inline(always)]
    pub fn prefetch_further(&self, pixel: usize, bin: u16) {
        let Some(slots) = self.slots.get(pixel) else { return };
        if let Some(rank) = slots[1..].iter().position(|&kept| bin == kept) {
            self.further.prefetch(self.places[pixel][rank] as usize);
        }
    }

    /// Asks for all sums of a pixel.
    #[inline(always)]
    pub fn prefetch_all_sums(&self, pixel: usize) {
        let Some(slots) = self.slots.get(pixel) else { return };
        // Of an empty pixel those of the first, which are near at hand. Chosen, not skipped: which are empty no processor can tell beforehand.
        let nearest = if slots[0] == NONE { 0 } else { pixel };
        self.nearest.prefetch(nearest);
        if slots[1] != NONE {
            self.places[pixel].iter().for_each(|&place| self.further.prefetch(place as usize));
        }
    }

    /// The nearest bin and the next of every other pixel from one on, as many as are asked for; [`NONE`] of others.
    #[inline(always)]
    pub fn bins_of_every_other<const COUNT: usize>(
        &self,
        first: usize,
        count: usize,
    ) -> [[u32; COUNT]; 2] {
        let slots = self.slots.get(first..).unwrap_or_default();
        // Whole words: numbers of 16 bits one by one the compiler moves one by one.
        let mut words = [u64::MAX; COUNT];
        words
            .iter_mut()
            .take(count)
            .zip(slots.iter().step_by(2))
            .for_each(|(word, &slots)| *word = cast(slots));
        let [first, second] = if cfg!(target_endian = "big") { [48, 32] } else { [0, 16] };
        let [mut nearest, mut next] = [[0; COUNT]; 2];
        for (lane, word) in words.iter().enumerate() {
            nearest[lane] = (word >> first) as u32 & 0xffff;
            next[lane] = (word >> second) as u32 & 0xffff;
        }
        [nearest, next]
    }

    /// Lower parts of the sums of the nearest bins from a pixel on: of no meaning where there is none.
    #[inline(always)]
    pub fn nearest_from(&self, first: usize) -> &[Packed] {
        self.nearest.packed.get(first..).unwrap_or_default()
    }

    /// The parts above those, if there are any.
    #[inline(always)]
    pub fn high_of_nearest(&self, pixel: usize) -> Option<&High> {
        self.nearest.get(pixel).high
    }

    /// Whether a pixel has samples.
    #[inline(always)]
    pub fn has(&self, pixel: usize) -> bool {
        self.slots.get(pixel).is_some_and(|slots| slots[0] != NONE)
    }

    /// Asks for all sums of some pixels.
    #[inline(always)]
    pub fn prefetch_sums_of(&self, pixels: Range<usize>) {
        let (Some(slots), Some(nearest)) =
            (self.slots.get(pixels.clone()), self.nearest.packed.get(pixels.clone()))
        else {
            return;
        };
        let Some(first) = nearest.first() else { return };
        for ((slots, sums), pixel) in slots.iter().zip(nearest).zip(pixels) {
            // As in `prefetch_all_sums`.
            prefetch(if slots[0] == NONE { first } else { sums });
            if slots[1] != NONE {
                self.places[pixel].iter().for_each(|&place| self.further.prefetch(place as usize));
            }
        }
    }

    /// Whether there is room for any pixel.
    pub fn has_pixels(&self) -> bool {
        !self.slots.is_empty()
    }

    /// Whether there are no samples at all.
    pub fn is_empty(&self) -> bool {
        self.is_empty
    }

    /// The kept bins of a pixel, nearest first, with their sums. None of a pixel that there is no room for.
    #[inline(always)]
    pub fn of(&self, pixel: usize) -> impl Iterator<Item = (u16, Kept<'_>)> {
        let slots = self.slots.get(pixel).unwrap_or(&EMPTY);
        let kept = slots.iter().take_while(|&&bin| bin != NONE).count();
        (0..kept).map(move |rank| {
            let sums = match rank.checked_sub(1) {
                None => self.nearest.get(pixel),
                Some(rank) => self.further.get(self.places[pixel][rank] as usize),
            };
            (slots[rank], sums)
        })
    }
}

/// The nearest [`BINS_KEPT`] bins of a pixel in both, nearest first, with the sums of both: complete, since a bin among the
/// nearest of both is among the nearest of each that has it.
pub(crate) fn merged(
    a: &PixelBins,
    b: &PixelBins,
    pixel: usize,
) -> impl Iterator<Item = (u16, Sums)> {
    let (mut a, mut b) = (a.of(pixel).peekable(), b.of(pixel).peekable());
    let next = move || {
        let (first, second) = (a.peek().map_or(NONE, |a| a.0), b.peek().map_or(NONE, |b| b.0));
        let mut found = (first.min(second), Sums::default());
        if first <= second {
            found.1.join(&a.next()?.1.sums());
        }
        if second <= first {
            found.1.join(&b.next()?.1.sums());
        }
        Some(found)
    };
    std::iter::from_fn(next).take(BINS_KEPT)
}

#[cfg(test)]
#[path = "bins_tests.rs"]
mod tests;
