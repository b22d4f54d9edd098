//! Light for every pixel from the sums of its surface: as wide a mean as noise asks, no wider than the light allows.
//!
//! Means over ever wider tents (half-widths of 1, 2, 4, ... pixels), each over pixels of one label only. A pixel takes the
//! widest mean that lies within the confidence intervals of all narrower ones (the rule of intersecting confidence intervals:
//! Goldenshluger & Nemirovski 1997; Katkovnik 1999), or the first that is exact enough. So noise is averaged where light is
//! even, and a shadow's edge stays where the samples tell it from noise.
//!
//! What always holds:
//! - Only pixels of the same label have a part in a pixel's light.
//! - As samples grow, every pixel tends to the mean of its own.

use super::deposit::{Sums, luminance};
use super::shade::FULL_WEIGHT;
use super::surfaces::{NO_LABEL, Surfaces};
use crate::parts::for_parts;
use bytemuck::Zeroable;
use std::sync::atomic::{AtomicBool, Ordering};

/// Tents tried: the widest has 2⁷ pixels on each side of its middle.
const LEVELS: usize = 8;

/// Half the width of a confidence interval, in standard errors.
const CONFIDENCE: f32 = 3.0;

/// A mean with no more relative error than this is not widened: a step of an 8-bit display.
const ENOUGH: f32 = 0.004;

/// Samples from which a variance is estimated at the least.
const FEWEST: f32 = 12.0;

/// Rows of one piece of work.
const ROWS: usize = 16;

/// Sums of a pixel, or of a tent around it.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
struct Cell {
    light: [f32; 3],
    weight: f32,
    square: f32,
}

impl Cell {
    fn add(&mut self, part: f32, other: &Cell) {
        for (sum, value) in self.light.iter_mut().zip(other.light) {
            *sum += part * value;
        }
        self.weight += part * other.weight;
        self.square += part * other.square;
    }

    fn mean(&self) -> [f32; 3] {
        self.light.map(|sum| sum / self.weight)
    }

    fn variance(&self) -> f32 {
        let mean = luminance(self.light) / self.weight;
        (self.square / self.weight - mean * mean).max(0.0)
    }
}

/// A mean's luminance, its samples and their variance.
#[derive(Clone, Copy, Debug, Default, Zeroable)]
struct Mean {
    value: f32,
    samples: f32,
    variance: f32,
}

/// How a pixel's choice stands.
#[derive(Clone, Copy, Debug)]
struct Choice {
    light: [f32; 3],
    /// How many means have been taken so far.
    taken: usize,
    open: bool,
}

/// Light of every pixel, in fixed-point steps; `None` where no sample of its surface is near enough. Samples are means of
/// `paths` paths.
pub(crate) fn light(surfaces: &Surfaces, sums: &[Sums], paths: u16) -> Vec<Option<[f32; 3]>> {
    let mut light = vec![None; sums.len()];
    let full = surfaces.size.0;
    let (columns, rows) = surfaces.bounds();
    let width = columns.len();
    // Only the part that sees anything is looked at: panes mostly fill a corner of the picture.
    let places = |row: usize| row * full + columns.start..row * full + columns.end;
    let mut labels = vec![0; width * rows.len()];
    for (line, row) in labels.chunks_mut(width.max(1)).zip(rows.clone()) {
        line.copy_from_slice(&surfaces.labels[places(row)]);
    }
    let one = weight_of_one(paths);
    let mut cells: Vec<Cell> = vec![Cell::default(); labels.len()];
    for_parts(&mut cells, width, ROWS, |part, lines| {
        for (line, row) in lines.chunks_mut(width).zip(rows.start + part * ROWS..) {
            for (cell, sum) in line.iter_mut().zip(&sums[places(row)]) {
                cell.weight = sum.weight as f32 / one;
                cell.light = sum.light.map(|x| x as f32 / one);
                cell.square = sum.square as f32 / one;
            }
        }
    });
    let choices = choose(cells, &labels, width);
    for (line, row) in choices.chunks(width.max(1)).zip(rows.clone()) {
        for (light, choice) in light[places(row)].iter_mut().zip(line) {
            *light = (choice.taken > 0).then_some(choice.light);
        }
    }
    light
}

/// Weight in sums of one sample along the eye's ray.
pub(crate) fn weight_of_one(paths: u16) -> f32 {
    (FULL_WEIGHT * u64::from(paths.max(1))) as f32
}

