//! Sums of samples by pixel and depth bin.
//!
//! Invariants:
//! - A pixel has its [`BINS_KEPT`] nearest bins, and their sums are complete. A bin is refused or
//!   removed only if the pixel has that many nearer bins. A bin makes room only for a nearer one.
//!   So a bin that is among the nearest at the end was never refused or removed.
//! - Memory is 140 bytes for each pixel and 384 bytes for each pixel with more than one bin.

use crate::sums::{BinSums, Colour};

/// Number of depth bins of each pixel, the nearest ones. A pixel rarely sees more than two
/// surfaces.
pub(crate) const BINS_KEPT: usize = 4;
/// Number of depth bins for each doubling of the distance.
pub(crate) const BINS_PER_OCTAVE: u16 = 32;
/// Bin of samples that hit nothing: beyond every other bin, adjacent to none.
pub(crate) const FAR: u16 = u16::MAX - 1;
/// The number that stands for no bin.
const NONE: u16 = u16::MAX;
/// Number of low bits that are cut from a squared distance as f32. Four bits of its mantissa
/// remain: 16 bins for each doubling of the square, 32 for each doubling of the distance. Bins are
/// 1.6 to 3.1 % wide.
const BIN_SHIFT: u32 = 19;

/// Returns the logarithmic depth bin of a squared distance from the eye.
#[inline(always)]
pub(crate) fn depth_bin(distance_squared: f64) -> u16 {
    // Positive floats sort as their bits do, and the bits are a logarithm good enough for bins.
    ((distance_squared as f32).to_bits() >> BIN_SHIFT) as u16
}

/// Returns the distance at the middle of a bin; infinity for [`FAR`].
#[inline(always)]
pub(crate) fn bin_distance(bin: u16) -> f32 {
    if bin >= FAR {
        return f32::INFINITY;
    }
    f32::from_bits((u32::from(bin) << BIN_SHIFT) | 1 << (BIN_SHIFT - 1)).sqrt()
}

/// The depth bins of all pixels.
pub(crate) struct PixelBins {
    /// The bins of each pixel, nearest first.
    bins: Vec<[u16; BINS_KEPT]>,
    /// Sums of each pixel's nearest bin; no meaning if the pixel has none.
    nearest: Vec<BinSums>,
    /// Index into `further` of a pixel's other bins; no meaning if it has one bin or none.
    places: Vec<u32>,
    further: Vec<[BinSums; BINS_KEPT - 1]>,
}

impl PixelBins {
    pub fn new(pixels: usize) -> Self {
        Self {
            bins: vec![[NONE; BINS_KEPT]; pixels],
            nearest: bytemuck::zeroed_vec(pixels),
            places: vec![0; pixels],
            further: Vec::new(),
        }
    }

    /// Adds a sample of a pixel.
    #[inline(always)]
    pub fn add(
        &mut self,
        pixel: usize,
        bin: u16,
        colour: &Colour,
        weight: u32,
        near: Option<usize>,
    ) {
        let bins = &self.bins[pixel];
        let Some(rank) = bins.iter().position(|&kept| bin <= kept) else { return };
        if bins[rank] != bin {
            self.make_room(pixel, rank, bin);
        }
        let sums = match rank {
            0 => &mut self.nearest[pixel],
            _ => &mut self.further[self.places[pixel] as usize][rank - 1],
        };
        sums.add(colour, weight, near);
    }

    /// Inserts an empty bin at a rank among a pixel's bins.
    #[inline(never)]
    fn make_room(&mut self, pixel: usize, rank: usize, bin: u16) {
        let bins = &mut self.bins[pixel];
        let count = bins.iter().filter(|&&kept| kept != NONE).count();
        bins[rank..].rotate_right(1);
        bins[rank] = bin;
        if count == 0 {
            self.nearest[pixel] = BinSums::default();
            return;
        }
        if count == 1 {
            self.places[pixel] = self.further.len() as u32;
            self.further.push([BinSums::default(); BINS_KEPT - 1]);
        }
        let further = &mut self.further[self.places[pixel] as usize];
        let shifted = &mut further[rank.saturating_sub(1)..];
        shifted.rotate_right(1);
        shifted[0] =
            if rank == 0 { std::mem::take(&mut self.nearest[pixel]) } else { BinSums::default() };
    }

