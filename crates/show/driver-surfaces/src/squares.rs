//! Squares of a picture: their surfaces, their sums, and their light at any point of the picture.

use crate::estimate::Estimate;
use crate::light_store::Sums;
use crate::visible::VisiblePoint;
use rayon::prelude::*;

/// The squares of a picture, and the surface of each.
pub(crate) struct Squares {
    pub size: (usize, usize),
    pub seen: Vec<VisiblePoint>,
    /// Side of a square, pixels.
    pub step: usize,
}

/// Squares of a picture, and their light.
pub(crate) struct SquareLayer {
    pub squares: Squares,
    /// The light of each square; its error is infinite where nothing is known.
    pub lights: Vec<Estimate>,
    /// For each surface whose light is unknown, a guess from light around it. Empty if there is no
    /// such surface.
    pub guesses: Vec<Option<Estimate>>,
}

impl Squares {
    /// Returns the squares of a picture of this size. Squares have sides of `step` pixels. `seen`
    /// returns the surface of a pixel.
    pub fn new(
        seen: impl Fn(usize) -> VisiblePoint + Sync,
        (width, height): (usize, usize),
        step: usize,
    ) -> Squares {
        let size = (width.div_ceil(step), height.div_ceil(step));
        let middle = |at: usize, size: usize| (at * step + step / 2).min(size - 1);
        let of_square = |at: usize| {
            let (row, column) = (middle(at / size.0, height), middle(at % size.0, width));
            seen(row * width + column)
        };
        let seen = (0..size.0 * size.1).into_par_iter().map(of_square).collect();
        Squares { size, seen, step }
    }

    /// Returns the middle of a square in the picture, in pixels from the middle of the first pixel.
    pub fn middle(&self, number: usize) -> (f32, f32) {
        let middle = |at: usize| (at * self.step) as f32 + 0.5 * (self.step - 1) as f32;
        (middle(number % self.size.0), middle(number / self.size.0))
    }

    /// Returns the sums of squares, each over its pixels that show the same surface as the middle
    /// one.
    pub fn sums<'a>(
        &self,
        (width, height): (usize, usize),
        of_pixel: impl Fn(usize) -> Option<(&'a VisiblePoint, &'a Sums)> + Sync,
    ) -> Vec<Sums> {
        let step = self.step;
        let square = |number: usize| {
            let middle = &self.seen[number];
            let (left, top) = (number % self.size.0 * step, number / self.size.0 * step);
            let rows = top..(top + step).min(height);
            let columns = left..(left + step).min(width);
            let mut sums = Sums::default();
            if !middle.is_surface() {
                return sums;
            }
            for pixel in rows.flat_map(|y| columns.clone().map(move |x| y * width + x)) {
                let Some((seen, more)) = of_pixel(pixel) else { continue };
                let reach = middle.width * step as f32;
                if alike(middle, seen, 0.5 * reach, 16.0 * reach) > 0.1 {
                    sums.add(more);
                }
            }
            sums
        };
        (0..self.seen.len()).into_par_iter().map(square).collect()
    }
}

impl SquareLayer {
    /// Returns squares with their light. `guess` returns the light of a surface where it is
    /// unknown.
    pub fn new(
        squares: Squares,
        lights: Vec<Estimate>,
        guess: impl Fn(&VisiblePoint) -> Estimate + Sync,
    ) -> SquareLayer {
        let is_unknown = |(seen, light): &(&VisiblePoint, &Estimate)| {
            seen.is_surface() && light.error.is_infinite()
        };
        let all = || squares.seen.par_iter().zip(&lights);
        let guesses = match all().any(|square| is_unknown(&square)) {
            true => all().map(|at| is_unknown(&at).then(|| guess(at.0))).collect(),
            false => Vec::new(),
        };
        SquareLayer { squares, lights, guesses }
    }

    /// Returns the light at a point of the picture, from the squares around it that show the same
    /// surface and whose light is known.
    pub fn at(&self, at: (f32, f32), seen: &VisiblePoint) -> Option<Estimate> {
        self.between(at, seen, |square| {
            let light = &self.lights[square];
            light.error.is_finite().then_some(light)
        })
    }

    /// The same from guesses.
    pub fn guess_at(&self, at: (f32, f32), seen: &VisiblePoint) -> Option<Estimate> {
        if self.guesses.is_empty() {
            return None;
        }
        self.between(at, seen, |square| self.guesses[square].as_ref())
    }

