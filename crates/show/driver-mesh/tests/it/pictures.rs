//! Pictures of known scenes.

use crate::common::*;
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::{Frame, FrameRequest};
use holo_driver_mesh::mesh_driver;
use holo_picture::{View, ViewKind, ViewSpec};
use holo_section::{Section, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (96, 72);

fn drawn(section: &Section, view: &View, stored: &[Stored]) -> Frame {
    let mut viewer = TestViewer::new(mesh_driver(Arc::from([section.clone()]), [0.0; 3]));
    viewer.look(&FrameRequest { view: *view, size: SIZE, is_moving: false }).unwrap();
    for (beam, sample) in stored {
        viewer.insert(key(0, *beam), 1, std::slice::from_ref(sample));
    }
    viewer.settle();
    viewer.draw()
}

#[test]
fn the_error_falls_as_samples_come() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let truth = truth(room, &view, SIZE, 4);
    let errors = [300, 3_000, 30_000, 300_000].map(|count| {
        let frame = drawn(&section, &view, &near_samples(room, &section, &view, count, 1, clean));
        relative_error(&frame, &truth)
    });
    let most = [0.08, 0.02, 0.01, 0.006];
    assert!(errors.iter().zip(most).all(|(error, most)| *error < most), "{errors:?}");
}

#[test]
fn noise_is_averaged_without_bias() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let truth = truth(room, &view, SIZE, 4);
    let stored = near_samples(room, &section, &view, 400_000, 1, one_path);
    let frame = drawn(&section, &view, &stored);
    assert!(bias(&frame, &truth).abs() < 0.01, "{}", bias(&frame, &truth));
    assert!(relative_error(&frame, &truth) < 0.2, "{}", relative_error(&frame, &truth));
}

#[test]
fn samples_that_look_behind_an_object_do_not_show_through_it() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let truth = truth(room, &view, SIZE, 4);
    let stored = batch_samples(room, &section, &view, SIZE, 60_000, 1, clean);
    let frame = drawn(&section, &view, &stored);
    assert!(relative_error(&frame, &truth) < 0.015, "{}", relative_error(&frame, &truth));
}

#[test]
fn depths_are_those_of_the_surfaces() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let frame = drawn(&section, &view, &near_samples(room, &section, &view, 60_000, 1, clean));
    let mut wrong = 0;
    for (pixel, depth) in (0..).zip(&frame.depth) {
        let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
        let (eye, direction) = view.ray(x, y);
        let distance = room(eye, direction).1 as f32;
        wrong += u32::from((depth / distance - 1.0).abs() > 0.01);
    }
    // Those at the ball's edge.
    assert!(wrong < 60, "{wrong} pixels");
}

/// A red disk before a green wall.
fn disk(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let to_disk = (4.0 - origin.x) / direction.x;
    let at = origin + direction * to_disk;
    if to_disk > 0.0 && (at - DVec3::new(4.0, 0.0, 0.0)).length() < 1.0 {
        return ([1.0, 0.0, 0.0], to_disk);
    }
    let to_wall = (12.0 - origin.x) / direction.x;
    if to_wall > 0.0 { ([0.0, 1.0, 0.0], to_wall) } else { ([0.0; 3], f64::INFINITY) }
}

#[test]
fn no_colour_smears_over_a_silhouette() {
    let section = section([-0.5; 3], [1.0; 3], [8; 3], ViewClass::Interior, false);
    let view = view([0.0; 3], [1.0, 0.0, 0.0], 60.0, SIZE);
    // A sample for every ten pixels.
    let stored = near_samples(disk, &section, &view, 700, 1, clean);
    let frame = drawn(&section, &view, &stored);
    let is_pure = |[r, g, _]: [f32; 3]| (r > 0.99) != (g > 0.99) && r + g < 1.01;
    assert!(frame.picture.pixels.iter().all(|&pixel| is_pure(pixel)));
    let truth = truth(disk, &view, SIZE, 1);
    let wrong = frame.picture.pixels.iter().zip(&truth).filter(|(a, b)| a[0] != b[0]).count();
    assert!(wrong < 200, "{wrong} pixels on the wrong side");
}

