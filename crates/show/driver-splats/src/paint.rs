//! Draws splats into pixels: the nearest surface of each pixel, on all cores.
//!
//! Rows are drawn in bands, and each band goes through its splats in their order. So pictures do
//! not depend on the number of threads.

use glam::Vec3;
use holo_color::relative_luminance;
use rayon::prelude::*;

use crate::{SplatShape, traversal::DrawnSplat};

/// Rows of a band.
const BAND: usize = 16;

/// Least radius of a splat, pixels. A disc seen from its edge would fall between pixels.
const LEAST_REACH: f32 = 0.75;

/// Largest splat, pixels: splats beside the eye.
const MOST_REACH: f32 = 2000.0;

/// Splats blend if they are behind the nearest one by less than this share of their radii.
const THICKNESS: f32 = 1.0;

/// Steepness of the fading of fuzzy splats.
const FADING: f32 = 2.5;

/// What splats show in a picture.
pub(crate) struct SplatPicture {
    /// Radiance; 0 where no splat is.
    pub pixels: Vec<[f32; 3]>,
    /// Distance from the eye; 0 where no splat is.
    pub depth: Vec<f32>,
    /// Standard error of the relative luminance.
    pub errors: Vec<f32>,
}

/// The view rays of a picture in camera coordinates.
pub(crate) struct PixelRays {
    /// Unit directions; 0 where the view has no ray.
    pub directions: Vec<Vec3>,
    /// Where rays begin, in a parallel view; otherwise empty, for the eye.
    pub origins: Vec<Vec3>,
    pub size: (usize, usize),
}

/// A pixel while it is drawn.
#[derive(Clone, Copy)]
struct Pixel {
    nearest: f32,
    reach: f32,
    light: Vec3,
    error: f32,
    weight: f32,
}

/// How a splat shows in a pixel.
struct DiscHit {
    distance: f32,
    weight: f32,
}

/// Draws splats. `peak` is that of the file.
pub(crate) fn paint(
    splats: &[DrawnSplat],
    rays: &PixelRays,
    shape: SplatShape,
    peak: f32,
) -> SplatPicture {
    let (width, height) = rays.size;
    let bands = bands(splats, rays.size);
    let mut painted = SplatPicture {
        pixels: vec![[0.0; 3]; width * height],
        depth: vec![0.0; width * height],
        errors: vec![f32::INFINITY; width * height],
    };
    let lines = painted.pixels.par_chunks_mut(width * BAND);
    let lines = lines.zip(painted.depth.par_chunks_mut(width * BAND));
    let lines = lines.zip(painted.errors.par_chunks_mut(width * BAND));
    lines.zip(&bands).enumerate().for_each(|(band, (((pixels, depth), errors), numbers))| {
        let of_band = numbers.iter().map(|&number| &splats[number as usize]);
        let band = BandOfRows { rays, top: band * BAND, rows: depth.len() / width, shape };
        for (at, pixel) in band.draw(of_band, peak).into_iter().enumerate() {
            if pixel.weight > 0.0 {
                pixels[at] = (pixel.light / pixel.weight).to_array();
                depth[at] = pixel.nearest;
                errors[at] = pixel.error / pixel.weight;
            }
        }
    });
    painted
}

/// Returns the numbers of the splats of each band of rows, in order.
fn bands(splats: &[DrawnSplat], size: (usize, usize)) -> Vec<Vec<u32>> {
    let count = size.1.div_ceil(BAND);
    let mut bands = vec![Vec::new(); count];
    for (number, splat) in (0..).zip(splats) {
        let reach = splat.reach.clamp(LEAST_REACH, MOST_REACH) * 1.2 + 1.0;
        let (x, y) = splat.place;
        if !(x + reach > 0.0 && x - reach < size.0 as f32) {
            continue;
        }
        let first = ((y - reach) / BAND as f32).floor().max(0.0);
        let last = ((y + reach) / BAND as f32).floor().min(count as f32 - 1.0);
        if first <= last {
            bands[first as usize..=last as usize].iter_mut().for_each(|band| band.push(number));
        }
    }
    bands
}

/// Some rows of a picture.
struct BandOfRows<'a> {
    rays: &'a PixelRays,
    top: usize,
    rows: usize,
    shape: SplatShape,
}

