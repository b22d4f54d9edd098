//! Textures: pictures on surfaces, decoded once, with smaller copies for views from a distance.
//!
//! Invariants:
//! - The encoded file is kept: it is smaller than its texels, and packs without loss.
//! - A picture larger than [`MAX_SIDE`] is halved until it fits, so memory is bounded.
//! - Colours are linear when they are looked up.

use std::io::Cursor;
use std::sync::{Arc, OnceLock};

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::foreign;

/// Greatest side of a texture in texels; larger ones are halved. Four bytes a texel, and a third
/// more for smaller copies, are 89 MB.
pub const MAX_SIDE: u32 = 4096;

/// Greatest side of a picture that is decoded at all, and most memory for that.
const MAX_DECODED_SIDE: u32 = 16384;
const MAX_DECODED_BYTES: u64 = 1 << 30;

/// Greatest size of a texture's file in bytes.
pub const MAX_TEXTURE_BYTES: usize = 256 << 20;

/// The continuation of a texture beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// It repeats.
    #[default]
    Repeat,
    /// Its edge texels continue.
    Clamp,
    /// It repeats, and every other copy is mirrored.
    Mirror,
}

impl Wrap {
    /// Returns the texel of a side of `size` texels.
    #[inline]
    fn texel(self, at: i32, size: i32) -> usize {
        let texel = match self {
            Wrap::Repeat => at.rem_euclid(size),
            Wrap::Clamp => at.clamp(0, size - 1),
            Wrap::Mirror => {
                let at = at.rem_euclid(2 * size);
                at.min(2 * size - 1 - at)
            }
        };
        texel as usize
    }
}

/// A texture.
#[derive(Clone, Debug)]
pub struct Texture {
    /// The picture's file: PNG, JPEG, WebP, Radiance HDR, EXR, BMP, GIF, TIFF or TGA.
    pub encoded: Arc<[u8]>,
    /// The continuation to the right and below.
    pub wrap: [Wrap; 2],
    /// True if its bytes are linear, not sRGB.
    pub is_linear: bool,
    /// True if its brightness is used as opacity, unless the picture has opacity itself.
    pub is_mask: bool,
    /// True if its file asks for a turned or mirrored picture, which is not done.
    pub(crate) is_turned: bool,
    levels: Arc<Vec<TextureLevel>>,
}

impl PartialEq for Texture {
    fn eq(&self, other: &Texture) -> bool {
        let key = |t: &Texture| (t.wrap, t.is_linear, t.is_mask);
        key(self) == key(other) && self.encoded == other.encoded
    }
}

/// Returns whether a file's header can be that of TGA, which has no signature.
fn is_tga(encoded: &[u8]) -> bool {
    let Some(&[_, has_palette, kind, ..]) = encoded.first_chunk::<18>() else { return false };
    let is_known_kind = matches!(kind, 1..=3 | 9..=11);
    has_palette <= 1 && is_known_kind && matches!(encoded[16], 8 | 15 | 16 | 24 | 32)
}

/// The opacities that a texture has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Opacities {
    /// All texels are opaque.
    Whole,
    /// Each texel is opaque or a hole.
    Mask,
    /// Some texels are neither.
    Varied,
}

/// Returns what a file is that is no picture in a format that is read, and what to do.
fn other_format(encoded: &[u8]) -> Option<String> {
    const FORMATS: [(&[u8], &str); 6] = [
        (b"\xabKTX 20", "a KTX2 picture"),
        (b"\xabKTX 11", "a KTX picture"),
        (b"sB", "a Basis picture"),
        (b"DDS ", "a DDS picture"),
        (b"8BPS", "a Photoshop file"),
        (b"<svg", "an SVG drawing"),
    ];
    let known = FORMATS.iter().find(|(first, _)| encoded.starts_with(first)).map(|(_, what)| *what);
    let kind = encoded.get(4..12).unwrap_or_default();
    let is_new = matches!(kind, b"ftypavif" | b"ftypheic" | b"ftypmif1");
    if let Some(what) = known.or(is_new.then_some("an AVIF or HEIC picture")) {
        return Some(format!("it is {what}, which is not read: convert it to PNG or JPEG"));
    }
    foreign::pointer(encoded).map(str::to_owned)
}

