//! Pictures of the sky: equirectangular, with the zenith in the first row and north in the middle
//! column. East is right of north. Cubes are converted (`sky_cube`).
//!
//! Invariants:
//! - A picture larger than [`MAX_SKY_SIDE`] is halved until it fits, so memory is bounded.
//! - Every number is finite and not negative.

use std::f64::consts::{PI, TAU};
use std::io::Cursor;

use glam::DVec3;
use image::{ColorType, DynamicImage, ImageDecoder, ImageReader, Limits};

use crate::Rgb;
use crate::sky_cube::{self, SkyCube};

/// Greatest side of a picture of the sky in pixels; larger ones are halved. 4096 × 2048 pixels are
/// 100 MB, and each worker fetches them once.
pub const MAX_SKY_SIDE: usize = 4096;

/// Greatest side of a picture that is decoded at all, and most memory for that.
const MAX_DECODED_SIDE: u32 = 16384;
const MAX_DECODED_BYTES: u64 = 2 << 30;

/// Greatest number of a pixel. The sun in such pictures has 1e4 to 1e6.
const MAX_PIXEL: f32 = 1e9;

/// A picture of all directions.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyPicture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Rows from the zenith down.
    pub(crate) pixels: Vec<Rgb>,
}

impl SkyPicture {
    /// Decodes a Radiance HDR or EXR picture.
    ///
    /// # Errors
    /// A text for people, if it is damaged, too large, no HDR picture, or of another shape.
    pub fn decode(encoded: &[u8]) -> Result<SkyPicture, String> {
        let reader = ImageReader::new(Cursor::new(encoded)).with_guessed_format();
        let mut reader = reader.map_err(|error| error.to_string())?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(MAX_DECODED_SIDE);
        limits.max_image_height = Some(MAX_DECODED_SIDE);
        limits.max_alloc = Some(MAX_DECODED_BYTES);
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(|error| error.to_string())?;
        if !matches!(decoder.color_type(), ColorType::Rgb32F | ColorType::Rgba32F) {
            return Err("it is no HDR picture, so it does not say how bright the sky is; use a \
                        Radiance .hdr or an .exr"
                .to_owned());
        }
        let (width, height) = decoder.dimensions();
        let (width, height) = (width as usize, height as usize);
        // Before any memory is taken for pixels.
        if !is_whole_sky(width, height) && sky_cube::layout(width, height).is_none() {
            return Err(wrong_shape(width, height));
        }
        let image = DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
        let pixels = image.into_rgb32f().into_raw();
        let pixels = pixels.as_chunks::<3>().0.to_vec();
        match SkyCube::of_picture(width, height, &pixels) {
            Some(cube) => {
                let (width, pixels) = cube.unrolled(MAX_SKY_SIDE);
                SkyPicture::new(width, width / 2, pixels)
            }
            None => SkyPicture::new(width, height, pixels),
        }
    }

    /// Makes a picture from its rows.
    ///
    /// # Errors
    /// A text for people, if its sides do not suit.
    pub fn new(width: usize, height: usize, mut pixels: Vec<Rgb>) -> Result<SkyPicture, String> {
        if !is_whole_sky(width, height) || pixels.len() != width * height {
            return Err(wrong_shape(width, height));
        }
        let sound =
            |channel: f32| if channel.is_nan() { 0.0 } else { channel.clamp(0.0, MAX_PIXEL) };
        pixels.iter_mut().for_each(|pixel| *pixel = pixel.map(sound));
        let mut picture = SkyPicture { width, height, pixels };
        while picture.width > MAX_SKY_SIDE {
            picture = picture.halved();
        }
        Ok(picture)
    }

    fn halved(&self) -> SkyPicture {
        let (width, height) = (self.width / 2, self.height / 2);
        let mean = |at: usize| {
            let (x, y) = (2 * (at % width), 2 * (at / width));
            let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
            let four = four.map(|(x, y)| self.pixels[y * self.width + x]);
            std::array::from_fn(|k| four.iter().map(|pixel| pixel[k]).sum::<f32>() * 0.25)
        };
        SkyPicture { width, height, pixels: (0..width * height).map(mean).collect() }
    }

    /// Returns the number in a unit direction of the horizon's frame. Pixels blend into each other.
    #[inline]
    pub(crate) fn at(&self, direction: DVec3) -> Rgb {
        let azimuth = direction.x.atan2(direction.y);
        let across = (azimuth / TAU + 0.5) * self.width as f64 - 0.5;
        let down = direction.z.clamp(-1.0, 1.0).acos() / PI * self.height as f64 - 0.5;
        let (left, above) = (across.floor(), down.floor());
        let (x, y) = ((across - left) as f32, (down - above) as f32);
        let pixel = |column: f64, row: f64| {
            let column = (column as i64).rem_euclid(self.width as i64) as usize;
            let row = (row as i64).clamp(0, self.height as i64 - 1) as usize;
            self.pixels[row * self.width + column]
        };
        let four = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
        let four = four.map(|(right, below)| pixel(left + right, above + below));
        let shares = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
        std::array::from_fn(|k| four.iter().zip(shares).map(|(p, share)| p[k] * share).sum())
    }

    pub(crate) fn brightest(&self) -> f32 {
        self.pixels.as_flattened().iter().copied().fold(0.0, f32::max)
    }
}

/// Returns whether a picture of this shape is equirectangular.
fn is_whole_sky(width: usize, height: usize) -> bool {
    width == 2 * height && width >= 4
}

