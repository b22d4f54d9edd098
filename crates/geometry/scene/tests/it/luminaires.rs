//! Luminaires in scenes: hung, made of a model's faces, packed and refused.

#![allow(clippy::panic, clippy::unwrap_used, reason = "tests")]

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_photometry::{LuminousOpening, OpeningShape, PhotometricWeb, Photometry, WebPole};
use holo_scene::{
    Hanging, HungLuminaire, LoadOptions, Loaded, LuminousPart, Material, Scene, SceneError, load,
};

use crate::common::arrays_of;

const LAMP: &str = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 3 1 2 0.3 1.2 0\n1 1 20\n0 45 90\n\
    0 45 90\n1000 700 0\n1000 500 0\n1000 300 0\n";

fn lamp() -> Photometry {
    Photometry::read(LAMP.as_bytes()).unwrap()
}

fn floor() -> Scene {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|corner| corner * 10.0);
    let materials = vec![Material::grey("floor")];
    Scene::from_world(&corners, &[[0, 1, 2]], &[0], materials, [0.0; 3]).unwrap().0
}

fn hung(name: &str, place: DVec3) -> HungLuminaire {
    let photometry = lamp();
    HungLuminaire {
        name: name.into(),
        group: "desks".into(),
        place,
        axes: [DVec3::X, DVec3::Y, DVec3::Z],
        mesh: Arc::new(photometry.opening.mesh(photometry.web.halves())),
        web: Arc::new(photometry.web),
        colour: [1.0; 3],
    }
}

/// Returns the flux that a scene's luminaires emit, lumens.
fn flux(scene: &Scene, unit: f64) -> f64 {
    let all = scene.emitters().map(|triangle| {
        let material = scene.material(triangle);
        let sides = if material.two_sided_emission { 2.0 } else { 1.0 };
        sides * scene.area(triangle) * f64::from(material.emission[1])
    });
    all.sum::<f64>() * std::f64::consts::PI * 179.0 * unit * unit
}

#[test]
fn hung_luminaires_have_faces_of_their_own_and_the_flux_of_their_file() {
    for unit in [1.0, 0.001] {
        let places = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 2.0, 3.0)].map(|p| p / unit);
        let two = [hung("left", places[0]), hung("right", places[1])];
        let scene = floor().with_luminaires_hung(&two, unit).unwrap();
        assert_eq!(scene.features().luminaires, 2);
        assert_eq!(scene.emitters().count(), 4);
        let expected = 2.0 * lamp().web.flux();
        assert!((flux(&scene, unit) / expected - 1.0).abs() < 1e-3, "{unit}");
        let [left, right] = scene.luminaires() else { panic!() };
        assert_eq!((left.name.as_str(), right.group.as_str()), ("left", "desks"));
        let first = scene.emitters().next().unwrap();
        assert_eq!(scene.luminaire_of(scene.material_id(first)).unwrap().name, "left");
        assert!(scene.luminaire_of(0).is_none());
        // The long side lies along x.
        let corners = scene.corners(first);
        let extent =
            corners[0].max(corners[1]).max(corners[2]) - corners[0].min(corners[1]).min(corners[2]);
        assert!((f64::from(extent.x) * unit - 1.2).abs() < 1e-3, "{extent}");
    }
}

#[test]
fn the_share_of_a_direction_is_its_intensity_over_the_area_that_is_seen() {
    let scene = floor().with_luminaires_hung(&[hung("one", DVec3::Z)], 1.0).unwrap();
    let luminaire = &scene.luminaires()[0];
    let emission = f64::from(scene.materials[luminaire.material as usize].emission[0]);
    for (away, candela) in [
        (Vec3::NEG_Z, 1000.0),
        (Vec3::new(1.0, 0.0, -1.0).normalize(), 700.0),
        (Vec3::new(0.0, 1.0, -1.0).normalize(), 300.0),
    ] {
        let radiance = candela / (0.36 * f64::from(-away.z) * 179.0);
        let found = emission * f64::from(luminaire.share(away));
        assert!((found / radiance - 1.0).abs() < 1e-4, "{away}: {found} {radiance}");
    }
    assert_eq!(luminaire.share(Vec3::Z), 0.0);
    let greatest = f64::from(luminaire.greatest_share(10_000));
    assert!(greatest >= f64::from(luminaire.share(Vec3::NEG_Z)) * 0.999, "{greatest}");
    let brightest = scene.brightest_emissions().flatten().fold(0.0, f32::max);
    assert!(f64::from(brightest) >= 0.999 * 1000.0 / (0.36 * 179.0));
}

