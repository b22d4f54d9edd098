//! Choosing points on lights, and the density with which a direction would have been chosen.
//!
//! Always true: the density per area of a point on an emitter is the same for all points of one material (power over area
//! is luminance), so a hit needs no search for its light; every triangle that emits can be chosen.

use holo_raycast::{Raycaster, SurfacePoint};
use holo_scene::Scene;

use crate::geometry::triangle;
use crate::sampler::Sampler;

/// What to sample: a table over emitting triangles by power, and the sky.
#[derive(Debug)]
pub(crate) struct Lights {
    triangles: Vec<u32>,
    table: Alias,
    /// Density per area of being chosen, by material, given that an emitter is chosen; 0 where nothing is emitted.
    density: Vec<f32>,
    /// Probability of choosing the sky rather than an emitter.
    pub sky: f32,
}

/// Radiance-weighted luminance as in Radiance's photopic weights.
pub(crate) fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.265 * r + 0.670 * g + 0.065 * b
}

impl Lights {
    pub(crate) fn new(scene: &Scene) -> Self {
        let strength: Vec<f64> = scene
            .materials
            .iter()
            .map(|m| f64::from(luminance(m.emission)) * if m.two_sided_emission { 2.0 } else { 1.0 })
            .collect();
        let of = |t: u32| strength[scene.material_ids[t as usize] as usize];
        let triangles: Vec<u32> = scene.emitters().filter(|&t| of(t) > 0.0).collect();
        let powers: Vec<f64> = triangles.iter().map(|&t| of(t) * scene.area(t)).collect();
        let total: f64 = powers.iter().sum();
        let density = strength.iter().map(|s| if total > 0.0 { (s / total) as f32 } else { 0.0 }).collect();
        let has_sky = luminance(scene.sky) > 0.0;
        let sky = match (has_sky, triangles.is_empty()) {
            (false, _) => 0.0,
            (true, true) => 1.0,
            // Which of them a surface sees is unknown.
            (true, false) => 0.5,
        };
        Self { table: Alias::new(&powers), triangles, density, sky }
    }

    /// Whether there is anything to sample.
    pub(crate) fn any(&self) -> bool {
        self.sky > 0.0 || !self.triangles.is_empty()
    }

    /// A point on an emitter, chosen by power and then uniformly by area. Density: [`density`](Self::density).
    #[inline]
    pub(crate) fn point(&self, raycaster: &Raycaster, sampler: &mut Sampler) -> SurfacePoint {
        let chosen = self.triangles[self.table.choose(sampler.fine())];
        let (u, v) = triangle(sampler.two());
        raycaster.surface(chosen, u, v)
    }

    /// Density per area at a point of a material's emitters, with the choice between sky and emitters.
    #[inline]
    pub(crate) fn density(&self, material: u32) -> f32 {
        self.density[material as usize] * (1.0 - self.sky)
    }
}

/// Constant-time choice by weight (Vose 1991, "A linear algorithm for generating random numbers with a given distribution").
#[derive(Debug)]
struct Alias {
    /// Probability of keeping the column, and what to choose otherwise.
    columns: Vec<(f32, u32)>,
}

impl Alias {
    fn new(weights: &[f64]) -> Self {
        let mean = weights.iter().sum::<f64>() / weights.len() as f64;
        let mut scaled: Vec<f64> = weights.iter().map(|w| w / mean).collect();
        let mut columns: Vec<(f32, u32)> = (0..weights.len() as u32).map(|i| (1.0, i)).collect();
        let (mut small, mut large): (Vec<u32>, Vec<u32>) =
            (0..weights.len() as u32).partition(|&i| scaled[i as usize] < 1.0);
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            columns[s as usize] = (scaled[s as usize] as f32, l);
            scaled[l as usize] -= 1.0 - scaled[s as usize];
            if scaled[l as usize] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        Self { columns }
    }

    #[inline]
    fn choose(&self, uniform: f64) -> usize {
        let at = uniform * self.columns.len() as f64;
        let i = (at as usize).min(self.columns.len() - 1);
        let (probability, other) = self.columns[i];
        if ((at - i as f64) as f32) < probability { i } else { other as usize }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_chooses_in_proportion_to_weight() {
        let weights = [0.5, 3.0, 0.0, 1.0, 1e-3, 7.0, 1.0];
        let table = Alias::new(&weights);
        let n = 1_000_000;
        let mut counts = [0_u32; 7];
        let mut sampler = Sampler::new(3, 0);
        for _ in 0..n {
            counts[table.choose(sampler.fine())] += 1;
        }
        let total: f64 = weights.iter().sum();
        for (weight, count) in weights.iter().zip(counts) {
            let p = weight / total;
            let sigma = (f64::from(n) * p * (1.0 - p)).sqrt();
            assert!((f64::from(count) - f64::from(n) * p).abs() <= 4.5 * sigma, "{weight}: {count}");
        }
    }
}
