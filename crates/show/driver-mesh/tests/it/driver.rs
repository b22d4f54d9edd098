//! The driver from view to view.

use crate::common::*;
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::{FrameRequest, LiveSample, Search};
use holo_driver_mesh::mesh_driver;
use holo_picture::View;
use holo_section::Section;
use std::sync::Arc;

const SIZE: (u32, u32) = (96, 72);
const SKY: [f32; 3] = [0.1, 0.2, 0.4];

fn viewer(section: &Section) -> TestViewer {
    TestViewer::new(mesh_driver(Arc::from([section.clone()]), SKY))
}

/// A view from the room's middle, turned to the left by so many degrees.
fn turned(degrees: f64) -> View {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let eye = [3.3, 4.1, 3.2];
    view(eye, [eye[0] + cosine, eye[1] + sine, eye[2] - 0.2], 60.0, SIZE)
}

fn look(viewer: &mut TestViewer, view: &View, is_moving: bool) {
    viewer.look(&FrameRequest { view: *view, size: SIZE, is_moving }).unwrap();
}

fn put(viewer: &mut TestViewer, stored: &[Stored]) {
    stored.iter().for_each(|(beam, sample)| {
        viewer.insert(key(0, *beam), 1, std::slice::from_ref(sample));
    });
}

#[test]
fn a_turned_head_sees_the_samples_of_earlier_views_until_its_own_have_come() {
    let section = room_section(8);
    let mut viewer = viewer(&section);
    let [ahead, left] = [turned(0.0), turned(100.0)];
    look(&mut viewer, &ahead, true);
    put(&mut viewer, &near_samples(room, &section, &ahead, 20_000, 1, clean));
    let first = viewer.draw();
    look(&mut viewer, &left, true);
    viewer.draw();
    look(&mut viewer, &ahead, true);
    let again = viewer.draw();
    let error = relative_error(&again, &first.picture.pixels);
    assert!(error < 1e-6, "the same light from the same place: {error}");
    assert!(again.samples_used > 1000);
}

#[test]
fn a_picture_at_rest_does_not_depend_on_where_one_came_from() {
    let section = room_section(8);
    let (here, there) = (turned(0.0), view([3.6, 4.2, 3.1], [10.0, 4.5, 2.0], 60.0, SIZE));
    let (mut walked, mut alone) = (viewer(&section), viewer(&section));
    look(&mut walked, &here, false);
    put(&mut walked, &near_samples(room, &section, &here, 10_000, 1, clean));
    walked.draw();
    let own = near_samples(room, &section, &there, 3_000, 2, clean);
    for viewer in [&mut walked, &mut alone] {
        look(viewer, &there, false);
        put(viewer, &own[..200]);
    }
    let before = [&mut walked, &mut alone].map(|viewer| viewer.draw().picture.pixels);
    assert!(before[0] != before[1], "light of the earlier view is shown at first");
    for viewer in [&mut walked, &mut alone] {
        put(viewer, &own[200..]);
        viewer.settle();
    }
    let [walked, alone] = [&mut walked, &mut alone].map(TestViewer::draw);
    assert!(walked.picture == alone.picture && walked.depth == alone.depth);
}

#[test]
fn a_moving_eye_sees_the_same_surfaces_from_its_own_place() {
    let section = room_section(8);
    let here = room_view(SIZE);
    // The first step keeps the mesh, the second one builds it anew.
    for (step, most) in [(0.15, 0.01), (1.2, 0.03)] {
        let mut viewer = viewer(&section);
        look(&mut viewer, &here, false);
        put(&mut viewer, &near_samples(room, &section, &here, 40_000, 1, clean));
        viewer.draw();
        let there = here.moved(here.vp + here.vd * step, here.vd).unwrap();
        look(&mut viewer, &there, true);
        let frame = viewer.draw();
        let truth = truth(room, &there, SIZE, 4);
        let error = relative_error(&frame, &truth);
        assert!(error < most, "{step}: {error}");
        let stale = relative_error(&frame, &crate::common::truth(room, &here, SIZE, 4));
        assert!(stale > 2.0 * error, "{step}: not the old picture: {stale}, {error}");
    }
}

