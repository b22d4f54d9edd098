//! A picture of linear radiance in memory.
//!
//! Invariant of every function here: row 0 is the top row, and values are radiance in W·sr⁻¹·m⁻² per RGB channel,
//! whatever exposure a file had.

use crate::error::PictureError;
use crate::files::{self, Format};
use crate::view::{View, check_size};
use std::path::Path;

/// Most pixels of a picture: 2²⁶ take 805 MB, and no picture of ours comes near.
pub const MAX_PIXELS: u64 = 1 << 26;

/// Most pixels on one side of a picture; bounds what one scanline can take.
pub const MAX_SIDE: u32 = 65_535;

/// Luminance in cd/m² of a radiance in W·sr⁻¹·m⁻² per RGB channel: 179·(0.265R + 0.670G + 0.065B), as Radiance has it.
#[inline]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    179.0 * (0.265 * rgb[0] + 0.670 * rgb[1] + 0.065 * rgb[2])
}

/// Linear radiance, pixel by pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// `width * height` radiances (RGB, W·sr⁻¹·m⁻²), rows from the top, each from the left.
    pub pixels: Vec<[f32; 3]>,
    /// The view that it shows, where known.
    pub view: Option<View>,
    /// What a `.hdr` file multiplies radiance by (its `EXPOSURE=`), kept to be written again. `pixels` never contain it.
    pub exposure: f32,
}

impl Picture {
    /// A black picture. For sizes that come from outside call [`Picture::check_size`] first; sizes of
    /// [`View::resolve`] have been checked.
    pub fn new(width: u32, height: u32) -> Picture {
        let pixels = vec![[0.0; 3]; width as usize * height as usize];
        Picture { width, height, pixels, view: None, exposure: 1.0 }
    }

    /// A picture of these pixels, rows from the top.
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

    /// Fails unless a picture of this size may be made: each side 1 to [`MAX_SIDE`], at most [`MAX_PIXELS`] in all.
    ///
    /// # Errors
    /// [`PictureError::Size`].
    pub fn check_size(width: u32, height: u32) -> Result<(), PictureError> {
        check_size((width, height))
            .map_err(|_| PictureError::Size { width: width.into(), height: height.into() })
    }

    /// (width, height).
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The radiance of a pixel, `row` 0 at the top; None outside the picture.
    pub fn get(&self, column: u32, row: u32) -> Option<[f32; 3]> {
        if column >= self.width {
            return None;
        }
        self.pixels.get(row as usize * self.width as usize + column as usize).copied()
    }

    /// Reads a picture; its first bytes say what it is, its extension only where they do not.
    ///
    /// `.hdr`, `.pic`: Radiance RGBE, flat or with either run-length encoding; `EXPOSURE=` and `COLORCORR=` are divided
    /// out, `VIEW=` is kept. `.pfm`: colour or grey, either byte order, multiplied by the size of its scale. `.exr`: the
    /// R, G and B of the first layer that has them.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind, damaged, or larger than [`MAX_PIXELS`]. Names the file.
    pub fn read(path: impl AsRef<Path>) -> Result<Picture, PictureError> {
        files::read(path.as_ref())
    }

    /// Reads a picture from the bytes of a file of a known format; `.png` is not read.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn decode(bytes: &[u8], format: Format) -> Result<Picture, PictureError> {
        files::decode(bytes, format)
    }

    /// Writes `.hdr` (or `.pic`), `.pfm`, `.exr` (32-bit floats) or, tone mapped by
    /// [`ToneMap::auto`](crate::ToneMap::auto), `.png`, as the extension says.
    ///
    /// The file appears whole or not at all: it is written beside its place, flushed, and moved there.
    ///
    /// # Errors
    /// An unknown extension, a picture whose parts disagree, or the disk. Names the file.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), PictureError> {
        files::write(self, path.as_ref())
    }

    /// The bytes of a file of this picture.
    ///
    /// # Errors
    /// A picture whose parts disagree.
    pub fn encode(&self, format: Format) -> Result<Vec<u8>, PictureError> {
        files::encode(self, format)
    }

    /// Fails unless size, pixels and exposure agree with each other: the fields are public.
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
