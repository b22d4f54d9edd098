//! The second pass: a network and the significance of detail determine how much each neighbourhood
//! counts beside the next wider one.
//!
//! Invariant: the network sees ratios only, so neither the unit of light nor the size of the scene
//! changes a share.

use super::choose::{Choice, Widest};
use super::network::{self, INPUTS, Inputs, LANES};
use super::sums::{SCALES, Sum};
use crate::estimate::{Estimate, LightSums};
use crate::light_store::luminance;
use crate::planes::{Square, SquareLayout, SquarePlanes, Weights};
use holo_cpu::Isa;
use rayon::prelude::*;

/// Errors are compared with at least this luminance, fixed-point steps.
const DARKEST: f32 = 1e-3;

/// The quantities by which the second pass chooses.
pub(super) struct Refinement<'a> {
    pub choice: Choice<'a>,
    /// Sums of all scales by geometry and light.
    pub by_light: &'a [Sum],
    /// Samples by geometry alone of all scales but the narrowest.
    pub counts: &'a [SquarePlanes<1>],
    /// The details of all scales except the widest.
    pub details: &'a [SquarePlanes<2>],
    /// Side of a square, pixels.
    pub step: usize,
}

/// Squares whose shares are determined together.
struct Block {
    squares: [Option<(Square, Widest)>; LANES],
    /// The shares of each scale except the widest.
    shares: [[f32; LANES]; SCALES],
}

/// Returns the details of all squares for each scale except the widest: weighted means over the
/// square and the 8 around it. `by_light` and `weights` are those of all scales.
pub(super) fn details(
    choice: &Choice,
    by_light: &[Sum],
    weights: &[Weights],
) -> Vec<SquarePlanes<2>> {
    let Choice { layout, wide, .. } = choice;
    let variances = layout.planes(|at| [LightSums::from(wide.at(at)).variance_around()]);
    let of_scale = |(scale, weights): (usize, &Weights)| {
        let own = layout.planes(|at| {
            let [narrow, wider] = [0, 1].map(|more| by_light[scale + more].at(at).into());
            let [variance] = variances.at(at);
            let ScaleDetail { difference, noise } = ScaleDetail::new(&narrow, &wider, variance);
            [difference, noise, f32::from(u8::from(noise > 0.0))]
        });
        let sums = layout.widened(&own, 1 << scale, weights, None);
        layout.planes(|at| {
            let [difference, noise, total] = sums.at(at);
            let total = total.max(f32::MIN_POSITIVE);
            [difference / total, noise / total]
        })
    };
    weights.iter().enumerate().map(of_scale).collect()
}