/// The mean for every pixel, from the sums of each.
fn choose(mut cells: Vec<Cell>, labels: &[u32], width: usize) -> Vec<Choice> {
    let start = Choice { light: [0.0; 3], taken: 0, open: true };
    let mut choices = vec![start; cells.len()];
    let mut half = vec![Cell::default(); cells.len()];
    // The means taken, by level within each part: where few levels are needed, most of this memory is never touched.
    let mut means: Vec<Mean> = bytemuck::zeroed_vec(cells.len() * LEVELS);
    let part = (ROWS * width).max(1);
    for level in 0..LEVELS {
        let is_open = AtomicBool::new(false);
        let mut parts: Vec<_> = choices.chunks_mut(part).zip(means.chunks_mut(part * LEVELS)).collect();
        for_parts(&mut parts, 1, 1, |number, parts| {
            for (choices, means) in parts {
                let length = choices.len();
                let (cells, labels) = (&cells[number * part..][..length], &labels[number * part..][..length]);
                let mut open = false;
                for (offset, (choice, cell)) in choices.iter_mut().zip(cells).enumerate() {
                    choice.consider(cell, level, means, offset, length);
                    open |= choice.open && labels[offset] != NO_LABEL;
                }
                is_open.fetch_or(open, Ordering::Relaxed);
            }
        });
        if level + 1 == LEVELS || !is_open.into_inner() {
            break;
        }
        let step = 1 << level;
        for_parts(&mut half, width, ROWS, |part, rows| across(&cells, labels, width, step, part * ROWS, rows));
        for_parts(&mut cells, width, ROWS, |part, rows| down(&half, labels, width, step, part * ROWS, rows));
    }
    choices
}

/// One pass of the tent along rows.
fn across(from: &[Cell], labels: &[u32], width: usize, step: usize, top: usize, rows: &mut [Cell]) {
    for (row, line) in rows.chunks_mut(width).enumerate() {
        let start = (top + row) * width;
        let (from, labels) = (&from[start..start + width], &labels[start..start + width]);
        for (column, cell) in line.iter_mut().enumerate() {
            *cell = from[column];
            let label = labels[column];
            if label == NO_LABEL {
                continue;
            }
            if column >= step && labels[column - step] == label {
                cell.add(0.5, &from[column - step]);
            }
            if column + step < width && labels[column + step] == label {
                cell.add(0.5, &from[column + step]);
            }
        }
    }
}

/// One pass of the tent along columns.
fn down(from: &[Cell], labels: &[u32], width: usize, step: usize, top: usize, rows: &mut [Cell]) {
    let reach = step * width;
    for (row, line) in rows.chunks_mut(width).enumerate() {
        let start = (top + row) * width;
        for (column, cell) in line.iter_mut().enumerate() {
            let pixel = start + column;
            *cell = from[pixel];
            let label = labels[pixel];
            if label == NO_LABEL {
                continue;
            }
            if pixel >= reach && labels[pixel - reach] == label {
                cell.add(0.5, &from[pixel - reach]);
            }
            if pixel + reach < from.len() && labels[pixel + reach] == label {
                cell.add(0.5, &from[pixel + reach]);
            }
        }
    }
}

impl Choice {
    /// Takes the next wider mean if it may be had. The pixel's means are at `offset` and then every `stride`.
    fn consider(&mut self, cell: &Cell, level: usize, means: &mut [Mean], offset: usize, stride: usize) {
        if !self.open || cell.weight <= 0.0 {
            return;
        }
        // A tent's weights w have (Σw)²/Σw² = 9/4 Σw / max w.
        let samples = cell.weight * if level == 0 { 1.0 } else { 2.25 };
        let mean = Mean { value: luminance(cell.light) / cell.weight, samples, variance: cell.variance() };
        if samples >= FEWEST {
            // The variance of the widest mean judges all: narrow ones, of few samples, would think that they agree. An edge
            // within it makes it too large, by so much that two samples on one side still tell. A narrow mean with a rare
            // bright sample knows best how little it knows.
            for narrower in means[offset..].iter().step_by(stride).take(self.taken) {
                let error = (mean.variance.max(narrower.variance) / narrower.samples).sqrt();
                if error <= ENOUGH * narrower.value || (mean.value - narrower.value).abs() > CONFIDENCE * error {
                    self.open = false;
                    return;
                }
            }
        }
        self.light = cell.mean();
        means[offset + self.taken * stride] = mean;
        self.taken += 1;
    }
}
