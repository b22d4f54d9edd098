//! Tests of whole scenes, by their own geometry.

use crate::building::ROOMS;
use crate::config::{SECTIONS, VIEWS};
use crate::material::{ALL, NamedMaterial};
use crate::rooms::{Object, SHELL, interior};
use crate::{Bundled, config, cornell, corridor, obj_and_mtl, write};
use glam::DVec3;
use holo_scene::{LoadOptions, Scene, load};
use std::collections::HashMap;
use std::sync::LazyLock;

type Triangle = [DVec3; 3];

static INTERIOR: LazyLock<Vec<Object>> = LazyLock::new(interior);

fn triangles() -> impl Iterator<Item = (Triangle, &'static NamedMaterial)> {
    INTERIOR.iter().flat_map(|object| object.mesh.triangles())
}

fn shell() -> Vec<Triangle> {
    INTERIOR
        .iter()
        .filter(|o| o.name == SHELL)
        .flat_map(|o| o.mesh.triangles().map(|(t, _)| t))
        .collect()
}

/// Returns the distance along a ray to a triangle (Möller and Trumbore 1997).
fn meets([a, b, c]: Triangle, origin: DVec3, direction: DVec3) -> Option<f64> {
    let (u, v, from) = (b - a, c - a, origin - a);
    let p = direction.cross(v);
    let determinant = u.dot(p);
    let (s, q) = (from.dot(p) / determinant, from.cross(u));
    let t = direction.dot(q) / determinant;
    let distance = v.dot(q) / determinant;
    (s >= 0.0 && t >= 0.0 && s + t <= 1.0 && distance > 0.0).then_some(distance)
}

/// Returns the lights as fixtures: triangles connected by shared corners.
fn fixtures() -> Vec<Vec<Triangle>> {
    let lit: Vec<Triangle> =
        triangles().filter(|(_, material)| material.is_light()).map(|(t, _)| t).collect();
    let mut parent: Vec<usize> = (0..lit.len()).collect();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    let mut owner: HashMap<[i64; 3], usize> = HashMap::new();
    for (i, corners) in lit.iter().enumerate() {
        for corner in corners {
            let key = (*corner * 1e5).round().to_array().map(|c| c as i64);
            let first = *owner.entry(key).or_insert(i);
            let (a, b) = (root(&mut parent, first), root(&mut parent, i));
            parent[a] = b;
        }
    }
    let mut groups: HashMap<usize, Vec<Triangle>> = HashMap::new();
    for (i, triangle) in lit.iter().enumerate() {
        groups.entry(root(&mut parent, i)).or_default().push(*triangle);
    }
    groups.into_values().collect()
}

#[test]
fn a_scene_has_the_same_bytes_each_time() {
    for scene in Bundled::ALL {
        assert!(obj_and_mtl(scene) == obj_and_mtl(scene));
        assert_eq!(config(scene), config(scene));
    }
}

#[test]
fn the_interior_is_large_finite_and_within_its_garden() {
    let mut count = 0;
    for (triangle, _) in triangles() {
        count += 1;
        for p in triangle {
            assert!(p.is_finite());
            assert!(
                p.cmpge(DVec3::new(-16.0, -18.0, -0.53)).all()
                    && p.cmple(DVec3::new(28.0, 28.0, 6.0)).all(),
                "{p}"
            );
        }
    }
    assert!((100_000..300_000).contains(&count), "{count} triangles");
}

#[test]
fn furniture_stays_inside_the_house() {
    let (low, high) = (DVec3::new(0.0, 0.0, -1e-9), DVec3::new(11.15, 10.7, 2.7 + 1e-9));
    for object in INTERIOR.iter().filter(|o| ![SHELL, "garden"].contains(&o.name)) {
        for p in &object.mesh.points {
            // Wall linings, and legs that end on the floor, may touch the outer walls but not
            // extend beyond them.
            let slack = DVec3::new(1e-6, 1e-6, 0.021);
            assert!(
                p.cmpge(low - slack).all() && p.cmple(high + slack).all(),
                "{} at {p}",
                object.name
            );
        }
    }
}

#[test]
fn there_are_many_lights_of_different_sizes() {
    let mut areas: Vec<f64> = fixtures()
        .iter()
        .map(|fixture| fixture.iter().map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum())
        .collect();
    areas.sort_by(f64::total_cmp);
    assert!(areas.len() >= 40, "{} fixtures", areas.len());
    assert!(areas[areas.len() - 1] > 100.0 * areas[0], "{areas:?}");
}

