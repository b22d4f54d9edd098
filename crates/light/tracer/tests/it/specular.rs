//! Tests mirrors, panes and solid glass against closed forms.

use std::f64::consts::PI;

use crate::common::{BLACK, Model, estimate, expect, fresnel, pane_reflects};
use glam::DVec3;
use holo_scene::Bsdf;

const LE: [f32; 3] = [3.0, 5.0, 7.0];
const TF: [f32; 3] = [0.9, 0.6, 0.3];

fn scaled(colour: [f32; 3], by: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| f64::from(colour[c]) * by[c])
}

#[test]
fn a_mirror_shows_its_colour_times_the_light_without_noise() {
    for up in [true, false] {
        let mut model = Model::default();
        let mirror = model.material(Bsdf::Mirror { ks: TF }, [0.0; 3]);
        let light = model.material(BLACK, LE);
        model.square(0.0, 5.0, up, mirror);
        model.square(4.0, 50.0, false, light);
        let traced =
            model.tracer(Some(0)).trace(DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.6, 0.0, -0.8), 1);
        for c in 0..3 {
            assert!((traced.radiance[c] - TF[c] * LE[c]).abs() < 1e-6 * LE[c]);
        }
        assert!((traced.distance - 1.25).abs() < 1e-6);
    }
}

#[test]
fn mirrors_do_not_count_as_bounces_and_chains_of_perfect_mirrors_end() {
    // Two perfect mirrors face each other, slightly inclined to the ray, which reaches the light
    // after a dozen reflections.
    let mut model = Model::default();
    let mirror = model.material(Bsdf::Mirror { ks: [1.0; 3] }, [0.0; 3]);
    let light = model.material(BLACK, LE);
    model.square(0.0, 5.0, true, mirror);
    model.square(1.0, 5.0, false, mirror);
    model.polygon(&[[6.0, -9.0, -5.0], [6.0, -9.0, 5.0], [6.0, 9.0, 5.0], [6.0, 9.0, -5.0]], light);
    let (eye, direction) = (DVec3::new(-4.5, 0.0, 0.5), DVec3::new(1.0, 0.0, 1.2));
    expect(estimate(&model.tracer(Some(0)), eye, direction, 20_000), scaled(LE, [1.0; 3]));

    // A closed box of perfect mirrors without light: only roulette ends a path.
    let mut closed = Model::default();
    let mirror = closed.material(Bsdf::Mirror { ks: [1.0; 3] }, [0.0; 3]);
    closed.cuboid([-1.0; 3], [1.0; 3], false, mirror);
    assert_eq!(
        estimate(&closed.tracer(None), DVec3::splat(0.1), DVec3::new(0.3, 0.5, 0.7), 2_000).mean,
        [0.0; 3]
    );
}

#[test]
fn a_pane_transmits_and_reflects_its_series_of_fresnel_terms() {
    let ior = 1.52;
    for cosine in [1.0, 0.7, 0.3, 0.1] {
        let sine = (1.0_f64 - cosine * cosine).sqrt();
        let direction = DVec3::new(sine, 0.0, -cosine);
        let back = pane_reflects(cosine, f64::from(1.52_f32));
        let through = 1.0 - back;

        // Light behind the pane is coloured; reflected light from behind the eye is not.
        for (height, up, expected) in [
            (-1.0, true, scaled(LE, TF.map(|t| f64::from(t) * through))),
            (3.0, false, scaled(LE, [back; 3])),
        ] {
            let mut model = Model::default();
            let pane = model.material(Bsdf::ThinGlass { ior, transmittance: TF }, [0.0; 3]);
            let light = model.material(BLACK, LE);
            model.square(0.0, 50.0, true, pane);
            model.square(height, 500.0, up, light);
            expect(estimate(&model.tracer(Some(0)), DVec3::Z, direction, 40_000), expected);
        }
    }
}

