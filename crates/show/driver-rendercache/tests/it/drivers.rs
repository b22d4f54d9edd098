//! The two drivers behind the trait that front ends use.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::sync::Arc;

use crate::scenes::view;
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::{Frame, FrameRequest, SelectOptions, best_beam, select_beams};
use holo_driver_rendercache::{
    EmptyPixels, PointImageParams, Stage, Stages, frameless_driver, pointimage_driver,
};
use holo_picture::View;
use holo_section::{BeamKey, Sample, Section, SectionSpec, ViewClass};

const SIZE: (u32, u32) = (48, 36);
const SKY: [f32; 3] = [0.1, 0.2, 0.3];
const CHECKS: [f32; 2] = [0.5, 0.9];

/// A cube of two units around the origin.
fn section() -> Section {
    let axes = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
    let (grid, class) = ([8; 3], ViewClass::Interior);
    let spec = SectionSpec { origin: [-1.0; 3], axes, grid, class, obstructions: true };
    Section::new(spec).unwrap()
}

fn look(view: View, size: (u32, u32)) -> FrameRequest {
    FrameRequest { view, size, is_moving: false }
}

fn ahead() -> FrameRequest {
    look(view(DVec3::ZERO, 0.0, SIZE), SIZE)
}

fn render_cache() -> TestViewer {
    let params = PointImageParams { empty: EmptyPixels::Black, ..PointImageParams::default() };
    TestViewer::new(pointimage_driver(Arc::from([section()]), SKY, params))
}

fn both() -> [TestViewer; 2] {
    let frameless = frameless_driver(Arc::from([section()]), SKY);
    [render_cache(), TestViewer::new(frameless)]
}

/// Inserts a sample of a wall five units ahead for every `step`-th pixel, whose ray passes the eye.
/// Its light alternates from pixel to pixel. Returns how many samples there were.
fn insert(driver: &mut TestViewer, look: &FrameRequest, step: usize, light: [f32; 2]) -> u64 {
    let section = section();
    let mut count = 0;
    for pixel in (0..look.size.0 * look.size.1).step_by(step) {
        let (x, y) = View::pixel_centre(look.size, pixel % look.size.0, pixel / look.size.0);
        let (eye, direction) = look.view.ray(x, y);
        let hit = section.line(eye, direction).unwrap();
        let distance = 5.0 / direction.y - hit.entry_t;
        let rgb = [light[pixel as usize % 2]; 3];
        let sample = Sample::encode(hit.coords, rgb, distance, section.diagonal(), 0);
        driver.insert(BeamKey { section: 0, beam: section.beam(hit.pair) }, 1, &[sample]);
        count += 1;
    }
    count
}

/// Returns the names of the stages that ran, and the frame.
fn draw(driver: &mut TestViewer) -> (Vec<&'static str>, Frame) {
    let (stages, frame) = driver.draw_stages();
    (stages, frame.unwrap())
}

fn black_pixels(frame: &Frame) -> usize {
    frame.picture.pixels.iter().filter(|pixel| **pixel == [0.0; 3]).count()
}

#[test]
fn parts_are_left_out_at_once_and_come_back() {
    let mut driver = render_cache();
    driver.look(&ahead()).unwrap();
    driver.viewpoint_radius(&ahead(), 5.0);
    insert(&mut driver, &ahead(), 3, CHECKS);
    let (prefilter, interpolation) = (Stage::Prefilter.name(), Stage::Interpolate.name());
    let (stages, all) = draw(&mut driver);
    assert!(stages.contains(&prefilter) && stages.contains(&interpolation), "{stages:?}");
    assert_eq!(black_pixels(&all), 0);
    assert!(driver.switch("prefilter", false) && driver.switch("interpolation", false));
    let (stages, bare) = draw(&mut driver);
    assert!(!stages.contains(&prefilter), "{stages:?}");
    let half = (SIZE.0 * SIZE.1 / 2) as usize;
    assert!(black_pixels(&bare) > half, "pixels without samples stay black");
    assert!(driver.switch("interpolation", true));
    let some = draw(&mut driver).1;
    assert!(black_pixels(&some) < black_pixels(&bare));
    assert!(driver.switch("prefilter", true));
    let (stages, again) = draw(&mut driver);
    assert!(stages.contains(&prefilter) && again.picture.pixels == all.picture.pixels);
    // Nothing changes: nothing is computed.
    assert!(driver.switch("prefilter", true));
    assert_eq!(draw(&mut driver).0, [Stage::UpdatePoints.name()]);
    // Another size is another cache, with the parts that were chosen.
    driver.switch("prefilter", false);
    let small = (40, 30);
    driver.look(&look(view(DVec3::ZERO, 0.0, small), small)).unwrap();
    assert!(!draw(&mut driver).0.contains(&prefilter));
}

