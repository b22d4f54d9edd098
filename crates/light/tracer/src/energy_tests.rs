//! Tests that white materials return all light, within 4.5 standard errors and the stated error of
//! the tables, and that coloured ones return less.

use glam::Vec3;
use holo_scene::Bsdf;

use crate::albedo::{AlbedoTable, over_normals};
use crate::bsdf::{Scatter, Tables};
use crate::sampler::Sampler;
use holo_optics::{Ggx, dielectric, reflect};

fn prepared(bsdf: &Bsdf) -> Scatter {
    Scatter::new(bsdf, &mut Tables::default())
}

const WHITE: [f32; 3] = [1.0; 3];
const ALPHAS: [f32; 6] = [1e-3, 0.05, 0.2, 0.4, 0.7, 1.0];
/// From normal incidence to grazing angles, where a rough surface loses most.
const ANGLES: [f32; 6] = [0.0, 0.5, 1.0, 1.4, 1.54, 1.57];
/// The error that `albedo` states for its tables.
const TABLE_ERROR: f64 = 5e-4;

fn direction(theta: f32) -> Vec3 {
    Vec3::new(theta.sin(), 0.0, theta.cos())
}

/// Returns mean and standard error of the share of flux that is scattered, in the first channel.
fn albedo(scatter: &Scatter, theta: f32, front: bool) -> (f64, f64) {
    let samples = 40_000;
    let mut sampler = Sampler::new(20, u64::from(theta.to_bits()));
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..samples {
        let sampled = scatter.sample(direction(theta), front, &mut sampler);
        // Radiance in glass is greater; eta2 turns it into flux.
        let w = sampled.map_or(0.0, |s| f64::from(s.weight.x * s.eta2));
        sum += w;
        squares += w * w;
    }
    let n = f64::from(samples);
    (sum / n, ((squares / n - (sum / n).powi(2)).max(0.0) / n).sqrt())
}

#[test]
fn white_materials_return_all_light_at_every_roughness_and_angle() {
    // 6 roughnesses, 6 angles, 5 kinds, 2 sides at 4.5 sigma: by chance once in 400 sets of seeds,
    // and the seeds are fixed.
    for alpha in ALPHAS {
        for bsdf in [
            Bsdf::Conductor { ks: WHITE, alpha },
            Bsdf::Dielectric { ior: 1.5, transmittance: WHITE, alpha },
            Bsdf::Dielectric { ior: 1.1, transmittance: WHITE, alpha },
            Bsdf::Dielectric { ior: 2.4, transmittance: WHITE, alpha },
            Bsdf::Coated { kd: WHITE, ks: WHITE, ior: 1.5, alpha },
        ] {
            let scatter = prepared(&bsdf);
            for theta in ANGLES {
                for front in [true, false] {
                    let (share, error) = albedo(&scatter, theta, front);
                    let difference = (share - 1.0).abs();
                    assert!(
                        difference <= 4.5 * error + TABLE_ERROR,
                        "{bsdf:?} {theta} {front}: {share} ± {error}"
                    );
                }
            }
        }
    }
}

#[test]
fn smooth_boundaries_return_all_light() {
    for bsdf in [
        Bsdf::Mirror { ks: WHITE },
        Bsdf::ThinGlass { ior: 1.5, transmittance: WHITE },
        Bsdf::Dielectric { ior: 1.5, transmittance: WHITE, alpha: 0.0 },
        Bsdf::Dielectric { ior: 1.0, transmittance: WHITE, alpha: 0.0 },
    ] {
        let scatter = prepared(&bsdf);
        for theta in ANGLES {
            for front in [true, false] {
                let (share, error) = albedo(&scatter, theta, front);
                // Every weight is 1 to a few roundings.
                assert!(
                    (share - 1.0).abs() < 1e-6 && error < 1e-6,
                    "{bsdf:?} {theta} {front}: {share} ± {error}"
                );
            }
        }
    }
}

#[test]
fn a_coat_adds_its_reflection_to_a_coloured_base_and_never_makes_light() {
    for alpha in ALPHAS {
        let mut tables = Tables::default();
        let coated = [0.0, 0.5].map(|kd| {
            let bsdf = Bsdf::Coated { kd: [kd; 3], ks: WHITE, ior: 1.5, alpha };
            Scatter::new(&bsdf, &mut tables)
        });
        for theta in ANGLES {
            let [(black, black_error), (grey, grey_error)] =
                coated.each_ref().map(|scatter| albedo(scatter, theta, true));
            // The base is linear in kd, and all light at 1: grey lies in the middle.
            let error = 0.5 * black_error + grey_error;
            assert!(
                (grey - 0.5 * (1.0 + black)).abs() <= 4.5 * error + TABLE_ERROR,
                "{alpha} {theta}: {grey} {black}"
            );
            assert!(black > 0.0 && black < 1.0);
        }
    }
}

#[test]
fn a_smooth_coat_on_black_reflects_four_percent_at_normal_incidence() {
    let scatter = prepared(&Bsdf::Coated { kd: [0.0; 3], ks: WHITE, ior: 1.5, alpha: 1e-3 });
    let (share, error) = albedo(&scatter, 0.0, true);
    assert!((share - 0.04).abs() <= 4.5 * error + 1e-5, "{share} ± {error}");
}

