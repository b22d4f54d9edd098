//! Exact sums of samples, by pixel and depth bin.
//!
//! Invariants:
//! - Every sum is an integer sum (saturating where it could overflow, which integers ≥ 0 do in any order), so the same
//!   samples give the same bits whatever their order and batches.
//! - A pixel keeps its [`BINS_KEPT`] nearest bins and the sums of those are complete: at the time a sample arrives, its
//!   bin is refused only if [`BINS_KEPT`] nearer bins are already known, and evicted only when that many are. Known bins
//!   never go away but for nearer ones, so a bin once refused or evicted is not among the nearest at the end; and a bin
//!   that is among the nearest at the end was never refused nor evicted.
//! - Memory is at most [`BINS_KEPT`] × (`Sums` + 6 bytes) a pixel, and beyond one bin of each pixel it grows only with the bins really
//!   met.

use crate::pointimage::{filled, prefetch, reserved, zeroed};
use bytemuck::{Pod, Zeroable, cast_ref};
use std::mem::offset_of;
use std::ops::Range;

/// Nearest depth bins kept for each pixel. A pixel rarely sees more than two surfaces.
pub(crate) const BINS_KEPT: usize = 4;
/// Depth bins to each doubling of the distance.
pub(crate) const BINS_AN_OCTAVE: u16 = 32;
/// Classes of nearness to the eye, each half as far as the last.
pub(crate) const NEAR_CLASSES: usize = 4;
/// Bin of samples that hit nothing: beyond every other, adjacent to none.
pub(crate) const FAR: u16 = u16::MAX - 1;
/// No bin.
pub(crate) const NONE: u16 = u16::MAX;
/// Bits cut from a squared distance as f32: 4 of its mantissa stay, so 16 bins to each doubling of the square, 32 to each
/// doubling of the distance; the widest bin is 3.1 %, the narrowest 1.6 %.
const BIN_SHIFT: u32 = 19;
/// Fraction bits of the colour sums.
pub(crate) const COLOUR_FRACTION: i32 = 48;
/// Exponents above this are taken as this (radiances above 4e12), so that one sample cannot overflow its sum.
const MAX_EXPONENT: u8 = 170;
/// Fraction bits of luminance, for its second moment, and its upper bound.
pub(crate) const LUMINANCE_SCALE: f32 = 1_048_576.0;
const LUMINANCE_MAX: f32 = (1_u64 << 50) as f32;
/// Fraction bits of compressed luminance, and its upper bound.
pub(crate) const COMPRESSED_SCALE: f32 = 4096.0;
const COMPRESSED_MAX: f32 = (1_u64 << 26) as f32;

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
    if bin >= FAR { f32::INFINITY } else { f32::from_bits((u32::from(bin) << BIN_SHIFT) | 1 << (BIN_SHIFT - 1)) }
}

/// Luminance in the domain in which leaves are compared: its fourth root.
///
/// A root rather than a logarithm: black samples are common, and a root does not ask what scale the scene has. The fourth
/// brings a lamp a thousand times brighter than its surroundings down to six times.
#[inline(always)]
pub(crate) fn compress(luminance: f32) -> f32 {
    luminance.max(0.0).sqrt().sqrt()
}

/// Luminance of linear RGB in the scene's radiance unit (without Radiance's 179 lm/W).
#[inline(always)]
pub(crate) fn luminance(rgb: [f32; 3]) -> f32 {
    0.265 * rgb[0] + 0.670 * rgb[1] + 0.065 * rgb[2]
}

/// A sample's colour, ready to be added.
#[derive(Clone, Copy)]
pub(crate) struct Colour {
    fixed: [u128; 3],
    luminance_squared: u128,
    compressed: u64,
}

impl Colour {
    /// RGBE bytes: c·2^(e−136) each, which fixed point holds exactly from 2⁻⁴⁸ up.
    #[inline(always)]
    pub fn from_rgbe(rgbe: [u8; 4]) -> Self {
        let [r, g, b, exponent] = rgbe;
        if exponent == 0 {
            return Self { fixed: [0; 3], luminance_squared: 0, compressed: 0 };
        }
        let exponent = exponent.min(MAX_EXPONENT);
        let shift = i32::from(exponent) - 136 + COLOUR_FRACTION;
        let fix = |c: u8| {
            if shift >= 0 {
                u128::from(c) << shift
            } else {
                u128::from(c).checked_shr(shift.unsigned_abs()).unwrap_or(0)
            }
        };
        // 2^(e-136): normal for e ≥ 10, and what is smaller is 0 in every fixed point here.
        let scale = f32::from_bits(u32::from(exponent.saturating_sub(9)) << 23);
        let luminance = luminance([f32::from(r), f32::from(g), f32::from(b)]) * scale;
        let squared_root = (luminance * LUMINANCE_SCALE).min(LUMINANCE_MAX) as u64;
        let compressed = (compress(luminance) * COMPRESSED_SCALE).min(COMPRESSED_MAX) as u64;
        Self {
            fixed: [fix(r), fix(g), fix(b)],
            luminance_squared: u128::from(squared_root) * u128::from(squared_root),
            compressed,
        }
    }
}