/// The light of closed fixtures (globes, rods) is on their outside. Flat and open ones face a room,
/// not a solid.
#[test]
fn lights_shine_into_the_rooms() {
    let all: Vec<Triangle> = triangles().map(|(t, _)| t).collect();
    for fixture in fixtures() {
        let middle = fixture.iter().flatten().sum::<DVec3>() / (3.0 * fixture.len() as f64);
        // Three triangles of each fixture, because a ray against everything takes a millisecond.
        for [a, b, c] in [0, fixture.len() / 2, fixture.len() - 1].map(|i| fixture[i]) {
            let normal = (b - a).cross(c - a).normalize();
            let from = (a * 0.4 + b * 0.35 + c * 0.25) + normal * 1e-4;
            let inside = ROOMS.iter().any(|room| {
                (room.x.0..room.x.1).contains(&from.x)
                    && (room.y.0..room.y.1).contains(&from.y)
                    && (0.0..2.7).contains(&from.z)
            });
            assert!(inside, "the light at {middle} shines from {from}, outside every room");
            let free =
                all.iter().filter_map(|&t| meets(t, from, normal)).fold(f64::INFINITY, f64::min);
            assert!(free > 0.02, "the light at {middle} is covered at {free} m along {normal}");
            // From the inside of a solid, the ray along the normal would end at its far side, seen
            // from within.
            let behind = fixture.iter().filter_map(|&t| meets(t, from, normal)).count();
            assert_eq!(behind, 0, "the light at {middle} looks into itself");
        }
    }
}

/// The house is convex, so a ray that slipped between two of its parts would hit nothing more.
#[test]
fn no_light_leaks_between_walls() {
    let shell = shell();
    let random = &mut crate::random::SeededRandom::new(1);
    for room in ROOMS {
        let from = DVec3::new((room.x.0 + room.x.1) / 2.0, (room.y.0 + room.y.1) / 2.0, 1.3);
        for _ in 0..300 {
            let z = random.range(-1.0, 1.0);
            let (sin, cos) = random.range(0.0, std::f64::consts::TAU).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            let direction = DVec3::new(ring * cos, ring * sin, z);
            let nearest = shell
                .iter()
                .filter_map(|&t| meets(t, from, direction))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest.is_finite(), "{}: a way out along {direction}", room.name);
            let end = from + direction * nearest;
            assert!((-0.021..=2.7 + 1e-9).contains(&end.z), "{}: {end}", room.name);
        }
    }
}

#[test]
fn every_section_lies_in_its_room_clear_of_walls_and_every_eye_in_a_section() {
    let walls = shell();
    for section in &SECTIONS {
        let low = DVec3::from(section.origin);
        let high = low + DVec3::from(section.size);
        let room = ROOMS
            .iter()
            .find(|room| room.name == section.name)
            .expect("sections are named as rooms");
        assert!(
            low.x > room.x.0 && high.x < room.x.1 && low.y > room.y.0 && high.y < room.y.1,
            "{}",
            section.name
        );
        assert!(low.z >= 0.9 && high.z < 2.7, "{}", section.name);
        // Walls are boxes along the axes, so a triangle's bounding box is exact.
        for [a, b, c] in &walls {
            let apart = a.max(*b).max(*c).cmplt(low).any() || a.min(*b).min(*c).cmpgt(high).any();
            assert!(apart, "{} meets a wall at {a}", section.name);
        }
    }
    for view in &VIEWS {
        let eye = DVec3::from(view.vp);
        let within = SECTIONS.iter().any(|s| {
            let low = DVec3::from(s.origin);
            eye.cmpgt(low).all() && eye.cmplt(low + DVec3::from(s.size)).all()
        });
        assert!(within, "{} looks from outside every section", view.name);
        assert!(DVec3::from(view.vd).length() > 0.5 && (30.0..100.0).contains(&view.vh));
    }
    assert_eq!(SECTIONS.len(), ROOMS.len());
}

