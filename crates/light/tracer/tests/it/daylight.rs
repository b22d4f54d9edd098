//! Tests light of skies that differ by direction, and of their suns, against closed forms.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;
use holo_daylight::{SkyFormula, clear_sky, overcast_sky};
use holo_scene::{Bsdf, SUN_RADIUS, Scene, Sky, SkyAxes, SkyPicture, Sun};
use holo_tracer::{Settings, Tracer};

use crate::common::{BLACK, Estimate, Model, estimate, expect, pane_reflects};

const WHITE: Bsdf = Bsdf::Diffuse { kd: [1.0; 3] };

/// Returns a tracer of a model under this sky.
fn under(model: &Model, sky: Sky, engine: &str) -> Tracer {
    let mut scene = Scene::clone(&model.scene());
    scene.sky = sky;
    let settings = Settings { bounces: None, paths: 1 };
    let tracer = Tracer::new(Arc::new(scene), settings).unwrap();
    if engine == "gather" { tracer.with_gather() } else { tracer }
}

/// Returns a sky by a formula over a black ground, with Z up.
fn sky_of(formula: SkyFormula) -> Sky {
    Sky::of_formula(formula, 0.0, SkyAxes::new(DVec3::Z, 0.0))
}

/// A white square that faces this way.
fn plate(normal: DVec3) -> Model {
    let mut model = Model::default();
    let white = model.material(WHITE, [0.0; 3]);
    let (a, b) = normal.any_orthonormal_pair();
    let corners = [a + b, b - a, -a - b, a - b].map(|corner| corner.to_array());
    let mut front = corners;
    if (DVec3::from(front[1]) - DVec3::from(front[0]))
        .cross(DVec3::from(front[2]) - DVec3::from(front[0]))
        .dot(normal)
        < 0.0
    {
        front.reverse();
    }
    model.polygon(&front, white);
    model
}

/// Returns the mean radiance around the direction of the sun, over a square whose solid angle is
/// four times that of the disc, seen from above a floor or over it if it is a mirror.
fn around_sun(tracer: &Tracer, towards: DVec3) -> f64 {
    let (right, up) = towards.any_orthonormal_pair();
    let half = (PI * SUN_RADIUS.sin().powi(2)).sqrt();
    const SIDE: u32 = 128;
    let place = |at: u32| (f64::from(at) + 0.5) / f64::from(SIDE) * 2.0 - 1.0;
    let mut sum = 0.0;
    for at in 0..SIDE * SIDE {
        let aside = right * place(at % SIDE) + up * place(at / SIDE);
        let traced = tracer.trace(DVec3::Z, (towards + aside * half).normalize(), u64::from(at));
        sum += f64::from(traced.radiance[1]);
    }
    sum / f64::from(SIDE * SIDE)
}