/// Sums over the samples of one depth bin of one pixel: two cache lines.
#[derive(Clone, Copy, Default, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Sums {
    rgb: [u128; 3],
    luminance_squared: u128,
    compressed_squared: u128,
    compressed: u64,
    weight: u64,
    weight_squared: u64,
    pub count: u32,
    /// Samples whose ray passes so near the eye that they are samples of this very pixel, by how near: within the radius,
    /// within half of it, a quarter, and so on. Each counts for itself only, not in the wider ones.
    pub near: [u32; NEAR_CLASSES],
    /// 0: none of its bytes is without a value.
    rest: u32,
}

const _: () = assert!(size_of::<Sums>() == 128);

impl Sums {
    #[inline(always)]
    fn add(&mut self, colour: &Colour, weight: u32, near: Option<usize>) {
        let (wide, weight) = (u128::from(weight), u64::from(weight));
        self.weight = self.weight.saturating_add(weight);
        self.weight_squared = self.weight_squared.saturating_add(weight * weight);
        for (sum, value) in self.rgb.iter_mut().zip(colour.fixed) {
            *sum = sum.saturating_add(value.saturating_mul(wide));
        }
        self.luminance_squared = self.luminance_squared.saturating_add(colour.luminance_squared * wide);
        self.compressed = self.compressed.saturating_add(colour.compressed * weight);
        let compressed = u128::from(colour.compressed);
        self.compressed_squared = self.compressed_squared.saturating_add(compressed * compressed * wide);
        self.count = self.count.saturating_add(1);
        if let Some(class) = near.and_then(|class| self.near.get_mut(class)) {
            *class = class.saturating_add(1);
        }
    }

    /// Adds another bin's sums: two bins of one surface.
    pub fn join(&mut self, other: &Self) {
        self.weight = self.weight.saturating_add(other.weight);
        self.weight_squared = self.weight_squared.saturating_add(other.weight_squared);
        for (sum, value) in self.rgb.iter_mut().zip(other.rgb) {
            *sum = sum.saturating_add(value);
        }
        self.luminance_squared = self.luminance_squared.saturating_add(other.luminance_squared);
        self.compressed = self.compressed.saturating_add(other.compressed);
        self.compressed_squared = self.compressed_squared.saturating_add(other.compressed_squared);
        self.count = self.count.saturating_add(other.count);
        for (near, other) in self.near.iter_mut().zip(other.near) {
            *near = near.saturating_add(other);
        }
    }

    /// Asks for both cache lines.
    #[inline(always)]
    fn prefetch(&self) {
        prefetch(&self.rgb);
        prefetch(&self.near);
    }

    /// What the sums tell. They must not be empty.
    #[inline(always)]
    pub fn moments(&self) -> Moments {
        // All at once: as floats, and divided by the weight. Every scale is a power of two, so where it is applied changes no bit.
        let words = cast_ref::<Self, [u64; WORDS]>(self).map(|word| word as f64);
        let wide = |number: usize| words[2 * number + 1 - LOW] * 18_446_744_073_709_551_616.0 + words[2 * number + LOW];
        let (compressed, weight, weight_squared) = (words[10], words[11], words[12]);
        let [scale, luminance_squared, compressed, compressed_squared] =
            [1.0, wide(3), compressed, wide(4)].map(|sum| sum / weight);
        let scale = scale / (1_u64 << COLOUR_FRACTION) as f64;
        let compressed_scale = f64::from(COMPRESSED_SCALE);
        Moments {
            weight,
            weight_squared,
            mean: [wide(0) * scale, wide(1) * scale, wide(2) * scale],
            luminance_squared: luminance_squared / f64::from(LUMINANCE_SCALE).powi(2),
            compressed: compressed / compressed_scale,
            compressed_squared: compressed_squared / (compressed_scale * compressed_scale),
        }
    }
}

