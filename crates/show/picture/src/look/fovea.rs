//! The picture as an eye takes it in: means over cells as wide as the fovea, about 1° (Larson,
//! Rushmeier & Piatko 1997, §3). Adaptation, glare and acuity follow from them.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::curve::finite;
use super::eye;
use super::raster::Raster;
use crate::kind::ViewKind;
use crate::picture::Picture;
use crate::view::{DEFAULT_VH, View};
use holo_color::luminance;

/// Width of the fovea in radians.
const FOVEA: f64 = PI / 180.0;

/// Cells across a parallel view, which has no angles.
const PARALLEL_CELLS: f64 = 60.0;

/// Most cells. Glare takes a time that grows with their square. Wider views get wider cells.
const MOST_CELLS: f64 = 4096.0;

/// Share of the light that an eye scatters over its retina (§5.1, from Moon & Spencer 1945).
const SCATTERED: f32 = 0.087;

/// Least 2 (1 − cos θ) between two cells. Without it, rounding could give two neighbours in narrow
/// views an endless weight.
const LEAST_ANGLE: f32 = 1e-6;

/// Returns the picture's means over foveal cells, in radiance.
pub(super) fn fovea(picture: &Picture) -> Raster<Vec3> {
    let (across, along) = size_in_cells(picture);
    let (width, height) = (picture.width as usize, picture.height as usize);
    let mean = |cell: usize| {
        let part = |i: usize, of: usize, size: usize| i * size / of..(i + 1) * size / of;
        let (rows, columns) =
            (part(cell / across, along, height), part(cell % across, across, width));
        let pixels = (rows.len() * columns.len()) as f64;
        let mut sum = [0.0_f64; 3];
        for row in rows {
            for &rgb in &picture.pixels[row * width + columns.start..][..columns.len()] {
                let rgb = finite(rgb);
                (0..3).for_each(|channel| sum[channel] += f64::from(rgb[channel]));
            }
        }
        Vec3::from(sum.map(|sum| (sum / pixels) as f32))
    };
    let values = (0..along * across).into_par_iter().with_min_len(across).map(mean).collect();
    Raster { width: across, height: along, values }
}

/// Returns the number of cells across and along a picture (§3, equation 1). A picture without a
/// view counts as a perspective one of the default angle.
fn size_in_cells(picture: &Picture) -> (usize, usize) {
    let (width, height) = (f64::from(picture.width), f64::from(picture.height));
    let default = 2.0 * (DEFAULT_VH.to_radians() / 2.0).tan();
    let (across, along) = match &picture.view {
        Some(view) if view.kind == ViewKind::Parallel => {
            (PARALLEL_CELLS, PARALLEL_CELLS * height / width)
        }
        Some(view) => (view.extent().0 / FOVEA, view.extent().1 / FOVEA),
        None => (default / FOVEA, default / FOVEA * height / width),
    };
    let shrink = (MOST_CELLS / (across * along)).sqrt().min(1.0);
    let count = |cells: f64, pixels: f64| (cells * shrink).round().clamp(1.0, pixels) as usize;
    (count(across, width), count(along, height))
}

/// Where foveal cells look, and how wide pixels are there.
pub(super) struct Gaze {
    /// Unit vectors; 0 where the picture shows nothing.
    directions: Vec<Vec3>,
    /// Angles that pixels take up, in radians; 0 where the picture shows nothing.
    pixels: Vec<f32>,
}

impl Gaze {
    /// Returns the gaze of each cell.
    pub fn new(picture: &Picture, cells: &Raster<Vec3>) -> Gaze {
        let (x, y) = (DVec3::X, DVec3::Y);
        let view = picture.view.filter(|view| view.kind.has_eye());
        let view =
            view.or_else(|| View::new(DVec3::ZERO, y, x.cross(y), None, None, picture.size()).ok());
        let direction = |x: f64, y: f64| view.and_then(|view| Some(view.try_ray(x, 1.0 - y)?.1));
        let centre = |cell: usize| {
            (
                ((cell % cells.width) as f64 + 0.5) / cells.width as f64,
                ((cell / cells.width) as f64 + 0.5) / cells.height as f64,
            )
        };
        let angle = |from: (f64, f64), to: (f64, f64)| {
            Some(direction(from.0, from.1)?.distance(direction(to.0, to.1)?))
        };
        let pixel = |(x, y): (f64, f64)| {
            let (dx, dy) = (0.5 / f64::from(picture.width), 0.5 / f64::from(picture.height));
            Some((angle((x - dx, y), (x + dx, y))? * angle((x, y - dy), (x, y + dy))?).sqrt())
        };
        let centres = (0..cells.values.len()).map(centre);
        let (directions, pixels) = centres
            .map(|(x, y)| {
                let towards = direction(x, y).unwrap_or_default();
                (towards.as_vec3(), pixel((x, y)).unwrap_or_default() as f32)
            })
            .unzip();
        Gaze { directions, pixels }
    }

