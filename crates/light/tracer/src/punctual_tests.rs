//! Tests of punctual lights against closed forms.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, PunctualBeam, PunctualLight, Scene};

use crate::engine::PathEngine;
use crate::secondary_tests::estimate;
use crate::weighting::Direct;

/// Reflectance of the floor.
const KD: f64 = 0.5;

fn light(position: [f32; 3], intensity: f32, beam: PunctualBeam) -> PunctualLight {
    let (name, group) = ("one".to_owned(), "all".to_owned());
    PunctualLight { name, group, position, intensity: [intensity; 3], radius: 0.01, beam }
}

/// Returns a floor of 100 × 100 around the origin, and other quads of other materials.
fn floor(others: &[(Bsdf, [[f64; 3]; 4])], lights: Vec<PunctualLight>) -> Arc<Raycaster> {
    let square = [[-50.0, -50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, 50.0]];
    let mut positions = square.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
    let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
    let mut ids = vec![0, 0];
    let material = |bsdf| Material { bsdf, ..Material::grey("m") };
    let mut materials = vec![material(Bsdf::Diffuse { kd: [KD as f32; 3] })];
    for (bsdf, corners) in others {
        let first = positions.len() as u32;
        positions.extend(corners.map(DVec3::from_array));
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        ids.extend([materials.len() as u32; 2]);
        materials.push(material(*bsdf));
    }
    let scene = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap().0;
    // The scene's origin is the centre of its bounds.
    let origin = scene.origin.as_vec3();
    let moved = lights.into_iter().map(|light| {
        let position = (Vec3::from(light.position) - origin).to_array();
        PunctualLight { position, ..light }
    });
    let scene = scene.with_punctual_lights(moved.collect()).unwrap();
    Arc::new(Raycaster::build(Arc::new(scene)).unwrap())
}

/// Returns the irradiance of the floor at a place by a light of this share of its intensity.
fn irradiance(light: &PunctualLight, place: DVec3) -> f64 {
    let towards = Vec3::from(light.position).as_dvec3() - place;
    let share = f64::from(light.beam.share((-towards).normalize().as_vec3()));
    f64::from(light.intensity[0]) * share * towards.z.max(0.0) / towards.length().powi(3)
}

/// Returns the eye and direction that see a place of the floor.
fn looking_at(place: DVec3) -> (DVec3, DVec3) {
    let eye = place + DVec3::new(0.6, 0.3, 1.0);
    (eye, place - eye)
}

#[test]
fn one_light_has_the_intensity_of_its_format_in_every_direction() {
    let cone = PunctualBeam::Cone { axis: [0.0, 0.0, -1.0], inner: 0.3, outer: 0.6 };
    for (beam, places) in [
        (PunctualBeam::Everywhere, [0.0, 3.0, 8.0, 20.0, 1.5]),
        (cone, [0.0, 0.734, 1.449, 2.328, 1.9]),
    ] {
        let light = light([0.0, 0.0, 3.0], 1000.0, beam);
        let raycaster = floor(&[], vec![light.clone()]);
        let engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
        for x in places {
            let place = DVec3::new(x, 0.0, 0.0);
            let (mean, variance) = estimate(&engine, &raycaster, looking_at(place), 16);
            let expected = KD / PI * irradiance(&light, place);
            let is_right = (mean - expected).abs() <= 1e-4 * expected;
            assert!(is_right && variance <= 1e-9 * mean * mean, "{beam:?} {x}: {mean} {expected}");
        }
    }
}

