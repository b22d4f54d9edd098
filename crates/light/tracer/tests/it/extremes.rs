//! Tests scenes with errors or at the limits of numbers. Results are finite, and right where the
//! right result is defined.

use crate::common::{BLACK, Model, estimate, expect};
use glam::DVec3;
use holo_scene::{Bsdf, Scene};
use holo_tracer::{Settings, Tracer};

const KD: [f32; 3] = [0.5, 0.75, 0.0];
const LE: [f32; 3] = [1.0, 2.0, 3.0];
/// Radiance in a closed room that emits everywhere: L = Le / (1 - kd).
const INSIDE: [f64; 3] = [2.0, 8.0, 3.0];

const DIRECTIONS: [DVec3; 4] = [
    DVec3::X,
    DVec3::new(-0.5, 0.7, 0.9),
    DVec3::new(0.1, -0.2, -1.0),
    DVec3::new(-0.9, -0.8, 0.3),
];

fn glowing() -> (Model, u32) {
    let mut model = Model::default();
    let wall = model.material(Bsdf::Diffuse { kd: KD }, LE);
    (model, wall)
}

fn expect_furnace(tracer: &Tracer, eye: DVec3) {
    for direction in DIRECTIONS {
        expect(estimate(tracer, eye, direction, 4_000), INSIDE);
    }
}

#[test]
fn a_gap_of_a_millionth_of_the_scene_neither_leaks_nor_loses_light() {
    // At the scene's boundary, where rounding is greatest; along an axis, and oblique.
    for (name, normal) in [("level", DVec3::Z), ("askew", DVec3::new(0.36, 0.48, 0.8))] {
        let turned = glam::DQuat::from_rotation_arc(DVec3::Z, normal);
        let at = |x: f64, y: f64, z: f64| (turned * DVec3::new(x, y, z)).to_array();
        let gap = 4e-6;
        let (low, high) = (-2.0, -2.0 + gap);
        let mut model = Model { sky: [0.5; 3], ..Model::default() };
        let floor = model.material(Bsdf::Diffuse { kd: [0.8, 0.5, 0.2] }, [0.0; 3]);
        let lamp = model.material(BLACK, LE);
        let card = model.material(BLACK, [0.0; 3]);
        model.polygon(
            &[at(-2.0, -2.0, low), at(2.0, -2.0, low), at(2.0, 2.0, low), at(-2.0, 2.0, low)],
            floor,
        );
        // A triangle at the other end gives the scene its size.
        model.polygon(&[at(-0.1, -0.1, 2.0), at(0.1, -0.1, 2.0), at(0.1, 0.1, 2.0)], card);
        model.polygon(
            &[at(-1.7, -1.0, high), at(-1.7, 1.0, high), at(-0.2, 1.0, high), at(-0.2, -1.0, high)],
            lamp,
        );
        model.polygon(
            &[at(0.2, -1.0, high), at(0.2, 1.0, high), at(1.7, 1.0, high), at(1.7, -1.0, high)],
            card,
        );
        let tracer = model.tracer(None);
        let axis = |v: DVec3| turned * v;
        for (slant, y) in [(0.0, 0.3), (0.8, -0.31), (3.0, 0.07)] {
            let direction = axis(DVec3::new(slant, 0.2, -1.0).normalize());
            let eye = |x| DVec3::from_array(at(x, y, low + gap / 2.0));
            // The lamp covers all that the floor below it sees, except one part in 10¹¹.
            expect(
                estimate(&tracer, eye(-0.9), direction, 2_000),
                [0, 1, 2].map(|c| f64::from(LE[c]) * f64::from([0.8_f32, 0.5, 0.2][c])),
            );
            // Sideways light from the lamp's edge is one part in 10¹¹ too.
            let below = estimate(&tracer, eye(0.9), direction, 2_000).mean;
            assert!(below[0] < 1e-10, "{name}: {below:?} below the card");
            let found = tracer.trace(eye(-0.9), direction, 0).distance;
            let expected = gap / 2.0 * (1.0 + 0.04 + slant * slant).sqrt();
            // Half a unit in the last place of 2, once for the plane and once for the point.
            assert!(
                (found - expected).abs() < 2.5e-7 * (1.0 + slant),
                "{name}: {found} {expected}"
            );
        }
    }
}