#[test]
fn light_through_a_pane_reaches_a_floor_by_the_material_alone() {
    // Floor, pane above it, sky: kd S Tf times the cosine-weighted mean of the pane's transmission.
    let kd = [0.8, 0.5, 0.2];
    let mut model = Model { sky: [1.0, 2.0, 3.0], ..Model::default() };
    let floor = model.material(Bsdf::Diffuse { kd }, [0.0; 3]);
    let pane = model.material(Bsdf::ThinGlass { ior: 1.5, transmittance: TF }, [0.0; 3]);
    model.square(0.0, 20_000.0, true, floor);
    model.square(1.0, 10_000.0, true, pane);
    let steps = 10_000;
    let mean: f64 = (0..steps)
        .map(|i| {
            // Uniform in the square of the cosine.
            let cosine = ((f64::from(i) + 0.5) / f64::from(steps)).sqrt();
            (1.0 - pane_reflects(cosine, 1.5)) / f64::from(steps)
        })
        .sum();
    // The horizontal illuminance under a pane, below an even sky of radiance 1.
    assert!((PI * mean - 2.6733).abs() < 1e-3, "{mean}");
    let expected =
        [0, 1, 2].map(|c| f64::from(kd[c]) * f64::from(model.sky[c]) * f64::from(TF[c]) * mean);
    let direction = DVec3::new(0.3, 0.2, -1.0);
    // The eye is below the pane. With direct light alone, light that the pane reflects back to the
    // floor is a bounce and does not count.
    expect(
        estimate(&model.tracer(Some(0)), DVec3::new(0.0, 0.0, 0.5), direction, 60_000),
        expected,
    );
}

#[test]
fn a_solid_slab_transmits_its_series_and_colours_each_boundary() {
    for cosine in [1.0, 0.6, 0.3] {
        let sine = (1.0_f64 - cosine * cosine).sqrt();
        let direction = DVec3::new(sine, 0.0, -cosine);
        let r = fresnel(cosine, 1.5);
        let through = (1.0 - r).powi(2) / (1.0 - r * r);
        let mut model = Model::default();
        let glass =
            model.material(Bsdf::Dielectric { ior: 1.5, transmittance: TF, alpha: 0.0 }, [0.0; 3]);
        let light = model.material(BLACK, LE);
        // So thin that light cannot leave at the sides within many reflections.
        model.cuboid([-500.0, -500.0, -0.25], [500.0, 500.0, 0.0], true, glass);
        model.square(-3.0, 500.0, true, light);
        let expected = scaled(LE, TF.map(|t| f64::from(t) * f64::from(t) * through));
        expect(estimate(&model.tracer(Some(0)), DVec3::Z, direction, 40_000), expected);
    }
}

#[test]
fn radiance_in_glass_is_greater_by_the_square_of_the_index() {
    // Under an even sky, clear glass is invisible from outside. Inside, every direction that leads
    // out has n² times the radiance.
    let mut model = Model { sky: [1.0, 2.0, 4.0], ..Model::default() };
    let glass = model
        .material(Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 }, [0.0; 3]);
    model.cuboid([-1.0; 3], [1.0; 3], true, glass);
    let tracer = model.tracer(None);
    let outside = DVec3::new(3.0, 2.0, 2.5);
    for target in [DVec3::ZERO, DVec3::new(0.5, 0.3, 0.2)] {
        // All error is by roulette, which ends about one path in 25,000. With fewer paths it might
        // end none, and the standard error would be 0.
        expect(estimate(&tracer, outside, target - outside, 1_000_000), [1.0, 2.0, 4.0]);
    }
    expect(estimate(&tracer, DVec3::ZERO, DVec3::new(0.1, 0.2, 1.0), 40_000), [2.25, 4.5, 9.0]);
}

#[test]
fn frosted_glass_under_an_even_sky_is_invisible() {
    let mut model = Model { sky: [1.0; 3], ..Model::default() };
    for alpha in [0.1, 0.5, 1.0] {
        let glass =
            model.material(Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha }, [0.0; 3]);
        model.triangles.clear();
        model.ids.clear();
        model.cuboid([-1.0; 3], [1.0; 3], true, glass);
        let outside = DVec3::new(3.0, 2.0, 2.5);
        let e = estimate(&model.tracer(None), outside, -outside, 40_000);
        // Tables are within 5e-4, and light leaves after a few boundaries.
        assert!((e.mean[0] - 1.0).abs() <= 4.5 * e.error[0] + 3e-3, "{alpha}: {e:?}");
    }
}
