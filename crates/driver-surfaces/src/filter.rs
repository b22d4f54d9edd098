//! The filter: smooths the light of squares of pixels along surfaces, as widely as its noise needs.
//!
//! It sums over ever wider neighbourhoods (à-trous). Each square uses the narrowest one with a
//! small enough standard error. There are two passes. In the first, weights depend on geometry
//! alone. In the second, they also depend on differences of the light that the first found. There,
//! a narrow neighbourhood counts only as far as it differs from the next wider one by more than
//! noise.
//!
//! The first pass finds the light twice, each time from half of the squares. In the second pass,
//! weights for the samples of one half depend on the light of the other half (Rousselle, Knaus &
//! Zwicker 2012). If samples chose their own weights, they would count most where their noise is
//! alike, and blotches of noise would stay.
//!
//! Invariants:
//! - No light crosses a crease or a sheet. Weights fall to 0 with the distance from either plane,
//!   and are 0 between sides that face away from each other.
//! - A sample contributes at most a tenth of the light of its wide neighbourhood. The limit grows
//!   with the number of samples, so the bias that it causes vanishes as they grow.

use crate::behind::BehindPanes;
use crate::cell::{Sums, luminance};
use crate::coats::{CoatScales, mean_of_samples};
use crate::estimate::{Estimate, Lit};
use crate::likely::LikelyLight;
use crate::planes::{Geometry, Layout, Planes, Square, Weights};
use crate::squares::Squares;
use crate::store::Store;
use crate::view::{Seen, View};
use glam::Vec3;
use holo_denoise::Denoiser;
use holo_display::Interrupt;
use rayon::prelude::*;

/// Number of neighbourhoods. Each is twice as wide as the one before.
const SCALES: usize = 6;

/// Most light of one sample, as a share of the light of its wide neighbourhood.
const MOST_SHARE: f32 = 0.1;

/// Weight of the picture's mean in the light around a sample, in samples. Without it, a sample
/// alone in its neighbourhood would have darkness around it, and would be cut to nothing.
const MEAN_AROUND: f32 = 4.0;

/// Weight of the likely light in the widest neighbourhood, in samples.
const LIKELY_WEIGHT: f32 = 2.0;

/// Relative standard errors at which a neighbourhood begins to count and at which it counts fully,
/// for the first pass over all squares, for the same over half of them, and for the second pass.
const NOISE: [[f32; 2]; 3] = [[0.35, 0.1], [0.5, 0.14], [0.1, 0.03]];

/// Binary logarithm of the ratio of distances from edges at which two squares no longer count for
/// each other, because shadows lie along edges.
const DIFFERENT_DISTANCE: f32 = 2.0;

/// Natural logarithm of the ratio of light at which two squares no longer count for each other, in
/// the second pass.
const DIFFERENT_LIGHT: f32 = 0.5;

/// Share of the first pass's error that the second keeps, because its weights follow the first
/// light.
const FIRST_ERROR_SHARE: f32 = 0.25;

/// Fixed-point steps that the denoiser sees as 1.
const SCALE: f32 = 1024.0;

/// The sums of each square: light (3), count, square.
type Sum = Planes<5>;

/// The sums of all squares.
pub(crate) struct OfSquares {
    /// Over samples that count for the view.
    pub towards_eye: Vec<Sums>,
    /// Over samples from all directions on coats, and as above elsewhere. `None` without coats.
    pub from_all: Option<Vec<Sums>>,
}

impl OfSquares {
    /// Returns true if no square has a sample, as at the start of a new holodeck.
    pub fn are_empty(&self) -> bool {
        let all = self.from_all.as_ref().unwrap_or(&self.towards_eye);
        all.iter().all(|sums| sums.count == 0)
    }
}

/// Filtered light of all squares.
pub(crate) struct Filtered {
    /// The light towards the eye.
    pub lights: Vec<Estimate>,
    /// The part of it that coats send beyond the mean of all directions. Empty without coats.
    pub beyond: Vec<Estimate>,
}

impl Filtered {
    /// Adds `beyond` to the mean light of all directions.
    fn new(mut lights: Vec<Estimate>, beyond: Vec<Estimate>) -> Filtered {
        for (light, beyond) in lights.iter_mut().zip(&beyond) {
            light.light = (light.light + beyond.light).max(Vec3::ZERO);
            light.error = light.error.hypot(beyond.error);
        }
        Filtered { lights, beyond }
    }
}

