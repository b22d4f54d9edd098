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
use crate::planes::{Geometry, Layout, Planes, Square, Weights};
use crate::squares::Squares;
use crate::store::Store;
use crate::usual::Usual;
use crate::view::{Seen, View};
use glam::Vec3;
use holo_denoise::Denoiser;
use rayon::prelude::*;

/// The number of neighbourhoods. Each is twice as wide as the one before.
const SCALES: usize = 6;

/// The most that a sample brings, as a share of the light of its wide neighbourhood.
const MOST_SHARE: f32 = 0.1;

/// The weight of the picture's mean in the light around a sample, samples. Without it, a sample that
/// is alone in its neighbourhood would have darkness around it, and count for nothing.
const MEAN_AROUND: f32 = 4.0;

/// The weight of light that is likely in the widest neighbourhood, samples.
const LIKELY: f32 = 2.0;

/// Relative standard errors at which a neighbourhood begins to count and at which it counts fully,
/// for the first and for the second time.
const NOISE: [[f32; 2]; 2] = [[0.35, 0.1], [0.1, 0.03]];

/// The binary logarithm of the ratio of distances from edges at which two squares no longer count for
/// each other: shadows lie along edges.
const ALONG: f32 = 2.0;

/// The natural logarithm of the ratio of light at which two squares no longer count for each other.
/// Used the second time.
const DIFFERENT: f32 = 0.5;

/// The share of the first error that the second light keeps: weights follow the light found first.
const KEPT: f32 = 0.25;

/// Fixed-point steps that the denoiser sees as 1.
const SCALE: f32 = 1024.0;

/// The sums of each square: light (3), count, square.
type Sum = Planes<5>;

impl Squares {
    /// Returns the number of scales that judge brightest samples: as many pixels at any step.
    fn wide(&self) -> usize {
        if self.step == 4 { 4 } else { 5 }
    }

    /// Returns the light of every square. If only `once`, for a denoiser that replaces the light
    /// where samples are, the second time is left out.
    pub fn filter(&self, view: &View, store: &Store, sums: &[Sums], once: bool) -> Vec<Estimate> {
        let layout = self.layout();
        let geometry = self.geometry(&layout);
        let weights: Vec<Weights> =
            (0..SCALES).map(|scale| layout.weights(&geometry, self.step, 1 << scale)).collect();
        let edges = layout.edge_distances(&weights[0]);
        let weights = layout.all_weights_by(&weights, &edges, ALONG);
        let raw = layout.planes(|at| Lit::new(&sums[at.number]).to_array());
        let usual = (0..self.wide())
            .fold(raw.clone(), |lit, scale| layout.widened(&lit, 1 << scale, &weights[scale]));
        let likely = Usual::new((view, store), self, &layout, &raw);
        let mean = luminance(likely.mean.to_array());
        let held = layout.planes(|at| {
            hold_back(&raw.at(at).into(), &usual.at(at).into(), &sums[at.number], mean).to_array()
        });
        let mut scales = scales(&layout, held, &weights);
        let last = &scales[SCALES];
        let likely = layout.planes(|at| {
            let [.., count, _] = last.at(at);
            likely.at(at, count).unwrap_or_default().to_array()
        });
        let first = choose_all(&layout, &scales, &scales[self.wide()], NOISE[0], &[], &likely);
        if once {
            return first;
        }
        let bright =
            layout.planes(|at| [luminance(first[at.number].light.to_array()).max(1.0).ln()]);
        let weights = layout.all_weights_by(&weights, &bright, DIFFERENT);
        let wide = scales.swap_remove(self.wide());
        let scales = self::scales(&layout, scales.swap_remove(0), &weights);
        let details = details(&layout, &scales, &weights, &wide);
        let mut lights = choose_all(&layout, &scales, &wide, NOISE[1], &details, &likely);
        for (light, first) in lights.iter_mut().zip(&first) {
            light.error = light.error.hypot(KEPT * first.error);
        }
        lights
    }

    fn layout(&self) -> Layout {
        let occupied = |row: &[Seen]| {
            let begin = row.iter().position(Seen::is_surface).unwrap_or(0);
            begin..row.iter().rposition(Seen::is_surface).map_or(begin, |last| last + 1)
        };
        Layout {
            size: self.size,
            occupied: self.seen.par_chunks(self.size.0).map(occupied).collect(),
        }
    }

