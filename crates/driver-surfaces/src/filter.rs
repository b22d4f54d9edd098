//! The filter: smooths the light of squares of pixels along surfaces, as widely as its noise needs.
//!
//! It adds sums over ever wider neighbourhoods (à-trous). Each square takes the narrowest one with
//! a small enough standard error. This happens twice. At first, weights depend on geometry alone. The
//! second time they also depend on how much the light found at first differs.
//!
//! What always holds:
//! - No light crosses a crease or a sheet. Weights fall to 0 with the distance from either plane,
//!   and are 0 between sides that face away from each other.
//! - A sample brings at most a tenth of the light of its wide neighbourhood. The limit grows with
//!   the number of samples, so the bias that it causes vanishes as they grow.

use crate::cell::{Sums, luminance};
use crate::view::Seen;
use glam::Vec3;
use holo_denoise::Denoiser;
use rayon::prelude::*;

/// The number of neighbourhoods. Each is twice as wide as the one before.
const SCALES: usize = 6;

/// The most that a sample brings, as a share of the light of its wide neighbourhood.
const MOST_SHARE: f32 = 0.1;

/// Relative standard errors at which a neighbourhood begins to count and at which it counts fully,
/// for the first and for the second time.
const NOISE: [[f32; 2]; 2] = [[0.25, 0.08], [0.1, 0.03]];

/// The natural logarithm of the ratio of light at which two squares no longer count for each other.
/// Used the second time.
const DIFFERENT: f32 = 0.5;

/// The share of the first error that the second light keeps: weights follow the light found first.
const KEPT: f32 = 0.25;

/// The number of squares around one.
const AROUND: usize = 8;

/// The number of samples from which a measured variance is believed.
const RELIABLE: f32 = 16.0;

/// The least variance of samples, relative to their squared mean: a few may be alike by chance.
const LEAST_VARIANCE: f32 = 0.2;

/// Standard errors by which samples have to differ from an estimate to be another light.
const SIGNIFICANT: f32 = 3.0;

/// Fixed-point steps that the denoiser sees as 1.
const SCALE: f32 = 1024.0;

/// Sums over the samples of a square or of its neighbourhood, in fixed-point steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lit {
    pub light: Vec3,
    pub count: f32,
    /// Sum of squared luminance.
    pub square: f32,
}

/// The light of a square, and the standard error of its luminance. Where the error is infinite,
/// nothing is known.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Estimate {
    pub light: Vec3,
    pub error: f32,
    /// The variance of one sample's luminance.
    pub variance: f32,
}

impl Estimate {
    /// Nothing is known.
    pub const UNKNOWN: Estimate =
        Estimate { light: Vec3::ZERO, error: f32::INFINITY, variance: 0.0 };

    /// Adds a share of another one.
    pub fn add(&mut self, share: f32, other: &Estimate) {
        self.light += share * other.light;
        self.error += share * other.error;
        self.variance += share * other.variance;
    }

    /// Returns a sum divided by the total of its shares.
    pub fn divided(self, total: f32) -> Estimate {
        let Estimate { light, error, variance } = self;
        Estimate { light: light / total, error: error / total, variance: variance / total }
    }

    /// Returns this estimate improved by samples of the same light. `spread` is how much that light
    /// may differ from the estimate, relative to it, besides its error.
    pub fn improved(&self, sums: &Sums, spread: f32) -> Estimate {
        if sums.count == 0 {
            return *self;
        }
        let lit = Lit::new(sums);
        let (bright, own) = (luminance(self.light.to_array()), luminance(lit.mean().to_array()));
        let differs = (own - bright) * (own - bright);
        // Few samples say little of their own variance.
        let spread_out = (lit.square - lit.count * own * own).max(0.0);
        let usual = RELIABLE * (self.variance + differs);
        let variance = (spread_out + usual) / (lit.count + RELIABLE);
        let noise = variance / lit.count;
        // What differs by three standard errors is another light.
        let before = (self.error * self.error + spread * spread * bright * bright)
            .max(differs - SIGNIFICANT * SIGNIFICANT * noise)
            .max(0.0);
        let share =
            if before.is_finite() { before / (before + noise).max(f32::MIN_POSITIVE) } else { 1.0 };
        let light = self.light + share * (lit.mean() - self.light);
        Estimate { light, error: (share * noise).sqrt(), variance }
    }
}

