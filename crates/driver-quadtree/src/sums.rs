//! Exact sums over samples, and what they tell.
//!
//! Every sum is of integers, and saturates where it could overflow, which integers ≥ 0 do in any order: the same samples give the same bits
//! whatever their order and batches. Wide as such sums have to be for scenes of any brightness, few need it: what is kept of all is their lower
//! parts, one cache line ([`Packed`]), and the parts above only where they are not 0 ([`High`]).

use bytemuck::{Pod, Zeroable};

/// Classes of nearness to the eye, each half as far as the last.
pub(crate) const NEAR_CLASSES: usize = 4;
/// Fraction bits of the colour sums: RGBE colours from 2⁻⁴⁰ · 256 up are exact, and a pixel of radiance 1 has room for 2²³ / 64 single paths before
/// a part above is needed for its colour.
pub(super) const COLOUR_FRACTION: i32 = 40;
/// Exponents above this are taken as this (radiances above 4e12), so that one sample cannot overflow its sum.
const MAX_EXPONENT: u8 = 170;
/// Doublings of RGBE's bytes in fixed point that are in [`Colour::fixed`]: of radiances up to 4080, whose luminance takes 32 bits.
const MOST_SHIFT: i32 = 44;
/// Fraction bits of luminance, for its second moment, and its upper bound.
pub(super) const LUMINANCE_SCALE: f32 = 1_048_576.0;
const LUMINANCE_MAX: f32 = (1_u64 << 50) as f32;
/// Fraction bits of compressed luminance, and its upper bound.
pub(super) const COMPRESSED_SCALE: f32 = 4096.0;
const COMPRESSED_MAX: f32 = (1_u64 << 26) as f32;

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
    /// Fixed point, less the doublings of bright ones.
    fixed: [u64; 3],
    doublings: u32,
    luminance: u64,
    compressed: u64,
    /// Up to this weight its products with it fit the lower parts of sums, but for that of luminance squared.
    most_weight: u32,
}

impl Colour {
    /// RGBE bytes: c·2^(e−136) each, which fixed point holds exactly from 2⁻⁴⁰ up.
    #[inline(always)]
    pub fn from_rgbe(rgbe: [u8; 4]) -> Self {
        let [r, g, b, exponent] = rgbe;
        if exponent == 0 {
            return Self {
                fixed: [0; 3],
                doublings: 0,
                luminance: 0,
                compressed: 0,
                most_weight: MOST_WEIGHT,
            };
        }
        let exponent = exponent.min(MAX_EXPONENT);
        let shift = i32::from(exponent) - 136 + COLOUR_FRACTION;
        let (left, right) = (shift.clamp(0, MOST_SHIFT), (-shift).clamp(0, 8));
        // 2^(e-136): normal for e ≥ 10, and what is smaller is 0 in every fixed point here.
        let scale = f32::from_bits(u32::from(exponent.saturating_sub(9)) << 23);
        let luminance = luminance([f32::from(r), f32::from(g), f32::from(b)]) * scale;
        let doublings = (shift - MOST_SHIFT).max(0) as u32;
        let room = MOST_WEIGHT.min((LOW >> 8 >> left) as u32);
        Self {
            fixed: [r, g, b].map(|c| u64::from(c) << left >> right),
            doublings,
            luminance: (luminance * LUMINANCE_SCALE).min(LUMINANCE_MAX) as u64,
            compressed: (compress(luminance) * COMPRESSED_SCALE).min(COMPRESSED_MAX) as u64,
            most_weight: if doublings == 0 { room } else { 0 },
        }
    }
}

/// Sums over the samples of one depth bin of one pixel.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub(crate) struct Sums {
    rgb: [u128; 3],
    luminance_squared: u128,
    compressed_squared: u128,
    compressed: u64,
    weight: u64,
    weight_squared: u64,
    count: u32,
    near: [u32; NEAR_CLASSES],
}

/// What sums of any kind tell.
pub(crate) trait Summed {
    /// Samples.
    fn count(&self) -> u32;