#[test]
fn the_interior_loads_without_a_warning_and_its_sections_are_empty() {
    let dir = tempfile::tempdir().unwrap();
    let written = write(Bundled::Interior, dir.path()).unwrap();
    let loaded = load(&written.obj, &LoadOptions::default()).unwrap();
    assert!(loaded.warnings.is_empty(), "{}", loaded.warnings[0]);
    // As many as in the mesh, except for slivers that rounding to 10 µm flattens.
    let made = triangles().count();
    let read = loaded.scene.triangles().len();
    assert!(read <= made && read > made - made / 500, "{read} of {made}");
    assert_eq!(loaded.scene.materials.len(), ALL.len(), "a material is defined but not used");
    let features = loaded.scene.features();
    assert!(features.diffuse && features.mirror && features.thin_glass);
    assert_eq!(Scene::unpack(&loaded.scene.pack()).unwrap(), loaded.scene);
    // The bounds are those of the mesh: the file has steps of 10 µm, the scene has f32 around its
    // centre.
    let (low, high) = loaded.scene.bounds();
    let corners = || triangles().flat_map(|(triangle, _)| triangle);
    let (made_low, made_high) =
        (corners().reduce(DVec3::min).unwrap(), corners().reduce(DVec3::max).unwrap());
    assert!((low - made_low).abs().max_element() < 1e-5, "{low} {made_low}");
    assert!((high - made_high).abs().max_element() < 1e-5, "{high} {made_high}");
    for section in &SECTIONS {
        let [w, d, h] = section.size;
        let axes = [DVec3::X * w, DVec3::Y * d, DVec3::Z * h];
        assert!(
            !loaded.scene.geometry_inside(DVec3::from(section.origin), axes),
            "{} is not empty",
            section.name
        );
    }
}

#[test]
fn cornell_loads_and_has_the_published_measurements() {
    let dir = tempfile::tempdir().unwrap();
    let written = write(Bundled::Cornell, dir.path()).unwrap();
    let loaded = load(&written.obj, &LoadOptions::default()).unwrap();
    assert!(loaded.warnings.is_empty(), "{}", loaded.warnings[0]);
    assert_eq!((loaded.scene.triangles().len(), loaded.scene.materials.len()), (32, 4));
    let features = loaded.scene.features();
    assert!(features.diffuse && !features.mirror && !features.sky);
    assert_eq!(features.emitters, 2);
    let lamp = loaded.scene.emitters().next().unwrap();
    assert_eq!(loaded.scene.material(lamp).emission, [17.0, 12.0, 4.0]);
    assert!(loaded.scene.normal(lamp).y < -0.999, "the lamp shines down");
    // The blocks stand inside a section that reaches into the box, not inside one before it.
    let axes = [DVec3::X * 4.3, DVec3::Y * 4.2, DVec3::Z * 5.0];
    assert!(loaded.scene.geometry_inside(DVec3::new(0.6, 0.6, -4.0), axes));
    assert!(!loaded.scene.geometry_inside(DVec3::new(0.6, 0.6, -5.5), axes));
    let (low, high) = loaded.scene.bounds();
    assert!(
        (low - DVec3::ZERO).length() < 1e-6
            && (high - DVec3::new(5.56, 5.488, 5.592)).length() < 1e-6
    );
    // The published box in whole millimetres: a lamp of 130 mm × 105 mm that faces down, blocks of
    // 165 mm and 330 mm.
    let area = |[a, b, _, d]: [[f64; 3]; 4]| {
        let [a, b, d] = [a, b, d].map(DVec3::from);
        (b - a).cross(d - a)
    };
    let lamp = cornell::QUADS.iter().find(|quad| quad.0 == "light").unwrap();
    assert!((area(lamp.1) - DVec3::new(0.0, -130.0 * 105.0, 0.0)).length() < 1e-6);
    for (first, height) in [(6, 165.0), (11, 330.0)] {
        let top = cornell::QUADS[first].1;
        assert!(top.iter().all(|corner| corner[1] == height));
        for (i, side) in cornell::QUADS[first + 1..first + 5].iter().enumerate() {
            let feet = side.1.iter().filter(|corner| corner[1] == 0.0).count();
            assert_eq!(feet, 2, "side {i}");
            assert!(
                side.1.iter().all(|c| top.iter().any(|t| t[0] == c[0] && t[2] == c[2])),
                "side {i}"
            );
        }
    }
}

/// The bundled box has the numbers of the file that the reference pictures were made from.
#[test]
#[ignore = "needs ../shared"]
fn cornell_equals_the_shared_one() {
    let shared = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes/cornell/cornell.obj");
    let theirs = std::fs::read_to_string(shared).unwrap();
    let numbers = |text: &str| -> Vec<String> {
        text.lines()
            .filter(|l| ["v ", "f ", "us"].iter().any(|k| l.starts_with(k)))
            .map(str::to_owned)
            .collect()
    };
    assert_eq!(numbers(&cornell::obj()), numbers(&theirs));
}