#[test]
fn eyes_see_the_disc_of_the_sun_only_if_it_is_wanted_and_mirrors_show_it_too() {
    let towards = DVec3::new(0.3, 0.4, 0.8).normalize();
    let sun = Sun { towards: towards.as_vec3().to_array(), irradiance: [100.0; 3] };
    let even = Sky::default().with_sun(Some(sun));
    for (bsdf, reflected) in [(WHITE, false), (Bsdf::Mirror { ks: [1.0; 3] }, true)] {
        let mut model = Model::default();
        let floor = model.material(bsdf, [0.0; 3]);
        model.polygon(
            &[[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [-9.0, 9.0, 0.0]],
            floor,
        );
        let seen = DVec3::new(towards.x, towards.y, -towards.z);
        let looks = if reflected { vec![towards, seen] } else { vec![towards] };
        for engine in ["path", "gather"] {
            for look in &looks {
                let tracer = under(&model, even.clone(), engine);
                assert!(around_sun(&tracer, *look) < 1e-6, "{engine}: not asked for");
                let found = around_sun(&tracer.with_visible_sun(), *look);
                let wanted = f64::from(sun.radiance()[1]) / 4.0;
                assert!((found / wanted - 1.0).abs() < 0.01, "{engine} {found} {wanted}");
            }
        }
    }
}

/// Estimates the irradiance of a white plate, by its radiance.
fn irradiance(normal: DVec3, sky: Sky, engine: &str, paths: u64) -> Estimate {
    let tracer = under(&plate(normal), sky, engine);
    let (aside, _) = normal.any_orthonormal_pair();
    let Estimate { mean, error } =
        estimate(&tracer, normal + aside * 0.1, -normal - aside * 0.1, paths);
    Estimate { mean: mean.map(|l| l * PI), error: error.map(|e| e * PI) }
}

/// Checks an estimate, and that it is precise enough to show an error of 0.5 %.
fn expect_precisely(found: Estimate, expected: f64) {
    assert!(found.error[0] < 1.1e-3 * expected, "{found:?} {expected}");
    expect(found, [expected; 3]);
}

#[test]
fn an_overcast_sky_lights_level_and_upright_plates_by_its_closed_forms() {
    let formula = overcast_sky(DVec3::new(0.6, 0.0, 0.8)).sky;
    let level = 7.0 * PI / 9.0 * formula.radiance(DVec3::Z);
    // The integral of (1 + 2 sin γ)/3 over the half of the sky that a wall sees.
    let upright = 0.39618 * level;
    for engine in ["path", "gather"] {
        expect_precisely(irradiance(DVec3::Z, sky_of(formula), engine, 60_000), level);
        for towards in [DVec3::X, -DVec3::Y] {
            expect_precisely(irradiance(towards, sky_of(formula), engine, 400_000), upright);
        }
    }
}

#[test]
fn a_clear_sky_lights_a_plate_by_its_integral_and_its_sun_by_the_cosine() {
    let towards = DVec3::new(-0.5, -0.4, 0.6).normalize();
    let level = clear_sky(towards);
    let expected = level.sky.horizontal();
    expect_precisely(irradiance(DVec3::Z, sky_of(level.sky), "path", 200_000), expected);
    let sun = Sun { towards: towards.as_vec3().to_array(), irradiance: [level.sun as f32; 3] };
    let with_sun = sky_of(level.sky).with_sun(Some(sun));
    let expected = expected + level.sun * towards.z;
    for engine in ["path", "gather"] {
        expect_precisely(irradiance(DVec3::Z, with_sun.clone(), engine, 100_000), expected);
    }
}

/// A picture with a bright spot of a few pixels and a dim rest.
fn spotted() -> SkyPicture {
    let (width, height) = (256, 128);
    let mut pixels = vec![[0.2, 0.3, 0.5]; width * height];
    for (x, y) in [(60, 40), (61, 40), (60, 41), (61, 41)] {
        pixels[y * width + x] = [4000.0; 3];
    }
    SkyPicture::new(width, height, pixels).unwrap()
}

#[test]
fn a_bright_spot_of_a_picture_is_aimed_at() {
    let sky = Sky::of_picture(spotted(), 1.5, SkyAxes::new(DVec3::Z, 30.0));
    let horizontal = sky.horizontal().map(f64::from);
    for engine in ["path", "gather"] {
        let found = irradiance(DVec3::Z, sky.clone(), engine, 40_000);
        // The sum of the closed form has 32,768 directions, few of which meet the spot.
        for c in 0..3 {
            let error = found.mean[c] / horizontal[c] - 1.0;
            assert!(error.abs() < 0.05, "{found:?} {horizontal:?}");
            assert!(found.error[c] < 5e-3 * found.mean[c], "noise: {found:?}");
        }
    }
}

#[test]
fn rays_that_meet_nothing_show_the_sky_in_their_direction_without_its_sun() {
    let formula = clear_sky(DVec3::new(0.0, -0.6, 0.8)).sky;
    let axes = SkyAxes::new(DVec3::Y, 20.0);
    let sun = Sun { towards: [0.0, 0.8, 0.6], irradiance: [900.0; 3] };
    let sky = Sky::of_formula(formula, 7.0, axes).with_sun(Some(sun));
    let tracer = under(&plate(DVec3::Z), sky.clone(), "path");
    let eye = DVec3::new(0.0, 0.0, 5.0);
    for direction in [DVec3::new(0.0, 0.8, 0.6), DVec3::X, DVec3::new(0.3, -0.5, 0.2)] {
        let direction = direction.normalize();
        let traced = tracer.trace(eye, direction, 0);
        assert!(traced.distance.is_infinite());
        assert_eq!(traced.radiance, sky.radiance(direction), "{direction}");
    }
    assert_eq!(tracer.trace(eye, DVec3::new(0.0, -0.5, 0.5), 0).radiance, [7.0; 3]);
    let seen = sky.seen(DVec3::new(0.0, 0.8, 0.6));
    assert!(seen[0] > 1e6, "people see the disc: {seen:?}");
}

/// A closed grey room with a window in the wall towards +X, and glass in it if `glazed`.
fn windowed(glazed: bool) -> Model {
    let mut model = Model::default();
    let grey = model.material(Bsdf::Diffuse { kd: [0.5; 3] }, [0.0; 3]);
    let quad =
        |model: &mut Model, corners: [[f64; 3]; 4], material| model.polygon(&corners, material);
    let (w, h) = (2.0, 2.5);
    quad(&mut model, [[-w, -w, 0.0], [w, -w, 0.0], [w, w, 0.0], [-w, w, 0.0]], grey);
    quad(&mut model, [[-w, -w, h], [-w, w, h], [w, w, h], [w, -w, h]], grey);
    quad(&mut model, [[-w, -w, 0.0], [-w, w, 0.0], [-w, w, h], [-w, -w, h]], grey);
    quad(&mut model, [[-w, -w, 0.0], [-w, -w, h], [w, -w, h], [w, -w, 0.0]], grey);
    quad(&mut model, [[-w, w, 0.0], [w, w, 0.0], [w, w, h], [-w, w, h]], grey);
    // The wall with the window from y -1 to 1 and z 1 to 2.
    for (y, z) in [
        ([-w, -1.0], [0.0, h]),
        ([1.0, w], [0.0, h]),
        ([-1.0, 1.0], [0.0, 1.0]),
        ([-1.0, 1.0], [2.0, h]),
    ] {
        quad(
            &mut model,
            [[w, y[0], z[0]], [w, y[0], z[1]], [w, y[1], z[1]], [w, y[1], z[0]]],
            grey,
        );
    }
    if glazed {
        let glass =
            model.material(Bsdf::ThinGlass { ior: 1.52, transmittance: [0.9; 3] }, [0.0; 3]);
        quad(&mut model, [[w, -1.0, 1.0], [w, -1.0, 2.0], [w, 1.0, 2.0], [w, 1.0, 1.0]], glass);
    }
    model
}

/// The same sky as many rays by the material find it, without aiming: a lamp at the horizon's
/// distance would be no sky, so the reference integrates the sky over the window.
fn through_window(sky: &Sky, point: DVec3) -> f64 {
    const STEPS: u32 = 400;
    let mut sum = 0.0;
    for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
        let [y, z] = [i, j].map(|k| (f64::from(k) + 0.5) / f64::from(STEPS));
        let towards = DVec3::new(2.0, -1.0 + 2.0 * y, 1.0 + z) - point;
        let distance2 = towards.length_squared();
        let direction = towards / distance2.sqrt();
        let area = 2.0 / f64::from(STEPS * STEPS);
        let weight = direction.z * direction.x / distance2 * area;
        sum += weight * f64::from(sky.radiance(direction)[0]);
    }
    sum
}