impl Squares {
    /// Returns the scale that judges brightest samples. It spans as many pixels at any step.
    fn limiting_scale(&self) -> usize {
        if self.step == 4 { 4 } else { 5 }
    }

    /// Returns the light of every square. `behind` tells which squares lie behind panes. If `once`,
    /// the second pass is left out, because a denoiser replaces the light of squares with samples.
    /// `None` if it was interrupted.
    pub fn filter(
        &self,
        (view, store): (&View, &Store),
        OfSquares { towards_eye, from_all }: &OfSquares,
        behind: &BehindPanes,
        once: bool,
        interrupt: &Interrupt,
    ) -> Option<Filtered> {
        let sums = from_all.as_ref().unwrap_or(towards_eye);
        let layout = self.layout();
        let geometry = self.geometry(&layout);
        let weights: Vec<Weights> =
            (0..SCALES).map(|scale| layout.weights(&geometry, self.step, 1 << scale)).collect();
        let edges = layout.edge_distances(&weights[0]);
        let weights = layout.all_weights_by(&weights, &edges, DIFFERENT_DISTANCE);
        interrupt.check()?;
        let raw = layout.planes(|at| Lit::new(&sums[at.number]).to_array());
        let likely = LikelyLight::new((view, store), self, &layout, &raw);
        let held = |raw: &Sum, sums: &[Sums]| {
            let around = (0..self.limiting_scale())
                .fold(raw.clone(), |lit, scale| layout.widened(&lit, 1 << scale, &weights[scale]));
            let mean = luminance(likely.mean.to_array());
            layout.planes(|at| {
                let (own, around) = (raw.at(at).into(), around.at(at).into());
                let held = limit_brightest(&own, &around, &sums[at.number], mean);
                behind.taken_out(at.number, held).to_array()
            })
        };
        let towards_eye = from_all.as_ref().map(|_| {
            let raw = layout.planes(|at| match view.shows_coat(&self.seen[at.number]) {
                true => Lit::new(&towards_eye[at.number]).to_array(),
                false => [0.0; 5],
            });
            held(&raw, towards_eye)
        });
        let held = held(&raw, sums);
        interrupt.check()?;
        let halves = (!once).then(|| halves(&layout, &held));
        let of_halves = halves.map(|halves| halves.map(|half| scales(&layout, half, &weights)));
        let scales = match &of_halves {
            Some([even, odd]) => both(&layout, even, odd),
            None => scales(&layout, held, &weights),
        };
        interrupt.check()?;
        let last = &scales[SCALES];
        let likely = layout.planes(|at| {
            let [.., count, _] = last.at(at);
            likely.at(at, count).unwrap_or_default().to_array()
        });
        let wide = &scales[self.limiting_scale()];
        let first = choose_all(&layout, &scales, wide, NOISE[0], &[], &likely);
        let with_coats = |lights: Vec<Estimate>, from_all: &[Sum], weights: [&[Weights]; 2]| {
            let beyond = towards_eye.map(|towards_eye| {
                let towards_eye = &scales_by_halves(&layout, &towards_eye, weights);
                CoatScales { towards_eye, from_all }.beyond((view, &self.seen), &layout, &lights)
            });
            Filtered::new(lights, beyond.unwrap_or_default())
        };
        let Some(of_halves) = of_halves else {
            return Some(with_coats(first, &scales, [&weights, &weights]));
        };
        let by_light = |half: &[Sum]| {
            let first = choose_all(&layout, half, wide, NOISE[1], &[], &likely);
            let bright = |light: &Estimate| luminance(light.light.to_array()).max(1.0).ln();
            let bright = layout.planes(|at| [bright(&first[at.number])]);
            layout.all_weights_by(&weights, &bright, DIFFERENT_LIGHT)
        };
        let [by_even, by_odd] = of_halves.each_ref().map(|half| by_light(half));
        interrupt.check()?;
        let scales = scales_by_halves(&layout, &scales[0], [&by_odd, &by_even]);
        interrupt.check()?;
        let details = details(&layout, &scales, &weights, wide);
        let mut lights = choose_all(&layout, &scales, wide, NOISE[2], &details, &likely);
        for (light, first) in lights.iter_mut().zip(&first) {
            light.error = light.error.hypot(FIRST_ERROR_SHARE * first.error);
        }
        interrupt.check()?;
        Some(with_coats(lights, &scales, [&by_odd, &by_even]))
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

    /// Replaces the filtered light by the denoised means of all samples. If a square has no
    /// samples, its filtered light is denoised. If the library fails or is interrupted, the light
    /// stays filtered.
    pub fn denoise(
        &self,
        OfSquares { towards_eye, from_all }: &OfSquares,
        behind: &BehindPanes,
        Filtered { mut lights, beyond }: Filtered,
        denoiser: &mut Denoiser,
        interrupt: &Interrupt,
    ) -> Vec<Estimate> {
        let goes_on = || !interrupt.is_set();
        let of_samples = |number: usize| {
            let own = &towards_eye[number];
            match from_all {
                Some(all) => mean_of_samples(own, &all[number], &beyond[number]),
                None => (own.count > 0).then(|| own.mean()),
            }
        };
        let light = |number: usize| {
            let light = match of_samples(number) {
                None => lights[number].light,
                Some(mean) => behind.of(number).map_or(mean, |pane| pane.light(mean)),
            };
            (light.max(Vec3::ZERO) / SCALE).to_array()
        };
        let mut pixels: Vec<[f32; 3]> = (0..towards_eye.len()).map(light).collect();
        let normals: Vec<[f32; 3]> = self.seen.iter().map(|seen| seen.normal.to_array()).collect();
        if denoiser.denoise_light(&mut pixels, &normals, self.size, &goes_on).is_ok() {
            for (light, pixel) in lights.iter_mut().zip(pixels) {
                light.light = Vec3::from_array(pixel).max(Vec3::ZERO) * SCALE;
            }
        }
        lights
    }
}

/// Returns the sums of all scales, from the squares' own sums to the widest.
fn scales(layout: &Layout, of_squares: Sum, weights: &[Weights]) -> Vec<Sum> {
    let mut scales = vec![of_squares];
    for (scale, weights) in weights.iter().enumerate() {
        scales.push(layout.widened(&scales[scale], 1 << scale, weights));
    }
    scales
}

/// Returns sums in which every other square is 0, and those in which the other squares are.
fn halves(layout: &Layout, of_squares: &Sum) -> [Sum; 2] {
    [0, 1].map(|half| {
        let is_in_half = |at: Square| (at.row + at.column) % 2 == half;
        layout.planes(|at| if is_in_half(at) { of_squares.at(at) } else { [0.0; 5] })
    })
}

/// Returns the sums of all scales, with weights of its own for each half of the squares.
fn scales_by_halves(layout: &Layout, of_squares: &Sum, [even, odd]: [&[Weights]; 2]) -> Vec<Sum> {
    let halves = halves(layout, of_squares);
    let [of_even, of_odd] = halves;
    both(layout, &scales(layout, of_even, even), &scales(layout, of_odd, odd))
}

/// Returns the sums of both halves, for each scale.
fn both(layout: &Layout, even: &[Sum], odd: &[Sum]) -> Vec<Sum> {
    let added = |(even, odd): (&Sum, &Sum)| {
        layout.planes(|at| {
            let (mut sum, more) = (even.at(at), odd.at(at));
            sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
            sum
        })
    };
    even.iter().zip(odd).map(added).collect()
}

/// Returns the detail of every square for each scale except the widest: a weighted mean over the
/// square and the 8 around it.
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
/// sample does not raise its own limit. `mean`, the mean luminance of the picture, does.
fn limit_brightest(raw: &Lit, wide: &Lit, sums: &Sums, mean: f32) -> Lit {
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

/// The difference between the light of a scale and that of the next wider one.
#[derive(Clone, Copy, Debug, Default)]
struct Detail {
    /// The square of the difference.
    difference: f32,
    /// The expected square of the difference if it were noise alone.
    noise: f32,
}

impl Detail {
    /// Returns a square's own detail. `around` is the variance of one sample nearby. The detail is
    /// 0 if the neighbourhood is too dark to judge noise. The wider sums contain the narrow ones.
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

/// Returns the light of a square from its sums on all scales. The narrowest scale with little
/// enough noise counts, as far as its detail is significant. Without `details`, noise alone
/// decides.
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
        light += LIKELY_WEIGHT / (last.count + LIKELY_WEIGHT) * (likely - light);
    }
    let mut estimate = Estimate { light, error: last.variance(variance).sqrt(), variance };
    // The squared error from not using the narrowest scale.
    let mut blur = 0.0;
    for (number, scale) in scales[..scales.len() - 1].iter().enumerate().rev() {
        let lit = lit(scale);
        let own = lit.variance(variance).sqrt();
        // A black neighbourhood has the range of the least float, so that nothing is divided by 0.
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
    // Behind panes, noise may leave less than nothing.
    estimate.light = estimate.light.max(Vec3::ZERO);
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