#[test]
fn many_lights_add_up_and_each_hides_nothing() {
    // Three lights at each of 27 places, among them spots that light only a part of the floor.
    let mut lights = Vec::new();
    for k in 0..27 {
        let at = [k % 3, k / 3 % 3, k / 9].map(|i| i as f32 * 2.0 - 2.0);
        let position = [at[0], at[1], 3.0 + at[2]];
        let tilt = Vec3::new(0.3 * at[0], -0.2 * at[1], -1.0).normalize().to_array();
        lights.push(light(position, 1.0 + k as f32, PunctualBeam::Everywhere));
        let narrow = PunctualBeam::Cone { axis: tilt, inner: 0.1, outer: 0.4 };
        lights.push(light(position, 40.0, narrow));
        let wide =
            PunctualBeam::Cone { axis: [-tilt[0], tilt[1], tilt[2]], inner: 0.5, outer: 1.2 };
        lights.push(light(position, 10.0, wide));
    }
    let raycaster = floor(&[], lights.clone());
    let engine = PathEngine::new(&raycaster, None, Direct::Both, 2);
    for place in [DVec3::ZERO, DVec3::new(2.5, -1.0, 0.0), DVec3::new(-7.0, 4.0, 0.0)] {
        let n = 40_000;
        let (mean, variance) = estimate(&engine, &raycaster, looking_at(place), n);
        let sum: f64 = lights.iter().map(|light| irradiance(light, place)).sum();
        let expected = KD / PI * sum;
        let error = (variance / n as f64).sqrt();
        // 3 comparisons at 4.5 sigma: by chance once in 49,000 sets of seeds.
        assert!((mean - expected).abs() < 4.5 * error, "{place}: {mean} ± {error}, {expected}");
        assert!(error < 0.01 * mean, "{place}: {mean} ± {error}");
    }
}

#[test]
fn mirrors_throw_the_light_of_a_point_onto_surfaces_and_eyes_see_none() {
    let upright = [[4.0, -9.0, 0.0], [4.0, 9.0, 0.0], [4.0, 9.0, 9.0], [4.0, -9.0, 9.0]];
    let mirror = Bsdf::Mirror { ks: [0.9; 3] };
    let cone = PunctualBeam::Cone { axis: [0.6, 0.0, -0.8], inner: 0.2, outer: 1.1 };
    for beam in [PunctualBeam::Everywhere, cone] {
        let lamp = light([1.0, 0.5, 2.0], 7.0, beam);
        let raycaster = floor(&[(mirror, upright)], vec![lamp.clone()]);
        let mut engine = PathEngine::new(&raycaster, Some(0), Direct::Both, 1);
        let place = DVec3::new(2.5, 0.3, 0.0);
        // The light in the mirror, seen from the place in the mirror.
        let image = irradiance(&lamp, DVec3::new(8.0 - place.x, place.y, place.z));
        let expected = KD / PI * (irradiance(&lamp, place) + 0.9 * image);
        assert!(engine.caustics.is_some());
        let n = 200_000;
        let (mean, variance) = estimate(&engine, &raycaster, looking_at(place), n);
        let error = (variance / n as f64).sqrt();
        // The sphere has a width, so the mirror's light is that of points around the place.
        let width = 2e-4 * expected;
        assert!((mean - expected).abs() < 4.5 * error + width, "{mean} ± {error}, {expected}");
        assert!(error < 0.01 * expected, "{mean} ± {error}, {expected}");
        // The eye looks at the image of the light in the mirror, and at the light itself.
        let eye = DVec3::new(0.0, 0.5, 2.5);
        engine.bounces = 0;
        for target in [DVec3::new(7.0, 0.5, 2.0), DVec3::new(1.0, 0.5, 2.0)] {
            let seen = estimate(&engine, &raycaster, (eye, target - eye), 1000).0;
            assert!(seen < 1.0, "{seen}");
        }
    }
}

#[test]
fn panes_let_their_share_of_a_point_through() {
    let level = [[-9.0, -9.0, 1.5], [9.0, -9.0, 1.5], [9.0, 9.0, 1.5], [-9.0, 9.0, 1.5]];
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: [0.8; 3] };
    let lamp = light([0.0, 0.0, 3.0], 100.0, PunctualBeam::Everywhere);
    let raycaster = floor(&[(pane, level)], vec![lamp.clone()]);
    let engine = PathEngine::new(&raycaster, Some(0), Direct::Both, 1);
    let eye = (DVec3::new(0.6, 0.3, 1.0), DVec3::new(-0.6, -0.3, -1.0));
    let n = 20_000;
    let (mean, variance) = estimate(&engine, &raycaster, eye, n);
    let expected = KD / PI * irradiance(&lamp, DVec3::ZERO) * 0.8 * 0.923_08;
    let error = (variance / n as f64).sqrt();
    assert!((mean - expected).abs() < 4.5 * error + 1e-4 * expected, "{mean} {error} {expected}");
}
