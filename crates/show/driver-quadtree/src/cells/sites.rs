//! One sample for each pixel: the site of its cell.
//!
//! Invariant: a pixel's site is its first sample by depth bin, then by distance from the pixel's
//! middle, then by bytes. It is a function of the set of samples, not of their order.

use crate::reproject::Landing;

/// A sample, and where it landed in its pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Site {
    /// Depth bin, then the square of the distance from the middle in 512ths of a pixel, then the
    /// place in the pixel.
    rank: u64,
    /// Bits of the distance from the eye. Those of positive numbers sort as the numbers do.
    depth: u32,
    pub rgbe: [u8; 4],
}

const NONE: Site = Site { rank: u64::MAX, depth: 0, rgbe: [0; 4] };

impl Site {
    pub fn new(landing: &Landing, rgbe: [u8; 4]) -> Self {
        let [across, down] = landing.within;
        let aside = |part: u8| u64::from((2 * u16::from(part) + 1).abs_diff(256)).pow(2);
        let rank = u64::from(landing.bin) << 48
            | (aside(across) + aside(down)) << 16
            | u64::from(across) << 8
            | u64::from(down);
        Self { rank, depth: landing.depth.to_bits(), rgbe }
    }

    /// Returns the depth bin.
    pub fn bin(&self) -> u16 {
        (self.rank >> 48) as u16
    }

    /// Returns the distance from the eye; infinite for nothing.
    pub fn depth(&self) -> f32 {
        f32::from_bits(self.depth)
    }

    /// Returns how far right of the pixel's middle and below it the sample lies, pixels.
    pub fn aside(&self) -> [f32; 2] {
        let within = [(self.rank >> 8) as u8, self.rank as u8];
        within.map(|part| (f32::from(part) + 0.5) / 256.0 - 0.5)
    }
}

/// The sites of all pixels.
pub(super) struct Sites(Vec<Site>);

impl Sites {
    pub fn new(pixels: usize) -> Self {
        Self(vec![NONE; pixels])
    }

    /// Adds a sample of a pixel.
    pub fn add(&mut self, pixel: usize, site: Site) {
        if let Some(old) = self.0.get_mut(pixel) {
            *old = site.min(*old);
        }
    }

    /// Returns the site of a pixel, if it has a sample.
    pub fn of(&self, pixel: usize) -> Option<&Site> {
        self.0.get(pixel).filter(|site| site.rank != NONE.rank)
    }
}