#[test]
fn luminaires_are_packed_with_each_web_once() {
    let two = [hung("left", DVec3::Z), hung("right", DVec3::new(2.0, 0.0, 3.0))];
    let scene = floor().with_luminaires_hung(&two, 1.0).unwrap();
    let packed = scene.pack();
    let one = floor().with_luminaires_hung(&two[..1], 1.0).unwrap().pack().len();
    assert!(packed.len() - one < 400, "{}", packed.len() - one);
    let again = Scene::unpack(&packed).unwrap();
    assert_eq!(again, scene);
    assert_eq!(again.pack(), packed);
    let away = Vec3::new(0.3, 0.2, -0.8).normalize();
    assert_eq!(again.luminaires()[1].share(away), scene.luminaires()[1].share(away));
    for end in scene_part(&packed)..packed.len() {
        assert!(Scene::unpack(&packed[..end]).is_err(), "{end}");
    }
    for at in scene_part(&packed)..packed.len() {
        let mut damaged = packed.clone();
        damaged[at] ^= 0x40;
        if let Ok(scene) = Scene::unpack(&damaged) {
            assert_eq!(scene.pack(), damaged, "{at}");
        }
    }
}

#[test]
fn luminaires_have_the_same_light_after_their_scene_was_taken_apart() {
    let two = [hung("left", DVec3::Z), hung("right", DVec3::new(2.0, 0.0, 3.0))];
    let scene = floor().with_luminaires_hung(&two, 1.0).unwrap();
    let again = Scene::from_frame(&scene.pack_frame().unwrap(), arrays_of(&scene)).unwrap();
    assert_eq!(again, scene);
    let away = Vec3::new(0.3, 0.2, -0.8).normalize();
    assert!(scene.luminaires()[1].share(away) > 0.0);
    assert_eq!(again.luminaires()[1].share(away), scene.luminaires()[1].share(away));
}

/// Returns where the part after materials begins, about.
fn scene_part(packed: &[u8]) -> usize {
    let plain = floor().pack().len();
    plain.min(packed.len())
}

#[test]
fn impossible_luminaires_are_refused() {
    let scene = floor().with_luminaires_hung(&[hung("one", DVec3::Z)], 1.0).unwrap();
    let refused = |change: &dyn Fn(&mut holo_scene::Luminaire)| {
        let mut all = scene.luminaires().to_vec();
        change(&mut all[0]);
        let error = scene.clone().with_luminaires(all).unwrap_err();
        assert!(matches!(error, SceneError::Luminaire(0)), "{error}");
    };
    refused(&|one| one.material = 7);
    refused(&|one| one.axes = [[1.0, 0.0, 0.0]; 3]);
    refused(&|one| one.axes[2] = [0.0, 0.0, f32::NAN]);
    refused(&|one| one.name = "n".repeat(2000));
    let twice = [scene.luminaires(), scene.luminaires()].concat();
    assert!(matches!(scene.clone().with_luminaires(twice), Err(SceneError::Luminaire(1))));
    // Its faces vanish in the rounding of positions.
    let far = floor().with_luminaires_hung(&[hung("far", DVec3::X * 1e11)], 1.0).unwrap_err();
    assert!(matches!(far, SceneError::Luminaire(0)), "{far}");
}

fn written(folder: &Path, obj: &str, mtl: &str) -> Loaded {
    std::fs::write(folder.join("lamp.ies"), LAMP).unwrap();
    std::fs::write(folder.join("a.mtl"), mtl).unwrap();
    std::fs::write(folder.join("a.obj"), format!("mtllib a.mtl\n{obj}")).unwrap();
    load(&folder.join("a.obj"), &LoadOptions::default()).unwrap()
}

/// Two panels of 0.3 by 1.2 that face down, the first along y and the second along x, over a floor.
const PANELS: &str = "v 0 0 3\nv 0 1.2 3\nv 0.3 1.2 3\nv 0.3 0 3\nv 2 0 3\nv 2 0.3 3\nv 3.2 0.3 3\n\
    v 3.2 0 3\nv -5 -5 0\nv 5 -5 0\nv 5 5 0\nusemtl lamp_A\nf 1 2 3 4\nf 5 6 7 8\nusemtl floor\n\
    f 9 10 11\n";

