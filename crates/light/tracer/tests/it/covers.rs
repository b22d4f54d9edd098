//! Tests surfaces that are there with a probability, and glass that is something else in part,
//! against closed forms.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::sync::Arc;

use crate::common::{BLACK, Estimate, Model, expect, form_factor};
use glam::DVec3;
use holo_scene::{Base, Bsdf, Channel, Cover, Scene, Shading, Sun};
use holo_tracer::{Settings, Tracer};

/// The reflectance of a pane of index 1.5 at right angles.
const REFLECTED: f64 = 1.0 - 0.923_076_9;

fn covered(opacity: f32) -> Cover {
    Cover { opacity, ..Cover::default() }
}

/// Returns a tracer of a model with these covers, and its engines.
fn tracers(model: &Model, covers: &[Cover], suns: &[Sun]) -> [Tracer; 2] {
    let shading = Shading { covers: covers.to_vec(), ..Shading::default() };
    let scene = Arc::unwrap_or_clone(model.scene());
    let scene = scene.with_shading(shading).unwrap().with_suns(suns.to_vec()).unwrap();
    assert_eq!(Scene::unpack(&scene.pack()).unwrap(), scene);
    let scene = Arc::new(scene);
    let tracer = || Tracer::new(scene.clone(), Settings::default()).unwrap();
    [tracer(), tracer().with_gather()]
}

/// Returns the mean over rays that differ by a hair, because a ray decides once what it meets.
fn mean(tracer: &Tracer, origin: DVec3, direction: DVec3, rays: u32) -> Estimate {
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    for ray in 0..rays {
        let (sin, cos) = (f64::from(ray) * 2.399).sin_cos();
        let radius = 1e-3 * ((f64::from(ray) + 0.5) / f64::from(rays)).sqrt();
        let (across, up) = direction.any_orthonormal_pair();
        let origin = origin + (across * cos + up * sin) * radius;
        let traced = tracer.trace(origin, direction.normalize(), u64::from(ray));
        for c in 0..3 {
            let x = f64::from(traced.radiance[c]);
            sum[c] += x;
            squares[c] += x * x;
        }
    }
    assert_eq!(tracer.nonfinite_paths(), 0);
    let n = f64::from(rays);
    let mean = sum.map(|s| s / n);
    let error = [0, 1, 2].map(|c| ((squares[c] / n - mean[c] * mean[c]).max(0.0) / n).sqrt());
    Estimate { mean, error }
}

fn diffuse(kd: f32) -> Bsdf {
    Bsdf::Diffuse { kd: [kd; 3] }
}

#[test]
fn white_surfaces_of_any_coverage_vanish_in_an_even_light() {
    for opacity in [0.0, 0.1, 0.5, 0.69, 0.99] {
        let mut model = Model { sky: [1.0; 3], ..Model::default() };
        let white = model.material(diffuse(1.0), [0.0; 3]);
        model.cuboid([-1.0; 3], [1.0; 3], true, white);
        model.square(2.0, 1.0, false, white);
        for tracer in &tracers(&model, &[covered(opacity)], &[])[..1] {
            for way in [DVec3::NEG_Z, DVec3::new(0.3, 0.2, -1.0)] {
                expect(mean(tracer, -5.0 * way, way, 2000), [1.0; 3]);
            }
        }
    }
}

#[test]
fn what_is_behind_shows_with_the_rest() {
    for (kd, opacity) in [(0.0, 0.2), (0.4, 0.7), (0.9, 0.3), (0.1, 0.1)] {
        let mut model = Model { sky: [1.0; 3], ..Model::default() };
        let sheet = model.material(diffuse(kd), [0.0; 3]);
        model.square(0.0, 3.0, true, sheet);
        let a = f64::from(opacity);
        let one = f64::from(kd) * a + 1.0 - a;
        for tracer in tracers(&model, &[covered(opacity)], &[]) {
            expect(mean(&tracer, DVec3::Z, DVec3::NEG_Z, 6000), [one; 3]);
            expect(mean(&tracer, DVec3::NEG_Z, DVec3::Z, 6000), [one; 3]);
        }
    }
    // Two black sheets, one behind the other.
    let mut model = Model { sky: [1.0; 3], ..Model::default() };
    let black = model.material(BLACK, [0.0; 3]);
    model.square(0.0, 3.0, true, black);
    model.square(0.5, 3.0, true, black);
    let [tracer, _] = tracers(&model, &[covered(0.6)], &[]);
    expect(mean(&tracer, DVec3::Z, DVec3::NEG_Z, 6000), [0.16; 3]);
}

