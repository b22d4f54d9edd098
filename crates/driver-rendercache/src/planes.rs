//! The point image and the picture made from it, array by array, rows from the top.

use holo_picture::Picture;
use rayon::prelude::*;

/// Rows that one thread works on at a time. It changes no bit: what is written to a row does not
/// depend on where bands of rows begin.
pub(crate) const ROWS: usize = 16;

/// Pixels along the side of the widest filter.
pub(crate) const WIDEST: usize = 9;

/// The point that a pixel shows. The least of several keys is that of the nearest fresh point, else
/// of the nearest point; of equally near ones, of the first in the cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key(u64);

impl Key {
    /// No point.
    pub const NONE: Self = Self(u64::MAX);
    /// The bit of a point that is not a sample of the current view. Depths have no sign.
    const OLD: u64 = 1 << 63;

    /// Returns the key of a point at a positive depth.
    pub fn new(depth: f32, is_fresh: bool, slot: usize) -> Self {
        let old = if is_fresh { 0 } else { Self::OLD };
        Self(old | u64::from(depth.to_bits()) << 32 | slot as u64)
    }

    pub fn slot(self) -> usize {
        self.0 as u32 as usize
    }

    pub fn depth(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32).abs()
    }

    pub fn is_fresh(self) -> bool {
        self.0 & Self::OLD == 0
    }
}

/// What is kept for every pixel.
#[derive(Debug)]
pub(crate) struct Planes {
    pub width: usize,
    pub height: usize,
    /// The nearest point.
    pub nearest: Vec<Key>,
    /// Its depth, 0 without one.
    pub depth: Vec<f32>,
    /// Its radiance, unless it was culled.
    pub light: Light,
    /// How much a sample is wanted. Until the filter has run, the age of the nearest point.
    pub priority: Vec<u8>,
    pub picture: Picture,
}

impl Planes {
    pub fn new((width, height): (u32, u32)) -> Self {
        let picture = Picture::new(width, height);
        let (width, height) = (width as usize, height as usize);
        Self {
            width,
            height,
            nearest: vec![Key::NONE; width * height],
            depth: vec![0.0; width * height],
            light: Light::new(width, height),
            priority: vec![0; width * height],
            picture,
        }
    }

    /// Returns the slot of the point that a pixel shows. One that was culled is not shown.
    pub fn shown(&self, pixel: u32) -> Option<usize> {
        let (column, row) = (pixel as usize % self.width, pixel as usize / self.width);
        let has_point = self.light.row(row + Light::MARGIN)[column + Light::MARGIN][3] > 0.0;
        has_point.then(|| self.nearest[pixel as usize].slot())
    }

    /// Lets a pixel show a point until the next frame.
    pub fn show(&mut self, pixel: u32, slot: usize, [red, green, blue]: [f32; 3]) {
        let (column, row) = (pixel as usize % self.width, pixel as usize / self.width);
        if let Some(nearest) = self.nearest.get_mut(pixel as usize) {
            *nearest = Key::new(f32::MIN_POSITIVE, true, slot);
            let at = (row + Light::MARGIN) * self.light.stride + column + Light::MARGIN;
            self.light.pixels[at] = [red, green, blue, 1.0];
        }
    }
}

/// Radiances with a count of 1 behind them, or four zeros where there is no point. A margin of
/// zeros is around the picture, so that filters need not look for its edges.
#[derive(Debug)]
pub(crate) struct Light {
    stride: usize,
    pixels: Vec<[f32; 4]>,
}

impl Light {
    /// Width of the margin: the reach of the widest filter.
    pub const MARGIN: usize = WIDEST / 2;

    fn new(width: usize, height: usize) -> Self {
        let stride = width + 2 * Self::MARGIN;
        Self { stride, pixels: vec![[0.0; 4]; stride * (height + 2 * Self::MARGIN)] }
    }

    /// Returns a row with its margins. Row [`MARGIN`](Self::MARGIN) is the picture's first.
    pub fn row(&self, row: usize) -> &[[f32; 4]] {
        &self.pixels[row * self.stride..][..self.stride]
    }

    /// Returns the picture's rows in bands of `rows`, without their margins.
    pub fn bands_mut(
        &mut self,
        rows: usize,
    ) -> impl IndexedParallelIterator<Item = impl Iterator<Item = &mut [[f32; 4]]>> {
        let stride = self.stride;
        let margin = Self::MARGIN * stride;
        let picture = margin..self.pixels.len() - margin;
        self.pixels[picture].par_chunks_mut(stride * rows).map(move |band| {
            band.chunks_mut(stride).map(move |row| &mut row[Self::MARGIN..stride - Self::MARGIN])
        })
    }
}
