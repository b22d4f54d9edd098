//! The image of a picture that comes in bands, from the top, and is never whole in memory.

use super::image::Strip;
use super::{Adaptation, Look, Tone};
use crate::picture::Picture;

/// Shows the bands of one picture with the same exposure, tones, scale and legend.
#[derive(Debug)]
pub struct Bands {
    look: Look,
    state: Adaptation,
    strip: Option<Strip>,
    size: (u32, u32),
    /// The last rows that came: one that was returned, and one that waits for the row below it.
    last: Vec<[f32; 3]>,
    /// Number of rows returned.
    rows: u32,
}

impl Look {
    /// Returns false if each pixel is made from the whole picture.
    #[must_use]
    pub fn shows_by_bands(&self) -> bool {
        self.tone != Tone::Human || self.false_color
    }

    /// Shows a picture of `size` pixels in bands. `preview` is the same picture with fewer pixels,
    /// which determines what depends on all of them. `None` unless the look
    /// [shows by bands](Self::shows_by_bands).
    #[must_use]
    pub fn bands(&self, preview: &Picture, size: (u32, u32)) -> Option<Bands> {
        if !self.shows_by_bands() {
            return None;
        }
        let mut state = Adaptation::default();
        let legend = self.follow(preview, &mut state, 0.0).legend;
        let strip = legend.and_then(|legend| Strip::beside(&legend, size.1));
        Some(Bands { look: *self, state, strip, size, last: Vec::new(), rows: 0 })
    }
}

impl Bands {
    /// Returns the size of the image, with its legend.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.size.0 + self.strip.as_ref().map_or(0, |strip| strip.width), self.size.1)
    }

    /// Takes the next rows of the picture. Returns rows of the image: red, green and blue of each
    /// pixel. The last row waits for the one below it, except at the picture's end.
    pub fn show(&mut self, pixels: &[[f32; 3]]) -> Vec<u8> {
        let width = self.size.0 as usize;
        let before = self.last.len() / width;
        let mut all = std::mem::take(&mut self.last);
        all.extend(pixels);
        let rows = all.len() / width;
        // The first of two rows has been returned already.
        let first = before.saturating_sub(1);
        let is_end = self.rows as usize + (rows - first) >= self.size.1 as usize;
        let end = if is_end { rows } else { rows.saturating_sub(1).max(first) };
        let mut band = Picture::new(self.size.0, rows as u32);
        band.pixels = all;
        let shown = self.look.follow(&band, &mut self.state, 0.0).rgb;
        let (own, more) =
            (3 * width, self.strip.as_ref().map_or(0, |strip| 3 * strip.width as usize));
        let mut rgb = Vec::with_capacity((own + more) * (end - first));
        for row in first..end {
            rgb.extend_from_slice(&shown[row * own..][..own]);
            if let Some(strip) = &self.strip {
                rgb.extend_from_slice(&strip.rgb[self.rows as usize * more..][..more]);
            }
            self.rows += 1;
        }
        self.last = band.pixels.split_off(rows.saturating_sub(2) * width);
        rgb
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Image, Scaling};

    const SIZE: (u32, u32) = (90, 70);

    #[test]
    fn bands_make_the_image_of_the_whole_picture() {
        let pixels = (0..SIZE.0 * SIZE.1).map(|i| [(i % 83) as f32, (i / 90) as f32, 1.0]);
        let picture = Picture::from_pixels(SIZE.0, SIZE.1, pixels.collect()).unwrap();
        let tones = [Tone::Soft, Tone::Linear, Tone::Camera].map(|tone| (tone, false, false));
        let colours = [(false, true), (true, false), (true, true)];
        let colours = colours.map(|(colours, lines)| (Tone::Human, colours, lines));
        for (tone, false_color, contours) in tones.into_iter().chain(colours) {
            let scaling = Scaling::Auto { log: true };
            let look = Look { tone, false_color, contours, scaling, ..Look::default() };
            let Some(mut bands) = look.bands(&picture, SIZE) else {
                assert_eq!((tone, false_color), (Tone::Human, false));
                continue;
            };
            let whole: Image = look.show(&picture).with_legend();
            for rows in [1, 2, 3, 16, 70] {
                let mut bands = std::mem::replace(&mut bands, look.bands(&picture, SIZE).unwrap());
                assert_eq!(bands.size(), (whole.width, whole.height));
                let parts = picture.pixels.chunks(rows * SIZE.0 as usize);
                let rgb: Vec<u8> = parts.flat_map(|part| bands.show(part)).collect();
                assert!(rgb == whole.rgb, "{look:?} in bands of {rows}");
            }
        }
    }
}