/// A picture of a texture, in rows from the top.
#[derive(Debug)]
struct TextureLevel {
    width: usize,
    height: usize,
    texels: Texels,
}

#[derive(Debug)]
enum Texels {
    /// Red, green, blue and opacity.
    Bytes(Vec<[u8; 4]>),
    /// Radiances of pictures with a high dynamic range.
    Floats(Vec<[f32; 4]>),
}

impl Texture {
    /// Decodes a picture.
    ///
    /// # Errors
    /// A text for people, if it is damaged, too large or of an unknown format.
    pub fn decode(
        encoded: Arc<[u8]>,
        wrap: [Wrap; 2],
        is_linear: bool,
        is_mask: bool,
    ) -> Result<Texture, String> {
        if encoded.len() > MAX_TEXTURE_BYTES {
            return Err(format!(
                "it has {} bytes, and at most {MAX_TEXTURE_BYTES} are read",
                encoded.len()
            ));
        }
        if let Some(problem) = other_format(&encoded) {
            return Err(problem);
        }
        let reader = ImageReader::new(Cursor::new(&encoded[..])).with_guessed_format();
        let mut reader = reader.map_err(|error| error.to_string())?;
        if reader.format().is_none() && is_tga(&encoded) {
            reader.set_format(ImageFormat::Tga);
        }
        let mut limits = Limits::default();
        limits.max_image_width = Some(MAX_DECODED_SIDE);
        limits.max_image_height = Some(MAX_DECODED_SIDE);
        limits.max_alloc = Some(MAX_DECODED_BYTES);
        reader.limits(limits);
        let mut decoder = reader.into_decoder().map_err(|error| error.to_string())?;
        if decoder.total_bytes() > MAX_DECODED_BYTES {
            let (width, height) = decoder.dimensions();
            return Err(format!("its {width} x {height} pixels take too much memory"));
        }
        // Coordinates on surfaces belong to the picture as it is stored. Modellers show it so.
        let is_turned = decoder.orientation().is_ok_and(|o| o != Orientation::NoTransforms);
        let image = DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
        let mut level = TextureLevel::new(image)?;
        if is_mask {
            level.take_brightness_as_opacity();
        }
        while level.width.max(level.height) > MAX_SIDE as usize {
            level = level.halved(is_linear);
        }
        let mut levels = vec![level];
        while let Some(last) = levels.last().filter(|last| last.width.max(last.height) > 1) {
            let next = last.halved(is_linear);
            levels.push(next);
        }
        Ok(Texture { encoded, wrap, is_linear, is_mask, is_turned, levels: Arc::new(levels) })
    }

    /// Returns width and height in texels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.levels.first().map_or([1; 2], |level| [level.width, level.height])
    }

    /// Returns the bytes of memory that it takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let texels = |level: &TextureLevel| match &level.texels {
            Texels::Bytes(texels) => 4 * texels.len(),
            Texels::Floats(texels) => 16 * texels.len(),
        };
        self.encoded.len() + self.levels.iter().map(texels).sum::<usize>()
    }

    /// Returns the kind of its opacities.
    pub(crate) fn opacities(&self) -> Opacities {
        let Some(level) = self.levels.first() else { return Opacities::Whole };
        let (mut is_whole, mut is_mask) = (true, true);
        let mut add = |opacity: f32| {
            is_whole &= opacity >= 1.0;
            is_mask &= opacity <= 0.0 || opacity >= 1.0;
        };
        match &level.texels {
            Texels::Bytes(texels) => texels.iter().for_each(|t| add(f32::from(t[3]) / 255.0)),
            Texels::Floats(texels) => texels.iter().for_each(|t| add(t[3])),
        }
        match (is_whole, is_mask) {
            (true, _) => Opacities::Whole,
            (false, true) => Opacities::Mask,
            (false, false) => Opacities::Varied,
        }
    }

    /// Returns linear red, green, blue and opacity at a place: (0, 0) is the top left corner and
    /// (1, 1) the bottom right one. `footprint` is the width of the observed area, as a share of
    /// the texture's side.
    #[must_use]
    #[inline]
    pub fn at(&self, [u, v]: [f32; 2], footprint: f32) -> [f32; 4] {
        let [width, height] = self.size();
        let texels = footprint * width.max(height) as f32;
        let last = self.levels.len() - 1;
        let level = texels.max(1.0).log2().min(last as f32);
        let (fine, share) = (level as usize, level.fract());
        let near = self.levels[fine].at(u, v, self.wrap, self.is_linear);
        if share == 0.0 || fine == last {
            return near;
        }
        let far = self.levels[fine + 1].at(u, v, self.wrap, self.is_linear);
        std::array::from_fn(|k| near[k] + (far[k] - near[k]) * share)
    }
}

