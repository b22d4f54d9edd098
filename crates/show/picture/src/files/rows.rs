//! Pictures that are written row by row, from the top, so that none is whole in memory.

use std::io::Write;

use crate::error::PictureError;
use crate::files::{Format, hdr};
use crate::picture::Picture;
use crate::view::View;

/// Name of the attribute that holds the view as Radiance's options.
const VIEW: &str = "VIEW";

/// Writes radiance as `.hdr` or `.exr`.
///
/// Rows of an `.exr` are not compressed. The table of their places precedes them, so their lengths
/// must be known in advance.
#[derive(Debug)]
pub struct RadianceRows<W> {
    out: W,
    format: Format,
    size: (u32, u32),
    /// Number of rows written.
    rows: u32,
}

impl<W: Write> RadianceRows<W> {
    /// Begins a picture of `size` pixels.
    ///
    /// # Errors
    /// A size outside the limits, a format other than `.hdr` and `.exr`, or a failure of `out`.
    pub fn begin(
        mut out: W,
        format: Format,
        size: (u32, u32),
        view: Option<&View>,
    ) -> Result<RadianceRows<W>, PictureError> {
        Picture::check_size(size.0, size.1)?;
        match format {
            Format::Hdr => out.write_all(&hdr::header(size, view, 1.0))?,
            Format::Exr => out.write_all(&exr_header(size, view))?,
            Format::Pfm | Format::Png => {
                let format = format!("{format:?} by rows").to_lowercase();
                return Err(PictureError::UnknownExtension(format));
            }
        }
        Ok(RadianceRows { out, format, size, rows: 0 })
    }

    /// Writes the next rows.
    ///
    /// # Errors
    /// More rows than the picture has, part of a row, or a failure of the output.
    pub fn write(&mut self, pixels: &[[f32; 3]]) -> Result<(), PictureError> {
        self.rows += check_rows(self.size, self.rows, pixels.len())?;
        let width = self.size.0 as usize;
        let mut bytes = Vec::with_capacity(pixels.len() * 12);
        if self.format == Format::Hdr {
            hdr::write_rows(&mut bytes, pixels, self.size.0, 1.0);
        } else {
            let first = self.rows - (pixels.len() / width) as u32;
            for (row, pixels) in (first..).zip(pixels.chunks_exact(width)) {
                bytes.extend(row.to_le_bytes());
                bytes.extend((12 * self.size.0).to_le_bytes());
                for channel in EXR_CHANNELS {
                    bytes.extend(pixels.iter().flat_map(|rgb| rgb[channel.1].to_le_bytes()));
                }
            }
        }
        Ok(self.out.write_all(&bytes)?)
    }

    /// Ends the picture, and returns the output.
    ///
    /// # Errors
    /// If rows are missing.
    pub fn finish(self) -> Result<W, PictureError> {
        check_end(self.size, self.rows)?;
        Ok(self.out)
    }
}

/// Channels in the order of an `.exr`, which is that of the alphabet, with their places in a pixel.
const EXR_CHANNELS: [(&[u8], usize); 3] = [(b"B\0", 2), (b"G\0", 1), (b"R\0", 0)];

/// Returns the bytes before the first row of an `.exr` of 32-bit floats without compression
/// (<https://openexr.com/en/latest/OpenEXRFileLayout.html>).
fn exr_header((width, height): (u32, u32), view: Option<&View>) -> Vec<u8> {
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        for text in [name, kind] {
            bytes.extend(text.as_bytes());
            bytes.push(0);
        }
        bytes.extend((value.len() as u32).to_le_bytes());
        bytes.extend(value);
    };
    let mut channels = Vec::new();
    for (name, _) in EXR_CHANNELS {
        channels.extend(name);
        // 32-bit floats, not perceptually linear, every column and row.
        channels.extend([2_u32, 0, 1, 1].iter().flat_map(|number| number.to_le_bytes()));
    }
    channels.push(0);
    let corners = [0, 0, width - 1, height - 1].map(u32::to_le_bytes);
    attribute("channels", "chlist", &channels);
    attribute("compression", "compression", &[0]);
    attribute("dataWindow", "box2i", corners.as_flattened());
    attribute("displayWindow", "box2i", corners.as_flattened());
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1_f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1_f32.to_le_bytes());
    attribute("software", "string", b"Holodeck");
    if let Some(view) = view {
        attribute(VIEW, "string", view.to_vf_options().as_bytes());
    }
    bytes.push(0);
    let first = bytes.len() as u64 + 8 * u64::from(height);
    let row_bytes = 8 + 12 * u64::from(width);
    bytes.extend((0..u64::from(height)).flat_map(|row| (first + row * row_bytes).to_le_bytes()));
    bytes
}