/// Sums as words: the wide ones within two roundings, where the language's own conversion is a call that takes several times as long.
const WORDS: usize = size_of::<Sums>() / size_of::<u64>();
/// Of two words of a wide sum, the lower.
const LOW: usize = if cfg!(target_endian = "big") { 1 } else { 0 };
const _: () = assert!(offset_of!(Sums, luminance_squared) == 3 * 16 && offset_of!(Sums, compressed_squared) == 4 * 16);
const _: () = assert!(offset_of!(Sums, compressed) == 10 * 8 && offset_of!(Sums, weight_squared) == 12 * 8);

/// Where sums are, counted in words of 32 bits.
pub(crate) mod places {
    use super::Sums;
    use std::mem::offset_of;

    pub(crate) const RGB: usize = offset_of!(Sums, rgb) / 4;
    pub(crate) const LUMINANCE_SQUARED: usize = offset_of!(Sums, luminance_squared) / 4;
    pub(crate) const COMPRESSED_SQUARED: usize = offset_of!(Sums, compressed_squared) / 4;
    pub(crate) const COMPRESSED: usize = offset_of!(Sums, compressed) / 4;
    pub(crate) const WEIGHT: usize = offset_of!(Sums, weight) / 4;
    pub(crate) const WEIGHT_SQUARED: usize = offset_of!(Sums, weight_squared) / 4;
    pub(crate) const COUNT: usize = offset_of!(Sums, count) / 4;
    pub(crate) const NEAR: usize = offset_of!(Sums, near) / 4;
}

/// What sums tell.
pub(crate) struct Moments {
    pub weight: f64,
    pub weight_squared: f64,
    /// Weighted mean colour.
    pub mean: [f64; 3],
    /// Weighted mean of luminance squared.
    pub luminance_squared: f64,
    /// Weighted means of compressed luminance and of its square.
    pub compressed: f64,
    pub compressed_squared: f64,
}

/// The bins of one pixel, nearest first.
type Slots = [u16; BINS_KEPT];

/// Where the sums of all but the nearest of them are.
type Places = [u32; BINS_KEPT - 1];

pub(super) const EMPTY: Slots = [NONE; BINS_KEPT];

/// The bins of all pixels.
#[derive(Clone)]
pub(crate) struct PixelBins {
    slots: Vec<Slots>,
    /// Apart: few pixels have several bins, and what is asked for of all of them stays in the caches.
    places: Vec<Places>,
    /// Of each pixel's nearest bin, pixel by pixel: they are read in this order, and a sample's are asked for by its pixel alone.
    /// Of no meaning where there is none.
    nearest: Vec<Sums>,
    /// Of all others: most pixels see one surface.
    further: Vec<Sums>,
    is_empty: bool,
}

impl PixelBins {
    pub fn new(pixels: usize) -> Self {
        // Growing would move what is there. Pages that are not used cost nothing.
        Self {
            slots: filled(EMPTY, pixels),
            places: zeroed(pixels),
            nearest: zeroed(pixels),
            further: reserved(pixels),
            is_empty: true,
        }
    }

    pub fn clear(&mut self) {
        self.slots.fill(EMPTY);
        self.further.clear();
        self.is_empty = true;
    }

    #[inline(always)]
    pub fn add(&mut self, pixel: usize, bin: u16, colour: &Colour, weight: u32, near: Option<usize>) {
        let slots = &self.slots[pixel];
        let rank = slots.iter().position(|&kept| bin <= kept).unwrap_or(BINS_KEPT);
        if rank == BINS_KEPT {
            return;
        }
        if slots[rank] != bin {
            self.make_room(pixel, rank, bin);
        }
        let sums = match rank.checked_sub(1) {
            None => &mut self.nearest[pixel],
            Some(rank) => &mut self.further[self.places[pixel][rank] as usize],
        };
        sums.add(colour, weight, near);
    }

