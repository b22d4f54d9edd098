//! Tests of two eyes.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

#[path = "../../../display/tests/common/mod.rs"]
mod common;
#[path = "../../../display/tests/common/viewer.rs"]
mod viewer;
mod wall;

use common::*;
use glam::DVec3;
use holo_display::{Driver, Frame, FrameRequest, select_beams};
use holo_driver_mesh::mesh_driver;
use holo_driver_quadtree::quadtree_driver;
use holo_picture::View;
use holo_section::{Section, ViewClass};
use holo_stereo::{StereoArrangement, StereoEyes, stereo_driver};
use std::sync::Arc;
use viewer::TestViewer;

const SIZE: (u32, u32) = (120, 80);
const ALL: [StereoArrangement; 4] = [
    StereoArrangement::SideBySide,
    StereoArrangement::OverUnder,
    StereoArrangement::Anaglyph,
    StereoArrangement::Interlaced,
];

fn eyes(arrangement: StereoArrangement) -> StereoEyes {
    StereoEyes { arrangement, distance: 0.2, convergence: Some(3.0) }
}

fn request(view: &View) -> FrameRequest {
    FrameRequest { view: *view, size: SIZE, is_moving: false }
}

/// Returns the frame of a driver from these samples.
fn drawn(driver: Driver, look: &FrameRequest, stored: &[Stored]) -> Frame {
    let mut viewer = TestViewer::new(driver);
    viewer.look(look).unwrap();
    for (beam, sample) in stored {
        viewer.insert(key(0, *beam), 1, std::slice::from_ref(sample));
    }
    viewer.settle();
    viewer.draw()
}

#[test]
fn each_eye_s_pixels_are_those_of_its_own_view() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let sections: Arc<[Section]> = Arc::from([section.clone()]);
    let stored = near_samples(room, &section, &view, 20_000, 1, clean);
    type Make = fn(Arc<[Section]>, [f32; 3]) -> Driver;
    for make in [mesh_driver as Make, quadtree_driver] {
        let driver = || make(Arc::clone(&sections), [0.0; 3]);
        for arrangement in ALL {
            let eyes = eyes(arrangement);
            let look = request(&view);
            let both = drawn(stereo_driver(driver(), eyes, Arc::clone(&sections)), &look, &stored);
            let requests = eyes.requests(&look).unwrap();
            let [left, right] = requests.map(|request| drawn(driver(), &request, &stored));
            assert!(left.picture != right.picture);
            let (width, height) = SIZE;
            for (row, column) in (0..height).flat_map(|row| (0..width).map(move |x| (row, x))) {
                let shown = both.picture.get(column, row).unwrap();
                let at = |eye: &Frame, column, row| eye.picture.get(column, row).unwrap();
                let own = match arrangement {
                    StereoArrangement::SideBySide if column < width / 2 => at(&left, column, row),
                    StereoArrangement::SideBySide => at(&right, column - width / 2, row),
                    StereoArrangement::OverUnder if row < height / 2 => at(&left, column, row),
                    StereoArrangement::OverUnder => at(&right, column, row - height / 2),
                    StereoArrangement::Anaglyph => {
                        let ([r, ..], [_, g, b]) =
                            (at(&left, column, row), at(&right, column, row));
                        [r, g, b]
                    }
                    StereoArrangement::Interlaced if row % 2 == 0 => at(&left, column, row),
                    StereoArrangement::Interlaced => at(&right, column, row),
                };
                assert_eq!(shown, own, "{arrangement:?}: column {column}, row {row}");
            }
            assert!(both.is_stereo && both.depth.iter().all(|depth| *depth > 0.0));
        }
    }
}

#[test]
fn an_odd_side_leaves_a_black_middle() {
    let eyes = StereoEyes { convergence: None, ..eyes(StereoArrangement::SideBySide) };
    let section = room_section(8);
    let size = (121, 80);
    let look = FrameRequest { view: room_view(size), size, is_moving: false };
    let stored = near_samples(room, &section, &look.view, 20_000, 1, clean);
    let sections: Arc<[Section]> = Arc::from([section]);
    let driver = stereo_driver(mesh_driver(Arc::clone(&sections), [0.0; 3]), eyes, sections);
    let frame = drawn(driver, &look, &stored);
    for row in 0..80 {
        assert_eq!(frame.picture.get(60, row), Some([0.0; 3]));
        assert!(frame.picture.get(59, row) != Some([0.0; 3]));
    }
}