impl Refinement<'_> {
    /// Returns the light of all squares.
    pub fn lights(&self) -> Vec<Estimate> {
        let layout: &SquareLayout = self.choice.layout;
        let (width, height) = layout.size;
        let mut lights = vec![Estimate::UNKNOWN; width * height];
        lights.par_chunks_mut(width).enumerate().for_each(|(row, lights)| {
            let squares: Vec<Square> = layout.squares(row).collect();
            for squares in squares.chunks(LANES) {
                let block = self.block(squares, lights);
                for (lane, known) in block.squares.into_iter().enumerate() {
                    let Some((at, widest)) = known else { continue };
                    let shares = block.shares.map(|shares| shares[lane]);
                    lights[at.column] = self.light(at, widest, shares);
                }
            }
        });
        lights
    }

    /// Returns the shares of at most [`LANES`] squares. Squares without samples around have none;
    /// their likely light is stored in `lights`, by column.
    fn block(&self, squares: &[Square], lights: &mut [Estimate]) -> Block {
        let mut block = Block { squares: [None; LANES], shares: [[0.0; LANES]; SCALES] };
        for (known, &at) in block.squares.iter_mut().zip(squares) {
            match self.choice.widest(at, self.by_light[SCALES].at(at)) {
                Ok(widest) => *known = Some((at, widest)),
                Err(likely) => lights[at.column] = likely,
            }
        }
        let isa = Isa::best();
        for (scale, shares) in block.shares.iter_mut().enumerate() {
            let mut inputs: Inputs = [[1.0; LANES]; INPUTS];
            for (lane, known) in block.squares.iter().enumerate() {
                let Some((at, widest)) = known else { continue };
                let of_square = self.inputs(*at, widest, scale);
                inputs.iter_mut().zip(of_square).for_each(|(lanes, value)| lanes[lane] = value);
            }
            *shares = network::shares(isa, &inputs);
        }
        block
    }

    /// Returns the light of a square. `shares` are those of all scales except the widest.
    fn light(&self, at: Square, widest: Widest, shares: [f32; SCALES]) -> Estimate {
        let mut estimate = widest.estimate;
        // The squared error from not using the narrowest scale.
        let mut blur = 0.0;
        for (scale, share) in shares.into_iter().enumerate().rev() {
            let narrow = LightSums::from(self.by_light[scale].at(at));
            if narrow.count > 0.0 {
                let own = narrow.variance(estimate.variance).sqrt();
                let detail = self.detail(at, scale);
                let share = share * detail.significant_share();
                let unused = 1.0 - share;
                blur = unused * unused * (blur + detail.real());
                estimate.approach(&narrow, own, share);
            }
        }
        estimate.error = (estimate.error * estimate.error + blur).sqrt();
        estimate.at_least_black()
    }

    /// Returns the detail of a scale at a square; none beyond the scales.
    fn detail(&self, at: Square, scale: usize) -> ScaleDetail {
        self.details.get(scale).map(|details| details.at(at).into()).unwrap_or_default()
    }

    /// Returns what the network determines the share of a scale by. All are positive.
    pub fn inputs(&self, at: Square, widest: &Widest, scale: usize) -> [f32; INPUTS] {
        let [narrow, wider] =
            [0, 1].map(|more| LightSums::from(self.by_light[scale + more].at(at)));
        let [by_geometry] = self.counts[scale].at(at);
        let detail = self.detail(at, scale);
        let narrower = scale.checked_sub(1).map(|scale| self.detail(at, scale)).unwrap_or_default();
        let bright = widest.bright.max(DARKEST);
        let of_bright = |square: f32| square / (bright * bright);
        let around = widest.estimate.variance;
        let [low, high] = [narrow, wider].map(|lit| luminance(lit.mean().to_array()));
        let spread = (narrow.square / narrow.count.max(1e-9) - low * low).max(0.0);
        let of_narrow = |count: f32| count / narrow.count.max(1e-9);
        [
            narrow.variance(around).sqrt() / bright,
            high / bright,
            detail.significance(),
            narrower.significance(),
            self.detail(at, scale + 1).significance(),
            ScaleDetail::new(&narrow, &wider, around).significance(),
            of_bright(detail.noise),
            of_bright(around),
            spread / (low * low).max(DARKEST * DARKEST),
            narrow.count,
            of_narrow(wider.count),
            of_narrow(widest.count),
            wider.count / by_geometry.max(1e-9),
            (1 << scale) as f32,
            self.step as f32,
        ]
    }
}

/// The difference between the light of a scale and that of the next wider one.
#[derive(Clone, Copy, Debug, Default)]
struct ScaleDetail {
    /// The square of the difference.
    difference: f32,
    /// The expected square of the difference if it were noise alone.
    noise: f32,
}

impl ScaleDetail {
    /// Returns a square's own detail. `around` is the variance of one sample nearby. The detail is
    /// 0 if the neighbourhood is too dark to judge noise. The wider sums contain the narrow ones.
    fn new(narrow: &LightSums, wider: &LightSums, around: f32) -> ScaleDetail {
        if narrow.count <= 0.0 || wider.count <= narrow.count {
            return ScaleDetail::default();
        }
        let differs = luminance((narrow.mean() - wider.mean()).to_array());
        let noise = narrow.variance(around) * (1.0 - narrow.count / wider.count);
        if noise > 0.0 {
            ScaleDetail { difference: differs * differs, noise }
        } else {
            ScaleDetail::default()
        }
    }

    /// Returns the part of the squared difference that noise does not explain.
    fn real(&self) -> f32 {
        (self.difference - self.noise).max(0.0)
    }

