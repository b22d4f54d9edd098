//! The filter: smooths the light of squares of pixels along surfaces, as widely as its noise needs.
//!
//! It adds sums over ever wider neighbourhoods (à-trous). Each square takes the narrowest one with
//! a small enough standard error. This happens twice. At first, weights depend on geometry alone. The
//! second time they also depend on how much the light found at first differs, and a narrower
//! neighbourhood counts only as far as it differs from the next wider one by more than noise.
//!
//! What always holds:
//! - No light crosses a crease or a sheet. Weights fall to 0 with the distance from either plane,
//!   and are 0 between sides that face away from each other.
//! - A sample brings at most a tenth of the light of its wide neighbourhood. The limit grows with
//!   the number of samples, so the bias that it causes vanishes as they grow.

use crate::cell::{Sums, luminance};
use crate::estimate::{Estimate, Lit};
use crate::squares::{AROUND, Squares, alike};
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

/// Fixed-point steps that the denoiser sees as 1.
const SCALE: f32 = 1024.0;

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
        let usual = (0..self.wide())
            .fold(raw.clone(), |lit, scale| self.widen(&lit, 1 << scale, &weights[scale]));
        let held: Vec<Lit> = raw
            .par_iter()
            .zip(&usual)
            .zip(sums)
            .map(|((raw, usual), sums)| hold_back(raw, usual, sums))
            .collect();
        let mut scales = self.scales(held, &weights);
        let first = choose_all(&scales, &scales[self.wide()], NOISE[0], &[]);
        let bright: Vec<f32> =
            first.par_iter().map(|e| luminance(e.light.to_array()).max(1.0).ln()).collect();
        let weights: Vec<Weights> = weights
            .iter()
            .enumerate()
            .map(|(scale, weights)| self.weights_of_light(weights, 1 << scale, &bright))
            .collect();
        let wide = scales.swap_remove(self.wide());
        let scales = self.scales(scales.swap_remove(0), &weights);
        let details = self.details(&scales, &weights, &wide);
        let mut lights = choose_all(&scales, &wide, NOISE[1], &details);
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

    /// Returns the sums of all scales: first the narrowest, which are those of the squares.
    fn scales(&self, of_squares: Vec<Lit>, weights: &[Weights]) -> Vec<Vec<Lit>> {
        let mut scales = vec![of_squares];
        for (scale, weights) in weights.iter().enumerate() {
            scales.push(self.widen(&scales[scale], 1 << scale, weights));
        }
        scales
    }

    /// Returns, for each scale but the widest, the detail of every square: a mean over the square and
    /// the 8 around it, by weight.
    fn details(&self, scales: &[Vec<Lit>], weights: &[Weights], wide: &[Lit]) -> Vec<Vec<Detail>> {
        let of_scale = |scale: usize| {
            let pairs = scales[scale].par_iter().zip(&scales[scale + 1]).zip(wide);
            let own: Vec<Detail> =
                pairs.map(|((narrow, wider), wide)| Detail::new(narrow, wider, wide)).collect();
            let at = |number: usize| {
                if !self.seen[number].is_surface() {
                    return Detail::default();
                }
                let around =
                    self.around(number, 1 << scale).into_iter().zip(weights[scale][number]);
                let mut mean = own[number];
                let mut total = f32::from(u8::from(mean.noise > 0.0));
                for (other, weight) in around.filter(|(other, _)| own[*other].noise > 0.0) {
                    mean.difference += weight * own[other].difference;
                    mean.noise += weight * own[other].noise;
                    total += weight;
                }
                let total = total.max(f32::MIN_POSITIVE);
                Detail { difference: mean.difference / total, noise: mean.noise / total }
            };
            (0..own.len()).into_par_iter().map(at).collect()
        };
        (0..weights.len()).map(of_scale).collect()
    }

    /// Adds to each square the 8 squares at this distance.
    fn widen(&self, lit: &[Lit], distance: usize, weights: &[[f32; AROUND]]) -> Vec<Lit> {
        let at = |number: usize| {
            let mut wider = lit[number];
            if !self.seen[number].is_surface() {
                return wider;
            }
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
            if !self.seen[number].is_surface() {
                return weights;
            }
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

/// What the light of a scale says beyond the next wider one.
#[derive(Clone, Copy, Debug, Default)]
struct Detail {
    /// The square of the difference between both.
    difference: f32,
    /// What noise alone would make of that square.
    noise: f32,
}

impl Detail {
    /// Returns a square's own detail. It is 0 where the neighbourhood is too dark to judge noise. The
    /// wider sums contain the narrow ones.
    fn new(narrow: &Lit, wider: &Lit, wide: &Lit) -> Detail {
        if narrow.count <= 0.0 || wider.count <= narrow.count {
            return Detail::default();
        }
        let differs = luminance((narrow.mean() - wider.mean()).to_array());
        let noise = narrow.variance(wide.variance_around()) * (1.0 - narrow.count / wider.count);
        if noise > 0.0 {
            Detail { difference: differs * differs, noise }
        } else {
            Detail::default()
        }
    }

    /// Returns the part of the squared difference that noise does not explain.
    fn real(&self) -> f32 {
        (self.difference - self.noise).max(0.0)
    }

    /// Returns the share of the difference that has the least expected error (Wiener's filter).
    fn share(&self) -> f32 {
        self.real() / (self.real() + self.noise).max(f32::MIN_POSITIVE)
    }
}

/// Returns the light of all squares from their sums on all scales.
fn choose_all(
    scales: &[Vec<Lit>],
    wide: &[Lit],
    noise: [f32; 2],
    details: &[Vec<Detail>],
) -> Vec<Estimate> {
    let at = |at: usize| choose(scales, at, &wide[at], noise, details);
    (0..wide.len()).into_par_iter().map(at).collect()
}

/// Returns the light of a square from its sums on all scales: of the narrowest one with little enough
/// noise, and no more of it than its detail says. Without `details`, noise alone decides.
fn choose(
    scales: &[Vec<Lit>],
    at: usize,
    wide: &Lit,
    [high, low]: [f32; 2],
    details: &[Vec<Detail>],
) -> Estimate {
    let Some(last) = scales.last().map(|scale| &scale[at]).filter(|lit| lit.count > 0.0) else {
        return Estimate::UNKNOWN;
    };
    let wide = if wide.count > 0.0 { wide } else { last };
    let bright = luminance(wide.mean().to_array());
    let variance = wide.variance_around();
    let mut estimate =
        Estimate { light: last.mean(), error: last.variance(variance).sqrt(), variance };
    // The square of what is lost by not taking the narrowest scale.
    let mut blur = 0.0;
    for (number, scale) in scales[..scales.len() - 1].iter().enumerate().rev() {
        let lit = &scale[at];
        let own = lit.variance(variance).sqrt();
        // Where all is black, so is every scale.
        let range = (high - low) * bright.max(f32::MIN_POSITIVE);
        let mut share = ((high * bright - own) / range).clamp(0.0, 1.0);
        if let Some(detail) = details.get(number).map(|details| &details[at]) {
            share *= detail.share();
            blur = (1.0 - share) * (1.0 - share) * (blur + detail.real());
        }
        if lit.count > 0.0 {
            estimate.light += share * (lit.mean() - estimate.light);
            estimate.error += share * (own - estimate.error);
        }
    }
    estimate.error = (estimate.error * estimate.error + blur).sqrt();
    estimate
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_beside_darkness_has_a_finite_share() {
        let lit = |light: f32, count: f32| Lit {
            light: Vec3::splat(light * count),
            count,
            square: light * light * count,
        };
        for (narrow, wider) in [(1e6, 0.0), (1e6, 1e6), (0.0, 0.0), (0.0, 1e6), (1e-30, 0.0)] {
            for wide in [0.0, 1e-30, 1e6] {
                for count in [1e-9, 1.0, 1e6] {
                    let own = lit(narrow, count);
                    let around = lit(narrow + wider, 2.0 * count);
                    let detail = Detail::new(&own, &around, &lit(wide, 1.0));
                    assert!((0.0..=1.0).contains(&detail.share()), "{detail:?}");
                    assert!(detail.noise > 0.0 || detail.difference == 0.0, "{detail:?}");
                }
            }
        }
    }
}