impl Lit {
    pub fn new(sums: &Sums) -> Lit {
        let count = sums.paths as f32;
        Lit { light: count * sums.mean(), count, square: count * sums.mean_square() }
    }

    fn mean(&self) -> Vec3 {
        self.light / self.count.max(1e-9)
    }

    /// Returns the variance of one sample's luminance in a wide neighbourhood.
    fn variance_around(&self) -> f32 {
        let bright = luminance(self.mean().to_array());
        let least = LEAST_VARIANCE * bright * bright * RELIABLE / (RELIABLE + self.count);
        (self.square / self.count.max(1e-9) - bright * bright).max(least)
    }

    /// Returns the variance of the mean. Few samples say little of their own variance, so `around`
    /// counts too, that of one sample in a wide neighbourhood.
    fn variance(&self, around: f32) -> f32 {
        let own = luminance(self.mean().to_array());
        let own = (self.square - self.count * own * own).max(0.0);
        (own + RELIABLE * around) / (self.count + RELIABLE) / self.count.max(0.3)
    }
}

/// The squares of a picture, and what each sees.
pub(crate) struct Squares {
    pub size: (usize, usize),
    pub seen: Vec<Seen>,
    /// Pixels a side of a square.
    pub step: usize,
}

/// For each square, the weights of the 8 squares around it at one distance.
type Weights = Vec<[f32; AROUND]>;

impl Squares {
    /// Returns the number of scales that judge brightest samples: as many pixels at any step.
    fn wide(&self) -> usize {
        if self.step == 4 { 4 } else { 5 }
    }

    /// Returns the light of every square.
    pub fn filter(&self, sums: &[Sums]) -> Vec<Estimate> {
        let raw: Vec<Lit> = sums.par_iter().map(Lit::new).collect();
        let weights: Vec<Weights> = (0..SCALES).map(|scale| self.weights(1 << scale)).collect();
        let widest = |lit: Vec<Lit>| {
            (0..self.wide()).fold(lit, |lit, scale| self.widen(&lit, 1 << scale, &weights[scale]))
        };
        let usual = widest(raw.clone());
        let held: Vec<Lit> = raw
            .par_iter()
            .zip(&usual)
            .zip(sums)
            .map(|((raw, usual), sums)| hold_back(raw, usual, sums))
            .collect();
        let wide = widest(held.clone());
        let first = self.smooth(&held, &weights, &wide, NOISE[0], false);
        let bright: Vec<f32> =
            first.par_iter().map(|e| luminance(e.light.to_array()).max(1.0).ln()).collect();
        let weights: Vec<Weights> = weights
            .iter()
            .enumerate()
            .map(|(scale, weights)| self.weights_of_light(weights, 1 << scale, &bright))
            .collect();
        let mut lights = self.smooth(&held, &weights, &wide, NOISE[1], true);
        for (light, first) in lights.iter_mut().zip(&first) {
            light.error = light.error.hypot(KEPT * first.error);
        }
        lights
    }

    /// Replaces filtered light by the denoised means of all samples. Where a square has none, its
    /// filtered light is denoised. If the library fails, light stays filtered.
    pub fn denoise(&self, sums: &[Sums], lights: &mut [Estimate], denoiser: &mut Denoiser) {
        let mean = |(sums, filtered): (&Sums, &Estimate)| {
            let light = if sums.count > 0 { sums.mean() } else { filtered.light };
            (light / SCALE).to_array()
        };
        let mut pixels: Vec<[f32; 3]> = sums.iter().zip(&*lights).map(mean).collect();
        let normals: Vec<[f32; 3]> = self.seen.iter().map(|seen| seen.normal.to_array()).collect();
        if denoiser.denoise_light(&mut pixels, &normals, self.size).is_ok() {
            for (light, pixel) in lights.iter_mut().zip(pixels) {
                light.light = Vec3::from_array(pixel).max(Vec3::ZERO) * SCALE;
            }
        }
    }