    /// Interpolates between the squares around a point for which `light` returns something.
    #[inline(always)]
    fn between<'a>(
        &self,
        (x, y): (f32, f32),
        seen: &VisiblePoint,
        light: impl Fn(usize) -> Option<&'a Estimate>,
    ) -> Option<Estimate> {
        let step = self.squares.step;
        let (width, height) = self.squares.size;
        // Position in squares, from the middle of the first one: its light is a mean over all its
        // pixels.
        let at = |pixel: f32| (pixel - 0.5 * (step - 1) as f32) / step as f32;
        let (across, down) = (at(x), at(y));
        let (left, top) = (across.floor(), down.floor());
        let reach = seen.width * step as f32;
        let mut sum = Estimate::default();
        let mut total = 0.0;
        for (row, v) in [(top, 1.0 - (down - top)), (top + 1.0, down - top)] {
            for (column, u) in [(left, 1.0 - (across - left)), (left + 1.0, across - left)] {
                if row < 0.0 || column < 0.0 || row >= height as f32 || column >= width as f32 {
                    continue;
                }
                let other = row as usize * width + column as usize;
                let Some(light) = light(other) else { continue };
                let there = &self.squares.seen[other];
                let near = (u + 0.02) * (v + 0.02);
                let weight = near * alike(seen, there, 0.5 * reach, 16.0 * reach);
                // An infinite error times 0 is no number.
                if weight > 0.0 {
                    sum.add(weight, light);
                    total += weight;
                }
            }
        }
        (total > 1e-3).then(|| sum.divided(total))
    }
}

/// Returns the weight of one point's light at another.
///
/// The weight is 1 nearby on the same plane. It is 0 farther than `width` off the plane, beyond
/// `reach`, and if normals differ by a right angle or more.
#[inline]
pub(crate) fn alike(here: &VisiblePoint, other: &VisiblePoint, width: f32, reach: f32) -> f32 {
    let plane = |seen: &VisiblePoint| (seen.point.to_array(), seen.normal.to_array());
    if !other.is_surface() || here.light != other.light {
        return 0.0;
    }
    alike_at(plane(here), plane(other), width, reach)
}

/// Returns the weight of [`alike`] for two points and their unit normals. A normal of length 0
/// means that there is no surface.
#[inline(always)]
pub(crate) fn alike_at(
    (point, normal): ([f32; 3], [f32; 3]),
    (other, other_normal): ([f32; 3], [f32; 3]),
    width: f32,
    reach: f32,
) -> f32 {
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let between = [other[0] - point[0], other[1] - point[1], other[2] - point[2]];
    let away = dot(between, between);
    let off = dot(between, normal).abs().max(dot(between, other_normal).abs());
    let tolerance = width + 0.05 * away.sqrt();
    let flat = (1.0 - off * off / (tolerance * tolerance)).max(0.0);
    let near = (1.0 - away / (reach * reach)).max(0.0);
    if dot(normal, other_normal) > 0.0 { flat * flat * near } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn squares_of_any_side_show_a_gradient_of_light_where_it_is() {
        let size = (24, 16);
        let at = |pixel: usize| ((pixel % size.0) as f32, (pixel / size.0) as f32);
        let seen = |pixel| {
            let (x, y) = at(pixel);
            let (point, normal) = (Vec3::new(x, y, 0.0), Vec3::Z);
            VisiblePoint { point, normal, width: 1.0, material: 0, ..VisiblePoint::NOTHING }
        };
        let light = |(x, y): (f32, f32)| 100.0 + x + 2.0 * y;
        for step in [1, 2, 4] {
            let squares = Squares::new(seen, size, step);
            let mean = |number: usize| {
                let (left, top) = (number % squares.size.0 * step, number / squares.size.0 * step);
                let pixels = (top..top + step)
                    .flat_map(|y| (left..left + step).map(move |x| (x as f32, y as f32)));
                let sum: f32 = pixels.map(light).sum();
                let light = Vec3::splat(sum / (step * step) as f32);
                Estimate { light, error: 0.0, variance: 0.0 }
            };
            let lights = (0..squares.seen.len()).map(mean).collect();
            let layer = SquareLayer::new(squares, lights, |_| Estimate::UNKNOWN);
            // Squares are interpolated inside the ring of their outermost middles.
            let inside = (0..size.0 * size.1).filter(|&pixel| {
                let (x, y) = (pixel % size.0, pixel / size.0);
                (4..size.0 - 4).contains(&x) && (4..size.1 - 4).contains(&y)
            });
            for pixel in inside {
                let found = layer.at(at(pixel), &seen(pixel)).unwrap().light.x;
                let off = found - light(at(pixel));
                // Squares farther away have slightly more than their share.
                assert!(off.abs() < 0.2, "{step}: {:?} is off by {off}", at(pixel));
            }
        }
    }
}