    /// Gives a pixel a bin without samples, which has this rank among its own.
    #[inline(never)]
    fn make_room(&mut self, pixel: usize, rank: usize, bin: u16) {
        const LAST: usize = BINS_KEPT - 1;
        self.is_empty = false;
        let (slots, places) = (&mut self.slots[pixel], &mut self.places[pixel]);
        if slots[0] == NONE {
            slots[0] = bin;
            self.nearest[pixel] = Sums::default();
            return;
        }
        let sums = if rank == 0 { std::mem::take(&mut self.nearest[pixel]) } else { Sums::default() };
        let place = if slots[LAST] == NONE {
            self.further.push(sums);
            (self.further.len() - 1) as u32
        } else {
            let place = places[LAST - 1];
            self.further[place as usize] = sums;
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
        self.nearest.get(pixel).into_iter().for_each(Sums::prefetch);
    }

    /// Asks for the sums of a pixel's bin, if they are there already and not of the nearest.
    #[inline(always)]
    pub fn prefetch_further(&self, pixel: usize, bin: u16) {
        let Some(slots) = self.slots.get(pixel) else { return };
        if let Some(rank) = slots[1..].iter().position(|&kept| bin == kept) {
            self.prefetch_place(self.places[pixel][rank]);
        }
    }

    /// Asks for all sums of a pixel.
    #[inline(always)]
    pub fn prefetch_all_sums(&self, pixel: usize) {
        let Some(slots) = self.slots.get(pixel) else { return };
        // Of an empty pixel those of the first, which are near at hand. Chosen, not skipped: which are empty no processor can tell beforehand.
        let nearest = if slots[0] == NONE { 0 } else { pixel };
        self.nearest.get(nearest).into_iter().for_each(Sums::prefetch);
        if slots[1] != NONE {
            self.places[pixel].iter().for_each(|&place| self.prefetch_place(place));
        }
    }

    #[inline(always)]
    fn prefetch_place(&self, place: u32) {
        self.further.get(place as usize).into_iter().for_each(Sums::prefetch);
    }

    /// The bins of every other pixel from one on, as many as are asked for.
    #[inline(always)]
    pub fn slots_of_every_other<const COUNT: usize>(&self, first: usize, count: usize, to: &mut [Slots; COUNT]) {
        let slots = self.slots.get(first..).unwrap_or_default();
        to.iter_mut().take(count).zip(slots.iter().step_by(2)).for_each(|(to, slots)| *to = *slots);
    }

    /// The sums of the nearest bins from a pixel on: of no meaning where there is none.
    #[inline(always)]
    pub fn nearest_from(&self, first: usize) -> &[Sums] {
        self.nearest.get(first..).unwrap_or_default()
    }

    /// Whether a pixel has samples.
    #[inline(always)]
    pub fn has(&self, pixel: usize) -> bool {
        self.slots.get(pixel).is_some_and(|slots| slots[0] != NONE)
    }

    /// Asks for all sums of some pixels.
    #[inline(always)]
    pub fn prefetch_sums_of(&self, pixels: Range<usize>) {
        let (Some(slots), Some(nearest)) = (self.slots.get(pixels.clone()), self.nearest.get(pixels.clone())) else {
            return;
        };
        let Some(first) = nearest.first() else { return };
        for ((slots, sums), pixel) in slots.iter().zip(nearest).zip(pixels) {
            // As in `prefetch_all_sums`.
            if slots[0] == NONE { first } else { sums }.prefetch();
            if slots[1] != NONE {
                self.places[pixel].iter().for_each(|&place| self.prefetch_place(place));
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
    pub fn of(&self, pixel: usize) -> impl Iterator<Item = (u16, &Sums)> {
        let slots = self.slots.get(pixel).unwrap_or(&EMPTY);
        let kept = slots.iter().take_while(|&&bin| bin != NONE).count();
        (0..kept).map(move |rank| {
            let sums = match rank.checked_sub(1) {
                None => &self.nearest[pixel],
                Some(rank) => &self.further[self.places[pixel][rank] as usize],
            };
            (slots[rank], sums)
        })
    }
}

/// The nearest [`BINS_KEPT`] bins of a pixel in both, nearest first, with the sums of both: complete, since a bin among the
/// nearest of both is among the nearest of each that has it.
pub(crate) fn merged(a: &PixelBins, b: &PixelBins, pixel: usize) -> impl Iterator<Item = (u16, Sums)> {
    let (mut a, mut b) = (a.of(pixel).peekable(), b.of(pixel).peekable());
    let next = move || {
        let (first, second) = (a.peek().map_or(NONE, |a| a.0), b.peek().map_or(NONE, |b| b.0));
        let mut found = (first.min(second), Sums::default());
        if first <= second {
            found.1.join(a.next()?.1);
        }
        if second <= first {
            found.1.join(b.next()?.1);
        }
        Some(found)
    };
    std::iter::from_fn(next).take(BINS_KEPT)
}

#[cfg(test)]
#[path = "bins_tests.rs"]
mod tests;