/// Radius of a bright ball, and the places of balls.
const SPOT: f64 = 0.12;
const SPOTS: [DVec3; 5] = [
    DVec3::new(2.0, 0.1, 0.1),
    DVec3::new(3.0, -0.6, 0.3),
    DVec3::new(4.0, 0.9, -0.5),
    DVec3::new(5.0, -0.2, -0.9),
    DVec3::new(6.0, -1.8, 0.8),
];

/// Bright balls in front of a dark wall. Each has another colour.
fn spots(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let wall = (10.0 - origin.x) / direction.x;
    let mut nearest = ([0.0; 3], if wall > 0.0 { wall } else { f64::INFINITY });
    for (number, spot) in (1_u8..).zip(SPOTS) {
        let middle = (spot - origin).dot(direction);
        let inside = SPOT * SPOT - ((spot - origin).length_squared() - middle * middle);
        if inside > 0.0 && middle > 0.0 && middle < nearest.1 {
            nearest = ([f32::from(number); 3], middle - inside.sqrt());
        }
    }
    nearest
}

#[test]
fn known_points_have_their_disparity_within_half_a_pixel() {
    let section = section([-0.5; 3], [1.0; 3], [8; 3], ViewClass::Interior, false);
    let size = (800, 300);
    let view = view([0.0; 3], [1.0, 0.0, 0.0], 90.0, size);
    let sections: Arc<[Section]> = Arc::from([section.clone()]);
    for convergence in [None, Some(4.0)] {
        let arrangement = StereoArrangement::SideBySide;
        let eyes = StereoEyes { arrangement, distance: 0.2, convergence };
        let look = FrameRequest { view, size, is_moving: false };
        let mut stored = Vec::new();
        for request in eyes.requests(&look).unwrap() {
            stored.extend(near_samples(spots, &section, &request.view, 400_000, 1, clean));
        }
        let driver = mesh_driver(Arc::clone(&sections), [0.0; 3]);
        let frame = drawn(stereo_driver(driver, eyes, Arc::clone(&sections)), &look, &stored);
        // Pixels per unit at distance 1.
        let focal = f64::from(size.0) / view.extent().0;
        for (number, spot) in (1_u8..).zip(SPOTS) {
            let middle = |columns: std::ops::Range<u32>| {
                let (mut sum, mut count) = (0.0, 0.0);
                for (row, column) in
                    (0..size.1).flat_map(|row| columns.clone().map(move |column| (row, column)))
                {
                    let [shown, ..] = frame.picture.get(column, row).unwrap();
                    if (shown - f32::from(number)).abs() < 0.3 {
                        (sum, count) = (sum + f64::from(column), count + 1.0);
                    }
                }
                assert!(count > 20.0, "ball {number} has {count} pixels");
                sum / count
            };
            let half = size.0 / 2;
            let (left, right) = (middle(0..half), middle(half..size.0) - f64::from(half));
            let nearness = 1.0 / spot.x - convergence.map_or(0.0, |distance| 1.0 / distance);
            let expected = focal * eyes.distance * nearness;
            assert!(
                (left - right - expected).abs() < 0.5,
                "ball {number}, {convergence:?}: {} for {expected}",
                left - right
            );
        }
    }
}

#[test]
fn beams_are_wanted_for_both_eyes() {
    let (section, view) = (room_section(24), room_view(SIZE));
    let sections: Arc<[Section]> = Arc::from([section]);
    let eyes = StereoEyes { distance: 1.0, ..eyes(StereoArrangement::Anaglyph) };
    let look = request(&view);
    let driver = mesh_driver(Arc::clone(&sections), [0.0; 3]);
    let mut viewer = TestViewer::new(stereo_driver(driver, eyes, Arc::clone(&sections)));
    let wanted = viewer.weigh(&look, Vec::new()).unwrap();
    let weight: f32 = wanted.iter().map(|beam| beam.weight).sum();
    let mut own = 0.0;
    for request in eyes.requests(&look).unwrap() {
        let options = holo_display::SelectOptions::default();
        let selected = select_beams(&sections, &request.view, request.size, &options).beams;
        for beam in &selected {
            assert!(wanted.iter().any(|wanted| wanted.key == beam.key), "{:?}", beam.key);
        }
        own += selected.iter().map(|beam| beam.weight).sum::<f32>();
    }
    assert!((weight / (0.5 * own) - 1.0).abs() < 1e-3, "{weight} of {own}");
    assert!(wanted.is_sorted_by(|a, b| a.key < b.key), "each beam once");
    // The rays of both eyes pass through the sphere around the middle.
    assert!(viewer.viewpoint_radius(&look, 3.0) > 0.5);
}
