//! Tests of every material: samples follow the stated density, weights are values over densities,
//! and scattering is reciprocal.

use std::f32::consts::PI;

use glam::Vec3;
use holo_scene::Bsdf;

use crate::bsdf::{Scatter, Tables};
use crate::sampler::Sampler;

fn prepared(bsdf: &Bsdf) -> Scatter {
    Scatter::new(bsdf, &mut Tables::default())
}

const COLOUR: [f32; 3] = [0.9, 0.5, 0.2];

/// Materials with a density, each with a name.
fn materials() -> Vec<(String, Scatter)> {
    let mut all = vec![("diffuse".into(), prepared(&Bsdf::Diffuse { kd: COLOUR }))];
    for alpha in [0.1, 0.25, 0.5, 1.0] {
        all.push((format!("conductor {alpha}"), prepared(&Bsdf::Conductor { ks: COLOUR, alpha })));
        let bsdf = Bsdf::Coated { kd: COLOUR, ks: [0.8; 3], ior: 1.5, alpha };
        all.push((format!("coated {alpha}"), prepared(&bsdf)));
        let bsdf = Bsdf::Dielectric { ior: 1.5, transmittance: COLOUR, alpha };
        all.push((format!("rough glass {alpha}"), prepared(&bsdf)));
    }
    all
}