#[test]
fn a_sample_has_the_distance_of_the_surface_whose_light_it_brings() {
    let mut model = Model::default();
    let black = model.material(BLACK, [0.0; 3]);
    let glow = model.material(BLACK, [2.0; 3]);
    model.square(1.0, 3.0, true, black);
    model.square(0.0, 3.0, true, glow);
    let [tracer, _] = tracers(&model, &[covered(0.7), Cover::default()], &[]);
    let mut counts = [0; 2];
    for ray in 0..1000 {
        let origin = DVec3::new(f64::from(ray) * 1e-4, 0.3, 3.0);
        let traced = tracer.trace(origin, DVec3::NEG_Z, 5);
        let is_behind = traced.distance > 2.5;
        counts[usize::from(is_behind)] += 1;
        assert_eq!(traced.radiance, [if is_behind { 2.0 } else { 0.0 }; 3]);
    }
    // The binomial distribution: 300 ± 14.5.
    assert!((240..360).contains(&counts[1]), "{counts:?}");
}

/// A floor below a panel that shines down, with a sheet between them.
fn floor_below_panel(sheet: Bsdf) -> (Model, [[f64; 3]; 4]) {
    let panel = [[-1.0, 1.0, 2.0], [1.0, 1.0, 2.0], [1.0, -1.0, 2.0], [-1.0, -1.0, 2.0]];
    let mut model = Model::default();
    let floor = model.material(diffuse(0.5), [0.0; 3]);
    let lamp = model.material(BLACK, [4.0; 3]);
    let sheet = model.material(sheet, [0.0; 3]);
    model.square(0.0, 3.0, true, floor);
    model.polygon(&panel, lamp);
    model.square(1.0, 30.0, true, sheet);
    (model, panel)
}

#[test]
fn lamps_and_suns_shine_through_with_the_rest() {
    let (model, panel) = floor_below_panel(BLACK);
    let covers = [Cover::default(), Cover::default(), covered(0.7)];
    let lit = 0.5 * 4.0 * form_factor(&panel, DVec3::ZERO, DVec3::Z) * 0.3;
    let (eye, down) = (DVec3::new(0.3, 0.0, 0.5), DVec3::new(-0.3, 0.0, -0.5));
    for tracer in tracers(&model, &covers, &[]) {
        expect(mean(&tracer, eye, down, 20_000), [lit; 3]);
    }
    let (mut model, _) = floor_below_panel(BLACK);
    model.materials[1].emission = [0.0; 3];
    let sun = Sun { towards: [0.0, 0.0, 1.0], irradiance: [2.0; 3] };
    // The panel is black and shades the middle.
    let aside = DVec3::new(2.0, 2.0, 0.0);
    let lit = 0.5 * 2.0 / std::f64::consts::PI * 0.3;
    for tracer in tracers(&model, &covers, &[sun]) {
        // Without noise, the cosines over the sun's disc count: 5e-6.
        let Estimate { mean, error } = mean(&tracer, eye + aside, down, 20_000);
        for (mean, error) in mean.into_iter().zip(error) {
            assert!((mean - lit).abs() < 1e-5 * lit + 5.0 * error, "{mean} is not {lit}");
        }
    }
}

#[test]
fn two_curtains_dim_the_sun_and_add_no_noise() {
    let (mut model, _) = floor_below_panel(BLACK);
    model.materials[1].emission = [0.0; 3];
    model.square(1.5, 30.0, true, 2);
    let covers = [Cover::default(), Cover::default(), covered(0.7)];
    let sun = Sun { towards: [0.0, 0.0, 1.0], irradiance: [2.0; 3] };
    let lit = 0.5 * 2.0 / std::f64::consts::PI * 0.3 * 0.3;
    let [tracer, _] = tracers(&model, &covers, &[sun]);
    let (eye, down) = (DVec3::new(2.3, 2.0, 0.5), DVec3::new(-0.3, 0.0, -0.5));
    for seed in 0..64 {
        let traced = tracer.trace(eye, down.normalize(), seed).radiance;
        for shown in traced.map(f64::from) {
            assert!((shown - lit).abs() < 1e-4 * lit, "{shown} instead of {lit}");
        }
    }
}

#[test]
fn a_lamp_that_covers_half_is_half_as_bright() {
    let (model, panel) = floor_below_panel(BLACK);
    let covers = [Cover::default(), covered(0.5), covered(0.0)];
    let lit = 0.5 * 4.0 * form_factor(&panel, DVec3::ZERO, DVec3::Z) * 0.5;
    let (eye, down) = (DVec3::new(0.3, 0.0, 0.5), DVec3::new(-0.3, 0.0, -0.5));
    for tracer in tracers(&model, &covers, &[]) {
        expect(mean(&tracer, eye, down, 20_000), [lit; 3]);
        expect(mean(&tracer, eye, DVec3::Z, 4000), [2.0; 3]);
    }
}