#[test]
fn a_room_with_a_window_receives_the_integral_of_its_sky() {
    let towards = DVec3::new(0.7, 0.1, 0.5).normalize();
    let spot = Sky::of_picture(spotted(), 1.0, SkyAxes::new(DVec3::Z, 90.0));
    for sky in [sky_of(clear_sky(towards).sky), spot] {
        let point = DVec3::new(0.8, 0.3, 0.0);
        let tracer = {
            let mut scene = Scene::clone(&windowed(false).scene());
            scene.sky = sky.clone();
            let settings = Settings { bounces: Some(0), paths: 1 };
            Tracer::new(Arc::new(scene), settings).unwrap()
        };
        let found = estimate(
            &tracer,
            point + DVec3::new(-0.2, 0.1, 1.0),
            DVec3::new(0.2, -0.1, -1.0),
            400_000,
        );
        let expected = 0.5 / PI * through_window(&sky, point);
        let error = found.mean[0] / expected - 1.0;
        let bound = 4.5 * found.error[0] / expected + 5e-3;
        assert!(error.abs() < bound && bound < 0.03, "{found:?} {expected}");
    }
}

#[test]
fn panes_pass_the_same_light_whether_it_is_aimed_at_or_found_by_chance() {
    // An even sky is found by the material behind panes; the same sky as a picture is aimed at.
    let pixels = vec![[2.0; 3]; 32 * 16];
    let picture = SkyPicture::new(32, 16, pixels).unwrap();
    let skies = [Sky::from([2.0; 3]), Sky::of_picture(picture, 1.0, SkyAxes::new(DVec3::Z, 0.0))];
    for engine in ["path", "gather"] {
        let [even, pictured] = skies.clone().map(|sky| {
            let tracer = under(&windowed(true), sky, engine);
            estimate(&tracer, DVec3::new(0.0, 0.2, 1.2), DVec3::new(0.3, 0.1, -1.0), 160_000)
        });
        let error = (even.error[0].powi(2) + pictured.error[0].powi(2)).sqrt();
        let difference = even.mean[0] - pictured.mean[0];
        // Cells of the engine gather may differ by 2 % of the light.
        let bias = if engine == "gather" { 0.02 * even.mean[0] } else { 0.0 };
        assert!(difference.abs() < 4.5 * error + bias, "{engine}: {even:?} {pictured:?}");
        assert!(error < 0.02 * even.mean[0], "{even:?} {pictured:?}");
    }
}