    /// Returns the bins of a pixel, nearest first, with their sums.
    #[inline(always)]
    pub fn of(&self, pixel: usize) -> impl Iterator<Item = (u16, &BinSums)> {
        let bins = self.bins[pixel].iter().take_while(|&&bin| bin != NONE);
        bins.enumerate().map(move |(rank, &bin)| match rank {
            0 => (bin, &self.nearest[pixel]),
            _ => (bin, &self.further[self.places[pixel] as usize][rank - 1]),
        })
    }
}

/// Returns the [`BINS_KEPT`] nearest bins of a pixel in `a` and `b` together, nearest first.
///
/// Their sums are complete, because a bin among the nearest of both is also among the nearest of
/// `a` and of `b`.
pub(crate) fn merged(
    a: &PixelBins,
    b: &PixelBins,
    pixel: usize,
) -> impl Iterator<Item = (u16, BinSums)> {
    let (mut a, mut b) = (a.of(pixel).peekable(), b.of(pixel).peekable());
    let next = move || {
        let bin = a.peek().into_iter().chain(b.peek()).map(|(bin, _)| *bin).min()?;
        let mut sums = BinSums::default();
        for part in [a.next_if(|next| next.0 == bin), b.next_if(|next| next.0 == bin)] {
            part.into_iter().for_each(|(_, part)| sums.join(part));
        }
        Some((bin, sums))
    };
    std::iter::from_fn(next).take(BINS_KEPT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sums::NEAR_CLASSES;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        #[test]
        fn a_pixel_keeps_its_nearest_bins_with_complete_sums(
            samples in prop::collection::vec((0..9_u16, any::<[u8; 4]>(), 1..70_000_u32), 0..200)
        ) {
            let mut bins = PixelBins::new(3);
            let mut model: BTreeMap<u16, BinSums> = BTreeMap::new();
            for &(bin, rgbe, weight) in &samples {
                let (colour, near) = (Colour::from_rgbe(rgbe), usize::from(bin) % NEAR_CLASSES);
                bins.add(1, bin, &colour, weight, Some(near));
                model.entry(bin).or_default().add(&colour, weight, Some(near));
            }
            let kept: Vec<(u16, BinSums)> = bins.of(1).map(|(bin, sums)| (bin, *sums)).collect();
            let expected: Vec<(u16, BinSums)> = model.into_iter().take(BINS_KEPT).collect();
            prop_assert_eq!(kept, expected);
            prop_assert_eq!(bins.of(0).count() + bins.of(2).count(), 0);
            prop_assert!(bins.further.len() < 2);
        }

        #[test]
        fn two_merged_are_as_if_all_had_been_added_to_one(
            samples in prop::collection::vec(
                (0..9_u16, any::<[u8; 4]>(), 1..70_000_u32, any::<bool>()), 0..60)
        ) {
            let mut parts = [PixelBins::new(1), PixelBins::new(1)];
            let mut whole = PixelBins::new(1);
            for &(bin, rgbe, weight, part) in &samples {
                let colour = Colour::from_rgbe(rgbe);
                parts[usize::from(part)].add(0, bin, &colour, weight, None);
                whole.add(0, bin, &colour, weight, None);
            }
            let found: Vec<(u16, BinSums)> = merged(&parts[0], &parts[1], 0).collect();
            let expected: Vec<(u16, BinSums)> = whole.of(0).map(|(bin, sums)| (bin, *sums)).collect();
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn bins_are_logarithmic_and_ordered() {
        let mut last = (0, 0.0);
        for step in 0..20_000 {
            let distance = 1e-4 * 1.002_f64.powi(step);
            let bin = depth_bin(distance * distance);
            assert!(bin >= last.0 && bin < FAR);
            if bin > last.0 && step > 0 && last.1 > 0.0 {
                assert_eq!(bin, last.0 + 1, "no bin is skipped by steps of 0.2 %");
            }
            last = (bin, distance);
            assert!((f64::from(bin_distance(bin)) / distance - 1.0).abs() < 0.016);
        }
        assert!(bin_distance(FAR).is_infinite());
        let octave = depth_bin(4.0 * 7.0 * 7.0) - depth_bin(7.0 * 7.0);
        assert_eq!(octave, BINS_PER_OCTAVE);
    }
}
