//! The point image and the picture made from it, array by array, rows from the top.

use std::ops::Range;

use crate::colour;

/// Number of rows that one thread works on at a time. It changes no bit, because the result of a
/// row does not depend on where bands begin.
pub(crate) const ROWS: usize = 32;

/// The slot of a pixel without a point.
pub(crate) const NO_SLOT: u32 = u32::MAX;

/// The data of every pixel.
#[derive(Debug)]
pub(crate) struct PixelPlanes {
    pub width: usize,
    pub height: usize,
    /// Slot of the nearest point, or [`NO_SLOT`].
    pub slot: Vec<u32>,
    /// Depth of that point: positive for a sample of the current view, negative for an old point, 0
    /// without a point.
    pub depth: Vec<f32>,
    /// Packed colour of that point, or [`colour::NONE`] without a point or if it was culled.
    pub colour: Vec<u32>,
    /// Priority of a request for the pixel. Until the filter has run, the age of the nearest point.
    pub priority: Vec<u8>,
    /// The picture: radiance.
    pub picture: Vec<[f32; 3]>,
}

impl PixelPlanes {
    pub fn new((width, height): (usize, usize)) -> Self {
        let pixels = width * height;
        Self {
            width,
            height,
            slot: vec![NO_SLOT; pixels],
            depth: vec![0.0; pixels],
            colour: vec![colour::NONE; pixels],
            priority: vec![0; pixels],
            picture: vec![[0.0; 3]; pixels],
        }
    }

    /// Returns the number of pixels that show a point.
    pub fn point_count(&self) -> usize {
        self.colour.iter().filter(|&&colour| colour != colour::NONE).count()
    }

    /// Returns planes of another size without points. Their picture is this one, enlarged or
    /// reduced by taking the nearest pixels.
    pub fn resized(&self, size: (usize, usize)) -> Self {
        let mut planes = Self::new(size);
        planes.picture = nearest(&self.picture, (self.width, self.height), size);
        planes
    }

    /// Returns column and row of a pixel.
    pub fn place(&self, pixel: u32) -> (usize, usize) {
        let width = self.width as u32;
        ((pixel % width) as usize, (pixel / width) as usize)
    }

    /// Returns the slot of the point that a pixel shows. `None` if it has no point, or a culled
    /// one.
    pub fn shown(&self, pixel: u32) -> Option<usize> {
        let has_point = self.colour[pixel as usize] != colour::NONE;
        has_point.then(|| self.slot[pixel as usize] as usize)
    }

    /// Makes a pixel show a point until the next frame.
    pub fn show(&mut self, pixel: u32, slot: usize, colour: u32) {
        if (pixel as usize) < self.slot.len() {
            (self.slot[pixel as usize], self.colour[pixel as usize]) = (slot as u32, colour);
        }
    }
}

/// Returns the rows of a band in a picture of `height` rows.
pub(crate) fn rows_of(band: usize, height: usize) -> Range<usize> {
    band * ROWS..((band + 1) * ROWS).min(height)
}

/// Returns data of pixels, rows from the top, for a picture of another size: each pixel takes the
/// nearest of the old ones.
pub(crate) fn nearest<T: Copy>(pixels: &[T], from: (usize, usize), to: (usize, usize)) -> Vec<T> {
    let row = |row: usize| (2 * row + 1) * from.1 / (2 * to.1);
    let column = |column: usize| (2 * column + 1) * from.0 / (2 * to.0);
    let place = |pixel: usize| row(pixel / to.0) * from.0 + column(pixel % to.0);
    (0..to.0 * to.1).map(|pixel| pixels[place(pixel)]).collect()
}