impl BandOfRows<'_> {
    fn draw<'s>(
        &self,
        splats: impl Iterator<Item = &'s DrawnSplat> + Clone,
        peak: f32,
    ) -> Vec<Pixel> {
        let empty = Pixel {
            nearest: f32::INFINITY,
            reach: 0.0,
            light: Vec3::ZERO,
            error: 0.0,
            weight: 0.0,
        };
        let mut pixels = vec![empty; self.rows * self.rays.size.0];
        let blends = self.shape == SplatShape::Fuzzy;
        for splat in splats.clone() {
            let light = if blends { (Vec3::ZERO, 0.0) } else { light(splat, peak) };
            self.for_pixels(splat, |at, hit| {
                let pixel = &mut pixels[at];
                if hit.distance >= pixel.nearest {
                    return;
                }
                let (nearest, reach) = (hit.distance, splat.radius);
                let weight = if blends { 0.0 } else { 1.0 };
                *pixel = Pixel { nearest, reach, light: light.0, error: light.1, weight };
            });
        }
        if blends {
            for splat in splats {
                let light = light(splat, peak);
                self.for_pixels(splat, |at, hit| {
                    let pixel = &mut pixels[at];
                    let thickness = THICKNESS * splat.radius.max(pixel.reach);
                    if hit.distance < pixel.nearest + thickness {
                        pixel.light += light.0 * hit.weight;
                        pixel.error += light.1 * hit.weight;
                        pixel.weight += hit.weight;
                    }
                });
            }
        }
        pixels
    }

    /// Calls `visit` with each pixel of these rows that a splat covers.
    fn for_pixels(&self, splat: &DrawnSplat, mut visit: impl FnMut(usize, DiscHit)) {
        let reach = splat.reach.clamp(LEAST_REACH, MOST_REACH);
        // A disc in a wide view is drawn longer than it is wide.
        let margin = if self.is_flat() { reach } else { reach * 1.2 + 0.5 };
        let (x, y) = splat.place;
        let width = self.rays.size.0;
        let range = |middle: f32, first: usize, count: usize| {
            let low = (middle - margin - 0.5).ceil().max(first as f32);
            let high = (middle + margin - 0.5).floor().min((first + count) as f32 - 1.0);
            (low <= high).then(|| low as usize..high as usize + 1)
        };
        let Some(columns) = range(x, 0, width) else { return };
        let Some(rows) = range(y, self.top, self.rows) else { return };
        for row in rows {
            for column in columns.clone() {
                let off = (column as f32 + 0.5 - x, row as f32 + 0.5 - y);
                let ray = row * width + column;
                if let Some(hit) = self.hit(splat, reach, off, ray) {
                    visit((row - self.top) * width + column, hit);
                }
            }
        }
    }

    fn is_flat(&self) -> bool {
        matches!(self.shape, SplatShape::Square | SplatShape::Circle)
    }

    /// Returns how a splat shows in a pixel `off` its centre; `None` if it does not.
    fn hit(&self, splat: &DrawnSplat, reach: f32, off: (f32, f32), ray: usize) -> Option<DiscHit> {
        let square = off.0 * off.0 + off.1 * off.1;
        let origin = self.rays.origins.get(ray).copied().unwrap_or(Vec3::ZERO);
        let to_centre = splat.centre - origin;
        if self.is_flat() {
            let is_inside = self.shape == SplatShape::Square || square <= reach * reach;
            let distance = to_centre.length();
            return is_inside.then_some(DiscHit { distance, weight: 1.0 });
        }
        let direction = self.rays.directions[ray];
        let slope = splat.normal.dot(direction);
        let along = splat.normal.dot(to_centre) / slope;
        let on_disc = match slope.abs() > 1e-3 && along > 0.0 {
            true => {
                (direction * along - to_centre).length_squared() / (splat.radius * splat.radius)
            }
            false => f32::INFINITY,
        };
        let on_screen = square / (LEAST_REACH * LEAST_REACH);
        let place = on_disc.min(on_screen);
        // NaN, of a ray that does not exist, is outside.
        let is_inside = place <= 1.0;
        let distance = if on_disc <= 1.0 { along } else { to_centre.length() };
        is_inside.then(|| DiscHit { distance, weight: (-FADING * place).exp() })
    }
}

/// Returns a splat's radiance, and the standard error of its relative luminance.
fn light(splat: &DrawnSplat, peak: f32) -> (Vec3, f32) {
    let rgb = splat.light.rgb(peak);
    let error = splat.light.error() * relative_luminance(rgb);
    (rgb.into(), if error.is_nan() { f32::INFINITY } else { error })
}