#[test]
fn glass_in_part_is_a_mixture() {
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: [0.25, 0.5, 1.0] };
    let glass = Channel { texture: None, channel: 0, factor: 0.45 };
    let base = Base { bsdf: diffuse(0.6), glass };
    let mixed = Cover { base: Some(base), ..Cover::default() };
    let clear = [0.25, 0.5, 1.0].map(|t: f64| (1.0 - REFLECTED) * t);
    let mut model = Model { sky: [1.0; 3], ..Model::default() };
    let sheet = model.material(pane, [0.0; 3]);
    model.square(0.0, 3.0, true, sheet);
    let shown = clear.map(|clear| 0.45 * (REFLECTED + clear) + 0.55 * 0.6);
    for tracer in tracers(&model, &[mixed], &[]) {
        expect(mean(&tracer, DVec3::Z, DVec3::NEG_Z, 20_000), shown);
    }
    // Half of it is there.
    let half = Cover { opacity: 0.5, ..mixed };
    let [tracer, _] = tracers(&model, &[half], &[]);
    let shown = shown.map(|shown| 0.5 * shown + 0.5);
    expect(mean(&tracer, DVec3::Z, DVec3::NEG_Z, 20_000), shown);
    // The sun shines through on a floor. The sheet's base is black, so nothing is scattered back.
    let mut model = Model::default();
    let floor = model.material(diffuse(0.5), [0.0; 3]);
    let sheet = model.material(pane, [0.0; 3]);
    model.square(0.0, 3.0, true, floor);
    model.square(1.0, 30.0, true, sheet);
    let black = Cover { base: Some(Base { bsdf: BLACK, ..base }), ..Cover::default() };
    let sun = Sun { towards: [0.0, 0.0, 1.0], irradiance: [2.0; 3] };
    let [tracer, _] = tracers(&model, &[Cover::default(), black], &[sun]);
    let lit = 0.5 * 2.0 / std::f64::consts::PI;
    let (eye, down) = (DVec3::new(0.3, 0.0, 0.5), DVec3::new(-0.3, 0.0, -0.5));
    let found = mean(&tracer, eye, down, 20_000);
    // The pane mirrors a little of the floor's light back to the floor.
    for (mean, clear) in found.mean.into_iter().zip(clear) {
        let least = lit * 0.45 * clear;
        let excess = mean / least - 1.0;
        assert!((-0.03..0.06).contains(&excess), "{found:?} {least}");
    }
}

/// A mirror or pane that covers a part, above a floor that glows: eyes see both by their shares,
/// and the floor's light reaches a wall above along both ways.
#[test]
fn mirrors_and_panes_that_cover_a_part_mirror_by_that_share() {
    for (bsdf, reflected, passed) in [
        (Bsdf::Mirror { ks: [0.6; 3] }, 0.6, 0.0),
        (Bsdf::ThinGlass { ior: 1.5, transmittance: [0.5; 3] }, REFLECTED, 0.5 * (1.0 - REFLECTED)),
    ] {
        for opacity in [0.2, 0.5, 0.8] {
            let mut model = Model { sky: [1.0; 3], ..Model::default() };
            let floor = model.material(BLACK, [3.0; 3]);
            let sheet = model.material(bsdf, [0.0; 3]);
            model.square(0.0, 30.0, true, floor);
            model.square(1.0, 30.0, true, sheet);
            let a = f64::from(opacity);
            let seen = a * (reflected + passed * 3.0) + (1.0 - a) * 3.0;
            for tracer in tracers(&model, &[Cover::default(), covered(opacity)], &[]) {
                expect(mean(&tracer, 2.0 * DVec3::Z, DVec3::NEG_Z, 20_000), [seen; 3]);
            }
        }
    }
}

#[test]
fn the_sun_off_a_mirror_that_covers_a_part_lights_by_that_share() {
    // The mirror stands on the floor and faces a sun at 45 degrees.
    let mut model = Model::default();
    let floor = model.material(diffuse(0.5), [0.0; 3]);
    let mirror = model.material(Bsdf::Mirror { ks: [0.8; 3] }, [0.0; 3]);
    model.square(0.0, 30.0, true, floor);
    model
        .polygon(&[[0.0, -9.0, 0.01], [0.0, 9.0, 0.01], [0.0, 9.0, 8.0], [0.0, -9.0, 8.0]], mirror);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let sun = Sun { towards: [half as f32, 0.0, half as f32], irradiance: [2.0; 3] };
    let (eye, down) = (DVec3::new(2.3, 0.0, 0.5), DVec3::new(-0.3, 0.0, -0.5));
    for opacity in [0.3, 1.0] {
        let a = f64::from(opacity);
        let lit = 0.5 * 2.0 / std::f64::consts::PI * half * (1.0 + 0.8 * a);
        let [tracer, _] = tracers(&model, &[Cover::default(), covered(opacity)], &[sun]);
        let found = mean(&tracer, eye, down, 4000);
        // The mirror also shows the floor to itself, but nothing else is lit.
        for (mean, error) in found.mean.into_iter().zip(found.error) {
            assert!(
                (mean - lit).abs() < 0.01 * lit + 5.0 * error,
                "{mean} is not {lit}: {opacity}"
            );
        }
    }
}
