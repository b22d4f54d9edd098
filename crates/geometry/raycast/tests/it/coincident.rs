//! Tests which of several faces at one place a ray meets.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};
use holo_raycast::{Hit, MAX_TILE, NO_TRIANGLE, Ray, Raycaster};
use holo_scene::{Material, Scene};

/// A place in space: a turn, a size and an offset.
type Place = (DMat3, f64, DVec3);

fn places() -> Vec<Place> {
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
    vec![
        (DMat3::IDENTITY, 1.0, DVec3::ZERO),
        (turn, 1.0, DVec3::ZERO),
        (turn, 1e-3, DVec3::new(2.0, -3.0, 5.0)),
        (turn, 1e5, DVec3::splat(1e7)),
        (DMat3::from_rotation_y(0.001), 7.0, DVec3::new(0.1, 0.2, 0.3)),
    ]
}

/// A scene of squares in the plane z = 0, each with two corners, its side and its material. Those
/// of material 1 emit light. Around them is a large box, so that the origin is not in their plane.
fn scene(squares: &[([f64; 4], bool, u32)], (turn, size, offset): Place) -> Arc<Raycaster> {
    let (mut positions, mut triangles, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    for &([x0, y0, x1, y1], is_up, material) in squares {
        let first = positions.len() as u32;
        positions
            .extend([[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| DVec3::new(x, y, 0.0)));
        // Small squares are cut along the other diagonal.
        let cut = if x1 - x0 > 1.0 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] };
        for [a, b, c] in cut {
            let corners = if is_up { [a, b, c] } else { [a, c, b] };
            triangles.push(corners.map(|corner| first + corner));
            ids.push(material);
        }
    }
    let first = positions.len() as u32;
    positions.extend([[9.0, 0.0, 8.0], [9.0, 1.0, 8.0], [9.0, 0.0, 7.0]].map(DVec3::from_array));
    triangles.push([first, first + 1, first + 2]);
    ids.push(0);
    positions.iter_mut().for_each(|p| *p = turn * (*p * size) + offset);
    let lamp = Material { emission: [1.0; 3], ..Material::grey("lamp") };
    let materials = vec![Material::grey("grey"), lamp];
    let made = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap();
    assert!(made.1.is_empty());
    Arc::new(Raycaster::build(Arc::new(made.0)).unwrap())
}

/// Returns the square that each of 64 rays meets at a grid of points between -1 and 1, from above
/// or below. All queries must agree.
fn met(raycaster: &Raycaster, (turn, size, offset): Place, from_above: bool) -> Vec<Option<u32>> {
    let at = |n: i32| (f64::from(n) + 0.5) / 4.0 - 1.0 + 0.013;
    let height = if from_above { 2.0 } else { -2.0 };
    let eye = turn * DVec3::new(0.3, -0.2, height) * size + offset;
    let grid = (0..8).flat_map(|y| (0..8).map(move |x| (x, y)));
    let rays: Vec<Ray> = grid
        .map(|(x, y)| {
            let target = turn * DVec3::new(at(x), at(y), 0.0) * size + offset;
            raycaster.localize(eye, (target - eye).normalize()).unwrap().0
        })
        .collect();
    let single: Vec<Option<Hit>> = rays.iter().map(|ray| raycaster.nearest(ray)).collect();
    let mut many = [None; MAX_TILE];
    raycaster.nearest_many(&rays, &mut many);
    assert_eq!(many[..], single[..]);
    let mut tile = [None; MAX_TILE];
    raycaster.nearest_tile(&rays, &mut tile);
    assert_eq!(tile[..], single[..]);
    let mut from = [None; MAX_TILE];
    raycaster.nearest_many_from(&rays, &[NO_TRIANGLE; MAX_TILE], &mut from);
    assert_eq!(from[..], single[..]);
    for (ray, hit) in rays.iter().zip(&single) {
        assert_eq!(raycaster.occluded(ray), hit.is_some());
        let Some(hit) = hit else { continue };
        // Seen from there, it is shown; a face at its place is not.
        assert_eq!(raycaster.shown(hit.triangle, hit.u, hit.v, ray.direction), 1.0);
        // A ray that leaves it on either side meets no other face at its place.
        let point = raycaster.surface(hit.triangle, hit.u, hit.v);
        for direction in [point.normal, -point.normal] {
            let out = holo_raycast::spawn(point.point, point.error, point.normal, direction);
            assert!(raycaster.nearest_from(&Ray::new(out, direction), hit.triangle).is_none());
        }
    }
    single.iter().map(|hit| hit.map(|hit| hit.triangle / 2)).collect()
}

