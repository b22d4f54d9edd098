//! Pixels that are darker than all of their surface around them: chance, as a rule.
//!
//! A pixel's choice among means ([`reconstruct`](super::reconstruct)) trusts intervals of two or three standard errors. Where many lamps
//! shine and a sample looks for one, some samples in a row are black now and then, and look certain: one pixel in some hundreds keeps
//! them for its own, a dark dot. Next to each other such errors are rare, so that choices made pixel by pixel are best compared with those
//! beside them (Katkovnik, Egiazarian & Astola 2006, §6.3, a median of scales). Here a lone dark pixel takes the light of the darkest
//! one beside it, unless its own samples exclude that by five standard errors.
//!
//! Lone bright pixels stay: their light is there, if not all on one pixel. Without them pictures of few samples were darker by 0.2 %,
//! at half resolution by 0.4 %.
//!
//! What always holds:
//! - What a pixel takes is light of its own surface, from one of the 3 × 3 pixels around it.
//! - As samples grow, every pixel keeps its own.

use super::deposit::{Sums, luminance};
use super::light::Light;
use super::surfaces::{NO_LABEL, Surfaces};
use crate::parts::for_parts;
use crate::pointimage::isa::{Isa, Kernel};

/// By what share darker than all around it a pixel is seen.
const SEEN: f32 = 0.02;

/// Standard errors by which a lone pixel's own samples have to tell it from those around.
const CERTAIN: f64 = 5.0;

/// Pixels around that it takes to judge one.
const FEWEST: usize = 3;

/// Rows of one piece of work.
const ROWS: usize = 32;

/// A pixel and the one beside it whose light it takes.
type Lone = (u32, u32);

/// The lone pixels of a picture in order, each with one beside it. `light` is as it was reconstructed, and `one` a sample's weight.
pub(crate) fn find(surfaces: &Surfaces, sums: &[Sums], light: &Light, one: f32) -> Vec<Lone> {
    let (width, height) = surfaces.size;
    let mut strips: Vec<Vec<Lone>> = vec![Vec::new(); height.div_ceil(ROWS)];
    for_parts(&mut strips, 1, 1, |part, strips| {
        let mut rows = [vec![0.0; width], vec![0.0; width], vec![0.0; width]];
        let mut labels = [vec![NO_LABEL; width], vec![NO_LABEL; width], vec![NO_LABEL; width]];
        let mut stands_out = vec![0_u8; width];
        let fill = |number: usize, row: Option<usize>, rows: &mut [Vec<f32>; 3], labels: &mut [Vec<u32>; 3]| {
            labels[number].fill(NO_LABEL);
            let Some(row) = row.filter(|&row| row < height) else { return };
            let pixels = row * width..(row + 1) * width;
            let (known, of) = (light.rows(pixels.clone()), &surfaces.labels[pixels]);
            for (column, (bright, label)) in rows[number].iter_mut().zip(&mut labels[number]).enumerate() {
                if let Some(light) = known.at(column) {
                    (*bright, *label) = (luminance(light), of[column]);
                }
            }
        };
        for found in strips {
            let first = part * ROWS;
            fill(0, first.checked_sub(1), &mut rows, &mut labels);
            fill(1, Some(first), &mut rows, &mut labels);
            for row in first..(first + ROWS).min(height) {
                fill(2, Some(row + 1), &mut rows, &mut labels);
                Isa::best().run(Compare { rows: &rows, labels: &labels, stands_out: &mut stands_out });
                for column in (0..width).filter(|&column| stands_out[column] != 0) {
                    let pixel = row * width + column;
                    found.extend(judge(surfaces, sums, light, pixel, one).map(|other| (pixel as u32, other as u32)));
                }
                rows.rotate_left(1);
                labels.rotate_left(1);
            }
        }
    });
    strips.concat()
}

/// Which pixels of the middle one of three rows are darker than all around them of the same label.
struct Compare<'a> {
    rows: &'a [Vec<f32>; 3],
    labels: &'a [Vec<u32>; 3],
    stands_out: &'a mut [u8],
}

impl Kernel for Compare<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let width = self.stands_out.len();
        self.stands_out.fill(0);
        let Some(count) = width.checked_sub(2) else { return };
        let (here, label) = (&self.rows[1][1..][..count], &self.labels[1][1..][..count]);
        let marks = &mut self.stands_out[1..][..count];
        for (number, (row, labels)) in self.rows.iter().zip(self.labels).enumerate() {
            for shift in (0..3).filter(|&shift| (number, shift) != (1, 1)) {
                let (beside, its) = (&row[shift..][..count], &labels[shift..][..count]);
                for i in 0..count {
                    let is_as_dark = beside[i] * (1.0 - SEEN) < here[i];
                    marks[i] |= u8::from(is_as_dark & (its[i] == label[i]));
                }
            }
        }
        for (mark, label) in marks.iter_mut().zip(label) {
            *mark = u8::from((*mark == 0) & (*label != NO_LABEL));
        }
    }
}

/// The pixel beside this one whose light it takes, if it takes any.
fn judge(surfaces: &Surfaces, sums: &[Sums], light: &Light, pixel: usize, one: f32) -> Option<usize> {
    let (width, height) = surfaces.size;
    let (column, row) = (pixel % width, pixel / width);
    let own = luminance(light.at(pixel)?);
    let (mut count, mut nearest): (usize, Option<(f32, usize)>) = (0, None);
    let (mut weight, mut bright, mut square) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mean = |sums: &Sums| f64::from(luminance(sums.light.map(|sum| sum as f32)));
    for y in row.saturating_sub(1)..(row + 2).min(height) {
        for x in column.saturating_sub(1)..(column + 2).min(width) {
            let other = y * width + x;
            if surfaces.labels[other] != surfaces.labels[pixel] {
                continue;
            }
            let sums = &sums[other];
            weight += sums.weight as f64;
            bright += mean(sums);
            square += sums.square as f64;
            if other == pixel {
                continue;
            }
            let Some(its) = light.at(other) else { continue };
            count += 1;
            let apart = (luminance(its) - own).abs();
            if nearest.is_none_or(|(least, _)| apart < least) {
                nearest = Some((apart, other));
            }
        }
    }
    let (_, other) = nearest.filter(|_| count >= FEWEST)?;
    let its = &sums[pixel];
    if its.weight > 0 {
        let apart = mean(its) / its.weight as f64 - f64::from(luminance(light.at(other)?));
        let variance = (square / weight - (bright / weight) * (bright / weight)).max(0.0);
        let samples = its.weight as f64 / f64::from(one);
        if samples * apart * apart > CERTAIN * CERTAIN * variance {
            return None;
        }
    }
    Some(other)
}
