//! Tests models that become part of a scene.

#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_photometry::Photometry;
use holo_scene::{
    HungLuminaire, Material, PunctualBeam, PunctualLight, Scene, SceneError, limits::MAX_NAME_BYTES,
};

use crate::common::instanced::{scene, shaded, textured};

/// A turn by 90° around z, twice the size, and moved.
const TURN: [[f64; 4]; 3] = [[0.0, -2.0, 0.0, 4.0], [2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 2.0, 1.0]];

/// The same for scenes around (1e5, 1e5, 1e5).
const FAR_TURN: [[f64; 4]; 3] =
    [[0.0, -2.0, 0.0, 3e5 + 4.0], [2.0, 0.0, 0.0, -1e5], [0.0, 0.0, 2.0, -1e5 + 1.0]];

fn placed(point: DVec3, rows: [[f64; 4]; 3]) -> DVec3 {
    DVec3::from_array(rows.map(|[x, y, z, sum]| DVec3::new(x, y, z).dot(point) + sum))
}

fn turned(direction: Vec3) -> Vec3 {
    Vec3::new(-direction.y, direction.x, direction.z)
}

/// Compares everything that a ray asks for at points of a triangle.
fn assert_same_look(of: (&Scene, u32), now: (&Scene, u32), turn: fn(Vec3) -> Vec3) {
    let ((before, old), (after, new)) = (of, now);
    for [u, v] in [[0.2, 0.3], [0.9, 0.05], [0.0, 1.0_f32]] {
        let look = |scene: &Scene, t: u32| {
            (
                scene.reflectance(t, u, v, 0.0),
                scene.finish(t, u, v, 0.0),
                scene.emission_texture(t, u, v, 0.0),
                scene.material(t).bsdf,
            )
        };
        assert_eq!(look(before, old), look(after, new), "{old} {new} {u} {v}");
        let smooth = before.smooth_normal(old, u, v).map(turn);
        let now = after.smooth_normal(new, u, v);
        assert_eq!(smooth.is_some(), now.is_some(), "{old} {new}");
        let apart = smooth.zip(now).map_or(0.0, |(smooth, now)| smooth.distance(now));
        assert!(apart < 1e-3, "{old} {new}: {smooth:?} {now:?}");
    }
}

#[test]
fn a_model_becomes_the_last_of_the_scene_s_own_triangles_with_its_materials_and_textures() {
    let kinds: [fn() -> Scene; 3] = [scene, shaded, textured];
    for (room, model) in kinds.iter().flat_map(|room| kinds.iter().map(move |model| (room, model)))
    {
        let (room, model) = (room(), model());
        let joined = room.clone().with_object("a chair", &model, &FAR_TURN).unwrap();
        let count = model.triangles().end;
        assert_eq!(joined.triangles().end, room.triangles().end + count);
        let own = room.own().triangles.len() as u32;
        for old in room.triangles() {
            let new = if old < own { old } else { old + count };
            assert_eq!(room.corners(old), joined.corners(new));
            assert_eq!(room.material(old), joined.material(new));
            assert_same_look((&room, old), (&joined, new), |normal| normal);
        }
        for old in model.triangles() {
            let new = own + old;
            for (corner, now) in model.corners(old).iter().zip(joined.corners(new)) {
                let expected = placed(model.origin + corner.as_dvec3(), FAR_TURN);
                let now = joined.origin + now.as_dvec3();
                assert!(expected.distance(now) < 1e-4, "{expected} {now}");
            }
            let name = &model.material(old).name;
            assert_eq!(joined.material(new).name, format!("a chair/{name}"));
            assert!(joined.normal(new).dot(turned(model.normal(old))) > 0.999);
            assert_same_look((&model, old), (&joined, new), turned);
        }
        assert_eq!(Scene::unpack(&joined.pack()).unwrap(), joined);
    }
}

#[test]
fn objects_of_one_name_have_materials_of_two_names() {
    let long = "x".repeat(2 * MAX_NAME_BYTES);
    for name in ["a chair", &long] {
        let once = scene().with_object(name, &scene(), &FAR_TURN).unwrap();
        let twice = once.with_object(name, &scene(), &FAR_TURN).unwrap();
        let mut names: Vec<&str> = twice.materials.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names.len(), 9);
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 9, "{names:?}");
    }
}