    /// Samples whose ray passes so near the eye that they are samples of this very pixel, by how near: within the radius,
    /// within half of it, a quarter, and so on. Each counts for itself only, not in the wider ones.
    fn near(&self) -> [u32; NEAR_CLASSES];

    /// Means. There must be samples.
    fn moments(&self) -> Moments;

    /// The sums themselves.
    fn sums(&self) -> Sums;
}

impl Sums {
    /// Adds a sample of a weight, of a class of nearness if it is near.
    pub fn add(&mut self, colour: &Colour, weight: u32, near: Option<usize>) {
        let wide = u128::from(weight);
        let mut near_classes = [0; NEAR_CLASSES];
        if let Some(count) = near.and_then(|class| near_classes.get_mut(class)) {
            *count = 1;
        }
        let squared = |number: u64| u128::from(number) * u128::from(number);
        self.join(&Self {
            rgb: colour.fixed.map(|value| (u128::from(value) << colour.doublings) * wide),
            luminance_squared: squared(colour.luminance) * wide,
            compressed_squared: squared(colour.compressed) * wide,
            compressed: colour.compressed * u64::from(weight),
            weight: u64::from(weight),
            weight_squared: u64::from(weight) * u64::from(weight),
            count: 1,
            near: near_classes,
        });
    }

    /// Adds another bin's sums: two bins of one surface.
    #[inline(always)]
    pub fn join(&mut self, other: &Self) {
        // None is near the end of its type: a sum of two fits.
        let wide = |sum: &mut u128, other: u128| *sum = (*sum + other).min(MOST_WIDE);
        let long = |sum: &mut u64, other: u64| *sum = (*sum + other).min(MOST_LONG);
        self.rgb.iter_mut().zip(other.rgb).for_each(|(sum, other)| wide(sum, other));
        wide(&mut self.luminance_squared, other.luminance_squared);
        wide(&mut self.compressed_squared, other.compressed_squared);
        long(&mut self.compressed, other.compressed);
        long(&mut self.weight, other.weight);
        long(&mut self.weight_squared, other.weight_squared);
        self.count = (self.count + other.count).min(MOST_COUNT);
        for (near, other) in self.near.iter_mut().zip(other.near) {
            *near = (*near + other).min(MOST_NEAR);
        }
    }

    /// Their lower parts, and those above.
    pub fn packed(&self) -> (Packed, High) {
        let [r, g, b] = self.rgb;
        let wide =
            [r, g, b, self.luminance_squared, self.compressed_squared, self.compressed.into()];
        let (mut low, mut high) = ([0; 8], [0; 8]);
        for (number, sum) in wide.into_iter().enumerate() {
            (low[number], high[number]) = (sum as u64 & LOW, (sum >> LOW_BITS) as u64);
        }
        low[WEIGHTS] = self.weight & LOW_HALF | (self.weight_squared & LOW_HALF) << 32;
        high[WEIGHTS] = self.weight >> LOW_HALF_BITS | self.weight_squared >> LOW_HALF_BITS << 32;
        for (class, &count) in self.near.iter().enumerate() {
            low[COUNTS] |= u64::from(count & LOW_NEAR) << (32 + 8 * class);
            high[COUNTS] |= u64::from(count >> LOW_NEAR_BITS) << (16 * class);
        }
        low[COUNTS] |= u64::from(self.count | if high == [0; 8] { 0 } else { HAS_HIGH });
        (Packed(low), High(high))
    }
}

impl Summed for Sums {
    #[inline(always)]
    fn count(&self) -> u32 {
        self.count
    }

    #[inline(always)]
    fn near(&self) -> [u32; NEAR_CLASSES] {
        self.near
    }

    #[inline(always)]
    fn moments(&self) -> Moments {
        // Within two roundings, where the language's own conversion is a call that takes several times as long.
        let wide = |sum: u128| {
            (sum >> 64) as u64 as f64 * 18_446_744_073_709_551_616.0 + sum as u64 as f64
        };
        let [red, green, blue] = self.rgb.map(wide);
        let (squared, compressed_squared) =
            (wide(self.luminance_squared), wide(self.compressed_squared));
        let [compressed, weight, weight_squared] =
            [self.compressed, self.weight, self.weight_squared].map(|sum| sum as f64);
        Moments::new(
            [red, green, blue, squared, compressed_squared, compressed],
            weight,
            weight_squared,
        )
    }

