//! Scenes, closed forms and statistics shared by the tests.
#![allow(clippy::expect_used, reason = "a test fails by it")]
#![allow(dead_code, reason = "each test binary uses a part")]

use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;
use holo_scene::{Bsdf, Material, Scene};
use holo_tracer::{Settings, Tracer};

pub const BLACK: Bsdf = Bsdf::Diffuse { kd: [0.0; 3] };

/// A scene under construction, in world coordinates.
#[derive(Clone, Default)]
pub struct Model {
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    pub ids: Vec<u32>,
    pub materials: Vec<Material>,
    pub sky: [f32; 3],
}

impl Model {
    pub fn material(&mut self, bsdf: Bsdf, emission: [f32; 3]) -> u32 {
        self.materials.push(Material {
            name: "m".into(),
            bsdf,
            emission,
            two_sided_emission: false,
        });
        self.materials.len() as u32 - 1
    }

    pub fn two_sided(&mut self, material: u32) {
        self.materials[material as usize].two_sided_emission = true;
    }

    /// Adds a polygon. Its front is the side from which the corners appear counter-clockwise.
    pub fn polygon(&mut self, corners: &[[f64; 3]], material: u32) {
        let base = self.positions.len() as u32;
        self.positions.extend(corners.iter().map(|&c| DVec3::from_array(c)));
        for i in 1..corners.len() as u32 - 1 {
            self.triangles.push([base, base + i, base + i + 1]);
            self.ids.push(material);
        }
    }

    /// Adds a square of half width `h` at height `z` that faces up or down.
    pub fn square(&mut self, z: f64, h: f64, up: bool, material: u32) {
        let mut corners = [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]];
        if !up {
            corners.reverse();
        }
        self.polygon(&corners, material);
    }

    /// Adds the six faces of a box, which face outwards or inwards.
    pub fn cuboid(&mut self, low: [f64; 3], high: [f64; 3], outwards: bool, material: u32) {
        for axis in 0..3 {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            for (level, positive) in [(low[axis], false), (high[axis], true)] {
                let corner = |a: f64, b: f64| {
                    let mut c = [0.0; 3];
                    (c[axis], c[j], c[k]) = (level, a, b);
                    c
                };
                let mut q = [
                    corner(low[j], low[k]),
                    corner(high[j], low[k]),
                    corner(high[j], high[k]),
                    corner(low[j], high[k]),
                ];
                if positive != outwards {
                    q.reverse();
                }
                self.polygon(&q, material);
            }
        }
    }

    pub fn scene(&self) -> Arc<Scene> {
        let (scene, dropped) = Scene::from_world(
            &self.positions,
            &self.triangles,
            &self.ids,
            self.materials.clone(),
            self.sky,
        )
        .expect("a valid scene");
        assert!(dropped.is_empty());
        Arc::new(scene)
    }

    pub fn tracer(&self, bounces: Option<u32>) -> Tracer {
        Tracer::new(self.scene(), Settings { bounces, paths: 1 }).expect("a tracer")
    }
}

/// Mean and standard error of estimates, by channel.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: [f64; 3],
    pub error: [f64; 3],
}

pub fn estimate(tracer: &Tracer, origin: DVec3, direction: DVec3, paths: u64) -> Estimate {
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    for seed in 0..paths {
        let traced = tracer.trace(origin, direction.normalize(), seed);
        for c in 0..3 {
            let x = f64::from(traced.radiance[c]);
            sum[c] += x;
            squares[c] += x * x;
        }
    }
    assert_eq!(tracer.nonfinite_paths(), 0);
    let n = paths as f64;
    let mean = sum.map(|s| s / n);
    let error =
        [0, 1, 2].map(|c| ((squares[c] / n - mean[c] * mean[c]).max(0.0) / (n - 1.0)).sqrt());
    Estimate { mean, error }
}

/// Checks that the estimate's expectation is `expected` within 4.5 standard errors, which fails by
/// chance once in 150,000. Estimates without variance may differ by the f32 rounding of about
/// twelve operations.
#[track_caller]
pub fn expect(estimate: Estimate, expected: [f64; 3]) {
    for c in 0..3 {
        let difference = (estimate.mean[c] - expected[c]).abs();
        let bound = 4.5 * estimate.error[c] + 3e-6 * expected[c];
        assert!(difference <= bound, "channel {c}: {estimate:?} is not {expected:?}");
    }
}

/// Returns the form factor of a polygon seen from a surface element at `x` with normal `n` (Lambert
/// 1760). This is the share of the cosine-weighted hemisphere that the polygon covers. The polygon
/// must be wholly above the element's plane.
pub fn form_factor(corners: &[[f64; 3]], x: DVec3, n: DVec3) -> f64 {
    let v: Vec<DVec3> = corners.iter().map(|&c| (DVec3::from_array(c) - x).normalize()).collect();
    let sum: f64 = (0..v.len())
        .map(|i| {
            let (a, b) = (v[i], v[(i + 1) % v.len()]);
            a.dot(b).clamp(-1.0, 1.0).acos() * a.cross(b).normalize_or_zero().dot(n)
        })
        .sum();
    (sum / (2.0 * PI)).abs()
}

/// Returns the share of unpolarised light that a smooth boundary reflects.
pub fn fresnel(cosine: f64, eta: f64) -> f64 {
    polarized(cosine, eta).iter().sum::<f64>() / 2.0
}

/// Returns the shares of both polarizations that a smooth boundary reflects, from Fresnel's
/// equations with angles.
fn polarized(cosine: f64, eta: f64) -> [f64; 2] {
    let (i, sin_t) = (cosine.acos(), cosine.acos().sin() / eta);
    if sin_t >= 1.0 {
        return [1.0; 2];
    }
    if i == 0.0 {
        return [((eta - 1.0) / (eta + 1.0)).powi(2); 2];
    }
    let t = sin_t.asin();
    [(i - t).sin() / (i + t).sin(), (i - t).tan() / (i + t).tan()]
        .map(|amplitude| amplitude.powi(2))
}

/// Returns the share of unpolarised light that a clear pane reflects, with all orders of reflection
/// between its faces. Each polarization stays what it is.
pub fn pane_reflects(cosine: f64, eta: f64) -> f64 {
    let orders = |r: f64| (0..400).map(|k| r.powi(2 * k)).sum::<f64>();
    let of = |r: f64| if r < 1.0 { r + (1.0 - r).powi(2) * r * orders(r) } else { 1.0 };
    polarized(cosine, eta).map(of).iter().sum::<f64>() / 2.0
}