/// Returns a triangle in the plane z = 0 with lamps.
fn lamp(lights: Vec<PunctualLight>, hung: &[HungLuminaire]) -> Scene {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let material = Material { emission: [7.0; 3], ..Material::grey("shade") };
    let scene = Scene::from_world(&corners, &[[0, 1, 2]], &[0], vec![material], [5.0; 3]);
    let lit = scene.unwrap().0.with_luminaires_hung(hung, 1.0).unwrap();
    lit.with_punctual_lights(lights).unwrap()
}

#[test]
fn lamps_of_a_model_light_the_scene_as_they_light_the_model() {
    let light = PunctualLight {
        name: "bulb".into(),
        group: "bulbs".into(),
        position: [1.0, 0.0, 2.0],
        intensity: [3.0, 2.0, 1.0],
        radius: 0.01,
        beam: PunctualBeam::Cone { axis: [1.0, 0.0, 0.0], inner: 0.2, outer: 0.5 },
    };
    let text = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 3 1 2 0.3 1.2 0\n1 1 20\n0 45 90\n\
        0 45 90\n1000 700 0\n1000 500 0\n1000 300 0\n";
    let photometry = Photometry::read(text.as_bytes()).unwrap();
    let hung = HungLuminaire {
        name: "tube".into(),
        group: String::new(),
        place: DVec3::new(0.3, 0.4, 2.0),
        axes: [DVec3::X, DVec3::Y, DVec3::Z],
        mesh: Arc::new(photometry.opening.mesh(photometry.web.halves())),
        web: Arc::new(photometry.web),
        colour: [1.0; 3],
    };
    let model = lamp(vec![light.clone()], std::slice::from_ref(&hung));
    let room = lamp(vec![light.clone()], &[hung]);
    let joined = room.clone().with_object("lamp", &model, &TURN).unwrap();
    assert_eq!(joined.sky, room.sky);
    assert_eq!(
        joined.lamp_groups(),
        ["bulbs", "lamp/bulbs", "lamp/shade", "lamp/tube", "shade", "tube", "sky"]
    );
    let [old, new] = &joined.punctual_lights[..] else { unreachable!("{joined:?}") };
    assert_eq!(old, &light);
    let place =
        |scene: &Scene, light: &PunctualLight| scene.origin + Vec3::from(light.position).as_dvec3();
    assert!(place(&joined, new).distance(placed(place(&model, &light), TURN)) < 1e-5);
    // At twice the distance, four times the intensity is the same irradiance.
    assert_eq!(new.intensity, [12.0, 8.0, 4.0]);
    assert_eq!((new.radius, new.radiance()), (0.02, light.radiance()));
    let PunctualBeam::Cone { axis, .. } = new.beam else { unreachable!("{new:?}") };
    assert!(Vec3::from(axis).distance(Vec3::Y) < 1e-6);
    // Luminaires keep their radiance in directions that turn with them.
    let [_, turned_one] = joined.luminaires() else { unreachable!("{joined:?}") };
    let before = &model.luminaires()[0];
    let tube = &joined.materials[turned_one.material as usize];
    assert_eq!(tube.emission, model.materials[before.material as usize].emission);
    for away in [Vec3::NEG_Z, Vec3::new(0.6, 0.0, -0.8), Vec3::new(0.0, 0.6, -0.8)] {
        let (was, is) = (before.share(away), turned_one.share(turned(away)));
        assert!((was - is).abs() <= 1e-3 * was && was > 0.0, "{away}: {was} {is}");
    }
}

#[test]
fn a_model_that_vanishes_or_has_no_sound_place_is_refused() {
    let flat = [[0.0; 4]; 3];
    let far = [[1.0, 0.0, 0.0, 1e9], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let mirrored = [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let unsound = [[f64::NAN, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    for rows in [flat, far, mirrored, unsound] {
        let refused = scene().with_object("a chair", &lamp(Vec::new(), &[]), &rows);
        assert!(
            matches!(&refused, Err(SceneError::Object { name }) if name == "a chair"),
            "{rows:?}: {refused:?}"
        );
    }
}