/// Adds a rectangle as a row of 24 strips, each half as wide as the one before: slivers.
fn slivers(model: &mut Model, [a, b, c, d]: [DVec3; 4], material: u32) {
    let mut from = 0.0;
    for i in 0..24 {
        let to = if i == 23 { 1.0 } else { 1.0 - 0.5_f64.powi(i + 1) };
        let corners =
            [a.lerp(b, from), a.lerp(b, to), d.lerp(c, to), d.lerp(c, from)].map(|p| p.to_array());
        model.polygon(&corners, material);
        from = to;
    }
}

fn faces(low: f64, high: f64) -> Vec<[DVec3; 4]> {
    let mut model = Model::default();
    let m = model.material(BLACK, [0.0; 3]);
    model.cuboid([low; 3], [high; 3], false, m);
    model.positions.chunks(4).map(|c| [c[0], c[1], c[2], c[3]]).collect()
}

#[test]
fn a_room_of_slivers_is_as_bright_as_one_of_squares() {
    let (mut model, wall) = glowing();
    for face in faces(-1.0, 1.0) {
        slivers(&mut model, face, wall);
    }
    let tracer = model.tracer(None);
    expect_furnace(&tracer, DVec3::new(0.1, 0.2, -0.3));
    // At the slivers, and beside the room's edge, as close as 2e-7.
    for i in (8..24).step_by(3) {
        let y = 1.0 - 1.5 * 2.0_f64.powi(-i);
        for direction in
            [DVec3::new(1.0, y, 0.3), DVec3::new(-1.0, -0.3, y), DVec3::new(y, -1.0, 0.5)]
        {
            expect(estimate(&tracer, DVec3::ZERO, direction, 5_000), INSIDE);
        }
    }
}

#[test]
fn a_room_of_duplicate_faces_is_as_bright_as_one_of_single_faces() {
    let (mut model, wall) = glowing();
    let other = model.material(Bsdf::Diffuse { kd: KD }, LE);
    for material in [wall, other, wall] {
        model.cuboid([-1.0; 3], [1.0; 3], false, material);
    }
    expect_furnace(&model.tracer(None), DVec3::new(0.1, 0.2, -0.3));
    // The duplicates list their corners in another order and face away.
    let (mut model, wall) = glowing();
    model.cuboid([-1.0; 3], [1.0; 3], false, wall);
    let inwards = model.triangles.clone();
    model.triangles.extend(inwards.iter().map(|[a, b, c]| [*c, *b, *a]));
    model.triangles.extend(inwards.iter().map(|[a, b, c]| [*b, *c, *a]));
    model.ids.extend(vec![wall; 2 * inwards.len()]);
    expect_furnace(&model.tracer(None), DVec3::new(0.1, 0.2, -0.3));
    // Rays meet the faces that face them in any order.
    model.triangles.rotate_left(inwards.len());
    expect_furnace(&model.tracer(None), DVec3::new(0.1, 0.2, -0.3));
    // A lamp and a card with the same corners: the lamp counts.
    let (mut model, lamp) = glowing();
    let card = model.material(Bsdf::Diffuse { kd: KD }, [0.0; 3]);
    for material in [card, lamp] {
        model.cuboid([-1.0; 3], [1.0; 3], false, material);
    }
    expect_furnace(&model.tracer(None), DVec3::new(0.1, 0.2, -0.3));
    // A lamp that shines on both sides, and whose front is outside: the card hides it.
    let (mut model, lamp) = glowing();
    let card = model.material(Bsdf::Diffuse { kd: KD }, [0.0; 3]);
    model.two_sided(lamp);
    model.cuboid([-1.0; 3], [1.0; 3], false, card);
    model.cuboid([-1.0; 3], [1.0; 3], true, lamp);
    assert_eq!(estimate(&model.tracer(None), DVec3::ZERO, DVec3::X, 1_000).mean, [0.0; 3]);
}

#[test]
fn coplanar_faces_that_overlap_give_finite_light_of_the_right_order() {
    let (mut model, wall) = glowing();
    model.cuboid([-1.0; 3], [1.0; 3], false, wall);
    for shift in [0.1, -0.23, 0.5] {
        let at = |a: f64, b: f64| [1.0, shift + a, shift * 0.7 + b];
        model.polygon(&[at(-0.4, -0.4), at(-0.4, 0.4), at(0.4, 0.4), at(0.4, -0.4)], wall);
    }
    let tracer = model.tracer(None);
    for direction in DIRECTIONS {
        let found = estimate(&tracer, DVec3::new(0.1, 0.2, -0.3), direction, 2_000);
        let right = found
            .mean
            .iter()
            .zip(INSIDE)
            .all(|(mean, inside)| *mean > 0.8 * inside && *mean < 1.5 * inside);
        assert!(right, "{found:?}");
    }
}

