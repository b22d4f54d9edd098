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

/// Kinds of sums that a pixel has: light by channel, weight, and squared luminance. A row of a picture has each kind by itself, one after
/// the other, so that a pass adds many pixels at once.
const KINDS: usize = 5;

/// Sums of a pixel, or of a tent around it.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    light: [f32; 3],
    weight: f32,
    square: f32,
}

impl Cell {
    /// The sums of a column, from those of its row.
    #[inline]
    fn of(row: &[f32], width: usize, column: usize) -> Cell {
        let [red, green, blue, weight, square] = [0, 1, 2, 3, 4].map(|kind: usize| row[kind * width + column]);
        Cell { light: [red, green, blue], weight, square }
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
    taken: u8,
    open: bool,
}

/// Light of the pixels of some rows, in fixed-point steps.
#[derive(Debug)]
pub(crate) struct Light {
    /// The first pixel.
    first: usize,
    light: Vec<Option<[f32; 3]>>,
}

impl Light {
    /// `None` where no sample of a pixel's surface is near enough.
    #[inline]
    pub fn at(&self, pixel: usize) -> Option<[f32; 3]> {
        self.light.get(pixel.wrapping_sub(self.first)).copied().flatten()
    }

    /// Sets a pixel's, if it is in the rows.
    pub fn set(&mut self, pixel: usize, light: [f32; 3]) {
        if let Some(there) = self.light.get_mut(pixel.wrapping_sub(self.first)) {
            *there = Some(light);
        }
    }
}

/// Light of every pixel. Samples are means of `paths` paths.
pub(crate) fn light(surfaces: &Surfaces, sums: &[Sums], paths: u16) -> Light {
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
    let mut cells: Vec<f32> = bytemuck::zeroed_vec(KINDS * labels.len());
    for_parts(&mut cells, KINDS * width, ROWS, |part, lines| {
        for (line, row) in lines.chunks_mut(KINDS * width).zip(rows.start + part * ROWS..) {
            for (column, sum) in sums[places(row)].iter().enumerate().filter(|(_, sum)| sum.weight > 0) {
                // Of 128 bits mostly the lower half is used, which converts ten times as fast.
                let square = u64::try_from(sum.square).map_or_else(|_| sum.square as f32, |square| square as f32);
                let [red, green, blue] = sum.light.map(|x| x as f32);
                for (kind, value) in [red, green, blue, sum.weight as f32, square].into_iter().enumerate() {
                    line[kind * width + column] = value / one;
                }
            }
        }
    });
    let choices = choose(cells, &labels, width);
    let mut light = vec![None; full * rows.len()];
    for_parts(&mut light, full, ROWS, |part, lines| {
        let choices = choices.chunks(width.max(1)).skip(part * ROWS);
        for (line, choices) in lines.chunks_mut(full).zip(choices) {
            for (light, choice) in line[columns.clone()].iter_mut().zip(choices) {
                *light = (choice.taken > 0).then_some(choice.light);
            }
        }
    });
    Light { first: rows.start * full, light }
}

/// Weight in sums of one sample along the eye's ray.
pub(crate) fn weight_of_one(paths: u16) -> f32 {
    (FULL_WEIGHT * u64::from(paths.max(1))) as f32
}

/// The mean for every pixel, from the sums of each.
fn choose(mut cells: Vec<f32>, labels: &[u32], width: usize) -> Vec<Choice> {
    let start = Choice { light: [0.0; 3], taken: 0, open: true };
    let mut choices = vec![start; labels.len()];
    let mut half: Vec<f32> = bytemuck::zeroed_vec(cells.len());
    // The means taken, by level within each part: where few levels are needed, most of this memory is never touched.
    let mut means: Vec<Mean> = bytemuck::zeroed_vec(labels.len() * LEVELS);
    let part = (ROWS * width).max(1);
    // Parts of which every choice is made.
    let mut done = vec![false; labels.len().div_ceil(part)];
    for level in 0..LEVELS {
        let mut parts: Vec<_> = choices.chunks_mut(part).zip(means.chunks_mut(part * LEVELS)).zip(&mut done).collect();
        for_parts(&mut parts, 1, 1, |number, parts| {
            for ((choices, means), done) in parts.iter_mut().filter(|(_, done)| !**done) {
                let length = choices.len();
                let labels = &labels[number * part..][..length];
                let mut open = false;
                for (row, line) in choices.chunks_mut(width).enumerate() {
                    let cells = &cells[KINDS * (number * part + row * width)..][..KINDS * width];
                    for (column, choice) in line.iter_mut().enumerate().filter(|(_, choice)| choice.open) {
                        let offset = row * width + column;
                        // The sky has no light to be found.
                        choice.open = labels[offset] != NO_LABEL;
                        if cells[3 * width + column] > 0.0 {
                            choice.consider(&Cell::of(cells, width, column), level, means, offset, length);
                        }
                        open |= choice.open;
                    }
                }
                **done = !open;
            }
        });
        if level + 1 == LEVELS || done.iter().all(|&done| done) {
            break;
        }
        let step = 1 << level;
        let lines = KINDS * width;
        for_parts(&mut half, lines, ROWS, |part, rows| across(&cells, labels, width, step, part * ROWS, rows));
        for_parts(&mut cells, lines, ROWS, |part, rows| down(&half, labels, width, step, part * ROWS, rows));
    }
    choices
}

/// Adds half of what is beside, where that is of the same label. Sky has nothing to add.
#[inline(always)]
fn add_half(sums: &mut [f32], labels: &[u32], beside: &[f32], labels_beside: &[u32]) {
    let count = sums.len().min(labels.len()).min(beside.len()).min(labels_beside.len());
    // Cut to one length first: then four are added at once, which a chain of iterators prevents.
    let (sums, labels) = (&mut sums[..count], &labels[..count]);
    let (beside, labels_beside) = (&beside[..count], &labels_beside[..count]);
    for i in 0..count {
        let half = 0.5 * beside[i];
        sums[i] += if labels[i] == labels_beside[i] { half } else { 0.0 };
    }
}

/// The same from both sides, without a look back at what was added first.
#[inline(always)]
fn with_halves(sums: &mut [f32], from: &[f32], labels: &[u32], before: (&[f32], &[u32]), after: (&[f32], &[u32])) {
    let count = sums.len();
    let (from, labels) = (&from[..count], &labels[..count]);
    let (before, labels_before) = (&before.0[..count], &before.1[..count]);
    let (after, labels_after) = (&after.0[..count], &after.1[..count]);
    for i in 0..count {
        let first = if labels[i] == labels_before[i] { 0.5 * before[i] } else { 0.0 };
        let second = if labels[i] == labels_after[i] { 0.5 * after[i] } else { 0.0 };
        sums[i] = from[i] + first + second;
    }
}

/// One pass of the tent along rows.
fn across(from: &[f32], labels: &[u32], width: usize, step: usize, top: usize, rows: &mut [f32]) {
    for (row, line) in (top..).zip(rows.chunks_mut(KINDS * width)) {
        let labels = &labels[row * width..][..width];
        let from = &from[row * KINDS * width..][..KINDS * width];
        for (sums, from) in line.chunks_mut(width).zip(from.chunks(width)) {
            if 2 * step < width {
                let end = width - step;
                sums[..step].copy_from_slice(&from[..step]);
                add_half(&mut sums[..step], labels, &from[step..], &labels[step..]);
                let (middle, after) = (&mut sums[step..end], (&from[2 * step..], &labels[2 * step..]));
                with_halves(middle, &from[step..], &labels[step..], (from, labels), after);
                sums[end..].copy_from_slice(&from[end..]);
                add_half(&mut sums[end..], &labels[end..], &from[end - step..], &labels[end - step..]);
            } else {
                sums.copy_from_slice(from);
                if step < width {
                    add_half(&mut sums[step..], &labels[step..], from, labels);
                    add_half(sums, labels, &from[step..], &labels[step..]);
                }
            }
        }
    }
}

/// One pass of the tent along columns.
fn down(from: &[f32], labels: &[u32], width: usize, step: usize, top: usize, rows: &mut [f32]) {
    let height = labels.len() / width.max(1);
    let labels_of = |row: usize| &labels[row * width..][..width];
    for (row, line) in (top..).zip(rows.chunks_mut(KINDS * width)) {
        let above = row.checked_sub(step);
        let below = (row + step < height).then_some(row + step);
        for (kind, sums) in line.chunks_mut(width).enumerate() {
            let sums_of = |row: usize| &from[(row * KINDS + kind) * width..][..width];
            let beside = |row: usize| (sums_of(row), labels_of(row));
            if let Some((above, below)) = above.zip(below) {
                with_halves(sums, sums_of(row), labels_of(row), beside(above), beside(below));
            } else {
                sums.copy_from_slice(sums_of(row));
                if let Some((other, labels_beside)) = above.or(below).map(beside) {
                    add_half(sums, labels_of(row), other, labels_beside);
                }
            }
        }
    }
}

impl Choice {
    /// Takes the next wider mean if it may be had. The pixel's means are at `offset` and then every `stride`.
    fn consider(&mut self, cell: &Cell, level: usize, means: &mut [Mean], offset: usize, stride: usize) {
        // A tent's weights w have (Σw)²/Σw² = 9/4 Σw / max w.
        let samples = cell.weight * if level == 0 { 1.0 } else { 2.25 };
        let mean = Mean { value: luminance(cell.light) / cell.weight, samples, variance: cell.variance() };
        if samples >= FEWEST {
            // The variance of the widest mean judges all: narrow ones, of few samples, would think that they agree. An edge
            // within it makes it too large, by so much that two samples on one side still tell. A narrow mean with a rare
            // bright sample knows best how little it knows.
            for narrower in means[offset..].iter().step_by(stride).take(usize::from(self.taken)) {
                let error = (mean.variance.max(narrower.variance) / narrower.samples).sqrt();
                if error <= ENOUGH * narrower.value || (mean.value - narrower.value).abs() > CONFIDENCE * error {
                    self.open = false;
                    return;
                }
            }
        }
        self.light = cell.mean();
        means[offset + usize::from(self.taken) * stride] = mean;
        self.taken += 1;
    }
}
