//! Pictures of the sky on the six faces of a cube, in the layouts that other programs write.
//!
//! North is the front face. Faces are seen from inside the cube. The upper face touches the front
//! one with its lower edge, and the lower face with its upper edge.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::Rgb;
use crate::sky_picture::{MAX_SKY_SIDE, SkyPicture};

/// Samples of a pixel of the unrolled picture, across and down.
const SAMPLES: usize = 2;

/// A face of the cube.
#[derive(Clone, Copy)]
enum Face {
    Right,
    Left,
    Up,
    Down,
    Front,
    Back,
}

/// The place of a face in a picture: its column and row in faces, and whether it is upside down.
type FacePlace = (usize, usize, bool);

/// A picture whose faces are at known places.
pub(crate) struct SkyCube<'a> {
    width: usize,
    side: usize,
    pixels: &'a [Rgb],
    /// By the order of [`Face`].
    places: [FacePlace; 6],
}

impl<'a> SkyCube<'a> {
    /// Returns the cube of a picture, if its shape is that of one.
    pub(crate) fn of_picture(width: usize, height: usize, pixels: &'a [Rgb]) -> Option<Self> {
        let (columns, rows, places): (_, _, [FacePlace; 6]) = match (width, height) {
            // The usual order of strips: +x, -x, +y, -y, +z, -z, with y up and z ahead.
            _ if width == 6 * height => (6, 1, [0, 1, 2, 3, 4, 5].map(|at| (at, 0, false))),
            _ if height == 6 * width => (1, 6, [0, 1, 2, 3, 4, 5].map(|at| (0, at, false))),
            _ if 3 * width == 4 * height => {
                (4, 3, [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (3, 1)].map(|(x, y)| (x, y, false)))
            }
            // The back face hangs from the lower one.
            _ if 4 * width == 3 * height => (
                3,
                4,
                [
                    (2, 1, false),
                    (0, 1, false),
                    (1, 0, false),
                    (1, 2, false),
                    (1, 1, false),
                    (1, 3, true),
                ],
            ),
            _ => return None,
        };
        let side = width / columns;
        let is_whole = side > 0 && side * columns == width && side * rows == height;
        (is_whole && pixels.len() == width * height).then_some(Self { width, side, pixels, places })
    }

    /// Returns the same sky as an equirectangular picture.
    ///
    /// # Errors
    /// A text for people, if it cannot be one.
    pub(crate) fn unrolled(&self) -> Result<SkyPicture, String> {
        let width = (4 * self.side).clamp(4, MAX_SKY_SIDE);
        let height = width / 2;
        let sample = |index: usize| {
            let (at, part) = (index / (SAMPLES * SAMPLES), index % (SAMPLES * SAMPLES));
            let inside = |part: usize| (part as f64 + 0.5) / SAMPLES as f64;
            let across = ((at % width) as f64 + inside(part % SAMPLES)) / width as f64;
            let down = ((at / width) as f64 + inside(part / SAMPLES)) / height as f64;
            let (east, north) = ((across - 0.5) * TAU).sin_cos();
            let (level, up) = (down * PI).sin_cos();
            self.at(DVec3::new(level * east, level * north, up))
        };
        let pixel = |at: usize| {
            let samples = (0..SAMPLES * SAMPLES).map(|part| sample(at * SAMPLES * SAMPLES + part));
            let sum =
                samples.fold([0.0; 3], |sum: Rgb, next| std::array::from_fn(|k| sum[k] + next[k]));
            sum.map(|channel| channel / (SAMPLES * SAMPLES) as f32)
        };
        SkyPicture::new(width, height, (0..width * height).map(pixel).collect())
    }

    /// Returns the pixel in a direction of the horizon's frame: x east, y north, z up.
    fn at(&self, direction: DVec3) -> Rgb {
        let DVec3 { x, y, z } = direction;
        let most = direction.abs().max_element();
        let (face, right, down) = match () {
            () if y == most => (Face::Front, x, -z),
            () if -y == most => (Face::Back, -x, -z),
            () if x == most => (Face::Right, -y, -z),
            () if -x == most => (Face::Left, y, -z),
            () if z == most => (Face::Up, x, y),
            () => (Face::Down, x, -y),
        };
        let (column, row, is_turned) = self.places[face as usize];
        let place = |along: f64| {
            let along = if is_turned { -along } else { along };
            let at = (along / most + 1.0) * 0.5 * self.side as f64;
            (at as usize).min(self.side - 1)
        };
        let (x, y) = (column * self.side + place(right), row * self.side + place(down));
        self.pixels[y * self.width + x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let sky = sky.unrolled().unwrap();
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