#[test]
fn the_corridor_is_small_closed_and_loads_without_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let written = write(Bundled::Corridor, dir.path()).unwrap();
    let loaded = load(&written.obj, &LoadOptions::default()).unwrap();
    assert!(loaded.warnings.is_empty(), "{}", loaded.warnings[0]);
    assert_eq!(loaded.scene.triangles().len(), 70);
    let all = corridor_triangles();
    let random = &mut crate::random::SeededRandom::new(2);
    for from in
        [[2.2, 0.8, 1.55], [7.1, 0.6, 1.55], [7.0, 3.0, 1.5], [9.0, 7.0, 1.0]].map(DVec3::from)
    {
        for _ in 0..2000 {
            let z = random.range(-1.0, 1.0);
            let (sin, cos) = random.range(0.0, std::f64::consts::TAU).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            let direction = DVec3::new(ring * cos, ring * sin, z);
            let nearest =
                all.iter().filter_map(|&t| meets(t, from, direction)).fold(f64::INFINITY, f64::min);
            assert!(nearest.is_finite(), "a way out from {from} along {direction}");
        }
    }
}

#[test]
fn the_corridor_has_no_direct_light_and_sees_surfaces_that_have() {
    let corners =
        || corridor::RECTANGLES.iter().flat_map(|r| r.corners().map(|corner| (r.material, corner)));
    let lamp: Vec<[f64; 3]> =
        corners().filter(|(m, _)| *m == "lamp").map(|(_, corner)| corner).collect();
    let [a, b, c] = [lamp[0], lamp[1], lamp[2]].map(DVec3::from);
    let normal = (b - a).cross(c - a).normalize();
    assert_eq!(normal, DVec3::Y, "the lamp shines into the room");
    // Both arms and the doorway lie behind the lamp's plane.
    const { assert!(corridor::CORRIDOR_TO < corridor::ROOM_FROM) };
    assert!(lamp.iter().all(|corner| corner[1] > corridor::ROOM_FROM));
    // From the bend, the far wall of the room is visible, and from there the lamp.
    let all = corridor_triangles();
    let nearest = |from: DVec3, to: DVec3| {
        all.iter().filter_map(|&t| meets(t, from, to - from)).fold(f64::INFINITY, f64::min)
    };
    let (bend, far_wall) = (DVec3::new(7.1, 0.6, 1.55), DVec3::new(7.2, 7.55, 1.5));
    assert!((nearest(bend, far_wall) - 1.0).abs() < 1e-9);
    let middle = (DVec3::from(lamp[0]) + DVec3::from(lamp[2])) / 2.0 + DVec3::new(0.05, 0.0, 0.02);
    assert!((nearest(far_wall - DVec3::Y * 1e-6, middle) - 1.0).abs() < 1e-9);
}

fn corridor_triangles() -> Vec<Triangle> {
    let quads = corridor::RECTANGLES.iter().map(|rectangle| rectangle.corners().map(DVec3::from));
    quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

#[test]
fn sections_of_the_corridor_are_empty() {
    let dir = tempfile::tempdir().unwrap();
    let loaded =
        load(&write(Bundled::Corridor, dir.path()).unwrap().obj, &LoadOptions::default()).unwrap();
    let numbers = |line: &str| -> Vec<f64> {
        line.split(|c: char| !"-.0123456789".contains(c))
            .filter_map(|word| word.parse().ok())
            .collect()
    };
    let text = config(Bundled::Corridor);
    let origins = text.lines().filter(|line| line.starts_with("origin")).map(numbers);
    let axes = text.lines().filter(|line| line.starts_with("axes")).map(numbers);
    let mut count = 0;
    for (origin, axes) in origins.zip(axes) {
        let axis = |i: usize| DVec3::from_slice(&axes[3 * i..]);
        let origin = DVec3::from_slice(&origin);
        assert!(
            !loaded.scene.geometry_inside(origin, [axis(0), axis(1), axis(2)]),
            "the section at {origin}"
        );
        count += 1;
    }
    assert_eq!(count, 3);
}

#[test]
fn models_are_read_whole_and_have_the_same_bytes_each_time() {
    let folder = tempfile::tempdir().unwrap();
    for name in crate::MODELS {
        let file = crate::write_model(name, folder.path()).unwrap().unwrap();
        let bytes = std::fs::read(&file).unwrap();
        crate::write_model(name, folder.path()).unwrap();
        assert!(bytes == std::fs::read(&file).unwrap(), "{name}");
        let loaded = load(&file, &LoadOptions::default()).unwrap();
        assert!(loaded.scene.triangles().len() > 40, "{name}");
        let features = loaded.scene.features();
        assert!(features.smooth, "{name}: its vase is round");
        let has_tiles = !["rhino-vase", "revit-flat"].contains(&name);
        assert_eq!(features.textures, has_tiles, "{name}: {:?}", loaded.warnings);
    }
    assert!(crate::write_model("none", folder.path()).unwrap().is_none());
}