#[test]
fn sun_under_a_pane_is_more_than_the_pane_transmits_by_what_it_reflects_of_the_floor() {
    // Under a wide pane, the floor of reflectance ρ has the irradiance E T / (1 - ρ R). T is the
    // pane's transmission at the angle of the sun, R what it reflects of even light.
    let towards = DVec3::new(1.0, 0.0, 1.0).normalize();
    let sun = Sun { towards: towards.as_vec3().to_array(), irradiance: [100.0; 3] };
    let reflectance = 0.5;
    let mut model = Model::default();
    let floor = model.material(Bsdf::Diffuse { kd: [reflectance; 3] }, [0.0; 3]);
    let pane = model.material(Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] }, [0.0; 3]);
    model.square(0.0, 20_000.0, true, floor);
    model.square(1.0, 10_000.0, true, pane);
    let reflected = |cosine: f64| pane_reflects(cosine, 1.5);
    const STEPS: u32 = 10_000;
    // Even in the square of the cosine.
    let even: f64 = (0..STEPS)
        .map(|k| reflected(((f64::from(k) + 0.5) / f64::from(STEPS)).sqrt()) / f64::from(STEPS))
        .sum();
    let through = 100.0 * towards.z * (1.0 - reflected(towards.z));
    let share = f64::from(reflectance);
    let expected = share / PI * through / (1.0 - share * even);
    let tracer = under(&model, Sky::default().with_sun(Some(sun)), "path");
    let eye = DVec3::new(0.0, 0.0, 0.5);
    expect_precisely(estimate(&tracer, eye, DVec3::new(0.3, 0.2, -1.0), 100_000), expected);
}

#[test]
fn a_black_plate_stays_black_under_any_sky() {
    let mut model = Model::default();
    let black = model.material(BLACK, [0.0; 3]);
    model.square(0.0, 1.0, true, black);
    let tracer = under(&model, sky_of(clear_sky(DVec3::Z).sky), "path");
    assert_eq!(tracer.trace(DVec3::Z, -DVec3::Z, 1).radiance, [0.0; 3]);
}
