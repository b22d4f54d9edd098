//! Pictures of the sky on the six faces of a cube, in the layouts that other programs write.
//!
//! North is the front face. Faces are seen from inside the cube. The upper face touches the front
//! one with its lower edge, and the lower face with its upper edge.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::Rgb;

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
pub(crate) type FacePlace = (usize, usize, bool);

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
        let (side, places) = layout(width, height)?;
        (pixels.len() == width * height).then_some(Self { width, side, pixels, places })
    }

    /// Returns the same sky as an equirectangular picture of at most `most` columns: its width and
    /// its pixels. It is twice as wide as high.
    pub(crate) fn unrolled(&self, most: usize) -> (usize, Vec<Rgb>) {
        let width = (4 * self.side).clamp(4, most);
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
        (width, (0..width * height).map(pixel).collect())
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

/// Returns the side of a face and the places of all faces, by the order of [`Face`], in a picture
/// of this shape. `None` if it is no cube.
pub(crate) fn layout(width: usize, height: usize) -> Option<(usize, [FacePlace; 6])> {
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
    is_whole.then_some((side, places))
}