    /// Returns the light of the narrowest neighbourhoods with little enough noise.
    fn smooth(
        &self,
        lit: &[Lit],
        weights: &[Weights],
        wide: &[Lit],
        noise: [f32; 2],
        finds_detail: bool,
    ) -> Vec<Estimate> {
        let mut scales = vec![lit.to_vec()];
        for (scale, weights) in weights.iter().enumerate() {
            scales.push(self.widen(&scales[scale], 1 << scale, weights));
        }
        let around: Vec<f32> = wide.par_iter().map(Lit::variance_around).collect();
        let details: Vec<Vec<Detail>> = if finds_detail {
            (0..weights.len())
                .map(|k| self.details(&scales[k], &scales[k + 1], 1 << k, &weights[k], &around))
                .collect()
        } else {
            Vec::new()
        };
        let choose = |at: usize| {
            let detail = |scale: usize| details.get(scale).map(|details| details[at]);
            choose(&scales, at, (&wide[at], around[at]), noise, detail)
        };
        (0..lit.len()).into_par_iter().map(choose).collect()
    }

    fn details(
        &self,
        narrow: &[Lit],
        wide: &[Lit],
        distance: usize,
        weights: &Weights,
        around: &[f32],
    ) -> Vec<Detail> {
        let own: Vec<Detail> = (0..narrow.len())
            .into_par_iter()
            .map(|at| {
                let (n, w) = (&narrow[at], &wide[at]);
                if n.count <= 0.0 || w.count <= n.count {
                    return Detail::default();
                }
                let d = luminance((n.mean() - w.mean()).to_array());
                let noise = n.variance(around[at]) * (1.0 - n.count / w.count);
                Detail { signal: d * d, noise, weight: 1.0 }
            })
            .collect();
        (0..narrow.len())
            .into_par_iter()
            .map(|at| {
                let mut sum = own[at];
                for (other, weight) in self.around(at, distance).into_iter().zip(weights[at]) {
                    if weight > 0.0 {
                        let o = &own[other];
                        sum.signal += weight * o.signal;
                        sum.noise += weight * o.noise;
                        sum.weight += weight * o.weight;
                    }
                }
                sum
            })
            .collect()
    }

    /// Adds to each square the 8 squares at this distance.
    fn widen(&self, lit: &[Lit], distance: usize, weights: &[[f32; AROUND]]) -> Vec<Lit> {
        let at = |number: usize| {
            let mut wider = lit[number];
            for (other, weight) in self.around(number, distance).into_iter().zip(weights[number]) {
                if weight > 0.0 {
                    let more = &lit[other];
                    wider.light += weight * more.light;
                    wider.count += weight * more.count;
                    wider.square += weight * more.square;
                }
            }
            wider
        };
        (0..lit.len()).into_par_iter().map(at).collect()
    }

    /// Returns the numbers of the 8 squares around one. Its own number stands for those outside the
    /// picture.
    #[inline]
    fn around(&self, number: usize, distance: usize) -> [usize; AROUND] {
        let (width, height) = self.size;
        let (x, y) = (number % width, number / width);
        let (left, up) = (x.wrapping_sub(distance), y.wrapping_sub(distance));
        let (right, down) = (x + distance, y + distance);
        let places = [
            (left, up),
            (x, up),
            (right, up),
            (left, y),
            (right, y),
            (left, down),
            (x, down),
            (right, down),
        ];
        places.map(|(x, y)| if x < width && y < height { y * width + x } else { number })
    }

    /// Returns weights by geometry alone.
    fn weights(&self, distance: usize) -> Weights {
        const KERNEL: [f32; AROUND] = [0.25, 0.5, 0.25, 0.5, 0.5, 0.25, 0.5, 0.25];
        let at = |number: usize| {
            let here = &self.seen[number];
            if !here.is_surface() {
                return [0.0; AROUND];
            }
            let width = here.width * self.step as f32;
            let mut weights = KERNEL;
            for (weight, other) in weights.iter_mut().zip(self.around(number, distance)) {
                let is_outside = other == number;
                let reach = 8.0 * width * distance as f32;
                *weight *=
                    if is_outside { 0.0 } else { alike(here, &self.seen[other], width, reach) };
            }
            weights
        };
        (0..self.seen.len()).into_par_iter().map(at).collect()
    }

