//! The driver from view to view, for the quadtree and both kinds of cells.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

use crate::common::section;
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::{Frame, FrameRequest, LiveSample, Search, select_beams};
use holo_driver_quadtree::{Filling, cells_driver, quadtree_driver};
use holo_picture::View;
use holo_section::{BeamId, BeamKey, Sample, Section, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (40, 30);
const PIXELS: u64 = (SIZE.0 * SIZE.1) as u64;
const SKY: [f32; 3] = [0.1, 0.2, 0.4];
/// Radius of the sphere that all samples end on.
const RADIUS: f64 = 5.0;

fn cube() -> Section {
    section([-0.5; 3], [1.0; 3], [4; 3], ViewClass::Interior, false)
}

/// A driver of each kind.
fn drivers() -> [TestViewer; 3] {
    let sections: Arc<[Section]> = Arc::from([cube()]);
    let cells = |filling| cells_driver(Arc::clone(&sections), SKY, filling);
    let leaves = quadtree_driver(Arc::clone(&sections), SKY);
    [leaves, cells(Filling::Smooth), cells(Filling::Constant)].map(TestViewer::new)
}

/// A view from the middle of the cube, turned to the right by so many degrees.
fn view(degrees: f64) -> View {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let towards = DVec3::new(sine, cosine, 0.0);
    View::new(DVec3::ZERO, towards, DVec3::Z, Some(60.0), None, SIZE).unwrap()
}

/// Starts a view.
fn look(driver: &mut TestViewer, degrees: f64, is_moving: bool) {
    driver.look(&FrameRequest { view: view(degrees), size: SIZE, is_moving }).unwrap();
}

fn draw(driver: &mut TestViewer) -> Frame {
    driver.draw()
}

/// Starts a view and draws what there is already.
fn moving_frame(driver: &mut TestViewer, degrees: f64) -> Frame {
    look(driver, degrees, false);
    draw(driver)
}

/// Samples of every pixel's middle of a view, on a sphere.
fn samples(degrees: f64) -> Vec<(BeamId, Sample)> {
    let (section, view) = (cube(), view(degrees));
    let sample = |pixel: u32| {
        let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
        let (eye, direction) = view.ray(x, y);
        let hit = section.line(eye, direction).unwrap();
        let distance = RADIUS - hit.entry_t;
        let sample = Sample::encode(hit.coords, [0.5; 3], distance, section.diagonal(), 0);
        (section.beam(hit.pair), sample)
    };
    (0..SIZE.0 * SIZE.1).map(sample).collect()
}

fn put(driver: &mut TestViewer, samples: &[(BeamId, Sample)]) {
    samples.iter().for_each(|(beam, sample)| {
        driver.insert(BeamKey { section: 0, beam: *beam }, 1, &[*sample])
    });
}

fn put_unseen(driver: &mut TestViewer, beam: BeamId) {
    driver.insert_unseen(BeamKey { section: 0, beam });
}

#[test]
fn the_last_view_s_samples_are_shown_until_the_next_one_s_have_come() {
    for mut driver in drivers() {
        assert_eq!(moving_frame(&mut driver, 0.0).samples_used, 0);
        put(&mut driver, &samples(0.0));
        let turned = moving_frame(&mut driver, 10.0);
        // A sixth of the picture is new.
        assert!(turned.samples_used > PIXELS * 3 / 4 && turned.empty_pixels < PIXELS / 3);
        // They are still there if the camera goes on before anything has come.
        assert!(moving_frame(&mut driver, 15.0).samples_used > PIXELS / 2);
        assert_eq!(moving_frame(&mut driver, 40.0).samples_used, 0, "too far");
        // And for good: looking back does not bring them back.
        assert_eq!(moving_frame(&mut driver, 30.0).samples_used, 0);
    }
}

#[test]
fn a_picture_at_rest_does_not_depend_on_where_one_came_from() {
    for (mut walked, mut alone) in drivers().into_iter().zip(drivers()) {
        look(&mut walked, 0.0, false);
        put(&mut walked, &samples(0.0));
        let own = samples(8.0);
        for driver in [&mut walked, &mut alone] {
            look(driver, 8.0, false);
            put(driver, &own[..600]);
        }
        assert!(draw(&mut walked).samples_used > draw(&mut alone).samples_used);
        [&mut walked, &mut alone].into_iter().for_each(|driver| driver.settle());
        assert_eq!(draw(&mut walked).picture, draw(&mut alone).picture);
        // Late samples count as well.
        [&mut walked, &mut alone].into_iter().for_each(|driver| put(driver, &own[600..]));
        let (walked, alone) = (draw(&mut walked), draw(&mut alone));
        assert!(walked.picture == alone.picture && walked.depth == alone.depth);
        assert!(alone.picture.pixels.iter().any(|pixel| pixel[0] > 0.4));
    }
}

#[test]
fn after_a_view_has_settled_only_its_own_samples_are_kept_for_the_next() {
    for (mut walked, mut alone) in drivers().into_iter().zip(drivers()) {
        look(&mut walked, 0.0, false);
        put(&mut walked, &samples(0.0));
        for driver in [&mut walked, &mut alone] {
            look(driver, 8.0, false);
            put(driver, &samples(8.0)[..600]);
            driver.settle();
        }
        assert_eq!(moving_frame(&mut walked, 9.0).picture, moving_frame(&mut alone, 9.0).picture);
    }
}

#[test]
fn samples_of_a_moving_eye_are_kept_for_the_picture_at_rest() {
    for (mut moving, mut alone) in drivers().into_iter().zip(drivers()) {
        look(&mut moving, 0.0, true);
        put(&mut moving, &samples(0.0));
        draw(&mut moving);
        // The camera rests, and nothing has come yet.
        let full = moving_frame(&mut moving, 0.0);
        look(&mut alone, 0.0, false);
        put(&mut alone, &samples(0.0));
        assert!(full.samples_used > PIXELS * 9 / 10);
        assert_eq!(full.picture, draw(&mut alone).picture);
    }
}

#[test]
fn what_is_asked_of_the_scene_is_told_by_the_view_s_own_samples() {
    for mut driver in drivers() {
        assert!(driver.depths().is_empty() && driver.surface_beams(Search::Thorough).is_none());
        look(&mut driver, 0.0, false);
        put(&mut driver, &samples(0.0));
        let near = |depth: &f32| (f64::from(*depth) / RADIUS - 1.0).abs() < 0.04;
        assert!(!driver.depths().is_empty() && driver.depths().iter().all(near));
        assert!(!driver.surface_beams(Search::Thorough).unwrap()().is_empty());
        look(&mut driver, 5.0, false);
        assert!(driver.depths().is_empty() && driver.surface_beams(Search::Thorough).is_none());
    }
}

#[test]
fn unseen_beams_show_the_sky_until_the_next_view_has_settled() {
    for mut driver in drivers() {
        look(&mut driver, 0.0, false);
        let beams = select_beams(&[cube()], &view(0.0), SIZE, &Default::default()).beams;
        beams.iter().for_each(|wanted| put_unseen(&mut driver, wanted.key.beam));
        let frame = draw(&mut driver);
        assert!(frame.unseen_pixels > PIXELS * 9 / 10);
        let is_sky = frame.picture.pixels.iter().filter(|pixel| **pixel == SKY).count() as u64;
        assert_eq!(is_sky, frame.unseen_pixels);
        assert!(moving_frame(&mut driver, 5.0).unseen_pixels > PIXELS / 2);
        driver.settle();
        assert_eq!(draw(&mut driver).unseen_pixels, 0);
    }
}

/// A view past the side of the cube, and live rays through the middles of its uncovered pixels.
fn past(driver: &mut TestViewer, is_moving: bool) -> (Vec<u32>, Vec<LiveSample>) {
    let eye = DVec3::new(-2.0, 0.5, 0.0);
    let view = View::new(eye, DVec3::X, DVec3::Z, Some(60.0), None, SIZE).unwrap();
    driver.look(&FrameRequest { view, size: SIZE, is_moving }).unwrap();
    let pixels = driver.uncovered();
    let rays = pixels.iter().map(|pixel| {
        let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
        let (origin, direction) = view.ray(x, y);
        LiveSample { origin, direction, radiance: [0.5, 1.0, 2.0], distance: 3.0 }
    });
    let rays = rays.collect();
    (pixels, rays)
}

#[test]
fn uncovered_pixels_show_what_live_rays_saw_and_covered_ones_do_not_change() {
    for mut driver in drivers() {
        let (pixels, rays) = past(&mut driver, false);
        assert!(pixels.len() > 200 && pixels.len() < PIXELS as usize - 200);
        let before = draw(&mut driver);
        assert!(before.picture.pixels.iter().all(|pixel| *pixel == [0.0; 3]));
        driver.insert_live(4, &rays);
        let after = draw(&mut driver);
        for pixel in 0..PIXELS as u32 {
            let colour = after.picture.pixels[pixel as usize];
            if pixels.binary_search(&pixel).is_ok() {
                assert!((colour[1] - 1.0).abs() < 0.01, "{pixel}: {colour:?}");
                assert!((after.depth[pixel as usize] / 3.0 - 1.0).abs() < 0.02);
            } else {
                assert_eq!(colour, [0.0; 3], "{pixel}");
            }
        }
        // Live rays belong to one view alone.
        past(&mut driver, false);
        assert_eq!(draw(&mut driver).picture, before.picture);
        // While the camera moves, the driver requests no live rays and shows none.
        let (pixels, _) = past(&mut driver, true);
        assert!(pixels.is_empty());
        driver.insert_live(4, &rays);
        assert_eq!(draw(&mut driver).picture, before.picture);
    }
}

#[test]
fn a_driver_without_a_view_has_a_name_and_shows_nothing() {
    for (mut driver, name) in drivers().into_iter().zip(["quadtree", "cells", "cells"]) {
        assert_eq!(driver.name(), name);
        put(&mut driver, &samples(0.0));
        driver.settle();
        assert!(driver.try_draw().is_none());
        assert!(driver.uncovered().is_empty());
        // Samples that came before the first view are lost.
        assert_eq!(moving_frame(&mut driver, 0.0).samples_used, 0);
    }
}