/// Returns the directional albedo of light that meets one facet of a white metal. Computed in f64
/// with angles from Walter et al. 2007, eqs. 20 and 33, and Heitz 2014, eq. 99, and integrated over
/// the hemisphere.
fn textbook_albedo(alpha: f64, theta: f32) -> f64 {
    let o = direction(theta).as_dvec3();
    let lambda = |z: f64| 0.5 * ((1.0 + alpha * alpha * (1.0 - z * z) / (z * z)).sqrt() - 1.0);
    let (steps, mut sum) = (600, 0.0);
    for i in 0..steps {
        let t = (f64::from(i) + 0.5) / f64::from(steps) * std::f64::consts::FRAC_PI_2;
        for j in 0..steps {
            let p = (f64::from(j) + 0.5) / f64::from(steps) * std::f64::consts::TAU;
            let wi = glam::DVec3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos());
            let m = (o + wi).normalize();
            let c2 = m.z * m.z;
            let tan2 = (1.0 - c2) / c2;
            let d =
                alpha * alpha / (std::f64::consts::PI * c2 * c2 * (alpha * alpha + tan2).powi(2));
            sum += d / (1.0 + lambda(o.z) + lambda(wi.z)) / (4.0 * o.z) * t.sin();
        }
    }
    sum * std::f64::consts::FRAC_PI_2 * std::f64::consts::TAU / f64::from(steps * steps)
}

#[test]
fn light_from_one_facet_matches_the_integral_of_the_textbook_formula() {
    for alpha in [0.2_f32, 0.5, 1.0] {
        let ggx = Ggx::new(alpha);
        for theta in [0.02, 0.5, 1.0, 1.4] {
            let share = over_normals(ggx, direction(theta).z, |wo, m| {
                let wi = reflect(wo, m);
                if wi.z > 0.0 { ggx.shadowing(wo, wi) } else { 0.0 }
            });
            let exact = textbook_albedo(alpha.into(), theta);
            // Both are midpoint rules.
            assert!((share - exact).abs() < 3e-4, "{alpha} {theta}: {share}, {exact}");
        }
    }
}

#[test]
fn a_coloured_metal_is_more_saturated_the_rougher_it_is() {
    // The geometric series of Kulla and Conty is E + (1 - E) ks² (1 - L̄) / (1 - ks L̄), where E is
    // the share of light that meets one facet.
    let ks = 0.5;
    let mut last = 0.51;
    for alpha in [0.05_f32, 0.5, 1.0] {
        let scatter = prepared(&Bsdf::Conductor { ks: [ks; 3], alpha });
        let (share, error) = albedo(&scatter, 1.0, true);
        let ggx = Ggx::new(alpha);
        let loss = |cosine| {
            over_normals(ggx, cosine, |wo, m| {
                let wi = reflect(wo, m);
                if wi.z > 0.0 { 1.0 - ggx.shadowing(wo, wi) } else { 1.0 }
            })
        };
        let steps = 400;
        let mean = (0..steps).map(|i| loss(((i as f32 + 0.5) / steps as f32).sqrt())).sum::<f64>()
            / f64::from(steps);
        let lost = loss(direction(1.0).z);
        let ks = f64::from(ks);
        let expected = ks * (1.0 - lost) + lost * ks * ks * (1.0 - mean) / (1.0 - ks * mean);
        assert!(
            (share - expected).abs() <= 4.5 * error + 1e-3,
            "{alpha}: {share} ± {error}, {expected}"
        );
        assert!(share < last);
        last = share;
    }
}

#[test]
fn tables_are_as_exact_as_stated() {
    for alpha in [1e-3_f32, 0.05, 0.4, 1.0] {
        let ggx = Ggx::new(alpha);
        let f = |wo: Vec3, m: Vec3| {
            let wi = reflect(wo, m);
            let share = if wi.z > 0.0 { ggx.shadowing(wo, wi) } else { 0.0 };
            share * dielectric(wo.dot(m).max(0.0), 1.5).0
        };
        let table = AlbedoTable::new(ggx, |cosine| over_normals(ggx, cosine, f));
        for i in (1..100).step_by(3) {
            // Fourth powers put most of them close to grazing angles.
            let cosine = (i as f32 / 100.0).powi(4);
            let wo = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
            let (around, outwards, mut sum) = (200, 1000, 0.0);
            for k in 0..around * outwards {
                let s = ((k / around) as f32 + 0.5) / outwards as f32;
                let u = [((k % around) as f32 + 0.5) / around as f32, 1.0 - s * s * s];
                sum += f64::from(f(wo, ggx.sample(wo, u)) * 3.0 * s * s);
            }
            let exact = sum / f64::from(around * outwards);
            let found = f64::from(table.at(cosine));
            assert!((found - exact).abs() < TABLE_ERROR, "{alpha} {cosine}: {found}, {exact}");
        }
    }
}
