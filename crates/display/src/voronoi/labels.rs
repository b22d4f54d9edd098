//! Which pixels show parts of one surface.
//!
//! Invariant: labels follow from what the pixels see alone, in the order of the pixels.

use super::surfaces::{NO_LABEL, SKY, Seen};
use std::collections::HashMap;

/// A label for each pixel: neighbours that continue each other have the same, and so have parts of one side of a triangle that
/// something in front keeps apart.
pub(crate) fn connect(seen: &[Seen], width: usize, pixel_width: f32) -> Vec<u32> {
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
    let height = labels.len() / width.max(1);
    let mut edges = vec![false; labels.len()];
    let mut differ = |a: usize, b: usize| {
        if labels[a] != labels[b] {
            edges[a] = true;
            edges[b] = true;
        }
    };
    for row in 0..height {
        for column in 0..width {
            let pixel = row * width + column;
            if column > 0 {
                differ(pixel, pixel - 1);
            }
            if row > 0 {
                differ(pixel, pixel - width);
                if column > 0 {
                    differ(pixel, pixel - width - 1);
                }
                if column + 1 < width {
                    differ(pixel, pixel - width + 1);
                }
            }
        }
    }
    edges
}
