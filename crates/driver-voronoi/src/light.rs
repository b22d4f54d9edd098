//! The light of a layer's pixels, as it was reconstructed.
//!
//! Invariant: what was found for lone pixels and those beside them is kept, so that a picture made in parts is that made at once.

use super::blocks;
use holo_cpu::zeroed;
use std::ops::Range;

/// A pixel's choice may yet be a wider mean.
pub(crate) const OPEN: u8 = 1;

/// A pixel has a mean.
pub(crate) const KNOWN: u8 = 2;

/// Light of a layer's pixels, in fixed-point steps.
#[derive(Clone, Debug)]
pub(crate) struct Light {
    pub channels: [Vec<f32>; 3],
    /// [`OPEN`] and [`KNOWN`].
    pub states: Vec<u8>,
    /// By block, the widest tents that had a part in it.
    pub reaches: Vec<u8>,
    /// By block, pixels of surfaces that have no samples of their own.
    pub without: Vec<u32>,
    /// Pixels that have other light than was found for them, and that.
    lone: Vec<(u32, [f32; 3])>,
}

impl Light {
    /// Of so many columns and rows.
    pub fn unknown(size: (usize, usize)) -> Light {
        let count = size.0 * size.1;
        Light {
            channels: std::array::from_fn(|_| zeroed(count)),
            states: zeroed(count),
            reaches: vec![0; blocks::count(size)],
            without: vec![0; blocks::count(size)],
            lone: Vec::new(),
        }
    }

    /// Gives pixels other light than was found, which is kept.
    pub fn replace(&mut self, others: &[(u32, [f32; 3])]) {
        self.lone = others
            .iter()
            .filter_map(|&(pixel, _)| Some((pixel, self.at(pixel as usize)?)))
            .collect();
        others.iter().for_each(|&(pixel, light)| self.set(pixel as usize, light));
    }

    /// Gives them back what was found for them.
    pub fn restore(&mut self) {
        std::mem::take(&mut self.lone)
            .into_iter()
            .for_each(|(pixel, own)| self.set(pixel as usize, own));
    }

    /// `None` where no sample of a pixel's surface is near enough.
    #[inline]
    pub fn at(&self, pixel: usize) -> Option<[f32; 3]> {
        let state = self.states.get(pixel)?;
        (state & KNOWN != 0).then(|| [0, 1, 2].map(|channel: usize| self.channels[channel][pixel]))
    }

    /// That of some pixels, one after the other.
    pub fn rows(&self, pixels: Range<usize>) -> Rows<'_> {
        let states = &self.states[pixels.clone()];
        Rows { channels: self.channels.each_ref().map(|channel| &channel[pixels.clone()]), states }
    }

    /// Sets a pixel's.
    pub fn set(&mut self, pixel: usize, light: [f32; 3]) {
        if let Some(state) = self.states.get_mut(pixel) {
            *state |= KNOWN;
            self.channels.iter_mut().zip(light).for_each(|(channel, light)| channel[pixel] = light);
        }
    }

    /// Pixels of surfaces that have no samples of their own.
    pub fn without(&self) -> u64 {
        self.without.iter().map(|&count| u64::from(count)).sum()
    }
}

/// Light of some pixels.
pub(crate) struct Rows<'a> {
    channels: [&'a [f32]; 3],
    states: &'a [u8],
}

impl Rows<'_> {
    /// Whether there is light on any of them.
    pub fn any(&self) -> bool {
        self.states.iter().any(|state| state & KNOWN != 0)
    }

    /// As [`Light::at`], of the pixel with this number among them.
    #[inline]
    pub fn at(&self, number: usize) -> Option<[f32; 3]> {
        let state = self.states.get(number)?;
        (state & KNOWN != 0).then(|| self.channels.map(|channel| channel[number]))
    }
}
