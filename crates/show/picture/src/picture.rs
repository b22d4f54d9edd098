//! A picture of linear radiance in memory.
//!
//! Invariants: row 0 is the top row. Values are radiance in W·sr⁻¹·m⁻² per RGB channel, whatever
//! the exposure of a file was.

use crate::error::PictureError;
use crate::size::is_size;
use crate::view::View;

/// Linear radiance, pixel by pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width * height` radiances (RGB, W·sr⁻¹·m⁻²), rows from the top, each from the left.
    pub pixels: Vec<[f32; 3]>,
    /// The view of the picture, if known.
    pub view: Option<View>,
    /// The exposure of a `.hdr` file (`EXPOSURE=`), a factor of its radiance, for writing the file
    /// again. `pixels` never contain it.
    pub exposure: f32,
}

impl Picture {
    /// Returns a black picture. Call [`Picture::check_size`] first for sizes from outside. Sizes
    /// from [`View::resolve`] have been checked.
    pub fn new(width: u32, height: u32) -> Picture {
        let pixels = vec![[0.0; 3]; width as usize * height as usize];
        Picture { width, height, pixels, view: None, exposure: 1.0 }
    }

    /// Returns a picture of these pixels, in rows from the top.
    ///
    /// # Errors
    /// A size outside the limits, or a number of pixels other than `width * height`.
    pub fn from_pixels(
        width: u32,
        height: u32,
        pixels: Vec<[f32; 3]>,
    ) -> Result<Picture, PictureError> {
        let picture = Picture { width, height, pixels, view: None, exposure: 1.0 };
        picture.check()?;
        Ok(picture)
    }

    /// Checks the size of a picture: each side from 1 to [`MAX_SIDE`](crate::MAX_SIDE), and at
    /// most [`MAX_PIXELS`](crate::MAX_PIXELS) in all.
    ///
    /// # Errors
    /// [`PictureError::Size`].
    pub fn check_size(width: u32, height: u32) -> Result<(), PictureError> {
        if is_size((width, height)) {
            Ok(())
        } else {
            Err(PictureError::Size { width: width.into(), height: height.into() })
        }
    }

    /// Returns (width, height).
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the radiance of a pixel; `row` 0 is at the top. `None` outside the picture.
    pub fn get(&self, column: u32, row: u32) -> Option<[f32; 3]> {
        if column >= self.width {
            return None;
        }
        self.pixels.get(row as usize * self.width as usize + column as usize).copied()
    }

    /// Checks that size, pixels and exposure agree, because the fields are public.
    pub(crate) fn check(&self) -> Result<(), PictureError> {
        Picture::check_size(self.width, self.height)?;
        if self.pixels.len() != self.width as usize * self.height as usize {
            let (width, height, pixels) = (self.width, self.height, self.pixels.len());
            return Err(PictureError::PixelCount { width, height, pixels });
        }
        if !(self.exposure.is_finite() && self.exposure > 0.0) {
            return Err(PictureError::Exposure(self.exposure));
        }
        Ok(())
    }
}
