//! Light of surfaces that have no sample near: that of the same side of the triangle elsewhere, and as far as that has few samples, of
//! others of the same material, turned the same way. Where records of indirect light are known, only the rest of the light is taken
//! from there: the light straight from lamps and the sky.
//!
//! Invariant: sums are of integers, pixel by pixel, so that no order of samples changes a bit.

use super::deposit::{Sums, luminance};
use super::indirect::Indirect;
use super::shade::Shadings;
use super::surfaces::{Seen, Surfaces};
use glam::Vec3;
use holo_display::for_bands;
use rustc_hash::FxHashMap;
use std::hash::Hash;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Steps of a normal's coordinates: those of one class are within about 40° of each other.
const STEPS: f32 = 1.5;

/// Rows of one piece of work.
const ROWS: usize = 32;

/// Samples of the side of a triangle that tell as much of its light as all surfaces like it: with the first sample, light must not jump.
const FEW: f32 = 4.0;

/// Pixels whose indirect light stands for a class's.
const EXAMPLES: usize = 8;

type Class = (u32, [i8; 3]);

/// Surfaces that are taken to be lit alike.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Kin {
    Side((u32, bool)),
    Class(Class),
    Material(u32),
    /// All that light falls on alike from everywhere: not lamps, of which what is kept is their own radiance.
    Diffuse,
    All,
}

/// Mean light by classes of surfaces.
pub(crate) struct Guesses {
    kin: FxHashMap<Kin, Known>,
    /// Mean indirect light of the examples, where it was asked for.
    indirect: Mutex<FxHashMap<Kin, Option<[f32; 3]>>>,
}

/// Mean light of some samples.
#[derive(Clone, Copy)]
pub(crate) struct Mean {
    pub light: [f32; 3],
    pub samples: f32,
}

impl Mean {
    /// Of the samples of both.
    fn with(self, other: Self) -> Self {
        let samples = self.samples + other.samples;
        let share = other.samples / samples;
        let light = [0, 1, 2].map(|channel| {
            self.light[channel] + share * (other.light[channel] - self.light[channel])
        });
        Self { light, samples }
    }
}

struct Known {
    mean: Mean,
    examples: [u32; EXAMPLES],
    count: usize,
}

#[derive(Clone, Copy, Default)]
struct Total {
    light: [u128; 3],
    weight: u128,
    /// The pixels of least [`rank`]: spread evenly over all.
    examples: [u32; EXAMPLES],
    count: usize,
    /// The greatest rank of theirs, when there is no room for more: looked for with each pixel it took most of the time of all sums.
    worst: u32,
}

impl Total {
    fn add(&mut self, sums: &Sums, pixel: u32) {
        for (total, sum) in self.light.iter_mut().zip(sums.light) {
            *total += u128::from(sum);
        }
        self.weight += u128::from(sums.weight);
        self.add_example(pixel);
    }

    #[inline]
    fn add_example(&mut self, pixel: u32) {
        if self.count < EXAMPLES {
            self.examples[self.count] = pixel;
            self.count += 1;
        } else if rank(pixel) < self.worst
            && let Some(worst) = self.examples.iter_mut().max_by_key(|pixel| rank(**pixel))
        {
            *worst = pixel;
        } else {
            return;
        }
        self.worst = self.examples.iter().map(|&pixel| rank(pixel)).fold(0, u32::max);
    }

    fn join(&mut self, other: &Total) {
        for (total, sum) in self.light.iter_mut().zip(other.light) {
            *total += sum;
        }
        self.weight += other.weight;
        other.examples[..other.count].iter().for_each(|&pixel| self.add_example(pixel));
    }

    /// A sample's weight is `one`.
    fn known(&self, one: f32) -> Known {
        let light = self.light.map(|sum| (sum as f64 / self.weight.max(1) as f64) as f32);
        let Total { mut examples, count, .. } = *self;
        examples[..count].sort_unstable();
        Known { mean: Mean { light, samples: self.weight as f32 / one }, examples, count }
    }
}

/// Pixels in an order that has nothing to do with where they are.
fn rank(pixel: u32) -> u32 {
    pixel.wrapping_mul(0x9E37_79B9).rotate_right(15).wrapping_mul(0x85EB_CA6B)
}

/// Sums by the side of a triangle, and its class.
type Sides = FxHashMap<(u32, bool, Class), Total>;

/// Sums of these pixels.
fn sides(surfaces: &Surfaces, sums: &[Sums], pixels: Range<usize>) -> Sides {
    let mut sides = Sides::default();
    // Neighbours mostly see the same: what a run of them adds up to is looked up once.
    let mut run: Option<((u32, bool, Class), Vec3, Total)> = None;
    let mut end = |run: Option<((u32, bool, Class), Vec3, Total)>| {
        if let Some((key, _, total)) = run {
            sides.entry(key).or_default().join(&total);
        }
    };
    for (pixel, (seen, sums)) in
        pixels.clone().zip(surfaces.seen[pixels.clone()].iter().zip(&sums[pixels]))
    {
        if seen.is_sky() || sums.weight == 0 {
            continue;
        }
        let same = |((triangle, front, class), normal, _): &((u32, bool, Class), Vec3, Total)| {
            (*triangle, *front, class.0) == (seen.triangle(), seen.front, seen.material)
                && *normal == seen.normal
        };
        match &mut run {
            Some(run) if same(run) => run.2.add(sums, pixel as u32),
            _ => {
                let mut total = Total::default();
                total.add(sums, pixel as u32);
                end(run.replace(((seen.triangle(), seen.front, class(seen)), seen.normal, total)));
            }
        }
    }
    end(run);
    sides
}