    fn geometry(&self, layout: &Layout) -> Geometry {
        layout.planes(|at| {
            let Seen { point, normal, width, light, .. } = self.seen[at.number];
            [point.x, point.y, point.z, normal.x, normal.y, normal.z, width, light as f32]
        })
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
}

/// Returns the sums of all scales: first the narrowest, which are those of the squares.
fn scales(layout: &Layout, of_squares: Sum, weights: &[Weights]) -> Vec<Sum> {
    let mut scales = vec![of_squares];
    for (scale, weights) in weights.iter().enumerate() {
        scales.push(layout.widened(&scales[scale], 1 << scale, weights));
    }
    scales
}

/// Returns, for each scale but the widest, the detail of every square: a mean over the square and
/// the 8 around it, by weight.
fn details(layout: &Layout, scales: &[Sum], weights: &[Weights], wide: &Sum) -> Vec<Planes<2>> {
    let variances = layout.planes(|at| [Lit::from(wide.at(at)).variance_around()]);
    let of_scale = |scale: usize| {
        let own = layout.planes(|at| {
            let [narrow, wider] = [0, 1].map(|more| scales[scale + more].at(at).into());
            let [variance] = variances.at(at);
            let Detail { difference, noise } = Detail::new(&narrow, &wider, variance);
            [difference, noise, f32::from(u8::from(noise > 0.0))]
        });
        let sums = layout.widened(&own, 1 << scale, &weights[scale]);
        layout.planes(|at| {
            let [difference, noise, total] = sums.at(at);
            let total = total.max(f32::MIN_POSITIVE);
            [difference / total, noise / total]
        })
    };
    (0..weights.len()).map(of_scale).collect()
}

/// Returns the sums of a square with its brightest sample cut to a share of the light around. That
/// sample itself does not raise its limit, but `mean` does, the mean luminance of the picture.
fn hold_back(raw: &Lit, wide: &Lit, sums: &Sums, mean: f32) -> Lit {
    let bright = sums.brightest();
    let others = (wide.count - 1.0).max(0.0) + MEAN_AROUND;
    let light = (luminance(wide.light.to_array()) - bright).max(0.0) + MEAN_AROUND * mean;
    let around = light / others;
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
    /// Returns a square's own detail, by the variance of one sample around. It is 0 where the
    /// neighbourhood is too dark to judge noise. The wider sums contain the narrow ones.
    fn new(narrow: &Lit, wider: &Lit, around: f32) -> Detail {
        if narrow.count <= 0.0 || wider.count <= narrow.count {
            return Detail::default();
        }
        let differs = luminance((narrow.mean() - wider.mean()).to_array());
        let noise = narrow.variance(around) * (1.0 - narrow.count / wider.count);
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
    layout: &Layout,
    scales: &[Sum],
    wide: &Sum,
    noise: [f32; 2],
    details: &[Planes<2>],
    likely: &Planes<3>,
) -> Vec<Estimate> {
    let (width, height) = layout.size;
    let mut lights = vec![Estimate::UNKNOWN; width * height];
    lights.par_chunks_mut(width).enumerate().for_each(|(row, lights)| {
        for at in layout.squares(row) {
            lights[at.number - row * width] =
                choose(scales, at, &wide.at(at).into(), noise, details, likely);
        }
    });
    lights
}

/// Returns the light of a square from its sums on all scales: of the narrowest one with little enough
/// noise, and no more of it than its detail says. Without `details`, noise alone decides.
fn choose(
    scales: &[Sum],
    at: Square,
    wide: &Lit,
    [high, low]: [f32; 2],
    details: &[Planes<2>],
    likely: &Planes<3>,
) -> Estimate {
    let lit = |scale: &Sum| Lit::from(scale.at(at));
    let last = scales.last().map(lit).unwrap_or_default();
    let likely = Vec3::from_array(likely.at(at));
    if last.count <= 0.0 {
        return if likely == Vec3::ZERO { Estimate::UNKNOWN } else { Estimate::guessed(likely) };
    }
    let wide = if wide.count > 0.0 { wide } else { &last };
    let bright = luminance(wide.mean().to_array());
    let variance = wide.variance_around();
    let mut light = last.mean();
    if likely != Vec3::ZERO {
        light += LIKELY / (last.count + LIKELY) * (likely - light);
    }
    let mut estimate = Estimate { light, error: last.variance(variance).sqrt(), variance };
    // The square of what is lost by not taking the narrowest scale.
    let mut blur = 0.0;
    for (number, scale) in scales[..scales.len() - 1].iter().enumerate().rev() {
        let lit = lit(scale);
        let own = lit.variance(variance).sqrt();
        // Where all is black, so is every scale.
        let range = (high - low) * bright.max(f32::MIN_POSITIVE);
        let mut share = ((high * bright - own) / range).clamp(0.0, 1.0);
        if let Some([difference, noise]) = details.get(number).map(|details| details.at(at)) {
            let detail = Detail { difference, noise };
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
                    let detail = Detail::new(&own, &around, lit(wide, 1.0).variance_around());
                    assert!((0.0..=1.0).contains(&detail.share()), "{detail:?}");
                    assert!(detail.noise > 0.0 || detail.difference == 0.0, "{detail:?}");
                }
            }
        }
    }
}
