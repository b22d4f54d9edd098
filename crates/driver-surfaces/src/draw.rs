//! Pictures: light of squares of pixels, looked up in the store, filtered, brought to every pixel, times its material.
//!
//! Invariant: a picture is a function of the store's sums and the view; threads change no bit.

use crate::cell::{Face, LEVELS, Place, Sums};
use crate::filter::{Estimate, Squares, alike};
use crate::store::Store;
use crate::view::{Seen, View};
use glam::Vec3;
use rayon::prelude::*;

/// Samples that a surface without a square is looked up with, at least.
const ENOUGH: u32 = 64;

/// The same of what panes mirror: it is a small share of what they show, and best smooth.
const ENOUGH_MIRRORED: u32 = 256;

/// What a view shows.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Radiance by pixel, rows from the top.
    pub pixels: Vec<[f32; 3]>,
    /// Standard error of its luminance; infinite where nothing is known.
    pub errors: Vec<f32>,
}

impl View {
    /// Draws the view; light is found once for each square of `step` × `step` pixels.
    #[must_use]
    pub fn draw(&self, store: &Store, step: usize) -> Drawn {
        let (width, height) = self.size;
        let size = (width.div_ceil(step), height.div_ceil(step));
        let middle = |at: usize, size: usize| (at * step + step / 2).min(size - 1);
        let seen: Vec<Seen> = (0..size.0 * size.1)
            .map(|at| self.seen[middle(at / size.0, height) * width + middle(at % size.0, width)])
            .collect();
        let sums: Vec<Sums> =
            seen.par_iter().map(|seen| self.sums_of_square(store, seen, step)).collect();
        let squares = Squares { size, seen: &seen, step };
        let lights = squares.filter(&sums);
        let mut pixels = vec![[0.0; 3]; width * height];
        let mut errors = vec![0.0; width * height];
        let rows = pixels.par_chunks_mut(width).zip(errors.par_chunks_mut(width)).enumerate();
        rows.for_each(|(y, (pixels, errors))| {
            for x in 0..width {
                let seen = &self.seen[y * width + x];
                let light = self.brought(store, &squares, &lights, (x, y), seen);
                (pixels[x], errors[x]) = self.painted(seen, light);
            }
        });
        let mirrored: Vec<_> = self
            .mirrored
            .par_iter()
            .map(|(pixel, seen)| {
                (*pixel as usize, self.painted(seen, self.wide(store, seen, ENOUGH_MIRRORED)))
            })
            .collect();
        for (pixel, (more, error)) in mirrored {
            (0..3).for_each(|c| pixels[pixel][c] += more[c]);
            errors[pixel] += error;
        }
        Drawn { pixels, errors }
    }

    /// What a surface shows in this light, and its standard error.
    fn painted(&self, seen: &Seen, light: Estimate) -> ([f32; 3], f32) {
        let (scale, radiance) = self.paint(seen);
        let unit = self.unit();
        let colour = [0, 1, 2].map(|c| radiance[c] + scale[c] * light.light[c] * unit);
        let bright = crate::cell::luminance(scale);
        (colour, if seen.is_surface() { bright * light.error * unit } else { 0.0 })
    }

    /// Sums of the cell that is about as wide as a square.
    fn sums_of_square(&self, store: &Store, seen: &Seen, step: usize) -> Sums {
        if !seen.is_surface() {
            return Sums::default();
        }
        let level = (seen.width * step as f32 / store.finest()).log2().round();
        let level = level.clamp(0.0, LEVELS as f32 - 1.0) as usize;
        let key = self.face(seen).key(Place::new(seen.point, store.finest()), level);
        store.get(key).copied().unwrap_or_default()
    }

    /// Light of the squares around a pixel, as far as they see the same surface.
    fn brought(
        &self,
        store: &Store,
        squares: &Squares,
        lights: &[Estimate],
        (x, y): (usize, usize),
        seen: &Seen,
    ) -> Estimate {
        if !seen.is_surface() {
            return Estimate { light: Vec3::ZERO, error: 0.0 };
        }
        let step = squares.step;
        let (width, height) = squares.size;
        // In squares, from the middle of the first one.
        let at = |pixel: usize| (pixel as f32 - (step / 2) as f32) / step as f32;
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
        self.wide(store, seen, ENOUGH)
    }

    /// Light of the first level of cells with enough samples; of the widest one if there is none.
    fn wide(&self, store: &Store, seen: &Seen, enough: u32) -> Estimate {
        let nothing = Estimate { light: Vec3::ZERO, error: f32::INFINITY };
        if !seen.is_surface() {
            return nothing;
        }
        let place = Place::new(seen.point, store.finest());
        let face: Face = self.face(seen);
        let mut best: Option<Sums> = None;
        for level in 0..LEVELS {
            let Some(sums) = store.get(face.key(place, level)) else { continue };
            best = Some(*sums);
            if sums.count >= enough {
                break;
            }
        }
        best.map_or(nothing, |sums| {
            let count = sums.count as f32;
            let light = Vec3::from_array(sums.light.map(|c| c as f32 / count));
            let bright = crate::cell::luminance(light.to_array());
            let variance = (sums.square as f32 / count - bright * bright).max(bright * bright);
            Estimate { light, error: (variance / count).sqrt() }
        })
    }
}