impl TextureLevel {
    fn new(image: DynamicImage) -> Result<TextureLevel, String> {
        let (width, height) = (image.width() as usize, image.height() as usize);
        if width == 0 || height == 0 {
            return Err("it has no pixels".to_owned());
        }
        let texels = match image {
            DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
                let finite = |c: f32| if c.is_finite() { c.clamp(0.0, 1e6) } else { 0.0 };
                let floats = image.into_rgba32f().into_raw();
                Texels::Floats(floats.as_chunks::<4>().0.iter().map(|t| t.map(finite)).collect())
            }
            other => Texels::Bytes(other.into_rgba8().into_raw().as_chunks::<4>().0.to_vec()),
        };
        Ok(TextureLevel { width, height, texels })
    }

    fn take_brightness_as_opacity(&mut self) {
        if let Texels::Bytes(texels) = &mut self.texels
            && texels.iter().all(|texel| texel[3] == u8::MAX)
        {
            texels.iter_mut().for_each(|texel| texel[3] = texel[0]);
        }
    }

    /// Returns a picture of half the size, rounded up, whose texels are means of four.
    fn halved(&self, is_linear: bool) -> TextureLevel {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mean = |index: usize| -> [f32; 4] {
            let (x, y) = (2 * (index % width), 2 * (index / width));
            let (right, below) = ((x + 1).min(self.width - 1), (y + 1).min(self.height - 1));
            let four = [(x, y), (right, y), (x, below), (right, below)]
                .map(|(x, y)| self.texel(x, y, is_linear));
            std::array::from_fn(|k| four.iter().map(|texel| texel[k]).sum::<f32>() * 0.25)
        };
        let texels = match &self.texels {
            Texels::Floats(_) => Texels::Floats((0..width * height).map(mean).collect()),
            Texels::Bytes(_) => Texels::Bytes(
                (0..width * height)
                    .map(|index| {
                        let [r, g, b, a] = mean(index);
                        let share = |c: f32| (c * 255.0 + 0.5) as u8;
                        let colour: fn(f32) -> u8 = if is_linear { share } else { srgb_byte };
                        [colour(r), colour(g), colour(b), share(a)]
                    })
                    .collect(),
            ),
        };
        TextureLevel { width, height, texels }
    }

    /// Returns a texel as linear numbers.
    #[inline]
    fn texel(&self, x: usize, y: usize, is_linear: bool) -> [f32; 4] {
        let index = y * self.width + x;
        match &self.texels {
            Texels::Floats(texels) => texels[index],
            Texels::Bytes(texels) => {
                let [r, g, b, a] = texels[index];
                let share = |byte: u8| f32::from(byte) * (1.0 / 255.0);
                if is_linear {
                    return [r, g, b, a].map(share);
                }
                let table = linear_table();
                [table[r as usize], table[g as usize], table[b as usize], share(a)]
            }
        }
    }

    /// Interpolates between four texels.
    #[inline]
    fn at(&self, u: f32, v: f32, wrap: [Wrap; 2], is_linear: bool) -> [f32; 4] {
        // Far from 0, floats have no fractions. Such coordinates come from damaged files.
        let place = |c: f32, size: usize| (c.clamp(-1e4, 1e4) * size as f32) - 0.5;
        let (x, y) = (place(u, self.width), place(v, self.height));
        let (left, top) = (x.floor(), y.floor());
        let (along, down) = (x - left, y - top);
        let column = |at: i32| wrap[0].texel(at, self.width as i32);
        let row = |at: i32| wrap[1].texel(at, self.height as i32);
        let columns = [column(left as i32), column(left as i32 + 1)];
        let rows = [row(top as i32), row(top as i32 + 1)];
        let [a, b] = columns.map(|x| self.texel(x, rows[0], is_linear));
        let [c, d] = columns.map(|x| self.texel(x, rows[1], is_linear));
        std::array::from_fn(|k| {
            let (above, below) = (a[k] + (b[k] - a[k]) * along, c[k] + (d[k] - c[k]) * along);
            above + (below - above) * down
        })
    }
}

