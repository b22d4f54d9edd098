//! A picture as a display shows it, and its legend.

use super::glyphs;
use super::legend::Legend;
use crate::error::PictureError;
use crate::picture::Picture;

/// An sRGB picture of 8 bits.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green and blue of each pixel, in rows from the top.
    pub rgb: Vec<u8>,
    /// The meaning of false colours and contours, if the image has them.
    pub legend: Option<Legend>,
    /// The factor that radiance was multiplied by, for tones that have one.
    pub exposure: Option<f32>,
}

/// Least height of a picture that gets a legend, in pixels.
const LEAST_HEIGHT: u32 = 64;

/// Height of a picture whose legend has one pixel per pixel of a letter.
const UNIT_HEIGHT: u32 = 400;

/// Least distance of two labels, over the height of a letter.
const LABELS_APART: f32 = 1.4;

const BACKGROUND: [u8; 3] = [24; 3];
const INK: [u8; 3] = [235; 3];

/// Measures of a legend's strip, in its unit.
const MARGIN: u32 = 6;
const BAR: u32 = 14;
const TICK: u32 = 3;

impl Image {
    /// Draws the legend into a strip at the right side of the picture, which makes it wider. A
    /// picture without a legend, or lower than 64 pixels, stays as it is.
    #[must_use]
    pub fn with_legend(self) -> Image {
        let strip = self.legend.as_ref().and_then(|legend| Strip::beside(legend, self.height));
        let Some(strip) = strip else { return self };
        let (own, more) = (self.width as usize * 3, strip.width as usize * 3);
        let mut rgb = Vec::with_capacity((own + more) * self.height as usize);
        for (row, strip) in self.rgb.chunks_exact(own).zip(strip.rgb.chunks_exact(more)) {
            rgb.extend_from_slice(row);
            rgb.extend_from_slice(strip);
        }
        Image { width: self.width + strip.width, rgb, ..self }
    }

    /// Encodes the image as the bytes of a `.png`, without its legend.
    ///
    /// # Errors
    /// A size outside the limits, or a number of bytes that does not match it.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        Picture::check_size(self.width, self.height)?;
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let failed = |error: png::EncodingError| PictureError::Png(error.to_string());
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(&self.rgb).map_err(failed)?;
        writer.finish().map_err(failed)?;
        Ok(bytes)
    }
}

/// A legend as pixels.
#[derive(Debug)]
pub(super) struct Strip {
    pub width: u32,
    height: u32,
    pub rgb: Vec<u8>,
    /// Pixels of the picture to one of a letter.
    unit: u32,
}

impl Strip {
    /// Returns the strip beside a picture of this height. `None` if the picture is too low for one.
    pub fn beside(legend: &Legend, height: u32) -> Option<Strip> {
        (height >= LEAST_HEIGHT).then(|| Strip::draw(legend, height))
    }

    fn draw(legend: &Legend, height: u32) -> Strip {
        let unit = (height / UNIT_HEIGHT).max(1);
        let texts = legend.ticks.iter().map(|tick| tick.label.as_str()).chain([legend.unit]);
        let text = texts.map(glyphs::text_width).max().unwrap_or(0);
        let width = unit * (MARGIN + BAR + TICK + 2 + text.max(BAR) + MARGIN);
        let rgb = BACKGROUND.repeat((width * height) as usize);
        let mut strip = Strip { width, height, rgb, unit };
        strip.text(legend.unit, MARGIN * unit, MARGIN * unit);
        let (top, bottom) = ((2 * MARGIN + glyphs::HEIGHT) * unit, height - MARGIN * unit);
        let length = bottom - top - 1;
        for row in top..bottom {
            let place = (bottom - 1 - row) as f32 / length.max(1) as f32;
            strip.row(row, MARGIN, BAR, legend.color(place));
        }
        let mut last = f32::INFINITY;
        for tick in &legend.ticks {
            let middle = bottom as f32 - 0.5 - tick.place * length as f32;
            let row = middle as u32;
            (row..row + unit).for_each(|row| strip.row(row, MARGIN + BAR, TICK, INK));
            let letter = (glyphs::HEIGHT * unit) as f32;
            if last - middle >= LABELS_APART * letter {
                let above =
                    (middle - 0.5 * letter).round().min((height - glyphs::HEIGHT * unit) as f32);
                strip.text(&tick.label, (MARGIN + BAR + TICK + 2) * unit, above.max(0.0) as u32);
                last = middle;
            }
        }
        strip
    }

    /// Fills part of a row; `left` and `width` are in units.
    fn row(&mut self, row: u32, left: u32, width: u32, color: [u8; 3]) {
        (left * self.unit..(left + width) * self.unit)
            .for_each(|column| self.set(column, row, color));
    }

    fn text(&mut self, text: &str, left: u32, top: u32) {
        for (index, letter) in (0..).zip(text.chars()) {
            let left = left + index * (glyphs::WIDTH + 1) * self.unit;
            for row in 0..glyphs::HEIGHT * self.unit {
                for column in 0..glyphs::WIDTH * self.unit {
                    if glyphs::is_inked(letter, column / self.unit, row / self.unit) {
                        self.set(left + column, top + row, INK);
                    }
                }
            }
        }
    }

    fn set(&mut self, column: u32, row: u32, color: [u8; 3]) {
        if column < self.width && row < self.height {
            let start = 3 * (row * self.width + column) as usize;
            self.rgb[start..start + 3].copy_from_slice(&color);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::look::{Scale, legend::Legend};

    fn image(width: u32, height: u32) -> Image {
        let legend = Legend::new(Scale::new(0.0, 500.0, false).unwrap());
        let rgb = vec![7; (width * height * 3) as usize];
        Image { width, height, rgb, legend: Some(legend), exposure: None }
    }

    #[test]
    fn a_legend_stands_beside_the_picture() {
        let plain = image(40, 100);
        let shown = plain.clone().with_legend();
        assert!(shown.width > 60 && shown.height == 100);
        assert_eq!(shown.rgb.len(), (shown.width * shown.height * 3) as usize);
        let pixel = |column: u32, row: u32| {
            let start = 3 * (row * shown.width + column) as usize;
            [shown.rgb[start], shown.rgb[start + 1], shown.rgb[start + 2]]
        };
        assert!((0..100).all(|row| (0..40).all(|column| pixel(column, row) == [7; 3])));
        let legend = plain.legend.as_ref().unwrap();
        let bar: Vec<_> = (19..94).map(|row| pixel(40 + MARGIN, row)).collect();
        assert_eq!((bar[0], bar[74]), (legend.color(1.0), legend.color(0.0)));
        assert!(shown.rgb.contains(&INK[0]));
    }

    #[test]
    fn a_low_picture_has_no_room_for_a_legend() {
        assert_eq!(image(40, 63).with_legend().width, 40);
        // The largest picture has a legend of its scale.
        let wide = image(1, 4000).with_legend();
        assert!(wide.width > 500);
    }

    #[test]
    fn a_png_needs_as_many_bytes_as_its_size_says() {
        let mut short = image(4, 4);
        short.rgb.pop();
        assert!(short.png().is_err());
        assert!(Image { width: 0, ..image(4, 4) }.png().is_err());
    }
}