    #[inline(always)]
    fn sums(&self) -> Sums {
        *self
    }
}

/// Bits of the lower part of a wide sum, of half a word's, and of a count of near ones: one less than there is room for, where it is seen that
/// a sum does not fit.
pub(super) const LOW_BITS: u32 = 63;
const LOW: u64 = (1 << LOW_BITS) - 1;
pub(super) const LOW_HALF_BITS: u32 = 31;
const LOW_HALF: u64 = (1 << LOW_HALF_BITS) - 1;
const LOW_NEAR_BITS: u32 = 7;
const LOW_NEAR: u32 = (1 << LOW_NEAR_BITS) - 1;
/// What sums end at: there is room for it in both parts, and two of the wide ones are a finite number in single precision, too.
const MOST_WIDE: u128 = (1 << (LOW_BITS + 63)) - 1;
const MOST_LONG: u64 = (1 << (LOW_HALF_BITS + 32)) - 1;
/// Most samples that are counted, and of those most of one class of nearness.
const MOST_COUNT: u32 = (1 << 30) - 1;
const MOST_NEAR: u32 = (1 << (LOW_NEAR_BITS + 16)) - 1;
/// Of the word that counts: there are parts above.
pub(super) const HAS_HIGH: u32 = 1 << 31;
/// Weights up to this have squares that fit half a word.
const MOST_WEIGHT: u32 = 46_340;

// Words of what is kept: red, green, blue, and from here on the others.
pub(super) const LUMINANCE_SQUARED: usize = 3;
pub(super) const COMPRESSED_SQUARED: usize = 4;
pub(super) const COMPRESSED: usize = 5;
/// The weight in the lower half, that of squares in the upper.
pub(super) const WEIGHTS: usize = 6;
/// Samples in the lower half, near ones in the upper, a byte for each class.
pub(super) const COUNTS: usize = 7;

/// Bits of the words that are set once a sum does not fit.
const NO_ROOM: [u64; 8] = {
    let mut bits = [!LOW; 8];
    bits[WEIGHTS] = (1 << LOW_HALF_BITS) | (1 << (32 + LOW_HALF_BITS));
    bits[COUNTS] = (MOST_COUNT as u64 + 1) | 0x8080_8080 << 32;
    bits
};

/// The lower parts of sums: one cache line.
#[derive(Clone, Copy, Default, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Packed([u64; 8]);

/// The parts above, in the same places; of near samples 16 bits for each class, and of samples none.
#[derive(Clone, Copy, Default, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct High([u64; 8]);

impl Packed {
    /// As [`Sums::add`], if no part above changes by it; else nothing changes, and it is false.
    #[inline(always)]
    #[must_use]
    pub fn add(&mut self, colour: &Colour, weight: u32, near: Option<usize>) -> bool {
        let long = u64::from(weight);
        if weight > colour.most_weight {
            return false;
        }
        let luminance_squared = u128::from(colour.luminance) * u128::from(colour.luminance * long);
        if luminance_squared > u128::from(LOW) {
            return false;
        }
        let near =
            near.filter(|&class| class < NEAR_CLASSES).map_or(0, |class| 1 << (32 + 8 * class));
        let [r, g, b] = colour.fixed;
        let compressed = colour.compressed * long;
        let added = [
            r * long,
            g * long,
            b * long,
            luminance_squared as u64,
            colour.compressed * compressed,
            compressed,
            long | (long * long) << 32,
            1 | near,
        ];
        self.plus(added)
    }

    /// As [`Sums::join`], if neither has parts above nor gets any; else nothing changes, and it is false.
    #[inline(always)]
    #[must_use]
    pub fn join(&mut self, other: &Self) -> bool {
        !self.has_high() && !other.has_high() && self.plus(other.0)
    }