/// Returns the linear values of all bytes of sRGB (IEC 61966-2-1).
pub(crate) fn linear_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|byte| linear_of(byte as f32 / 255.0)))
}

/// Returns the linear share of a share of sRGB (IEC 61966-2-1).
fn linear_of(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Number of equal parts of the linear range for which [`srgb_byte`] knows where to begin.
const SRGB_PARTS: usize = 4096;

/// The linear values from which on a greater byte of sRGB is nearer, and the byte of the beginning
/// of each part of the linear range.
fn srgb_table() -> &'static ([f32; 255], Vec<u8>) {
    static TABLE: OnceLock<([f32; 255], Vec<u8>)> = OnceLock::new();
    TABLE.get_or_init(|| {
        let steps: [f32; 255] = std::array::from_fn(|byte| linear_of((byte as f32 + 0.5) / 255.0));
        let byte = |part: usize| {
            steps.partition_point(|&step| step <= part as f32 / SRGB_PARTS as f32) as u8
        };
        (steps, (0..=SRGB_PARTS).map(byte).collect())
    })
}

/// Returns the byte of sRGB that is nearest to a linear share; 0 for NaN. Powers would take most of
/// the time of a texture.
pub(crate) fn srgb_byte(linear: f32) -> u8 {
    let (steps, first) = srgb_table();
    let linear = linear.clamp(0.0, 1.0);
    let mut byte = first[(linear * SRGB_PARTS as f32) as usize];
    while steps.get(usize::from(byte)).is_some_and(|&step| step <= linear) {
        byte += 1;
    }
    byte
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A PNG of these texels.
    fn texture(
        width: u32,
        height: u32,
        texels: &[[u8; 4]],
        wrap: [Wrap; 2],
        linear: bool,
    ) -> Texture {
        let mut bytes = Vec::new();
        let raw = texels.concat();
        let image = image::RgbaImage::from_raw(width, height, raw).unwrap();
        image.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
        Texture::decode(bytes.into(), wrap, linear, false).unwrap()
    }

    #[test]
    fn texels_are_interpolated_between_their_middles_and_linear() {
        let row = [[0, 0, 0, 255], [255, 255, 255, 255]];
        let found = texture(2, 1, &row, [Wrap::Clamp; 2], false);
        for (u, expected) in [(0.0, 0.0), (0.25, 0.0), (0.5, 0.5), (0.75, 1.0), (9.0, 1.0)] {
            assert!((found.at([u, 0.5], 0.0)[0] - expected).abs() < 1e-6, "{u}");
        }
        let grey = [[188, 188, 188, 128]];
        let srgb = texture(1, 1, &grey, [Wrap::Repeat; 2], false).at([0.3, 0.7], 0.0);
        assert!((srgb[0] - 0.5029).abs() < 1e-3 && (srgb[3] - 128.0 / 255.0).abs() < 1e-6);
        let linear = texture(1, 1, &grey, [Wrap::Repeat; 2], true).at([0.3, 0.7], 0.0);
        assert!((linear[0] - 188.0 / 255.0).abs() < 1e-6);
    }

    #[test]
    fn textures_repeat_clamp_or_mirror() {
        let row = [10u8, 20, 30, 40].map(|c| [c, c, c, 255]);
        let at = |wrap: Wrap, u: f32| {
            let found = texture(4, 1, &row, [wrap, Wrap::Repeat], true).at([u, 0.5], 0.0)[0];
            (found * 255.0).round() as u8
        };
        let middles = [-0.375, -0.125, 0.125, 0.875, 1.125, 1.375, 2.125];
        let all = |wrap| middles.map(|u| at(wrap, u));
        assert_eq!(all(Wrap::Repeat), [30, 40, 10, 40, 10, 20, 10]);
        assert_eq!(all(Wrap::Clamp), [10, 10, 10, 40, 40, 40, 40]);
        assert_eq!(all(Wrap::Mirror), [20, 10, 10, 40, 40, 30, 10]);
    }

    #[test]
    fn a_wide_look_sees_the_mean_of_light() {
        let board: Vec<[u8; 4]> = (0..64 * 64)
            .map(|k| if (k % 64 + k / 64) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] })
            .collect();
        let found = texture(64, 64, &board, [Wrap::Repeat; 2], false);
        for footprint in [4.0 / 64.0, 0.3, 1.0, 7.0] {
            let seen = found.at([0.37, 0.61], footprint)[0];
            // Bytes of sRGB are up to 0.0042 apart there.
            assert!((seen - 0.5).abs() < 0.006, "{footprint}: {seen}");
        }
    }

    #[test]
    fn tga_is_known_by_its_header() {
        let image = image::RgbImage::from_pixel(2, 1, image::Rgb([255, 0, 0]));
        let mut tga = Vec::new();
        image.write_to(&mut Cursor::new(&mut tga), ImageFormat::Tga).unwrap();
        let texture = Texture::decode(tga.into(), [Wrap::Repeat; 2], false, false).unwrap();
        assert_eq!((texture.size(), texture.at([0.5, 0.5], 0.0)), ([2, 1], [1.0, 0.0, 0.0, 1.0]));
    }

    #[test]
    fn bytes_of_srgb_are_the_nearest() {
        for (byte, &linear) in linear_table().iter().enumerate() {
            assert_eq!(usize::from(srgb_byte(linear)), byte);
        }
        for k in 0..=10_000_u16 {
            let linear = f32::from(k) / 1e4;
            let srgb = if linear <= 0.003_130_8 {
                linear * 12.92
            } else {
                1.055 * linear.powf(1.0 / 2.4) - 0.055
            };
            let distance = (f32::from(srgb_byte(linear)) - srgb * 255.0).abs();
            assert!(distance <= 0.501, "{linear}: {distance}");
        }
        assert_eq!([f32::NAN, -1.0, 2.0].map(srgb_byte), [0, 0, 255]);
    }

    #[test]
    fn invalid_and_too_large_pictures_are_refused() {
        let refused = |bytes: &[u8]| {
            Texture::decode(bytes.into(), [Wrap::Repeat; 2], false, false).unwrap_err()
        };
        assert!(!refused(b"no picture").is_empty());
        assert!(!refused(b"no picture, but longer than any header").is_empty());
        // The header of a PNG of 65,535 by 65,535 pixels.
        let mut png = Vec::new();
        let image = image::GrayImage::new(1, 1);
        image.write_to(&mut Cursor::new(&mut png), ImageFormat::Png).unwrap();
        png[16..24].copy_from_slice(&[0, 0, 255, 255, 0, 0, 255, 255]);
        let crc = crc32(&png[12..29]);
        png[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(!refused(&png).is_empty());
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| {
                if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 }
            })
        })
    }
}