    /// Returns weights by geometry and by the logarithms of luminance.
    fn weights_of_light(&self, weights: &Weights, distance: usize, bright: &[f32]) -> Weights {
        let at = |number: usize| {
            let mut weights = weights[number];
            for (weight, other) in weights.iter_mut().zip(self.around(number, distance)) {
                let differ = (bright[number] - bright[other]) / DIFFERENT;
                let same = (1.0 - differ * differ).max(0.0);
                *weight *= same * same;
            }
            weights
        };
        (0..weights.len()).into_par_iter().map(at).collect()
    }
}

/// Returns the weight of one point's light at another.
///
/// It is 1 nearby on the same plane. It is 0 farther than `width` off the plane, beyond `reach`,
/// and where normals differ by a right angle.
#[inline]
pub(crate) fn alike(here: &Seen, other: &Seen, width: f32, reach: f32) -> f32 {
    if here.normal.dot(other.normal) <= 0.0 || !other.is_surface() {
        return 0.0;
    }
    let between = other.point - here.point;
    let away = between.length_squared();
    let off = between.dot(here.normal).abs().max(between.dot(other.normal).abs());
    let tolerance = width + 0.05 * away.sqrt();
    let flat = (1.0 - off * off / (tolerance * tolerance)).max(0.0);
    let near = (1.0 - away / (reach * reach)).max(0.0);
    flat * flat * near
}

/// Returns the sums of a square with its brightest sample cut to a share of the light around. That
/// sample itself does not raise its limit.
fn hold_back(raw: &Lit, wide: &Lit, sums: &Sums) -> Lit {
    let bright = sums.brightest();
    let others = (wide.count - 1.0).max(1.0);
    let around = (luminance(wide.light.to_array()) - bright).max(0.0) / others;
    let most = around * (MOST_SHARE * others).max(2.0);
    if sums.count == 0 || bright <= most {
        return *raw;
    }
    let share = (bright - most) / luminance(raw.light.to_array()).max(1e-9);
    Lit {
        light: raw.light * (1.0 - share).max(0.0),
        square: (raw.square - (bright * bright - most * most)).max(0.0),
        ..*raw
    }
}

/// What the light of a scale says beyond the next wider one, around a square.
#[derive(Clone, Copy, Debug, Default)]
struct Detail {
    signal: f32,
    noise: f32,
    weight: f32,
}

/// Returns the light of a square from its sums on all scales, the narrowest first.
fn choose(
    scales: &[Vec<Lit>],
    at: usize,
    (wide, around): (&Lit, f32),
    [high, low]: [f32; 2],
    detail: impl Fn(usize) -> Option<Detail>,
) -> Estimate {
    let Some(last) = scales.last().map(|scale| &scale[at]).filter(|lit| lit.count > 0.0) else {
        return Estimate::UNKNOWN;
    };
    let (wide, around) =
        if wide.count > 0.0 { (wide, around) } else { (last, last.variance_around()) };
    let bright = luminance(wide.mean().to_array());
    let mut estimate =
        Estimate { light: last.mean(), error: last.variance(around).sqrt(), variance: around };
    let mut blur = 0.0;
    for (number, scale) in scales[..scales.len() - 1].iter().enumerate().rev() {
        let lit = &scale[at];
        let own = lit.variance(around).sqrt();
        // Where all is black, so is every scale.
        let dark = bright.max(f32::MIN_POSITIVE);
        let mut share = ((high * bright - own) / ((high - low) * dark)).clamp(0.0, 1.0);
        if let Some(detail) = detail(number).filter(|detail| detail.weight > 0.0) {
            let (signal, noise) = (detail.signal / detail.weight, detail.noise / detail.weight);
            let real = (signal - noise).max(0.0);
            share *= real / (real + noise).max(f32::MIN_POSITIVE);
            blur = (1.0 - share) * (1.0 - share) * (blur + real);
        }
        if lit.count > 0.0 && share > 0.0 {
            estimate.light += share * (lit.mean() - estimate.light);
            estimate.error += share * (own - estimate.error);
        }
    }
    estimate.error = (estimate.error * estimate.error + blur).sqrt();
    estimate
}