impl Guesses {
    /// A sample's weight is `one`.
    pub fn new(surfaces: &Surfaces, sums: &[Sums], shadings: &Shadings, one: f32) -> Guesses {
        let width = surfaces.size.0;
        let (_, rows) = surfaces.bounds();
        let mut strips: Vec<Sides> = Vec::new();
        strips.resize_with(rows.len().div_ceil(ROWS), Sides::default);
        for_bands(&mut strips, 1, 1, |part, strip| {
            let first = (rows.start + part * ROWS) * width;
            let end = (first + ROWS * width).min(rows.end * width);
            strip.iter_mut().for_each(|strip| *strip = sides(surfaces, sums, first..end));
        });
        // Which examples are kept depends on their ranks alone, sums are of integers: the maps' order changes nothing.
        let mut kin: FxHashMap<Kin, Total> = FxHashMap::default();
        for ((triangle, front, class), total) in strips.into_iter().flatten() {
            for of in
                [Kin::Side((triangle, front)), Kin::Class(class), Kin::Material(class.0), Kin::All]
            {
                kin.entry(of).or_default().join(&total);
            }
            if shadings.materials.get(class.0 as usize).is_some_and(|shading| shading.is_diffuse) {
                kin.entry(Kin::Diffuse).or_default().join(&total);
            }
        }
        let kin = kin.into_iter().map(|(kin, total)| (kin, total.known(one))).collect();
        Guesses { kin, indirect: Mutex::default() }
    }

    /// Of the same side of the triangle, together with `more` of its samples that no pixel has; the fewer there are, the more of other
    /// surfaces of the same material and turned the same way, else of the same material. With indirect light known there, the rest is
    /// of such surfaces, else of all diffuse ones.
    pub fn alike(
        &self,
        seen: &Seen,
        more: Option<Mean>,
        surfaces: &Surfaces,
        indirect: Option<&Indirect>,
    ) -> Option<[f32; 3]> {
        let known_there =
            indirect.and_then(|indirect| Some((indirect.light(seen, surfaces)?, indirect)));
        let here = |kin: Kin| match &known_there {
            Some((there, indirect)) => {
                let direct = self.direct(kin, surfaces, indirect)?;
                Some([0, 1, 2].map(|channel| there[channel] + direct[channel]))
            }
            None => None,
        };
        let of = |kin: Kin| {
            let known = self.kin.get(&kin)?;
            Some(Mean { light: here(kin).unwrap_or(known.mean.light), ..known.mean })
        };
        let own = of(Kin::Side(seen.side()));
        let own = own.zip(more).map(|(own, more)| own.with(more)).or(own).or(more);
        let others = of(Kin::Class(class(seen))).or_else(|| of(Kin::Material(seen.material)));
        let others = others.map(|others| others.light).or_else(|| here(Kin::Diffuse));
        match (own, others) {
            (Some(own), Some(light)) => Some(own.with(Mean { light, samples: FEW }).light),
            (Some(own), None) => Some(own.light),
            (None, others) => others.or(known_there.map(|(there, _)| there)),
        }
    }

    /// What such surfaces have besides indirect light.
    fn direct(&self, of: Kin, surfaces: &Surfaces, indirect: &Indirect) -> Option<[f32; 3]> {
        let known = self.kin.get(&of)?;
        let mut cache = self.indirect.lock().unwrap_or_else(PoisonError::into_inner);
        let mean = cache.entry(of).or_insert_with(|| {
            let lights = known.examples[..known.count].iter();
            let lights = lights
                .filter_map(|&pixel| indirect.light(&surfaces.seen[pixel as usize], surfaces));
            let (mut sum, mut count) = ([0.0_f32; 3], 0.0_f32);
            for light in lights {
                sum = [0, 1, 2].map(|channel| sum[channel] + light[channel]);
                count += 1.0;
            }
            (count > 0.0).then(|| sum.map(|sum| sum / count))
        });
        let mean = (*mean)?;
        Some([0, 1, 2].map(|channel| (known.mean.light[channel] - mean[channel]).max(0.0)))
    }

    /// Whether there are samples of the very side of its triangle.
    pub fn knows(&self, seen: &Seen) -> bool {
        self.kin.contains_key(&Kin::Side(seen.side()))
    }

    /// Luminance of all light in the picture.
    pub fn typical(&self) -> Option<f32> {
        self.kin.get(&Kin::All).map(|known| luminance(known.mean.light))
    }
}

fn class(seen: &Seen) -> Class {
    let round = |normal: Vec3| (normal * STEPS).round().to_array().map(|x| x as i8);
    (seen.material, round(seen.normal))
}