#[test]
fn light_seen_from_too_different_a_direction_is_forgotten() {
    let section = room_section(8);
    let mut viewer = viewer(&section);
    let from = view([2.5, 3.0, 2.0], [10.0, 3.0, 2.0], 40.0, SIZE);
    look(&mut viewer, &from, false);
    put(&mut viewer, &near_samples(room, &section, &from, 5_000, 1, clean));
    viewer.draw();
    // The wall at x = 10 from its side: all of it has turned by more than 20°.
    let beside = view([9.0, 6.5, 2.0], [10.0, 3.0, 2.0], 40.0, SIZE);
    look(&mut viewer, &beside, true);
    let frame = viewer.draw();
    assert_eq!(frame.samples_used, 0);
    assert!(frame.picture.pixels.iter().all(|pixel| *pixel == [0.0; 3]));
}

#[test]
fn pixels_outside_every_section_show_live_rays_alone() {
    let section =
        section([0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [4; 3], holo_section::ViewClass::Interior, false);
    let past = view([0.5, -0.4, 0.5], [1.6, 0.9, 0.5], 60.0, SIZE);
    let mut viewer = viewer(&section);
    look(&mut viewer, &past, false);
    let pixels = viewer.uncovered();
    assert!(pixels.len() > 500 && pixels.len() < 6000, "{}", pixels.len());
    put(&mut viewer, &near_samples(room, &section, &past, 3000, 1, clean));
    let before = viewer.draw();
    assert!(pixels.iter().all(|&pixel| before.picture.pixels[pixel as usize] == [0.0; 3]));
    let ray = |&pixel: &u32| {
        let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
        let (origin, direction) = past.ray(x, y);
        LiveSample { origin, direction, radiance: [2.0; 3], distance: 3.0 }
    };
    viewer.insert_live(1, &pixels[..200].iter().map(ray).collect::<Vec<_>>());
    let frame = viewer.draw();
    for (at, &pixel) in pixels.iter().enumerate() {
        let shown = frame.picture.pixels[pixel as usize];
        assert!(if at < 200 { shown[0] > 0.5 } else { shown == [0.0; 3] }, "{at}: {shown:?}");
    }
}

#[test]
fn unseen_beams_show_the_sky() {
    let section = room_section(8);
    let here = room_view(SIZE);
    let mut viewer = viewer(&section);
    look(&mut viewer, &here, false);
    let (eye, direction) = here.ray(0.5, 0.5);
    let beam = holo_display::best_beam(std::slice::from_ref(&section), eye, direction).unwrap();
    viewer.insert_unseen(beam);
    let frame = viewer.draw();
    let middle = (SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2) as usize;
    assert_eq!((frame.picture.pixels[middle], frame.depth[middle]), (SKY, f32::INFINITY));
    assert!(frame.unseen_pixels > 0 && frame.unseen_pixels < u64::from(SIZE.0 * SIZE.1));
}

#[test]
fn useful_beams_and_depths_are_those_of_the_visible_surfaces() {
    let section = room_section(8);
    let here = room_view(SIZE);
    let mut viewer = viewer(&section);
    look(&mut viewer, &here, false);
    assert!(viewer.surface_beams(Search::Quick).is_none());
    put(&mut viewer, &near_samples(room, &section, &here, 5_000, 1, clean));
    let depths = viewer.depths();
    assert!(depths.len() > 200, "{}", depths.len());
    let farthest = DVec3::new(10.0, 8.0, 6.0).length() as f32;
    assert!(depths.iter().all(|&depth| depth > 3.0 && depth < farthest));
    let found = viewer.surface_beams(Search::Quick).unwrap()();
    let crossed = |(beam, _): &holo_display::UsefulBeam| {
        let pair = section.cells(beam.beam).unwrap();
        let ray = section.ray(pair, holo_section::RayCoords([128; 4]));
        let eye = here.vp - ray.origin;
        eye.cross(ray.direction).length() < 0.5
    };
    let away = found.iter().filter(|beam| !crossed(beam)).count();
    assert!(away > 100, "beams that the view does not cross: {away}");
}