#[test]
fn a_room_of_inverted_normals_is_dark_unless_its_faces_emit_both_ways() {
    let (mut model, wall) = glowing();
    model.cuboid([-1.0; 3], [1.0; 3], true, wall);
    assert_eq!(estimate(&model.tracer(None), DVec3::ZERO, DIRECTIONS[1], 1_000).mean, [0.0; 3]);
    model.two_sided(wall);
    expect_furnace(&model.tracer(None), DVec3::new(0.1, 0.2, -0.3));
}

#[test]
fn radiance_from_the_least_to_the_greatest_float_is_exact() {
    for power in [-30, -20, -10, 10, 20] {
        let (mut model, wall) = glowing();
        let scale = 10.0_f32.powi(power);
        model.materials[wall as usize].emission = LE.map(|c| c * scale / 3.0);
        model.cuboid([-1.0; 3], [1.0; 3], false, wall);
        let tracer = model.tracer(None);
        let found = estimate(&tracer, DVec3::new(0.1, 0.2, -0.3), DIRECTIONS[1], 10_000);
        expect(found, INSIDE.map(|c| c * f64::from(scale) / 3.0));
    }
    // Beside a strong light a weak one is lost in rounding, but must not reduce it.
    let (mut model, wall) = glowing();
    model.cuboid([-1.0; 3], [1.0; 3], false, wall);
    let weak = model.material(Bsdf::Diffuse { kd: KD }, [1e-10; 3]);
    model.ids[..2].fill(weak);
    let strong = model.material(Bsdf::Diffuse { kd: KD }, [1e10; 3]);
    model.ids[2..4].fill(strong);
    let tracer = model.tracer(None);
    for direction in DIRECTIONS {
        let found = estimate(&tracer, DVec3::new(0.1, 0.2, -0.3), direction, 2_000);
        assert!(found.mean.iter().all(|m| m.is_finite() && (0.0..=4e10).contains(m)), "{found:?}");
    }
}

#[test]
fn faces_without_area_are_left_out_and_named() {
    let positions = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0, DVec3::Y];
    let material = holo_scene::Material::grey("m");
    let triangles = [[0, 1, 2], [0, 0, 3], [0, 1, 3]];
    let (scene, dropped) =
        Scene::from_world(&positions, &triangles, &[0; 3], vec![material], [0.0; 3])
            .expect("valid");
    assert_eq!((dropped, scene.triangles().len()), (vec![0, 1], 1));
    assert!(Tracer::new(scene.into(), Settings::default()).is_ok());
}

/// In a closed room of albedo 1, only the black lamp absorbs light. So all walls are as bright as
/// the lamp: it absorbs what it emits.
#[test]
fn a_room_that_absorbs_nothing_but_at_its_lamp_is_as_bright_as_the_lamp() {
    let mut model = Model::default();
    let white = model.material(Bsdf::Diffuse { kd: [1.0; 3] }, [0.0; 3]);
    let lamp = model.material(BLACK, LE);
    for face in faces(-1.0, 1.0).iter().filter(|face| face.iter().any(|corner| corner.z < 0.0)) {
        model.polygon(&face.map(|corner| corner.to_array()), white);
    }
    // The lamp is the middle of nine parts of the ceiling: light meets some 54 surfaces.
    let at = |i: u32, j: u32| [f64::from(i) / 1.5 - 1.0, f64::from(j) / 1.5 - 1.0, 1.0];
    for (i, j) in (0..9).map(|part| (part / 3, part % 3)) {
        let material = if (i, j) == (1, 1) { lamp } else { white };
        model.polygon(&[at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)], material);
    }
    let tracer = model.tracer(None);
    for direction in [DVec3::X, DVec3::new(-0.5, 0.7, -0.9)] {
        let found = estimate(&tracer, DVec3::new(0.1, 0.2, -0.3), direction, 4_000);
        expect(found, LE.map(f64::from));
        // At 256 paths, the error is less than a tenth most of the time. Paths of weight 1 that
        // meet the lamp once have no error, except if light takes more than 300 surfaces.
        for (error, lamp) in found.error.into_iter().zip(LE) {
            let error = error / f64::from(lamp);
            assert!(error * (4_000.0_f64 / 256.0).sqrt() < 0.1, "{error}");
        }
    }
}
