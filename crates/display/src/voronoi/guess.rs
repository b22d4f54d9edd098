//! Light of surfaces that have no sample near: that of the same side of the triangle elsewhere in the picture, else of others of the same
//! material, turned the same way.
//!
//! Invariant: sums are of integers, pixel by pixel, so that no order changes a bit.

use super::deposit::{Sums, luminance};
use super::surfaces::{SKY, Seen, Surfaces};
use glam::Vec3;
use std::collections::HashMap;

/// Steps of a normal's coordinates: those of one class are within about 40° of each other.
const STEPS: f32 = 1.5;

type Class = (u32, [i8; 3]);

/// Mean light by classes of surfaces.
pub(crate) struct Guesses {
    sides: HashMap<(u32, bool), [f32; 3]>,
    classes: HashMap<Class, [f32; 3]>,
    materials: HashMap<u32, [f32; 3]>,
    typical: Option<f32>,
}

#[derive(Clone, Copy, Default)]
struct Total {
    light: [u128; 3],
    weight: u128,
}

impl Total {
    fn add(&mut self, sums: &Sums) {
        for (total, sum) in self.light.iter_mut().zip(sums.light) {
            *total += u128::from(sum);
        }
        self.weight += u128::from(sums.weight);
    }

    fn mean(&self) -> [f32; 3] {
        self.light.map(|sum| (sum as f64 / self.weight.max(1) as f64) as f32)
    }
}

impl Guesses {
    pub fn new(surfaces: &Surfaces, sums: &[Sums]) -> Guesses {
        let mut sides: HashMap<(u32, bool), Total> = HashMap::new();
        let mut classes: HashMap<Class, Total> = HashMap::new();
        let mut materials: HashMap<u32, Total> = HashMap::new();
        let mut all = Total::default();
        for (seen, sums) in surfaces.seen.iter().zip(sums) {
            if seen.triangle != SKY && sums.weight > 0 {
                sides.entry(seen.side()).or_default().add(sums);
                classes.entry(class(seen)).or_default().add(sums);
                materials.entry(seen.material).or_default().add(sums);
                all.add(sums);
            }
        }
        Guesses {
            sides: sides.into_iter().map(|(side, total)| (side, total.mean())).collect(),
            classes: classes.into_iter().map(|(class, total)| (class, total.mean())).collect(),
            materials: materials.into_iter().map(|(material, total)| (material, total.mean())).collect(),
            typical: (all.weight > 0).then(|| luminance(all.mean())),
        }
    }

    /// Of the same side of the triangle, else of the same material and turned the same way, else of the same material.
    pub fn alike(&self, seen: &Seen) -> Option<[f32; 3]> {
        let side = self.sides.get(&seen.side());
        let light = side.or_else(|| self.classes.get(&class(seen)));
        light.or_else(|| self.materials.get(&seen.material)).copied()
    }

    /// Whether there are samples of the very side of its triangle.
    pub fn knows(&self, seen: &Seen) -> bool {
        self.sides.contains_key(&seen.side())
    }

    /// Luminance of all light in the picture.
    pub fn typical(&self) -> Option<f32> {
        self.typical
    }
}

fn class(seen: &Seen) -> Class {
    let round = |normal: Vec3| (normal * STEPS).round().to_array().map(|x| x as i8);
    (seen.material, round(seen.normal))
}
