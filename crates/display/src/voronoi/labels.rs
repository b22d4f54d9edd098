//! Which pixels show parts of one surface.
//!
//! Invariant: labels follow from what the pixels see alone, in the order of the pixels.

use super::surfaces::{NO_LABEL, SKY, Seen};
use crate::camera::PixelWidth;
use crate::parts::for_parts;
use std::collections::HashMap;

/// Rows of one piece of work.
const ROWS: usize = 16;

/// A label for each pixel: neighbours that continue each other have the same, and so have parts of one side of a triangle that
/// something in front keeps apart.
pub(crate) fn connect(seen: &[Seen], width: usize, pixel_width: PixelWidth) -> Vec<u32> {
    let mut labels: Vec<u32> = (0..seen.len() as u32).collect();
    let mut of_triangle: HashMap<((u32, bool), u8, bool), u32> = HashMap::new();
    for (pixel, here) in seen.iter().enumerate() {
        if here.triangle == SKY {
            labels[pixel] = NO_LABEL;
            continue;
        }
        let left = (pixel % width > 0).then(|| pixel - 1);
        let above = pixel.checked_sub(width);
        let mut alone = true;
        for other in [left, above].into_iter().flatten() {
            if here.continues(&seen[other], pixel_width) {
                alone = alone && seen[other].side() != here.side();
                join(&mut labels, pixel as u32, other as u32);
            }
        }
        // Only where a triangle begins can it be a new part of one: most pixels continue their neighbour's.
        if alone {
            let first = *of_triangle.entry((here.side(), here.image, here.through)).or_insert(pixel as u32);
            join(&mut labels, pixel as u32, first);
        }
    }
    for pixel in 0..labels.len() {
        if labels[pixel] != NO_LABEL {
            labels[pixel] = root(&mut labels, pixel as u32);
        }
    }
    labels
}

fn root(labels: &mut [u32], mut pixel: u32) -> u32 {
    while labels[pixel as usize] != pixel {
        let above = labels[labels[pixel as usize] as usize];
        labels[pixel as usize] = above;
        pixel = above;
    }
    pixel
}

fn join(labels: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(labels, a), root(labels, b));
    labels[a.max(b) as usize] = a.min(b);
}

/// Whether a pixel's label is not that of all 3 × 3 pixels around it.
pub(crate) fn edges(labels: &[u32], width: usize) -> Vec<bool> {
    let mut edges = vec![false; labels.len()];
    for_parts(&mut edges, width, ROWS, |part, lines| {
        for (line, row) in lines.chunks_mut(width).zip(part * ROWS..) {
            let rows = row.saturating_sub(1)..(row + 2).min(labels.len() / width);
            for around in rows.map(|row| &labels[row * width..][..width]) {
                let here = &labels[row * width..][..width];
                for (column, (edge, label)) in line.iter_mut().zip(here).enumerate() {
                    let left = around[column.saturating_sub(1)];
                    let right = around[(column + 1).min(width - 1)];
                    *edge |= left != *label || around[column] != *label || right != *label;
                }
            }
        }
    });
    edges
}
