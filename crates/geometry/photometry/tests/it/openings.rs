//! Openings: their shape from the signs of their sizes, and their faces.

use glam::DVec3;
use holo_photometry::{LuminousOpening, OpeningShape, Photometry};

use crate::written::{Ies, ROUND};

fn opening(sizes: [f64; 3]) -> LuminousOpening {
    let ies = Ies { opening: sizes, ..Ies::default() };
    let text = ies.write(ROUND, &[0.0, 90.0, 180.0], &[0.0]);
    Photometry::read(text.as_bytes()).unwrap().opening
}

#[test]
fn signs_of_width_length_and_height_state_the_shape() {
    // Width lies across the plane of 0°, length in it.
    for (sizes, shape, size) in [
        ([0.0, 0.0, 0.0], OpeningShape::Point, [0.0; 3]),
        ([0.3, 1.2, 0.0], OpeningShape::Rectangle, [1.2, 0.3, 0.0]),
        ([0.3, 1.2, 0.1], OpeningShape::Box, [1.2, 0.3, 0.1]),
        ([-0.2, 0.0, 0.0], OpeningShape::Ellipse, [0.2, 0.2, 0.0]),
        ([-0.2, -0.2, 0.0], OpeningShape::Ellipse, [0.2, 0.2, 0.0]),
        ([-0.2, -0.4, 0.0], OpeningShape::Ellipse, [0.4, 0.2, 0.0]),
        ([-0.2, 0.0, 0.3], OpeningShape::CylinderAlongZ, [0.2, 0.2, 0.3]),
        ([-0.2, -0.2, 0.3], OpeningShape::CylinderAlongZ, [0.2, 0.2, 0.3]),
        ([-0.2, -0.2, -0.2], OpeningShape::Ellipsoid, [0.2; 3]),
        ([-0.2, 0.0, -0.2], OpeningShape::Ellipsoid, [0.2; 3]),
        ([-0.1, 1.2, -0.1], OpeningShape::CylinderAlongX, [1.2, 0.1, 0.1]),
        ([0.0, 1.2, -0.1], OpeningShape::CylinderAlongX, [1.2, 0.1, 0.1]),
        ([1.2, -0.1, -0.1], OpeningShape::CylinderAlongY, [0.1, 1.2, 0.1]),
        ([1.2, 0.0, -0.1], OpeningShape::CylinderAlongY, [0.1, 1.2, 0.1]),
    ] {
        assert_eq!(opening(sizes), LuminousOpening { shape, size }, "{sizes:?}");
    }
}

#[test]
fn feet_are_metres_times_3048() {
    let ies = Ies { opening: [1.0, 4.0, 0.0], ..Ies::default() };
    let text = ies.write(ROUND, &[0.0, 90.0], &[0.0]).replace(" 1 2 1 4 0", " 1 1 1 4 0");
    let size = Photometry::read(text.as_bytes()).unwrap().opening.size;
    assert!((size[0] - 1.2192).abs() < 1e-12 && (size[1] - 0.3048).abs() < 1e-12);
}

/// The area that faces show in a direction.
fn seen(areas: &[DVec3], away: DVec3) -> f64 {
    areas.iter().map(|area| area.dot(away).max(0.0)).sum()
}

#[test]
fn faces_close_around_bodies_and_show_the_area_of_their_shape() {
    use std::f64::consts::PI;
    let both = [true; 2];
    let down = DVec3::NEG_Z;
    for (sizes, below, aside) in [
        ([0.3, 1.2, 0.1], 0.36, 0.03),
        ([-0.2, -0.2, 0.3], PI * 0.01, 0.06),
        ([-0.1, 1.2, -0.1], 0.12, PI * 0.0025),
    ] {
        let areas = opening(sizes).mesh(both).areas();
        assert!(areas.iter().sum::<DVec3>().length() < 1e-12, "{sizes:?}");
        // Round outlines have twelve corners: their widths are right within a few percent.
        assert!((seen(&areas, down) / below - 1.0).abs() < 0.03, "{sizes:?}");
        assert!((seen(&areas, DVec3::X) / aside - 1.0).abs() < 0.03, "{sizes:?}");
    }
    let sphere = opening([-0.2, -0.2, -0.2]).mesh(both).areas();
    assert_eq!(sphere.len(), 32);
    assert!(sphere.iter().sum::<DVec3>().length() < 1e-12);
    assert_eq!(opening([0.0; 3]).mesh(both).triangles.len(), 8);
}

#[test]
fn flat_openings_face_where_their_light_goes() {
    let rectangle = opening([0.3, 1.2, 0.0]);
    for (halves, direction, is_two_sided) in [
        ([true, false], DVec3::NEG_Z, false),
        ([false, true], DVec3::Z, false),
        ([true, true], DVec3::NEG_Z, true),
    ] {
        let mesh = rectangle.mesh(halves);
        let area: DVec3 = mesh.areas().into_iter().sum();
        assert!(area.distance(direction * 0.36) < 1e-12, "{halves:?}");
        assert_eq!(mesh.is_two_sided, is_two_sided);
    }
    let disc: DVec3 = opening([-0.2, -0.2, 0.0]).mesh([true, false]).areas().into_iter().sum();
    assert!((disc.z + std::f64::consts::PI * 0.01).abs() < 1e-12);
}
