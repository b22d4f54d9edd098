//! Pictures: brings the light of squares to every pixel, and multiplies it by the material.
//!
//! Invariant: a picture at rest is a function of the store and the view. Threads change no bit.

use crate::cell::{Face, Sums, luminance};
use crate::filter::{Estimate, Squares, alike};
use crate::gather::Gathered;
use crate::known::Known;
use crate::store::Store;
use crate::view::{Edge, POINTS, Seen, View, point_of};
use glam::Vec3;
use holo_denoise::Denoiser;
use rayon::prelude::*;

/// What a view shows.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Radiance of each pixel, rows from the top.
    pub pixels: Vec<[f32; 3]>,
    /// Standard error of each pixel's luminance; infinite where nothing is known.
    pub errors: Vec<f32>,
}

/// Mean numbers of samples per pixel from which squares have sides of 2 pixels and of 1 pixel.
const DENSE: [f32; 2] = [0.3, 4.0];

/// Light for surfaces of which no pixel nearby knows any.
struct Around<'a> {
    store: &'a Store,
    /// Of all samples: for surfaces of which nothing is known.
    mean: Vec3,
}

/// The side of the squares whose known light is looked up, in pixels of half resolution.
const MOVING: usize = 2;

impl Gathered {
    /// Draws the view, and keeps the light that it finds in `known`.
    ///
    /// Where no pixel nearby has light, `store` gives a mean over a larger place. A denoiser
    /// replaces the filter's light, but not its standard errors.
    #[must_use]
    pub(crate) fn draw_and_learn(
        &self,
        view: &View,
        store: &Store,
        denoiser: Option<&mut Denoiser>,
        known: &mut Known,
    ) -> Drawn {
        let step = self.step(view);
        let (size, seen) = view.middles(step);
        let squares = Squares { size, seen: &seen, step };
        let sums = view.sums_of_squares(&squares, &self.sums);
        let mut lights = squares.filter(&sums);
        if let Some(denoiser) = denoiser {
            squares.denoise(&sums, &mut lights, denoiser);
        }
        known.learn(view, &squares, &lights);
        view.lit(store, &squares, &lights)
    }

    /// Draws the view at rest.
    #[must_use]
    pub fn draw(&self, view: &View, store: &Store, denoiser: Option<&mut Denoiser>) -> Drawn {
        self.draw_and_learn(view, store, denoiser, &mut Known::default())
    }

    /// Returns the side of the squares that are filtered, pixels: fewer samples want wider ones.
    fn step(&self, view: &View) -> usize {
        let samples: f32 = self.sums.par_iter().map(|sums| sums.count as f32).sum();
        let pixels = view.seen.iter().filter(|seen| seen.is_surface()).count();
        let dense = samples / pixels.max(1) as f32;
        if dense < DENSE[0] {
            4
        } else if dense < DENSE[1] {
            2
        } else {
            1
        }
    }
}

impl View {
    /// Draws the view from light that earlier pictures found. `None` if they found too little.
    pub(crate) fn draw_known(&self, store: &Store, known: &Known) -> Option<Drawn> {
        let (size, seen) = self.middles(MOVING);
        let squares = Squares { size, seen: &seen, step: MOVING };
        let lights = known.lights(self, &squares)?;
        Some(self.lit(store, &squares, &lights))
    }

    /// Returns columns and rows of squares of `step` pixels a side, and what their middles see.
    fn middles(&self, step: usize) -> ((usize, usize), Vec<Seen>) {
        let (width, height) = self.size;
        let size = (width.div_ceil(step), height.div_ceil(step));
        let middle = |at: usize, size: usize| (at * step + step / 2).min(size - 1);
        let of_square = |at: usize| {
            let (row, column) = (middle(at / size.0, height), middle(at % size.0, width));
            self.seen[row * width + column]
        };
        (size, (0..size.0 * size.1).map(of_square).collect())
    }

    /// Draws the view with this light of its squares.
    fn lit(&self, store: &Store, squares: &Squares, lights: &[Estimate]) -> Drawn {
        let (width, height) = self.size;
        let around = &Around { store, mean: store.mean() };
        let mut pixels = vec![[0.0; 3]; width * height];
        let mut errors = vec![0.0; width * height];
        let rows = pixels.par_chunks_mut(width).zip(errors.par_chunks_mut(width)).enumerate();
        rows.for_each(|(y, (pixels, errors))| {
            for x in 0..width {
                let seen = &self.seen[y * width + x];
                let light = self.brought(around, squares, lights, (x as f32, y as f32), seen);
                (pixels[x], errors[x]) = self.painted(seen, light);
            }
        });
        let edges = self.edges.par_iter();
        let edges: Vec<_> =
            edges.map(|edge| (edge.pixel, self.edge(around, squares, lights, edge))).collect();
        for (pixel, shown) in edges {
            (pixels[pixel], errors[pixel]) = shown;
        }
        let mirrored = self.mirrored.par_iter();
        let mirrored: Vec<_> = mirrored
            .map(|(pixel, seen)| (*pixel as usize, self.painted(seen, self.wide(around, seen))))
            .collect();
        for (pixel, (more, error)) in mirrored {
            (0..3).for_each(|c| pixels[pixel][c] += more[c]);
            errors[pixel] += error;
        }
        Drawn { pixels, errors }
    }