/// Writes display colours as `.png`.
pub struct PngRows<W: Write + 'static> {
    out: png::StreamWriter<'static, W>,
    size: (u32, u32),
    rows: u32,
}

impl<W: Write + 'static> PngRows<W> {
    /// Begins a picture of `size` pixels.
    ///
    /// # Errors
    /// A size outside the limits, or a failure of `out`.
    pub fn begin(out: W, size: (u32, u32)) -> Result<PngRows<W>, PictureError> {
        Picture::check_size(size.0, size.1)?;
        let mut encoder = png::Encoder::new(out, size.0, size.1);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let writer = encoder.write_header().map_err(failed)?;
        let out = writer.into_stream_writer().map_err(failed)?;
        Ok(PngRows { out, size, rows: 0 })
    }

    /// Writes the next rows: red, green and blue of each pixel.
    ///
    /// # Errors
    /// More rows than the picture has, part of a row, or a failure of the output.
    pub fn write(&mut self, rgb: &[u8]) -> Result<(), PictureError> {
        self.rows += check_rows(self.size, self.rows, rgb.as_chunks::<3>().0.len())?;
        Ok(self.out.write_all(rgb)?)
    }

    /// Ends the picture.
    ///
    /// # Errors
    /// If rows are missing, or the output fails.
    pub fn finish(self) -> Result<(), PictureError> {
        check_end(self.size, self.rows)?;
        self.out.finish().map_err(failed)
    }
}

/// Returns how many rows these pixels are. They must be whole rows of the picture.
fn check_rows(size: (u32, u32), written: u32, pixels: usize) -> Result<u32, PictureError> {
    let (width, height) = size;
    let rows = (pixels / width as usize) as u64;
    let is_whole = pixels.is_multiple_of(width as usize);
    if !is_whole || u64::from(written) + rows > u64::from(height) {
        return Err(PictureError::PixelCount { width, height, pixels });
    }
    Ok(rows as u32)
}

fn check_end((width, height): (u32, u32), written: u32) -> Result<(), PictureError> {
    let pixels = width as usize * written as usize;
    if written == height { Ok(()) } else { Err(PictureError::PixelCount { width, height, pixels }) }
}

fn failed(error: png::EncodingError) -> PictureError {
    match error {
        png::EncodingError::IoError(error) => PictureError::Io(error),
        other => PictureError::Png(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const SIZE: (u32, u32) = (37, 23);

    fn picture() -> Picture {
        let pixels = (0..SIZE.0 * SIZE.1).map(|i| [i as f32 * 0.25, 1.0 / (i + 1) as f32, 3.0]);
        let mut picture = Picture::from_pixels(SIZE.0, SIZE.1, pixels.collect()).unwrap();
        picture.view = View::new(DVec3::ZERO, DVec3::Y, DVec3::Z, Some(50.0), None, SIZE).ok();
        picture
    }

    #[test]
    fn rows_make_the_picture_that_is_written_whole() {
        let picture = picture();
        for format in [Format::Hdr, Format::Exr] {
            let view = picture.view.as_ref();
            let mut rows = RadianceRows::begin(Vec::new(), format, SIZE, view).unwrap();
            for band in picture.pixels.chunks(5 * SIZE.0 as usize) {
                rows.write(band).unwrap();
            }
            let bytes = rows.finish().unwrap();
            let whole = Picture::decode(&picture.encode(format).unwrap(), format).unwrap();
            assert_eq!(Picture::decode(&bytes, format).unwrap(), whole, "{format:?}");
        }
    }

    #[test]
    fn missing_further_and_partial_rows_are_errors() {
        let pixels = picture().pixels;
        let begin = || RadianceRows::begin(Vec::new(), Format::Hdr, SIZE, None).unwrap();
        let mut rows = begin();
        assert!(rows.write(&pixels[1..]).is_err());
        rows.write(&pixels).unwrap();
        assert!(rows.write(&pixels[..SIZE.0 as usize]).is_err());
        assert!(begin().finish().is_err());
        assert!(RadianceRows::begin(Vec::new(), Format::Pfm, SIZE, None).is_err());
        assert!(RadianceRows::begin(Vec::new(), Format::Exr, (0, 9), None).is_err());
    }
}