#[test]
fn every_part_has_a_name_and_frameless_rendering_has_no_parts() {
    let [mut cache, mut frameless] = both();
    for name in Stages::NAMES {
        assert!(cache.switch(name, false), "{name}");
        assert!(!frameless.switch(name, false), "{name}");
    }
    assert!(!cache.switch("projection", false));
}

#[test]
fn before_the_first_view_nothing_is_shown() {
    for mut driver in both() {
        insert(&mut driver, &ahead(), 100, CHECKS);
        let beam = section().beam(section().line(DVec3::ZERO, DVec3::Y).unwrap().pair);
        driver.insert_unseen(BeamKey { section: 0, beam });
        assert!(driver.rays().is_none_or(|rays| rays.is_empty()) && driver.depths().is_empty());
        assert!(driver.try_draw().is_none(), "{}", driver.name());
    }
}

#[test]
fn a_size_outside_the_limits_is_refused() {
    for mut driver in both() {
        let error = driver.look(&look(ahead().view, (0, 8))).unwrap_err().to_string();
        assert!(error.starts_with(&format!("driver {}: ", driver.name())), "{error}");
    }
}

#[test]
fn looking_at_the_same_view_again_keeps_everything_and_another_view_keeps_the_samples() {
    for mut driver in both() {
        driver.weigh(&ahead(), Vec::new()).unwrap();
        driver.look(&ahead()).unwrap();
        driver.viewpoint_radius(&ahead(), 5.0);
        let count = insert(&mut driver, &ahead(), 1, CHECKS);
        let before = draw(&mut driver).1;
        assert_eq!((before.samples_used, before.empty_pixels), (count, 0), "{}", driver.name());
        driver.look(&FrameRequest { is_moving: true, ..ahead() }).unwrap();
        let same = draw(&mut driver).1;
        assert_eq!((same.samples_used, same.picture), (count, before.picture));
        // A little further on the same wall is there.
        let next = look(view(DVec3::new(0.05, 0.0, 0.0), 0.5, SIZE), SIZE);
        driver.look(&next).unwrap();
        let moved = draw(&mut driver).1;
        assert_eq!(moved.samples_used, 0);
        assert_eq!(moved.picture.view, Some(next.view));
        assert!(black_pixels(&moved) < 100, "{}: {} pixels", driver.name(), black_pixels(&moved));
    }
}

#[test]
fn pixels_show_the_distance_of_their_samples() {
    for mut driver in both() {
        driver.look(&ahead()).unwrap();
        driver.viewpoint_radius(&ahead(), 5.0);
        insert(&mut driver, &ahead(), 1, CHECKS);
        let depth = driver.depths();
        for (column, row) in [(0, 0), (24, 18), (47, 35)] {
            let (x, y) = View::pixel_centre(SIZE, column, row);
            let (_, direction) = ahead().view.ray(x, y);
            let distance = depth[(row * SIZE.0 + column) as usize];
            let expected = 5.0 / direction.y;
            // Codes of distances are exact within 1/2048 of the section's diagonal, and positions
            // in cells within 1/256 of them.
            let error = (f64::from(distance) - expected).abs();
            assert!(error < 0.01, "{}: {distance} for {expected}", driver.name());
        }
    }
}