    /// Returns what a surface shows in this light, and the standard error.
    fn painted(&self, seen: &Seen, light: Estimate) -> ([f32; 3], f32) {
        let (scale, radiance) = self.paint(seen);
        let unit = self.unit();
        let colour = [0, 1, 2].map(|c| radiance[c] + scale[c] * light.light[c] * unit);
        let bright = luminance(scale);
        (colour, if seen.is_surface() { bright * light.error * unit } else { 0.0 })
    }

    /// Returns the sums of squares: of their pixels that see the same surface as the middle one.
    fn sums_of_squares(&self, squares: &Squares, of_pixels: &[Sums]) -> Vec<Sums> {
        let (width, height) = self.size;
        let step = squares.step;
        let square = |number: usize| {
            let middle = &squares.seen[number];
            let (left, top) = (number % squares.size.0 * step, number / squares.size.0 * step);
            let rows = top..(top + step).min(height);
            let columns = left..(left + step).min(width);
            let mut sums = Sums::default();
            for pixel in rows.flat_map(|y| columns.clone().map(move |x| y * width + x)) {
                let reach = middle.width * step as f32;
                if alike(middle, &self.seen[pixel], 0.5 * reach, 16.0 * reach) > 0.1 {
                    sums.add(&of_pixels[pixel]);
                }
            }
            sums
        };
        (0..squares.seen.len()).into_par_iter().map(square).collect()
    }

    /// Returns the light at a point of the picture: of the squares around it that see its surface.
    fn brought(
        &self,
        around: &Around,
        squares: &Squares,
        lights: &[Estimate],
        (x, y): (f32, f32),
        seen: &Seen,
    ) -> Estimate {
        if !seen.is_surface() {
            return Estimate { light: Vec3::ZERO, error: 0.0 };
        }
        let step = squares.step;
        let (width, height) = squares.size;
        // In squares, from the middle of the first one.
        let at = |pixel: f32| (pixel - (step / 2) as f32) / step as f32;
        let (across, down) = (at(x), at(y));
        let (left, top) = (across.floor(), down.floor());
        let reach = seen.width * step as f32;
        let mut sum = Vec3::ZERO;
        let mut error = 0.0;
        let mut total = 0.0;
        for (row, v) in [(top, 1.0 - (down - top)), (top + 1.0, down - top)] {
            for (column, u) in [(left, 1.0 - (across - left)), (left + 1.0, across - left)] {
                if row < 0.0 || column < 0.0 || row >= height as f32 || column >= width as f32 {
                    continue;
                }
                let other = row as usize * width + column as usize;
                let light = &lights[other];
                if light.error.is_infinite() {
                    continue;
                }
                let near = (u + 0.02) * (v + 0.02);
                let weight = near * alike(seen, &squares.seen[other], 0.5 * reach, 16.0 * reach);
                sum += weight * light.light;
                error += weight * light.error;
                total += weight;
            }
        }
        if total > 1e-3 {
            return Estimate { light: sum / total, error: error / total };
        }
        self.wide(around, seen)
    }

    /// Returns what a pixel on an edge shows, and its standard error: means over its points.
    fn edge(
        &self,
        around: &Around,
        squares: &Squares,
        lights: &[Estimate],
        edge: &Edge,
    ) -> ([f32; 3], f32) {
        let (column, row) = (edge.pixel % self.size.0, edge.pixel / self.size.0);
        let (mut colour, mut error) = ([0.0; 3], 0.0);
        for (point, seen) in edge.seen.iter().enumerate() {
            let (x, y) = point_of(point);
            // Pixels' own numbers are those of their middles.
            let at = (column as f32 + x - 0.5, row as f32 + y - 0.5);
            let light = self.brought(around, squares, lights, at, seen);
            let (shown, more) = self.painted(seen, light);
            colour.iter_mut().zip(shown).for_each(|(sum, c)| *sum += c / POINTS as f32);
            error += more / POINTS as f32;
        }
        (colour, error)
    }

    /// Returns the mean light around a surface. Where nothing is known, it is the mean of all light:
    /// plausible beats black.
    fn wide(&self, around: &Around, seen: &Seen) -> Estimate {
        if !seen.is_surface() {
            return Estimate { light: Vec3::ZERO, error: f32::INFINITY };
        }
        let direction = self.way(seen).direction;
        let serves = |face: Face| face.serves(seen.normal, seen.material, direction);
        let sums = around.store.around(seen.point, serves);
        if sums.count == 0 {
            return Estimate { light: around.mean, error: f32::INFINITY };
        }
        let light = sums.mean();
        let bright = luminance(light.to_array());
        let variance = (sums.mean_square() - bright * bright).max(bright * bright);
        Estimate { light, error: (variance / sums.count as f32).sqrt() }
    }
}