    #[inline(always)]
    fn plus(&mut self, added: [u64; 8]) -> bool {
        let mut sums = self.0;
        let mut over = 0;
        for word in 0..8 {
            sums[word] += added[word];
            over |= sums[word] & NO_ROOM[word];
        }
        if over == 0 {
            self.0 = sums;
        }
        over == 0
    }

    /// Whether there are parts above.
    #[inline(always)]
    pub fn has_high(&self) -> bool {
        self.0[COUNTS] & u64::from(HAS_HIGH) != 0
    }

    /// Samples.
    #[inline(always)]
    pub fn count(&self) -> u32 {
        self.0[COUNTS] as u32 & !HAS_HIGH
    }
}

/// Sums as they are kept.
#[derive(Clone, Copy)]
pub(crate) struct Kept<'a> {
    pub packed: &'a Packed,
    /// If there are any.
    pub high: Option<&'a High>,
}

impl Summed for Kept<'_> {
    #[inline(always)]
    fn count(&self) -> u32 {
        self.packed.count()
    }

    #[inline(always)]
    fn near(&self) -> [u32; NEAR_CLASSES] {
        let low = (self.packed.0[COUNTS] >> 32) as u32;
        let mut near = low.to_le_bytes().map(u32::from);
        if let Some(high) = self.high {
            for (class, near) in near.iter_mut().enumerate() {
                *near |= u32::from((high.0[COUNTS] >> (16 * class)) as u16) << LOW_NEAR_BITS;
            }
        }
        near
    }

    #[inline(always)]
    fn moments(&self) -> Moments {
        if self.high.is_some() {
            return self.sums().moments();
        }
        let [red, green, blue, squared, compressed_squared, compressed, ..] =
            self.packed.0.map(|word| word as f64);
        let weights = self.packed.0[WEIGHTS];
        let (weight, weight_squared) =
            (f64::from(weights as u32), f64::from((weights >> 32) as u32));
        Moments::new(
            [red, green, blue, squared, compressed_squared, compressed],
            weight,
            weight_squared,
        )
    }

    #[inline(always)]
    fn sums(&self) -> Sums {
        let (low, high) = (self.packed.0, self.high.map_or([0; 8], |high| high.0));
        let wide = |at: usize| u128::from(high[at]) << LOW_BITS | u128::from(low[at]);
        let half = |shift: u32| {
            let of = |words: [u64; 8]| words[WEIGHTS] >> shift & 0xffff_ffff;
            of(high) << LOW_HALF_BITS | of(low)
        };
        Sums {
            rgb: [wide(0), wide(1), wide(2)],
            luminance_squared: wide(LUMINANCE_SQUARED),
            compressed_squared: wide(COMPRESSED_SQUARED),
            compressed: wide(COMPRESSED) as u64,
            weight: half(0),
            weight_squared: half(32),
            count: self.count(),
            near: self.near(),
        }
    }
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

impl Moments {
    /// Of sums of red, green, blue, luminance squared, and of compressed luminance squared and plain, in their fixed points.
    #[inline(always)]
    fn new(sums: [f64; 6], weight: f64, weight_squared: f64) -> Self {
        // All at once. Every scale is a power of two, so where it is applied changes no bit.
        let [scale, luminance_squared, compressed_squared, compressed] =
            [1.0, sums[3], sums[4], sums[5]].map(|sum| sum / weight);
        let scale = scale / (1_u64 << COLOUR_FRACTION) as f64;
        let compressed_scale = f64::from(COMPRESSED_SCALE);
        Self {
            weight,
            weight_squared,
            mean: [sums[0] * scale, sums[1] * scale, sums[2] * scale],
            luminance_squared: luminance_squared / f64::from(LUMINANCE_SCALE).powi(2),
            compressed: compressed / compressed_scale,
            compressed_squared: compressed_squared / (compressed_scale * compressed_scale),
        }
    }
}

#[cfg(test)]
#[path = "sums_tests.rs"]
mod tests;