#[test]
fn beams_that_hit_nothing_show_the_sky_and_pixels_outside_every_section_stay_black() {
    // From beside the section, half of the picture sees past it.
    let beside = look(view(DVec3::new(1.3, -3.0, 0.0), 0.0, SIZE), SIZE);
    for mut driver in both() {
        driver.look(&beside).unwrap();
        let beams: Vec<_> = (0..SIZE.0 * SIZE.1)
            .map(|pixel| {
                let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
                let (eye, direction) = beside.view.ray(x, y);
                best_beam(&[section()], eye, direction)
            })
            .collect();
        let unseen = beams.iter().flatten().next().copied().unwrap();
        driver.insert_unseen(unseen);
        // Sections and beams that do not exist change nothing.
        driver.insert_unseen(BeamKey { section: 7, ..unseen });
        driver.insert(BeamKey { section: 7, ..unseen }, 1, &[]);
        let frame = draw(&mut driver).1;
        let pixels = frame.picture.pixels.iter().zip(&frame.depth).zip(&beams);
        for ((pixel, depth), beam) in pixels {
            if *beam == Some(unseen) {
                assert_eq!((*pixel, *depth), (SKY, f32::INFINITY));
            } else {
                assert_eq!((*pixel, *depth), ([0.0; 3], 0.0));
            }
        }
        let count = |is: &dyn Fn(&Option<_>) -> bool| beams.iter().filter(|b| is(b)).count() as u64;
        assert!(frame.uncovered_pixels > 300 && frame.unseen_pixels > 0);
        assert_eq!(frame.uncovered_pixels, count(&|beam| beam.is_none()));
        assert_eq!(frame.unseen_pixels, count(&|beam| *beam == Some(unseen)));
        assert_eq!(frame.empty_pixels, count(&|beam| beam.is_some_and(|beam| beam != unseen)));
    }
}

#[test]
fn samples_that_pass_the_eye_replace_those_that_do_not() {
    for mut driver in both() {
        let name = driver.name();
        driver.look(&ahead()).unwrap();
        // The nearest surface is so near that only rays through the very eye are a pixel's own.
        driver.viewpoint_radius(&ahead(), 1e-3);
        let section = section();
        let light = |driver: &mut TestViewer| draw(driver).1.picture.get(24, 18).unwrap()[0];
        // Rays of another eye, a little aside, to what the middle sees.
        let aim = DVec3::new(0.05, 5.0, -0.05);
        for side in [0.2, -0.2] {
            let eye = DVec3::new(side, 0.3, 0.0);
            let hit = section.line(eye, (aim - eye).normalize()).unwrap();
            let distance = (aim - eye).length() - hit.entry_t;
            let sample = Sample::encode(hit.coords, [0.25; 3], distance, section.diagonal(), 0);
            driver.insert(BeamKey { section: 0, beam: section.beam(hit.pair) }, 1, &[sample]);
        }
        assert!((light(&mut driver) - 0.25).abs() < 0.01, "{name}: the guess is shown");
        // The render cache counts what it found as the first of the pixel's own samples.
        (0..60).for_each(|_| assert!(insert(&mut driver, &ahead(), 1, [0.75; 2]) > 0));
        assert!((light(&mut driver) - 0.75).abs() < 0.01, "{name}: the guess is still there");
    }
}

#[test]
fn the_render_cache_asks_for_rays_of_pixels_that_lack_samples() {
    let [mut cache, mut frameless] = both();
    let beams = select_beams(&[section()], &ahead().view, SIZE, &SelectOptions::default()).beams;
    let total = |beams: &[holo_display::WantedBeam]| {
        beams.iter().map(|beam| f64::from(beam.weight)).sum::<f64>()
    };
    assert_eq!(frameless.weigh(&ahead(), beams.clone()).unwrap(), beams);
    let weighed = cache.weigh(&ahead(), beams.clone()).unwrap();
    assert!((total(&weighed) / total(&beams) - 1.0).abs() < 1e-3);
    cache.viewpoint_radius(&ahead(), 5.0);
    insert(&mut cache, &ahead(), 1, CHECKS);
    let rays = cache.rays().unwrap();
    assert!(rays.len() > 50 && frameless.rays().is_none(), "{}", rays.len());
    for (BeamKey { section: number, beam }, coords) in rays {
        let section = section();
        let ray = section.ray(section.cells(beam).unwrap(), coords);
        // Rays lie on a lattice: they pass the eye within a step of it.
        let distance = ray.direction.cross(ray.origin).length();
        assert!(number == 0 && distance < 2.0 / 8.0 / 256.0, "{distance}");
    }
}

#[test]
fn own_rays_pass_within_a_quarter_of_a_pixel_but_not_closer_than_rays_are_stored() {
    for mut driver in both() {
        let mut radius = |nearest| driver.viewpoint_radius(&ahead(), nearest);
        let footprint = ahead().view.pixel_footprint(SIZE, 100.0);
        assert!((radius(100.0) / (footprint / 4.0) - 1.0).abs() < 1e-9);
        assert_eq!(radius(1e-6), 2.0 / 8.0 / 256.0);
    }
}
