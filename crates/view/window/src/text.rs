//! Text in a fixed-width font, rasterised in advance in four sizes.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use super::canvas::{Canvas, Color};

/// Height of a line at scale 1, pixels.
const LINE: f64 = 20.0;

/// Available sizes.
const SIZES: [RasterHeight; 4] =
    [RasterHeight::Size16, RasterHeight::Size20, RasterHeight::Size24, RasterHeight::Size32];

/// A size of text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Font {
    raster: RasterHeight,
    /// Pixels of the window per pixel of a glyph: 1, except on very fine screens.
    factor: i32,
}

/// Weight of text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextWeight {
    /// Usual text.
    Regular,
    /// Values and headings.
    Bold,
}

impl Font {
    /// Returns the font whose line height fits a screen with `scale` pixels per pixel of a usual
    /// screen.
    pub fn for_scale(scale: f64) -> Font {
        let wanted = LINE * if scale.is_finite() { scale.clamp(0.5, 8.0) } else { 1.0 };
        let sizes = (1..=8).flat_map(|factor| SIZES.map(|raster| Font { raster, factor }));
        let off = |font: &Font| (f64::from(font.height()) - wanted).abs();
        let base = Font { raster: RasterHeight::Size20, factor: 1 };
        // If two fonts fit equally well, the first is kept, because its glyphs are finer.
        sizes.fold(base, |best, font| if off(&font) < off(&best) { font } else { best })
    }

    /// Returns the height of a line, pixels.
    pub fn height(self) -> i32 {
        self.raster.val() as i32 * self.factor
    }

    /// Returns the width of a sign, pixels.
    pub fn width(self) -> i32 {
        get_raster_width(FontWeight::Regular, self.raster) as i32 * self.factor
    }

    /// Returns the width of a text, pixels.
    pub fn width_of(self, text: &str) -> i32 {
        written(text).count() as i32 * self.width()
    }
}

/// Writes a text. The upper left corner of its first sign is at the given point.
pub fn write(
    canvas: &mut Canvas,
    (font, weight): (Font, TextWeight),
    (x, y): (i32, i32),
    text: &str,
    color: Color,
) {
    let style = match weight {
        TextWeight::Regular => FontWeight::Regular,
        TextWeight::Bold => FontWeight::Bold,
    };
    for (index, sign) in (0..).zip(written(text)) {
        let Some(raster) = get_raster(sign, style, font.raster) else { continue };
        let left = x + index * font.width();
        for (row, line) in (0..).zip(raster.rows()) {
            for (column, &ink) in (0..).zip(line) {
                if ink == 0 {
                    continue;
                }
                for (down, across) in
                    (0..font.factor).flat_map(|a| (0..font.factor).map(move |b| (a, b)))
                {
                    let at = (left + column * font.factor + across, y + row * font.factor + down);
                    canvas.blend(at.0, at.1, color, f32::from(ink) / 255.0);
                }
            }
        }
    }
}

/// Returns the signs to write, with replacements for those that the font lacks.
fn written(text: &str) -> impl Iterator<Item = char> {
    text.chars().flat_map(|sign| {
        let signs: &'static str = match sign {
            '…' => "...",
            '–' | '—' | '−' => "-",
            '’' | '‘' => "'",
            '“' | '”' => "\"",
            '↑' => "Up",
            '↓' => "Down",
            '←' => "Left",
            '→' => "Right",
            '\n' | '\t' => " ",
            _ => "",
        };
        let known = get_raster(sign, FontWeight::Regular, RasterHeight::Size16).is_some();
        let own = signs.is_empty().then_some(if known { sign } else { '?' });
        signs.chars().chain(own)
    })
}

/// Breaks a text into lines of at most `most` signs, between words if possible.
pub fn wrapped(text: &str, most: usize) -> Vec<String> {
    let most = most.max(1);
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let mut word: Vec<char> = written(word).collect();
        while !word.is_empty() {
            let line = lines.last().map_or(0, |line| line.chars().count());
            let gap = usize::from(line > 0);
            if line + gap + word.len() > most && line > 0 {
                lines.push(String::new());
                continue;
            }
            let rest = word.split_off(word.len().min(most));
            if let Some(line) = lines.last_mut() {
                line.extend((gap > 0).then_some(' '));
                line.extend(word);
            }
            word = rest;
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_grows_with_the_screen_s_scale() {
        let height = |scale| Font::for_scale(scale).height();
        assert_eq!([1.0, 1.25, 1.5, 2.0, 3.0].map(height), [20, 24, 32, 40, 60]);
        assert!(height(f64::NAN) == 20 && height(1e9) == 160 && height(0.0) == 16);
    }

    #[test]
    fn a_sign_has_ink_within_its_cell_only() {
        let font = Font::for_scale(1.0);
        let size = (3 * font.width() as u32, font.height() as u32);
        let mut pixels = vec![0; (size.0 * size.1) as usize];
        let mut canvas = Canvas::new(&mut pixels, size).unwrap();
        write(&mut canvas, (font, TextWeight::Regular), (font.width(), 0), "W", [255; 3]);
        let lit = |cell: usize| {
            let width = font.width() as usize;
            let columns = cell * width..(cell + 1) * width;
            pixels.chunks(3 * width).any(|row| row[columns.clone()].iter().any(|&p| p > 0))
        };
        assert_eq!([0, 1, 2].map(lit), [false, true, false]);
    }

    #[test]
    fn a_sign_that_the_font_lacks_is_replaced() {
        assert_eq!(written("a…–’日\n").collect::<String>(), "a...-'? ");
        assert_eq!(written("W ↑").collect::<String>(), "W Up");
        assert_eq!(written("cd/m² 3×4").collect::<String>(), "cd/m² 3×4");
        assert_eq!(Font::for_scale(1.0).width_of("…"), 3 * Font::for_scale(1.0).width());
    }

    #[test]
    fn lines_are_cut_between_words_and_long_words_within() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
        assert_eq!(wrapped("abcdefgh ij", 3), ["abc", "def", "gh", "ij"]);
        assert_eq!(wrapped("", 3), [""]);
    }
}