#[test]
fn every_type_of_view_shows_the_room() {
    let section = room_section(8);
    let eye = DVec3::new(3.3, 4.1, 3.2);
    for (kind, vh, vv) in [
        (ViewKind::Parallel, 2.0, 1.5),
        (ViewKind::Cylindrical, 150.0, 60.0),
        (ViewKind::Angular, 160.0, 120.0),
        (ViewKind::Hemispherical, 170.0, 120.0),
    ] {
        let spec = ViewSpec {
            kind: Some(kind),
            vp: Some(eye),
            vd: Some(DVec3::new(1.0, 0.1, -0.2)),
            vu: Some(DVec3::Z),
            vh: Some(vh),
            vv: Some(vv),
            ..ViewSpec::default()
        };
        let mut view = spec.resolve(SIZE).unwrap().0;
        if kind == ViewKind::Parallel {
            view = view.moved(eye, DVec3::X).unwrap();
        }
        let stored = near_samples(room, &section, &view, 60_000, 1, clean);
        let frame = drawn(&section, &view, &stored);
        let size = frame.picture.size();
        let truth = truth(room, &view, SIZE, 3);
        assert_eq!(size, SIZE);
        let error = relative_error(&frame, &truth);
        assert!(error < 0.02, "{kind:?}: {error}");
    }
}

#[test]
fn points_at_any_distance_are_drawn() {
    for scale in [1e-7, 1.0, 1e9] {
        let side = 2.0 * scale;
        let section = section([-0.5 * side; 3], [side; 3], [8; 3], ViewClass::Interior, false);
        let view = view([0.0; 3], [1.0, 0.3, 0.2], 60.0, SIZE);
        let mut random = Random(1);
        let mut viewer = TestViewer::new(mesh_driver(Arc::from([section.clone()]), [0.0; 3]));
        viewer.look(&FrameRequest { view, size: SIZE, is_moving: false }).unwrap();
        for _ in 0..2000 {
            let (eye, direction) = view.ray(random.unit(), random.unit());
            let hit = section.line(eye, direction).unwrap();
            let distance = 0.8 * scale - hit.entry_t;
            let sample =
                holo_section::Sample::encode(hit.coords, [0.5; 3], distance, section.diagonal(), 0);
            viewer.insert(key(0, section.beam(hit.pair)), 1, &[sample]);
        }
        let frame = viewer.draw();
        for (pixel, depth) in frame.picture.pixels.iter().zip(&frame.depth) {
            assert!((pixel[0] - 0.5).abs() < 0.01, "{scale}: {pixel:?}");
            assert!((f64::from(*depth) / (0.8 * scale) - 1.0).abs() < 0.02, "{scale}: {depth}");
        }
    }
}

#[test]
fn a_near_surface_and_the_sky_may_lie_in_one_direction() {
    let section = section([-1.0; 3], [2.0; 3], [8; 3], ViewClass::Interior, false);
    let view = view([0.0; 3], [1.0, 0.3, 0.2], 60.0, SIZE);
    let mut random = Random(1);
    let mut stored = Vec::new();
    for number in 0..4000 {
        let (eye, direction) = view.ray(random.unit(), random.unit());
        let hit = section.line(eye, direction).unwrap();
        // Less than a unit away, and nothing at all, like leaves before the sky.
        let is_leaf = number % 4 > 0;
        let distance = if is_leaf { 0.1 - hit.entry_t } else { f64::INFINITY };
        let light = if is_leaf { [0.5; 3] } else { [2.0; 3] };
        let sample =
            holo_section::Sample::encode(hit.coords, light, distance, section.diagonal(), 0);
        stored.push((section.beam(hit.pair), sample));
    }
    let frame = drawn(&section, &view, &stored);
    let leaves = frame.depth.iter().filter(|depth| (**depth - 0.1).abs() < 0.01).count();
    assert!(leaves > frame.depth.len() / 2, "{leaves}");
}