#[test]
fn faces_of_an_obj_material_become_luminaires_that_lie_along_them() {
    let folder = tempfile::tempdir().unwrap();
    let mtl = "newmtl lamp_A\nies lamp.ies\nnewmtl floor\nKd 0.5 0.5 0.5\n";
    let loaded = written(folder.path(), PANELS, mtl);
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let [named] = &loaded.photometry[..] else { panic!() };
    let LuminousPart::Material { id, turn } = named.part else { panic!() };
    assert_eq!((named.path.file_name().unwrap().to_str(), turn), (Some("lamp.ies"), 0.0));
    let hanging = Hanging { up: DVec3::Z, unit: 1.0, turn };
    let (scene, count) =
        loaded.scene.with_luminous_material(id, &lamp(), [1.0; 3], hanging).unwrap();
    assert_eq!(count, 2);
    let [first, second] = scene.luminaires() else { panic!() };
    assert_eq!((first.name.as_str(), first.group.as_str()), ("lamp_A 1", "lamp_A"));
    // C0 lies along the file's length of 1.2 m.
    let is = |axis: [f32; 3], expected: Vec3| Vec3::from(axis).distance(expected) < 1e-4;
    assert!(is(first.axes[0], Vec3::Y) && is(second.axes[0], Vec3::X), "{first:?} {second:?}");
    assert!(is(first.axes[2], Vec3::Z));
    assert!((flux(&scene, 1.0) / (2.0 * lamp().web.flux()) - 1.0).abs() < 1e-3);
    assert_eq!(Scene::unpack(&scene.pack()).unwrap(), scene);
}

#[test]
fn missing_photometric_files_and_bad_statements_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mtl = "newmtl lamp_A\nies -turn 90 \"LAMP.IES\"\nnewmtl floor\nies\nies -turn x y\nies ../a.ies\n";
    let loaded = written(folder.path(), PANELS, mtl);
    assert!(matches!(
        loaded.photometry[..],
        [holo_scene::NamedPhotometry { part: LuminousPart::Material { turn: 90.0, .. }, .. }]
    ));
    let said: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let has = |line: &str, words: &str| said.iter().any(|w| w.contains(line) && w.contains(words));
    assert!(has(":4:", "takes a file") && has(":5:", "-turn DEGREES"), "{said:?}");
    assert!(has(":6:", "no light"), "{said:?}");
}

#[test]
fn gltf_nodes_name_photometric_files_in_extras_or_by_their_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("lamp.ies"), LAMP).unwrap();
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1,2,3]}],
        "extensionsUsed":["KHR_lights_punctual"],
        "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":40}]}},
        "nodes":[{"mesh":0},{"name":"desk","translation":[1,2,3],"extras":{"ies":"lamp.ies"}},
        {"name":"lamp.ies.001","extensions":{"KHR_lights_punctual":{"light":0}}},
        {"name":"gone","extras":{"ies":"gone.ies"}}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
        "min":[0,0,0],"max":[1,1,0]}],"bufferViews":[{"buffer":0,"byteLength":36}],
        "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, json).unwrap();
    let loaded = load(&path, &LoadOptions::default()).unwrap();
    assert!(loaded.scene.punctual_lights.is_empty());
    let said: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert!(said.iter().any(|w| w.contains("node gone") && w.contains("gone.ies")), "{said:?}");
    let parts: Vec<_> = loaded.photometry.iter().map(|named| &named.part).collect();
    let [LuminousPart::Node { name, matrix }, LuminousPart::Node { matrix: light, .. }] = parts[..]
    else {
        panic!("{parts:?}")
    };
    assert_eq!(name, "desk");
    assert_eq!(matrix.transform_point3(DVec3::ZERO), DVec3::new(1.0, 2.0, 3.0));
    // A light shines along -z; a luminaire along -y.
    assert!(light.transform_vector3(DVec3::NEG_Y).distance(DVec3::NEG_Z) < 1e-9);
}

#[test]
fn a_web_without_a_full_turn_is_dark_beyond_it() {
    let half =
        PhotometricWeb::new(WebPole::Width, vec![0.0, 1.0, 2.0], vec![-1.0, 1.0], vec![1.0; 6])
            .unwrap();
    assert_eq!((half.intensity(Vec3::NEG_Z), half.intensity(Vec3::Z)), (1.0, 0.0));
    let panel = LuminousOpening { shape: OpeningShape::Rectangle, size: [1.0, 1.0, 0.0] };
    assert!(!panel.mesh(half.halves()).is_two_sided);
}