#[test]
fn the_face_that_faces_the_ray_is_met() {
    let whole = [-1.0, -1.0, 1.0, 1.0];
    for place in places() {
        for (first, second) in [(true, false), (false, true)] {
            let raycaster = scene(&[(whole, first, 0), (whole, second, 0)], place);
            let up = if first { 0 } else { 1 };
            assert!(met(&raycaster, place, true).iter().all(|&square| square == Some(up)));
            assert!(met(&raycaster, place, false).iter().all(|&square| square == Some(1 - up)));
            assert_eq!(raycaster.coincident(), [0, 1, 2, 3]);
        }
    }
}

#[test]
fn then_the_lamp_and_then_the_earlier_face_however_they_are_cut() {
    let (whole, part) = ([-1.0, -1.0, 1.0, 1.0], [-0.4, -0.4, 0.5, 0.5]);
    for place in places() {
        for (squares, lamp) in [
            ([(whole, true, 0), (part, true, 1)], 1),
            ([(part, true, 1), (whole, true, 0)], 0),
            ([(part, true, 0), (whole, true, 0)], 0),
        ] {
            let raycaster = scene(&squares, place);
            let found = met(&raycaster, place, true);
            let inside = found.iter().filter(|square| **square == Some(lamp)).count();
            assert_eq!(inside, 16, "{found:?}");
            assert!(found.iter().all(|square| square.is_some()));
        }
        // A face that comes later and does not glow is not met where the first one is.
        let raycaster = scene(&[(whole, true, 0), (part, true, 0)], place);
        assert!(met(&raycaster, place, true).iter().all(|square| *square == Some(0)));
        // A lamp whose front is on the other side is met there alone.
        let raycaster = scene(&[(whole, true, 0), (part, false, 1)], place);
        assert!(met(&raycaster, place, true).iter().all(|square| *square == Some(0)));
        let below = met(&raycaster, place, false);
        assert_eq!(below.iter().filter(|square| **square == Some(1)).count(), 16);
    }
}

#[test]
fn a_hidden_face_is_not_shown() {
    let whole = [-1.0, -1.0, 1.0, 1.0];
    let raycaster = scene(&[(whole, true, 1), (whole, true, 1)], places()[0]);
    let down = Vec3::NEG_Z;
    assert_eq!(raycaster.shown(0, 0.3, 0.3, down), 1.0);
    assert_eq!(raycaster.shown(2, 0.3, 0.3, down), 0.0);
}

#[test]
fn neighbours_and_near_faces_are_not_at_one_place() {
    let half = [([-1.0, -1.0, 0.0, 1.0], true, 0), ([0.0, -1.0, 1.0, 1.0], true, 1)];
    for place in places() {
        assert!(scene(&half, place).coincident().is_empty());
    }
    // A sheet a thousandth of its width above another.
    let (positions, triangles): (Vec<DVec3>, [[u32; 3]; 2]) = (
        [0.0, 1e-3]
            .into_iter()
            .flat_map(|z| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]].map(DVec3::from_array))
            .collect(),
        [[0, 1, 2], [3, 4, 5]],
    );
    let grey = vec![Material::grey("grey")];
    let made = Scene::from_world(&positions, &triangles, &[0; 2], grey, [0.0; 3]).unwrap();
    assert!(Raycaster::build(Arc::new(made.0)).unwrap().coincident().is_empty());
}
