//! The last filter: light of squares of pixels, smoothed along surfaces as widely as its noise asks.
//!
//! Sums of squares are added up over ever wider neighbourhoods (à-trous, with weights by plane and normal only, so that
//! the weights do not depend on the noise), and each square takes the narrowest neighbourhood whose standard error is
//! small enough. `docs/notes/surface-light.md` has what else was measured.
//!
//! What always holds:
//! - No light crosses a crease or a sheet: weights fall to 0 with the distance from the plane and with the normals' angle.
//! - A sample brings at most a tenth of the light of its wide neighbourhood. The limit grows with the number of samples,
//!   so the bias that it causes vanishes as they grow.

use crate::cell::{Sums, brightest, luminance};
use crate::view::Seen;
use glam::Vec3;
use rayon::prelude::*;

/// Neighbourhoods: each is twice as wide as the one before.
const SCALES: usize = 6;

/// The scale over which the brightest samples are judged, and the variance of samples is measured.
const WIDE: usize = 3;

/// Share of its wide neighbourhood's light that a sample brings at most.
const MOST_SHARE: f32 = 0.1;

/// Relative standard error at which a wider neighbourhood begins to count, and at which it alone counts.
const NOISE: [f32; 2] = [0.08, 0.25];

/// Least variance of samples, relative to their squared mean: few samples are alike by chance.
const LEAST_VARIANCE: f32 = 0.2;

/// What is known of the light of one square, in floating-point steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lit {
    pub light: Vec3,
    pub count: f32,
    /// Of squared luminance.
    pub square: f32,
    /// Variance of `light`'s sum by that of a sample: equals `count` where nothing was smoothed.
    pub spread: f32,
}

/// Light of a square, and the standard error of its luminance. Nothing is known where the error is infinite.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimate {
    pub light: Vec3,
    pub error: f32,
}

impl Lit {
    pub fn new(sums: &Sums) -> Lit {
        let count = sums.count as f32;
        Lit {
            light: Vec3::from_array(sums.light.map(|c| c as f32)),
            count,
            square: sums.square as f32,
            spread: count,
        }
    }

    fn mean(&self) -> Vec3 {
        self.light / self.count.max(1e-9)
    }
}

/// Squares of pixels, what each sees and its sums.
pub(crate) struct Squares<'a> {
    pub size: (usize, usize),
    pub seen: &'a [Seen],
    /// Pixels a side of a square.
    pub step: usize,
}

impl Squares<'_> {
    /// The light of every square.
    pub fn filter(&self, sums: &[Sums]) -> Vec<Estimate> {
        let raw: Vec<Lit> = sums.par_iter().map(Lit::new).collect();
        let wide = (0..WIDE).fold(raw.clone(), |lit, scale| self.widen(&lit, 1 << scale));
        let held: Vec<Lit> = raw
            .par_iter()
            .zip(&wide)
            .zip(sums)
            .map(|((raw, wide), sums)| hold_back(raw, wide, sums))
            .collect();
        let mut scales = vec![held];
        for scale in 0..SCALES {
            scales.push(self.widen(&scales[scale], 1 << scale));
        }
        (0..sums.len()).into_par_iter().map(|at| choose(&scales, at)).collect()
    }

    /// Sums over the 3 × 3 squares at this distance.
    fn widen(&self, lit: &[Lit], distance: usize) -> Vec<Lit> {
        let width = self.size.0;
        let mut wider = vec![Lit::default(); lit.len()];
        wider.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, wider) in row.iter_mut().enumerate() {
                let here = &self.seen[y * width + x];
                if !here.is_surface() {
                    continue;
                }
                *wider = lit[y * width + x];
                self.around((x, y), distance, |other, kernel| {
                    let weight = kernel * self.weight(here, &self.seen[other], distance);
                    let more = &lit[other];
                    wider.light += weight * more.light;
                    wider.count += weight * more.count;
                    wider.square += weight * more.square;
                    wider.spread += weight * weight * more.spread;
                });
            }
        });
        wider
    }

    /// Calls `with` for the 8 squares around one, with their weights relative to its own.
    #[inline]
    fn around(&self, (x, y): (usize, usize), distance: usize, mut with: impl FnMut(usize, f32)) {
        let (width, height) = self.size;
        let columns = [x.wrapping_sub(distance), x, x + distance];
        let rows = [y.wrapping_sub(distance), y, y + distance];
        for (row, down) in rows.into_iter().zip([0.5, 1.0, 0.5]) {
            for (column, across) in columns.into_iter().zip([0.5, 1.0, 0.5]) {
                if column < width && row < height && (column, row) != (x, y) {
                    with(row * width + column, down * across);
                }
            }
        }
    }

    /// How much light of another square counts, by geometry alone.
    #[inline]
    fn weight(&self, here: &Seen, other: &Seen, distance: usize) -> f32 {
        let width = here.width * self.step as f32;
        alike(here, other, width, 8.0 * width * distance as f32)
    }
}

/// Weight of a point's light on another point of a surface: 1 on the same plane nearby; 0 farther off the plane than
/// `width`, beyond `reach`, or where normals differ by a right angle.
#[inline]
pub(crate) fn alike(here: &Seen, other: &Seen, width: f32, reach: f32) -> f32 {
    let cosine = here.normal.dot(other.normal);
    if cosine <= 0.0 || !other.is_surface() {
        return 0.0;
    }
    let between = other.point - here.point;
    let away = between.length_squared();
    let off = between.dot(here.normal).abs().max(between.dot(other.normal).abs());
    let tolerance = width + 0.05 * away.sqrt();
    let flat = (1.0 - off * off / (tolerance * tolerance)).max(0.0);
    let near = (1.0 - away / (reach * reach)).max(0.0);
    let turned = cosine * cosine;
    let turned = turned * turned;
    flat * flat * near * turned * turned
}

/// The sums of a square with its brightest sample cut to a share of the light around.
fn hold_back(raw: &Lit, wide: &Lit, sums: &Sums) -> Lit {
    let (bright, light) = brightest(sums.brightest);
    let around = luminance(wide.mean().to_array());
    let most = around * (MOST_SHARE * wide.count).max(2.0);
    if sums.count == 0 || bright <= most {
        return *raw;
    }
    let cut = 1.0 - most / bright;
    Lit {
        light: (raw.light - cut * Vec3::from_array(light)).max(Vec3::ZERO),
        square: (raw.square - (bright * bright - most * most)).max(0.0),
        ..*raw
    }
}

/// The light of a square from its sums on all scales.
fn choose(scales: &[Vec<Lit>], at: usize) -> Estimate {
    let last = &scales[scales.len() - 1][at];
    if last.count <= 0.0 {
        return Estimate { light: Vec3::ZERO, error: f32::INFINITY };
    }
    let wide = &scales[WIDE + 1][at];
    let wide = if wide.count > 0.0 { wide } else { last };
    let bright = luminance(wide.mean().to_array());
    let variance =
        (wide.square / wide.count - bright * bright).max(LEAST_VARIANCE * bright * bright);
    let error = |lit: &Lit| (variance * lit.spread).sqrt() / lit.count.max(1e-9);
    let mut estimate = Estimate { light: last.mean(), error: error(last) };
    for scale in scales[1..scales.len() - 1].iter().rev() {
        let lit = &scale[at];
        let own = error(lit);
        let [low, high] = NOISE.map(|noise| noise * bright);
        let share = ((high - own) / (high - low)).clamp(0.0, 1.0);
        if lit.count > 0.0 && share > 0.0 {
            estimate.light += share * (lit.mean() - estimate.light);
            estimate.error += share * (own - estimate.error);
        }
    }
    estimate
}
