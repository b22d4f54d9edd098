//! A picture of linear radiance in memory.
//!
//! Always true: row 0 is the top row. Values are radiance in W·sr⁻¹·m⁻² per RGB channel, whatever
//! the exposure of a file was.

use crate::error::PictureError;
use crate::files::{self, Format};
use crate::view::{View, check_size};
use std::path::Path;

/// Most pixels of a picture: 2²⁶ take 805 MB, far more than any display needs.
pub const MAX_PIXELS: u64 = 1 << 26;

/// Most pixels on one side of a picture. Bounds the memory for one scanline.
pub const MAX_SIDE: u32 = 65_535;

/// Returns the luminance in cd/m² of a radiance in W·sr⁻¹·m⁻² per RGB channel: 179·(0.265R + 0.670G
/// + 0.065B), as in Radiance.
#[inline]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    179.0 * (0.265 * rgb[0] + 0.670 * rgb[1] + 0.065 * rgb[2])
}

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
    /// The factor by which a `.hdr` file multiplies radiance (its `EXPOSURE=`), kept to be written
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

    /// Checks the size of a picture: each side from 1 to [`MAX_SIDE`], and at most [`MAX_PIXELS`]
    /// in all.
    ///
    /// # Errors
    /// [`PictureError::Size`].
    pub fn check_size(width: u32, height: u32) -> Result<(), PictureError> {
        check_size((width, height))
            .map_err(|_| PictureError::Size { width: width.into(), height: height.into() })
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

    /// Reads a picture. The first bytes decide about the format; the extension decides only if they
    /// do not.
    ///
    /// - `.hdr`, `.pic`: Radiance RGBE, flat or with either run-length encoding. `EXPOSURE=` and
    ///   `COLORCORR=` are divided out, `VIEW=` is kept.
    /// - `.pfm`: colour or grey, either byte order, multiplied by the magnitude of its scale.
    /// - `.exr`: R, G and B of the first layer that has them.
    ///
    /// # Errors
    /// The file cannot be read, is of another format, is damaged, or has more than [`MAX_PIXELS`]
    /// pixels. The error names the file.
    pub fn read(path: impl AsRef<Path>) -> Result<Picture, PictureError> {
        files::read(path.as_ref())
    }

    /// Decodes a picture from the bytes of a file. `.png` is not supported.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn decode(bytes: &[u8], format: Format) -> Result<Picture, PictureError> {
        files::decode(bytes, format)
    }

    /// Writes `.hdr` (or `.pic`), `.pfm`, `.exr` (32-bit floats) or `.png`, depending on the
    /// extension. A `.png` has the default [`Look`](crate::Look); [`Image::write`](crate::Image::write)
    /// writes others.
    ///
    /// The file appears whole or not at all: it is written under another name, flushed, and
    /// renamed.
    ///
    /// # Errors
    /// An unknown extension, a picture whose fields disagree, or a failure of the disk. The error
    /// names the file.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), PictureError> {
        files::write(self, path.as_ref())
    }

    /// Encodes the picture as the bytes of a file.
    ///
    /// # Errors
    /// A picture whose fields disagree.
    pub fn encode(&self, format: Format) -> Result<Vec<u8>, PictureError> {
        files::encode(self, format)
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