    /// Returns the square root of the share of the difference that has the least expected error
    /// (Wiener's filter). Without it, the network leaves 2 to 5 times as much noise in even light.
    /// Without the root, small details of clean light are lost.
    fn significant_share(&self) -> f32 {
        (self.real() / (self.real() + self.noise).max(f32::MIN_POSITIVE)).sqrt()
    }

    /// Returns 1 for no difference, and about 2 for one that noise explains.
    fn significance(&self) -> f32 {
        1.0 + self.difference / self.noise.max(1e-9)
    }
}

impl From<[f32; 2]> for ScaleDetail {
    fn from([difference, noise]: [f32; 2]) -> ScaleDetail {
        ScaleDetail { difference, noise }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_sample_beside_darkness_has_a_finite_detail() {
        let lit = |light: f32, count: f32| LightSums {
            light: Vec3::splat(light * count),
            count,
            square: light * light * count,
        };
        for (narrow, wider) in [(1e6, 0.0), (1e6, 1e6), (0.0, 0.0), (0.0, 1e6), (1e-30, 0.0)] {
            for wide in [0.0, 1e-30, 1e6] {
                for count in [1e-9, 1.0, 1e6] {
                    let own = lit(narrow, count);
                    let around = lit(narrow + wider, 2.0 * count);
                    let detail = ScaleDetail::new(&own, &around, lit(wide, 1.0).variance_around());
                    let share = detail.significant_share();
                    assert!((0.0..=1.0).contains(&share), "{detail:?}");
                    assert!(detail.significance() >= 1.0, "{detail:?}");
                    assert!(detail.noise > 0.0 || detail.difference == 0.0, "{detail:?}");
                }
            }
        }
    }

    /// Calls `check` with the refinement of one square, whose neighbourhoods have 1, 4, 16, …
    /// samples. Every other sample has the light 0, and the others twice `light`. The square's own
    /// sample has `own`.
    fn of_square(own: f32, light: f32, check: impl FnOnce(&Refinement, Square)) {
        let layout = SquareLayout { size: (1, 1), occupied: std::iter::once(0..1).collect() };
        let sums = |count: f32, light: f32, square: f32| {
            let sum = count * light;
            layout.planes(|_| [sum, sum, sum, count, count * square])
        };
        let by_light: Vec<Sum> = (0..=SCALES)
            .map(|scale| match scale {
                0 => sums(1.0, own, own * own),
                _ => sums(4_f32.powi(scale as i32), light, 2.0 * light * light),
            })
            .collect();
        let likely = layout.planes(|_| [0.0; 4]);
        let choice = Choice { layout: &layout, wide: &by_light[SCALES], likely: &likely };
        let weights = vec![layout.planes(|_| [0.0; 8]); SCALES];
        let details = &details(&choice, &by_light, &weights);
        let count = |sums: &Sum| layout.planes(|at| [sums.at(at)[3]]);
        let counts = &by_light[1..].iter().map(count).collect::<Vec<_>>();
        let refinement = Refinement { choice, by_light: &by_light, counts, details, step: 2 };
        check(&refinement, Square { number: 0, column: 0, row: 0 });
    }

    #[test]
    fn the_unit_of_light_changes_no_input() {
        let inputs = |unit: f32| {
            let mut found = Vec::new();
            of_square(300.0 * unit, 100.0 * unit, |refinement, at| {
                let widest =
                    refinement.choice.widest(at, refinement.by_light[SCALES].at(at)).unwrap();
                found = (0..SCALES).map(|scale| refinement.inputs(at, &widest, scale)).collect();
            });
            found
        };
        let one = inputs(1.0);
        for unit in [0.125, 1024.0, 65536.0] {
            for (scale, (one, other)) in one.iter().zip(inputs(unit)).enumerate() {
                for (number, (&one, other)) in one.iter().zip(other).enumerate() {
                    let same = (one - other).abs() <= 1e-3 * one;
                    assert!(same, "{unit} {scale} {number}: {one} {other}");
                }
            }
        }
    }

    #[test]
    fn one_bright_sample_among_noise_hardly_counts() {
        of_square(1000.0, 100.0, |refinement, _| {
            let found = refinement.lights()[0];
            assert!((found.light.y - 100.0).abs() < 20.0, "{found:?}");
            assert!(found.error > 0.0 && found.error.is_finite());
        });
    }
}