fn wrong_shape(width: usize, height: usize) -> String {
    format!(
        "it has {width} x {height} pixels; a picture of the whole sky is twice as wide as high \
         (equirectangular), or a cube: a cross of 4 x 3 or 3 x 4 faces, or a strip of 6"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn north_is_in_the_middle_and_east_right_of_it() {
        let mut pixels = vec![[0.0; 3]; 8 * 4];
        // Row 1 is above the horizon. Columns 4 and 6 begin at north and at east.
        (pixels[8 + 4], pixels[8 + 6], pixels[3 * 8]) = ([1.0; 3], [2.0; 3], [f32::NAN; 3]);
        let picture = SkyPicture::new(8, 4, pixels).unwrap();
        let at = |azimuth: f64, altitude: f64| {
            let (sin, cos) = azimuth.to_radians().sin_cos();
            let (up, level) = altitude.to_radians().sin_cos();
            picture.at(DVec3::new(sin * level, cos * level, up))[0]
        };
        assert!((at(22.5, 22.5) - 1.0).abs() < 1e-5);
        assert!((at(112.5, 22.5) - 2.0).abs() < 1e-5);
        assert!((at(0.0, 22.5) - 0.5).abs() < 1e-5, "between two pixels");
        assert_eq!((at(200.0, 22.5), at(30.0, -89.0)), (0.0, 0.0));
    }

    #[test]
    fn only_hdr_pictures_twice_as_wide_as_high_are_skies() {
        assert!(SkyPicture::new(8, 8, vec![[1.0; 3]; 64]).unwrap_err().contains("twice as wide"));
        let mut png = Cursor::new(Vec::new());
        DynamicImage::new_rgb8(8, 4).write_to(&mut png, image::ImageFormat::Png).unwrap();
        assert!(SkyPicture::decode(png.get_ref()).unwrap_err().contains(".hdr"));
        assert!(SkyPicture::decode(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n").is_err());
        // A shape of no sky is named before its pixels are read, which are not there.
        let header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 9000 +X 9001\n";
        assert!(SkyPicture::decode(header).unwrap_err().contains("it has 9001 x 9000 pixels"));
        let mut hdr = Cursor::new(Vec::new());
        DynamicImage::new_rgb32f(8, 4).write_to(&mut hdr, image::ImageFormat::Hdr).unwrap();
        assert_eq!(SkyPicture::decode(hdr.get_ref()).map(|p| p.width), Ok(8));
    }

    /// A cube whose pixels have the colour of their direction, in a layout of faces.
    fn cube(
        columns: usize,
        rows: usize,
        faces: &[(usize, usize, [DVec3; 3])],
    ) -> (usize, Vec<Rgb>) {
        const SIDE: usize = 32;
        let mut pixels = vec![[f32::NAN; 3]; columns * rows * SIDE * SIDE];
        for &(column, row, [ahead, right, down]) in faces {
            for at in 0..SIDE * SIDE {
                let (x, y) = (at % SIDE, at / SIDE);
                let place = |at: usize| (at as f64 + 0.5) / SIDE as f64 * 2.0 - 1.0;
                let way = (ahead + right * place(x) + down * place(y)).normalize();
                let pixel = (row * SIDE + y) * columns * SIDE + column * SIDE + x;
                pixels[pixel] = (way * 0.5 + 0.5).as_vec3().to_array();
            }
        }
        (SIDE, pixels)
    }

    #[test]
    fn crosses_and_strips_show_each_direction_where_it_is() {
        const NADIR: DVec3 = DVec3::NEG_Z;
        // The direction of a face's middle, of its right and of its lower side.
        let right = [DVec3::X, DVec3::NEG_Y, NADIR];
        let left = [DVec3::NEG_X, DVec3::Y, NADIR];
        let up = [DVec3::Z, DVec3::X, DVec3::Y];
        let down = [NADIR, DVec3::X, DVec3::NEG_Y];
        let front = [DVec3::Y, DVec3::X, NADIR];
        let back = [DVec3::NEG_Y, DVec3::NEG_X, NADIR];
        let hanging = [DVec3::NEG_Y, DVec3::X, DVec3::Z];
        let order = [right, left, up, down, front, back];
        let strip: Vec<_> = (0..).zip(order).map(|(at, face)| (at, 0, face)).collect();
        let column: Vec<_> = (0..).zip(order).map(|(at, face)| (0, at, face)).collect();
        let middle = [(0, 1, left), (1, 1, front), (2, 1, right), (1, 0, up), (1, 2, down)];
        let cross = [&middle[..], &[(3, 1, back)]].concat();
        let tall = [&middle[..], &[(1, 3, hanging)]].concat();
        for (columns, rows, faces) in
            [(6, 1, &strip), (1, 6, &column), (4, 3, &cross), (3, 4, &tall)]
        {
            let (side, pixels) = cube(columns, rows, faces);
            let sky = SkyCube::of_picture(columns * side, rows * side, &pixels).unwrap();
            let (width, pixels) = sky.unrolled(MAX_SKY_SIDE);
            let sky = SkyPicture::new(width, width / 2, pixels).unwrap();
            for at in 0..500 {
                let z = 1.0 - (f64::from(at) + 0.5) / 250.0;
                let (sin, cos) = (f64::from(at) * 2.399_963).sin_cos();
                let level = (1.0 - z * z).sqrt();
                let way = DVec3::new(level * cos, level * sin, z);
                let found = sky.at(way);
                let wanted = way * 0.5 + 0.5;
                let error = (DVec3::from(found.map(f64::from)) - wanted).abs().max_element();
                assert!(error < 0.04, "{columns} x {rows}: {way} {found:?}");
            }
        }
        assert!(SkyCube::of_picture(8, 4, &[[0.0; 3]; 32]).is_none(), "equirectangular");
        assert!(SkyCube::of_picture(5, 5, &[[0.0; 3]; 25]).is_none());
    }
}
