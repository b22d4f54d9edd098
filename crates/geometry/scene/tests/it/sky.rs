//! Skies that differ by direction: their radiance, and their bytes in a packed scene.

#![allow(clippy::unwrap_used, reason = "tests")]

use glam::{DVec3, Vec3};
use holo_daylight::{clear_sky, intermediate_sky, overcast_sky};
use holo_scene::{Bsdf, Material, Scene, SceneError, Sky, SkyAxes, SkyPicture, Sun};

fn scene(sky: Sky) -> Result<Scene, SceneError> {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let material = Material { bsdf: Bsdf::Diffuse { kd: [0.5; 3] }, ..Material::grey("wall") };
    Scene::from_world(&corners, &[[0, 1, 2]], &[0], vec![material], sky).map(|(scene, _)| scene)
}

fn skies() -> Vec<Sky> {
    let towards = DVec3::new(0.48, -0.36, 0.8);
    let axes = SkyAxes::new(DVec3::Y, 35.0);
    let sun = Sun { towards: axes.to_scene(towards).as_vec3().to_array(), irradiance: [700.0; 3] };
    let pixels = (0..32).map(|at| [at as f32, 1.0, 0.25]).collect();
    let picture = SkyPicture::new(8, 4, pixels).unwrap();
    vec![
        Sky::of_formula(clear_sky(towards).sky, 3.0, axes).with_sun(Some(sun)),
        Sky::of_formula(intermediate_sky(towards).sky, 3.0, axes),
        Sky::of_formula(overcast_sky(towards).sky, 0.0, axes),
        Sky::of_picture(picture, 2.5, axes).with_sun(Some(sun)),
        Sky::from([1.0, 2.0, 3.0]).with_sun(Some(sun)),
    ]
}

#[test]
fn skies_come_back_from_a_packed_scene_as_they_were_with_or_without_the_rest() {
    for sky in skies() {
        let packed = scene(sky.clone()).unwrap().pack();
        let unpacked = Scene::unpack(&packed).unwrap();
        assert_eq!(unpacked.sky, sky);
        assert_eq!(unpacked.pack(), packed);
        assert_eq!(Scene::unpack_sky(&packed).unwrap(), sky);
    }
    let plain = scene([1.0, 2.0, 3.0].into()).unwrap();
    assert_eq!(Scene::unpack_sky(&plain.pack()).unwrap(), plain.sky);
}

#[test]
fn damaged_skies_are_refused_and_never_a_panic() {
    for sky in skies() {
        let packed = scene(sky).unwrap().pack();
        assert!(Scene::unpack(&packed[..packed.len() - 1]).is_err());
        let length = u32::from_le_bytes(packed[84..88].try_into().unwrap()) as usize;
        let start = packed.len() - length;
        for at in start..packed.len().min(start + 220) {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                let mut changed = packed.clone();
                changed[at] = value;
                if let Ok(scene) = Scene::unpack(&changed) {
                    assert_eq!(scene.pack(), changed, "byte {at}");
                    let radiance = scene.sky.radiance(DVec3::new(0.0, 0.6, 0.8));
                    assert!(radiance.iter().all(|c| c.is_finite() && *c >= 0.0), "byte {at}");
                }
            }
        }
    }
}

#[test]
fn the_horizon_follows_up_and_north() {
    let towards = DVec3::new(0.0, -0.6, 0.8);
    let formula = clear_sky(towards).sky;
    for (up, turn, sun) in [
        (DVec3::Z, 0.0, DVec3::new(0.0, -0.6, 0.8)),
        (DVec3::Y, 0.0, DVec3::new(0.0, 0.8, 0.6)),
        // North turned to the east: south is west.
        (DVec3::Z, 90.0, DVec3::new(-0.6, 0.0, 0.8)),
    ] {
        let axes = SkyAxes::new(up, turn);
        assert!(axes.to_scene(towards).distance(sun) < 1e-12, "{up} {turn}");
        let sky = Sky::of_formula(formula, 5.0, axes);
        assert_eq!(sky.radiance(-up), [5.0; 3]);
        let expected = formula.radiance(towards) as f32;
        assert!((sky.radiance(sun)[0] / expected - 1.0).abs() < 1e-6);
        let horizontal = formula.horizontal() as f32;
        assert!((sky.horizontal()[0] / horizontal - 1.0).abs() < 5e-3, "{:?}", sky.horizontal());
    }
}

#[test]
fn the_disc_of_the_sun_is_seen_and_as_wide_as_the_real_one() {
    let towards = DVec3::new(0.6, 0.0, 0.8);
    let sun = Sun { towards: towards.as_vec3().to_array(), irradiance: [700.0; 3] };
    let sky = Sky::from([1.0; 3]).with_sun(Some(sun));
    let aside = towards.any_orthonormal_vector();
    let seen = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        sky.seen(towards * cos + aside * sin)[0]
    };
    assert!(seen(0.0) > 1e7 && seen(0.25) > 1e7);
    assert_eq!((seen(0.28), seen(180.0)), (1.0, 1.0));
    assert_eq!(sky.radiance(towards), [1.0; 3]);
    assert_eq!(Vec3::from(sky.mean()), Vec3::ONE);
}

#[test]
fn dimming_multiplies_sky_and_sun_and_a_sun_of_nothing_is_none() {
    for sky in skies() {
        let dimmed = sky.clone().dimmed(0.5, 0.25);
        let direction = DVec3::new(0.0, 0.6, 0.8);
        assert_eq!(dimmed.radiance(direction), sky.radiance(direction).map(|c| c * 0.5));
        let irradiance = |sky: &Sky| sky.sun().map(|sun| sun.irradiance[0]);
        assert_eq!(irradiance(&dimmed), irradiance(&sky).map(|e| e * 0.25));
        assert_eq!(sky.dimmed(1.0, 0.0).sun(), None);
    }
}