    /// Returns the veil that scattered light lays over each cell (§5.1). Light counts by cos θ/θ²
    /// for the angle θ between two cells.
    pub fn veil(&self, cells: &Raster<Vec3>) -> Raster<Vec3> {
        let veil = |here: usize| {
            let towards = self.directions[here];
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for (there, (&direction, &light)) in
                self.directions.iter().zip(&cells.values).enumerate()
            {
                let cosine = towards.dot(direction);
                if cosine > 0.0 && there != here {
                    // 2 (1 - cos θ) is θ² within 2 % up to 30°.
                    let weight = cosine / (2.0 * (1.0 - cosine)).max(LEAST_ANGLE);
                    sum += light * weight;
                    weights += weight;
                }
            }
            // A picture of one cell scatters onto itself.
            if weights > 0.0 { sum * (SCATTERED / weights) } else { cells.values[here] * SCATTERED }
        };
        let values = (0..cells.values.len()).into_par_iter().map(veil).collect();
        Raster { values, ..*cells }
    }

    /// Returns the width in pixels of the finest detail that the eye sees in each cell, at least 1.
    /// It is half a cycle of the finest grating that the eye resolves there (§5.3).
    pub fn details(&self, cells: &Raster<Vec3>) -> Raster<f32> {
        let detail = |(&light, &pixel): (&Vec3, &f32)| {
            let half_cycle = (FOVEA as f32) / (2.0 * eye::acuity(luminance(light.into())));
            if pixel > 0.0 { (half_cycle / pixel).max(1.0) } else { 1.0 }
        };
        let values = cells.values.iter().zip(&self.pixels).map(detail).collect();
        Raster { values, width: cells.width, height: cells.height }
    }
}

/// Returns light under a veil, without the light that the eye scatters away.
#[inline]
pub(super) fn under(veil: Vec3, light: Vec3) -> Vec3 {
    light * (1.0 - SCATTERED) + veil
}

/// A picture in ever coarser means, to show it without details that are too fine to be seen.
pub(super) struct Blur {
    levels: Vec<Raster<Vec3>>,
}

impl Blur {
    /// Makes means up to `coarsest` pixels wide.
    pub fn new(picture: &Picture, coarsest: f32) -> Blur {
        let values = picture.pixels.par_iter().map(|&rgb| finite(rgb).into()).collect();
        let whole =
            Raster { width: picture.width as usize, height: picture.height as usize, values };
        let mut levels = vec![whole];
        for _ in 0..coarsest.log2().ceil() as usize {
            levels.extend(levels.last().map(Raster::halved));
        }
        Blur { levels }
    }

    /// Returns the light at a place, with details `detail` pixels wide.
    #[inline]
    pub fn at(&self, x: f32, y: f32, detail: f32) -> Vec3 {
        let level = detail.log2().clamp(0.0, (self.levels.len() - 1) as f32);
        let finer = level as usize;
        let share = level - finer as f32;
        let fine = self.levels[finer].at(x, y);
        match self.levels.get(finer + 1).filter(|_| share > 0.0) {
            Some(coarser) => fine.lerp(coarser.at(x, y), share),
            None => fine,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, light: impl Fn(u32, u32) -> f32) -> Picture {
        let mut picture = Picture::new(width, height);
        for row in 0..height {
            for column in 0..width {
                picture.pixels[(row * width + column) as usize] = [light(column, row); 3];
            }
        }
        picture
    }

    #[test]
    fn cells_are_a_degree_wide_and_hold_means() {
        let picture = picture(330, 220, |column, _| column as f32);
        let cells = fovea(&picture);
        // 2 tan 30° / 1° = 66.2 cells across, of 5 pixels each.
        assert_eq!((cells.width, cells.height), (66, 44));
        assert_eq!(cells.values[0], Vec3::splat(2.0));
        assert_eq!(cells.values[65], Vec3::splat(327.0));
    }

    #[test]
    fn a_veil_of_even_light_adds_as_much_as_it_removes() {
        let picture = picture(200, 100, |_, _| 3.0);
        let cells = fovea(&picture);
        let veil = Gaze::new(&picture, &cells).veil(&cells);
        for (&cell, &veil) in cells.values.iter().zip(&veil.values) {
            assert!((under(veil, cell) - cell).abs().max_element() < 1e-4);
        }
    }

    #[test]
    fn the_veil_of_a_lamp_falls_with_the_square_of_the_angle() {
        let picture =
            picture(
                620,
                400,
                |column, row| {
                    if column / 10 == 31 && row / 10 == 20 { 1e4 } else { 0.0 }
                },
            );
        let cells = fovea(&picture);
        let veil = Gaze::new(&picture, &cells).veil(&cells);
        let at = |steps: usize| veil.at(0.5 + steps as f32 / cells.width as f32, 0.5).x;
        let ratio = at(5) / at(10);
        assert!((3.0..5.0).contains(&ratio), "{ratio}");
        assert!(at(5) > 0.0 && at(5) < 0.087 * 1e4);
    }

    #[test]
    fn details_blur_in_the_dark_only() {
        let shown = |light: f32| {
            let picture = picture(600, 400, |column, _| light * (column % 2) as f32);
            let cells = fovea(&picture);
            let details = Gaze::new(&picture, &cells).details(&cells);
            let detail = details.at(0.5, 0.5);
            let blur = Blur::new(&picture, detail);
            let at = |column: f32| blur.at((column + 0.5) / 600.0, 0.5, detail).x / light;
            (at(300.0), at(301.0))
        };
        assert_eq!(shown(10.0), (0.0, 1.0));
        let (dark, light) = shown(1e-6);
        assert!((dark - 0.5).abs() < 0.1 && (light - 0.5).abs() < 0.1, "{dark} {light}");
    }
}