fn direction(theta: f32, phi: f32) -> Vec3 {
    Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// From normal incidence to grazing.
const ANGLES: [f32; 5] = [0.02, 0.5, 1.0, 1.4, 1.54];
const THETAS: usize = 48;
const PHIS: usize = 32;

/// Returns expected counts of a grid of directions over the sphere, by the midpoint rule within its
/// cells.
///
/// Each cell has `sub` points by polar angle: 12 resolve lobes down to alpha 0.25. It has four
/// times as many by azimuth at grazing angles, where a lobe is only alpha times the sum of both
/// elevations wide.
fn expected(scatter: &Scatter, wo: Vec3, front: bool, samples: f64, sub: usize) -> Vec<f64> {
    let around = if wo.z < 0.1 { 4 * sub } else { sub };
    let (dt, dp) = (PI / (THETAS * sub) as f32, 2.0 * PI / (PHIS * around) as f32);
    let mut cells = vec![0.0; THETAS * PHIS];
    for i in 0..THETAS * sub {
        let theta = (i as f32 + 0.5) * dt;
        for j in 0..PHIS * around {
            let (_, pdf) = scatter.evaluate(wo, direction(theta, (j as f32 + 0.5) * dp), front);
            cells[i / sub * PHIS + j / around] += f64::from(pdf * theta.sin() * dt * dp) * samples;
        }
    }
    cells
}

#[test]
fn samples_follow_the_stated_density() {
    let samples = 100_000;
    for (name, scatter) in materials() {
        let sub = if name.ends_with("0.1") { 24 } else { 12 };
        for theta in ANGLES {
            // Opaque materials are the same on both sides.
            for &front in if scatter.transmits() { &[true, false][..] } else { &[true] } {
                let wo = direction(theta, 0.7);
                let expected = expected(&scatter, wo, front, f64::from(samples), sub);
                let mut counts = vec![0_u32; expected.len()];
                let mut sampler = Sampler::new(17, 0);
                let mut absorbed = 0;
                for _ in 0..samples {
                    match scatter.sample(wo, front, &mut sampler) {
                        None => absorbed += 1,
                        Some(s) => {
                            let i = (s.wi.z.clamp(-1.0, 1.0).acos() / PI * THETAS as f32) as usize;
                            let phi = s.wi.y.atan2(s.wi.x).rem_euclid(2.0 * PI);
                            let j = (phi / (2.0 * PI) * PHIS as f32) as usize;
                            counts[i.min(THETAS - 1) * PHIS + j.min(PHIS - 1)] += 1;
                        }
                    }
                }
                // The density integrates to the probability that a direction is made; 1e-3 for the
                // midpoint rule.
                let made = f64::from(samples - absorbed);
                let integral: f64 = expected.iter().sum();
                let sigma = (made * f64::from(absorbed) / f64::from(samples)).sqrt();
                let bound = 4.5 * sigma + 1e-3 * f64::from(samples);
                assert!(
                    (made - integral).abs() <= bound,
                    "{name} {theta} {front}: {made}, {integral}"
                );
                // Cells with few samples are pooled with the absorbed samples, which are what the
                // density lacks of 1.
                let (mut pooled, mut pooled_expected) =
                    (f64::from(absorbed), f64::from(samples) - expected.iter().sum::<f64>());
                let (mut chi2, mut degrees) = (0.0_f64, 0.0_f64);
                for (&count, &e) in counts.iter().zip(&expected) {
                    if e < 10.0 {
                        pooled += f64::from(count);
                        pooled_expected += e;
                    } else {
                        chi2 += (f64::from(count) - e).powi(2) / e;
                        degrees += 1.0;
                    }
                }
                if pooled_expected >= 10.0 {
                    chi2 += (pooled - pooled_expected).powi(2) / pooled_expected;
                } else {
                    // A share too small for chi²: use Poisson's distribution, with a margin of 1e-4
                    // for the midpoint rule.
                    degrees -= 1.0;
                    assert!(
                        pooled < 10.0 + 4.5 * 10.0_f64.sqrt() + 1e-4 * f64::from(samples),
                        "{name} {theta}: {pooled}"
                    );
                }
                // The cube root of chi² over its degrees is nearly normal (Wilson and Hilferty
                // 1931). With 85 cases at 4.5 sigma, one of 3,400 sets of seeds fails by chance;
                // the seeds are fixed.
                let v = 2.0 / (9.0 * degrees.max(1.0));
                let z = ((chi2 / degrees.max(1.0)).cbrt() - (1.0 - v)) / v.sqrt();
                assert!(
                    z < 4.5,
                    "{name}, angle {theta}, front {front}: chi² {chi2} of {degrees}, z {z}"
                );
            }
        }
    }
}

#[test]
fn weights_are_values_over_densities_of_the_same_direction() {
    for (name, scatter) in materials() {
        for theta in ANGLES {
            let wo = direction(theta, 2.0);
            let mut sampler = Sampler::new(18, 0);
            for front in [true, false] {
                for _ in 0..2_000 {
                    let Some(s) = scatter.sample(wo, front, &mut sampler) else { continue };
                    let (value, pdf) = scatter.evaluate(wo, s.wi, front);
                    let stated = s.pdf.unwrap_or(0.0);
                    // At alpha 0.1, a half vector's rounding of 1e-7 changes the density by about
                    // 1e-4 of it. The change is greater near grazing angles and where refraction
                    // turns into total reflection.
                    if s.wi.z.abs() < 0.02 || stated < 1e-3 {
                        continue;
                    }
                    assert!(
                        (pdf - stated).abs() < 5e-3 * stated,
                        "{name} {theta} {front}: {pdf} {stated} {s:?}"
                    );
                    let difference = (value - s.weight * stated).abs().max_element();
                    assert!(
                        difference < 1e-2 * value.max_element(),
                        "{name} {theta} {front}: {value} {s:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn scattering_is_reciprocal() {
    let mut sampler = Sampler::new(19, 0);
    for (name, scatter) in materials() {
        for _ in 0..2_000 {
            let mut draw = || direction(1.45 * sampler.one(), 2.0 * PI * sampler.one());
            let (a, b) = (draw(), draw());
            let (there, _) = scatter.evaluate(a, b, true);
            let (back, _) = scatter.evaluate(b, a, true);
            let (there, back) = (there / b.z, back / a.z);
            assert!(
                (there - back).abs().max_element() <= 2e-4 * there.max_element() + 1e-6,
                "{name}: {there} {back}"
            );
            if scatter.transmits() {
                // f(wo, wi) n_wi² = f(wi, wo) n_wo² (Veach 1997, §5.2), here with n_wi = 1.5 and
                // n_wo = 1.
                let flip = Vec3::new(1.0, 1.0, -1.0);
                let (there, _) = scatter.evaluate(a, b * flip, true);
                let (back, _) = scatter.evaluate(b, a * flip, false);
                let (there, back) = (there / b.z * 2.25, back / a.z);
                assert!(
                    (there - back).abs().max_element() <= 2e-3 * there.max_element() + 1e-5,
                    "{name}: {there} {back}"
                );
            }
        }
    }
}
