//! The driver of a session: what it stores from view to view, and what it refuses.

#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::walled_room;
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::{Frame, FrameRequest};
use holo_driver_surfaces::surfaces_driver;
use holo_picture::{View, ViewSpec};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use holo_section::{BeamId, BeamKey, RayCoords, Sample, Section, SectionSpec, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (64, 48);
/// Pixels of a view whose first frame is not refined.
const LARGE: (u32, u32) = (400, 300);
const ALBEDO: f32 = 0.5;
const LIGHT: f32 = 0.8;
/// Whether the eye moves.
const REST: bool = false;
const MOVING: bool = true;

/// A floor of 8 × 8 at height 0, and a section of 2 × 2 × 2 above its middle.
fn floor() -> (Arc<[Section]>, Arc<Raycaster>) {
    floor_of(Bsdf::Diffuse { kd: [ALBEDO; 3] })
}

fn floor_of(bsdf: Bsdf) -> (Arc<[Section]>, Arc<Raycaster>) {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let positions = [corner(-4.0, -4.0), corner(4.0, -4.0), corner(4.0, 4.0), corner(-4.0, 4.0)];
    let mut grey = Material::grey("floor");
    grey.bsdf = bsdf;
    let triangles = [[0, 1, 2], [0, 2, 3]];
    let (scene, _) =
        Scene::from_world(&positions, &triangles, &[0, 0], vec![grey], [1.0; 3]).unwrap();
    let section = Section::new(SectionSpec {
        origin: [-1.0, -1.0, 0.1],
        axes: [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]],
        grid: [3; 3],
        class: ViewClass::Interior,
        obstructions: false,
    });
    (Arc::from([section.unwrap()]), Arc::new(Raycaster::build(Arc::new(scene)).unwrap()))
}

/// Samples of beams spread over the section, all of one radiance.
fn samples(section: &Section, count: u64) -> Vec<(BeamKey, Sample)> {
    let sample = |number: u64| {
        let random = holo_display::split_mix(number + 1);
        let beam = BeamId(random % section.beam_count());
        let coords = RayCoords(((random >> 32) as u32).to_le_bytes());
        let ray = section.ray(section.cells(beam)?, coords);
        let distance = -ray.origin.z / ray.direction.z;
        let at = ray.origin + ray.direction * distance;
        let hits = distance > 0.0 && at.abs().max_element() < 4.0;
        let encoded = Sample::encode(coords, [LIGHT; 3], distance, section.diagonal(), 0);
        hits.then_some((BeamKey { section: 0, beam }, encoded))
    };
    (0..count).filter_map(sample).collect()
}

fn look(options: &str, is_moving: bool) -> FrameRequest {
    look_of(SIZE, options, is_moving)
}

fn look_of(size: (u32, u32), options: &str, is_moving: bool) -> FrameRequest {
    let mut spec = ViewSpec::default();
    spec.apply_line(options).unwrap();
    let (view, size): (View, _) = spec.resolve(size).unwrap();
    FrameRequest { view, size, is_moving }
}

/// Inserts dark samples along the same rays, which no frame has shown yet.
fn insert_dark(driver: &mut TestViewer, section: &Section, samples: &[(BeamKey, Sample)]) {
    for (beam, sample) in samples {
        let distance = sample.distance(section.diagonal());
        let dark = Sample::encode(sample.coords, [0.0; 3], distance, section.diagonal(), 0);
        driver.insert(*beam, 1, &[dark]);
    }
}

fn draw(driver: &mut TestViewer) -> Frame {
    driver.draw()
}

/// Does all work that improves the next frame.
fn finish(driver: &mut TestViewer) {
    while driver.prepare() {}
}

const DOWN: &str = "-vp 0 0 1 -vd 0 0.1 -1 -vu 0 1 0 -vh 60";
const WIDE: &str = "-vp 0 0 1 -vd 1 0.1 -0.2 -vu 0 0 1 -vh 60";
const ASIDE: &str = "-vp 0.3 -0.2 1.2 -vd 0.2 0 -1 -vu 0 1 0 -vh 50";

#[test]
fn a_new_view_shows_the_light_that_earlier_views_brought() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    driver.look(&look(DOWN, REST)).unwrap();
    assert!(draw(&mut driver).empty_pixels > 0, "nothing is known yet");
    for (beam, sample) in samples(&sections[0], 60_000) {
        driver.insert(beam, 1, &[sample]);
    }
    for (options, is_moving) in [(DOWN, REST), (ASIDE, REST), (ASIDE, MOVING)] {
        driver.look(&look(options, is_moving)).unwrap();
        let frame = draw(&mut driver);
        assert_eq!(frame.picture.pixels.len(), (SIZE.0 * SIZE.1) as usize);
        let shown = frame.picture.pixels.iter().map(|pixel| pixel[1]);
        // RGBE rounds by up to 1/256.
        let right = shown.filter(|shown| (shown - LIGHT).abs() < LIGHT / 128.0).count();
        assert!(100 * right > 99 * frame.depth.len(), "{options}: {right}");
    }
}

#[test]
fn a_room_is_recognised_before_any_light_is_known() {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [ALBEDO; 3] });
    let (sections, _) = floor();
    let mut driver = TestViewer::new(surfaces_driver(sections, raycaster, None));
    driver.look(&look("-vp 0 -1 1 -vd 0 1 -0.4 -vu 0 0 1 -vh 40", REST)).unwrap();
    let frame = draw(&mut driver);
    assert_eq!(frame.samples_used, 0);
    let column = |row: u32| frame.picture.pixels[(row * SIZE.0 + SIZE.0 / 2) as usize][1];
    let (wall, floor) = (column(8), column(40));
    // The sky of 1 lets expect light of 0.2 on surfaces, and the floor is seen at a smaller angle.
    assert!(wall > 1.2 * floor && floor > 0.02, "{wall} {floor}");
    assert!(wall < 0.2 * ALBEDO + 1e-6, "{wall}");
    assert!(frame.certainty.iter().all(|certainty| certainty.error.is_infinite()));
}

#[test]
fn rays_are_wished_for_where_the_light_is_noisy() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    driver.look(&look(DOWN, REST)).unwrap();
    assert_eq!(driver.pixel_weights(), None, "nothing is drawn yet");
    for (number, (beam, sample)) in (0..).zip(samples(&sections[0], 60_000)) {
        let section = &sections[0];
        let ray = section.ray(section.cells(beam.beam).unwrap(), sample.coords);
        let distance = sample.distance(section.diagonal());
        let is_noisy = (ray.origin + ray.direction * distance).x > 0.0;
        let light = match (is_noisy, number % 2) {
            (false, _) => LIGHT,
            (true, 0) => 0.0,
            (true, _) => 2.0 * LIGHT,
        };
        let diagonal = section.diagonal();
        let sample = Sample::encode(sample.coords, [light; 3], distance, diagonal, 0);
        driver.insert(beam, 1, &[sample]);
    }
    draw(&mut driver);
    finish(&mut driver);
    draw(&mut driver);
    let weights = driver.pixel_weights().unwrap();
    let (quiet, noisy) = (weights.at(0.2, 0.5), weights.at(0.8, 0.5));
    // The smooth half still gets its even share.
    assert!(noisy > 1.5 * quiet && quiet >= 0.5, "{quiet} {noisy}");
}

#[test]
fn a_moving_eye_sees_the_light_that_the_last_picture_found() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    for (beam, sample) in samples(&sections[0], 60_000) {
        driver.insert(beam, 1, &[sample]);
    }
    driver.look(&look(DOWN, REST)).unwrap();
    let at_rest = draw(&mut driver);
    let mean = |frame: &Frame| {
        let sum: f32 = frame.picture.pixels.iter().map(|pixel| pixel[1]).sum();
        sum / frame.picture.pixels.len() as f32
    };
    driver.look(&look(DOWN, MOVING)).unwrap();
    let moving = draw(&mut driver);
    assert_eq!(moving.picture.pixels.len(), at_rest.picture.pixels.len());
    assert!((mean(&moving) / mean(&at_rest) - 1.0).abs() < 0.02);
    assert!(!driver.refines() && driver.uncovered().is_empty());
    // Samples that come while the eye moves show at the next rest.
    let bright = |(beam, _): (BeamKey, Sample)| {
        let coords = RayCoords([9, 9, 9, 9]);
        let section = &sections[0];
        let ray = section.ray(section.cells(beam.beam)?, coords);
        let distance = -ray.origin.z / ray.direction.z;
        let sample = Sample::encode(coords, [4.0 * LIGHT; 3], distance, section.diagonal(), 0);
        (distance > 0.0).then_some((beam, sample))
    };
    for (beam, sample) in samples(&sections[0], 60_000).into_iter().filter_map(bright) {
        driver.insert(beam, 1, &[sample]);
    }
    assert!((mean(&draw(&mut driver)) / mean(&at_rest) - 1.0).abs() < 0.02);
    // The first frame after a stop shows known light, and the next one all samples.
    driver.look(&look(DOWN, REST)).unwrap();
    assert!((mean(&draw(&mut driver)) / mean(&at_rest) - 1.0).abs() < 0.02);
    assert!(driver.refines());
    assert!(mean(&draw(&mut driver)) > 1.5 * mean(&at_rest));
}

#[test]
fn known_light_of_a_coat_serves_an_eye_that_moves_round_it() {
    let coat = Bsdf::Coated { kd: [ALBEDO; 3], ks: [1.0; 3], ior: 1.5, alpha: 0.1 };
    let (sections, raycaster) = floor_of(coat);
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    let samples = samples(&sections[0], 60_000);
    samples.iter().for_each(|(beam, sample)| driver.insert(*beam, 1, &[*sample]));
    driver.look(&look(DOWN, REST)).unwrap();
    draw(&mut driver);
    insert_dark(&mut driver, &sections[0], &samples);
    let aslant = "-vp 0 -1 1 -vd 0 1 -1 -vu 0 0 1 -vh 30";
    driver.look(&look(aslant, MOVING)).unwrap();
    let pixels = draw(&mut driver).picture.pixels;
    let known = pixels.iter().filter(|pixel| (pixel[1] / LIGHT - 1.0).abs() < 0.02).count();
    assert!(10 * known > 9 * pixels.len(), "{known} of {} pixels", pixels.len());
}

#[test]
fn a_frame_counts_the_glossy_pixels_whose_gleams_are_a_guess() {
    let guessed = |bsdf: Bsdf| {
        let (sections, raycaster) = floor_of(bsdf);
        let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
        driver.look(&look(DOWN, REST)).unwrap();
        for (beam, sample) in samples(&sections[0], 2_000) {
            driver.insert(beam, 1, &[sample]);
        }
        let frame = draw(&mut driver);
        (frame.gleam_pixels, frame.depth.len() as u64)
    };
    let coat = Bsdf::Coated { kd: [ALBEDO; 3], ks: [1.0; 3], ior: 1.5, alpha: 0.1 };
    let metal = Bsdf::Conductor { ks: [0.9; 3], alpha: 0.3 };
    for glossy in [coat, metal] {
        let (count, pixels) = guessed(glossy);
        assert!(2 * count > pixels, "{count} of {pixels}");
    }
    assert_eq!(guessed(Bsdf::Diffuse { kd: [ALBEDO; 3] }).0, 0);
}

#[test]
fn the_first_frame_after_a_jump_shows_known_light_unless_the_driver_settles() {
    let (sections, raycaster) = floor();
    let shown = |options: &str, settles: bool| {
        let mut driver =
            TestViewer::new(surfaces_driver(Arc::clone(&sections), Arc::clone(&raycaster), None));
        let samples = samples(&sections[0], 60_000);
        samples.iter().for_each(|(beam, sample)| driver.insert(*beam, 1, &[*sample]));
        driver.look(&look_of(LARGE, DOWN, REST)).unwrap();
        draw(&mut driver);
        insert_dark(&mut driver, &sections[0], &samples);
        driver.look(&look_of(LARGE, options, REST)).unwrap();
        if settles {
            driver.settle();
        }
        finish(&mut driver);
        let middle = (LARGE.1 / 2 * LARGE.0 + LARGE.0 / 2) as usize;
        [(); 2].map(|()| draw(&mut driver).picture.pixels[middle][1] / LIGHT)
    };
    let is_near = |shown: [f32; 2], expected: [f32; 2]| {
        assert!(shown.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.1), "{shown:?}");
    };
    is_near(shown(DOWN, false), [1.0, 0.5]);
    is_near(shown(DOWN, true), [0.5, 0.5]);
    // No view has shown this place before.
    is_near(shown("-vp 0 0 1 -vd 1 0 -1 -vu 0 0 1 -vh 20", false), [0.5, 0.5]);
}

#[test]
fn a_moving_eye_sees_the_light_of_the_last_picture_also_if_that_was_finer() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    let samples = samples(&sections[0], 60_000);
    let middle = |size: (u32, u32)| (size.1 / 2 * size.0 + size.0 / 2) as usize;
    let half = (SIZE.0 / 2, SIZE.1 / 2);
    let shown = |driver: &mut TestViewer, size, is_moving| {
        driver.look(&look_of(size, DOWN, is_moving)).unwrap();
        draw(driver).picture.pixels[middle(size)][1] / LIGHT
    };
    samples.iter().for_each(|(beam, sample)| driver.insert(*beam, 1, &[*sample]));
    let coarse = shown(&mut driver, half, MOVING);
    assert!((coarse - 1.0).abs() < 0.1, "{coarse}");
    insert_dark(&mut driver, &sections[0], &samples);
    driver.look(&look(DOWN, REST)).unwrap();
    driver.draw_for_file();
    let light = shown(&mut driver, half, MOVING);
    assert!((light - 0.5).abs() < 0.1, "{light}");
}

#[test]
fn the_first_frame_after_a_stop_shows_known_light_unless_it_is_for_a_file() {
    let (sections, raycaster) = floor();
    let samples = samples(&sections[0], 60_000);
    let middle = (SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2) as usize;
    for (is_for_file, first) in [(false, 1.0), (true, 0.5)] {
        let mut driver =
            TestViewer::new(surfaces_driver(Arc::clone(&sections), Arc::clone(&raycaster), None));
        samples.iter().for_each(|(beam, sample)| driver.insert(*beam, 1, &[*sample]));
        driver.look(&look(DOWN, REST)).unwrap();
        draw(&mut driver);
        insert_dark(&mut driver, &sections[0], &samples);
        driver.look(&look(DOWN, MOVING)).unwrap();
        driver.look(&look(DOWN, REST)).unwrap();
        // All samples have arrived, but the person waits for the first frame.
        driver.settle();
        for (number, expected) in [first, 0.5].into_iter().enumerate() {
            let is_file = is_for_file && number == 0;
            let frame = if is_file { driver.draw_for_file() } else { driver.draw() };
            let shown = frame.picture.pixels[middle][1] / LIGHT;
            assert!((shown - expected).abs() < 0.1, "{shown}, {expected} expected");
        }
    }
}

#[test]
fn the_second_picture_of_a_large_view_at_rest_is_the_refined_one() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    for (beam, sample) in samples(&sections[0], 60_000) {
        driver.insert(beam, 1, &[sample]);
    }
    assert!(!driver.refines());
    // The floor's border goes through this view.
    driver.look(&look_of(LARGE, WIDE, REST)).unwrap();
    assert!(!driver.refines());
    let first = draw(&mut driver).picture.pixels;
    assert!(!driver.refines(), "no edge was looked into yet");
    finish(&mut driver);
    assert!(driver.refines());
    let second = draw(&mut driver).picture.pixels;
    assert!(!driver.refines() && first != second);
    assert_eq!(draw(&mut driver).picture.pixels, second);
    // Further samples change the picture.
    let before = second;
    for (beam, sample) in samples(&sections[0], 5_000) {
        let bright = [4.0 * LIGHT; 3];
        let distance = sample.distance(sections[0].diagonal());
        let bright = Sample::encode(sample.coords, bright, distance, sections[0].diagonal(), 0);
        driver.insert(beam, 1, &[bright]);
    }
    let second = draw(&mut driver).picture.pixels;
    assert!(second != before);
    // Once all stored samples have come, the first picture is refined.
    driver.look(&look_of(LARGE, WIDE, REST)).unwrap();
    driver.settle();
    finish(&mut driver);
    assert_eq!(draw(&mut driver).picture.pixels, second);
}

#[test]
fn a_picture_is_drawn_as_well_as_possible_once_no_more_samples_come() {
    let (sections, raycaster) = floor();
    let section = &sections[0];
    // The middle of the floor has a shadow, and about eight samples per pixel.
    let in_view = |(beam, sample): (BeamKey, Sample)| {
        let ray = section.ray(section.cells(beam.beam)?, sample.coords);
        let distance = sample.distance(section.diagonal());
        let at = ray.origin + ray.direction * distance;
        let light = if at.x < 0.05 { [LIGHT; 3] } else { [0.0; 3] };
        let lit = Sample::encode(sample.coords, light, distance, section.diagonal(), 0);
        (at.abs().max_element() < 0.5).then_some((beam, lit))
    };
    let samples: Vec<_> =
        samples(section, 300_000).into_iter().filter_map(in_view).cycle().take(1_200_000).collect();
    let driver = || {
        let mut driver =
            TestViewer::new(surfaces_driver(Arc::clone(&sections), Arc::clone(&raycaster), None));
        samples.iter().for_each(|(beam, sample)| driver.insert(*beam, 1, &[*sample]));
        driver.look(&look_of(LARGE, DOWN, REST)).unwrap();
        driver.settle();
        finish(&mut driver);
        driver
    };
    let mut of_frames = driver();
    let soon = draw(&mut of_frames).picture.pixels;
    assert!(of_frames.refines());
    let best = draw(&mut of_frames).picture.pixels;
    assert!(!of_frames.refines() && soon != best);
    assert!(draw(&mut of_frames).picture.pixels == best);
    let mut of_file = driver();
    assert!(of_file.draw_for_file().picture.pixels == best);
    assert!(!of_file.refines());
}

#[test]
fn the_first_picture_of_a_small_view_is_the_refined_one() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    for (beam, sample) in samples(&sections[0], 60_000) {
        driver.insert(beam, 1, &[sample]);
    }
    driver.look(&look(WIDE, REST)).unwrap();
    let first = draw(&mut driver).picture.pixels;
    finish(&mut driver);
    assert!(!driver.refines());
    assert_eq!(draw(&mut driver).picture.pixels, first);
}

#[test]
fn edges_are_looked_into_while_samples_pour_in() {
    let (sections, raycaster) = floor();
    let (beam, sample) = samples(&sections[0], 100)[0];
    for pours in [false, true] {
        let mut driver =
            TestViewer::new(surfaces_driver(Arc::clone(&sections), Arc::clone(&raycaster), None));
        driver.look(&look_of(LARGE, WIDE, REST)).unwrap();
        let count = if pours { 1 << 16 } else { 1 << 10 };
        driver.insert(beam, 1, &vec![sample; count]);
        driver.settle();
        draw(&mut driver);
        finish(&mut driver);
        assert_eq!(driver.refines(), !pours);
    }
}

#[test]
fn the_order_of_samples_changes_no_bit() {
    let (sections, raycaster) = floor();
    let mut all = samples(&sections[0], 20_000);
    let mut pictures = Vec::new();
    for _ in 0..2 {
        let mut driver =
            TestViewer::new(surfaces_driver(Arc::clone(&sections), Arc::clone(&raycaster), None));
        driver.look(&look(DOWN, REST)).unwrap();
        all.iter().for_each(|(beam, sample)| driver.insert(*beam, 1, &[*sample]));
        pictures.push(draw(&mut driver).picture.pixels);
        all.reverse();
    }
    assert!(pictures[0] == pictures[1]);
}

#[test]
fn preparing_between_samples_changes_no_bit() {
    let (sections, raycaster) = floor();
    let samples = samples(&sections[0], 40_000);
    let drawn = |prepares: bool| {
        let mut driver =
            TestViewer::new(surfaces_driver(Arc::clone(&sections), Arc::clone(&raycaster), None));
        driver.look(&look(DOWN, REST)).unwrap();
        for some in samples.chunks(9000) {
            if prepares {
                driver.prepare();
            }
            some.iter().for_each(|(key, sample)| driver.insert(*key, 1, &[*sample]));
        }
        if prepares {
            driver.prepare();
        }
        (draw(&mut driver).picture.pixels, draw(&mut driver).picture.pixels)
    };
    assert!(drawn(true) == drawn(false));
}

#[test]
fn a_signal_ends_frames_at_rest_and_no_others() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    let interrupt = driver.interrupt.clone();
    for (beam, sample) in samples(&sections[0], 20_000) {
        driver.insert(beam, 1, &[sample]);
    }
    let pixels = (SIZE.0 * SIZE.1) as usize;
    driver.look(&look(DOWN, REST)).unwrap();
    driver.settle();
    finish(&mut driver);
    let undisturbed = draw(&mut driver).picture.pixels;
    interrupt.set();
    assert!(driver.try_draw().is_none(), "the frame ended early");
    let for_file = driver.draw_for_file().picture.pixels.len();
    assert_eq!(for_file, pixels, "a picture for a file is whole");
    driver.look(&look(WIDE, MOVING)).unwrap();
    for _ in 0..2 {
        let moving = draw(&mut driver).picture.pixels.len();
        assert_eq!(moving, pixels, "frames go on while the eye moves");
    }
    interrupt.clear();
    driver.look(&look(DOWN, REST)).unwrap();
    // The first frame after a stop may show known light.
    draw(&mut driver);
    finish(&mut driver);
    assert!(draw(&mut driver).picture.pixels == undisturbed);
}

#[test]
fn depth_of_a_pixel_is_that_of_the_surface() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(sections, raycaster, None));
    assert!(driver.depths().is_empty(), "there is no view");
    // A parallel view from the same height, and one from a far eye.
    for (options, depth) in [
        ("-vp 0 0 1 -vd 0 0 -1 -vu 0 1 0 -vh 60", 1.0),
        ("-vtl -vp 0 0 1 -vd 0 0 -1 -vu 0 1 0 -vh 2", 1.0),
        ("-vp 0 0 4000 -vd 0 0 -1 -vu 0 1 0 -vh 0.05", 4000.0),
        ("-vp 0 0 1 -vd 0 0 -1 -vu 0 1 0 -vh 60 -vo 0.5", 1.0),
    ] {
        driver.look(&look(options, REST)).unwrap();
        let middle = driver.depths()[(SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2) as usize];
        assert!((middle / depth - 1.0).abs() < 1e-2, "{options}: {middle}");
    }
}

#[test]
fn clipping_surfaces_cut_the_scene_its_light_and_the_sky() {
    let (sections, raycaster) = floor();
    let mut driver = TestViewer::new(surfaces_driver(Arc::clone(&sections), raycaster, None));
    for (beam, sample) in samples(&sections[0], 60_000) {
        driver.insert(beam, 1, &[sample]);
    }
    // The floor lies at a depth of 1: nearer than the fore surface, and farther than the aft one.
    for (clip, shown) in [("-vo 2", [1.0; 3]), ("-va 0.5", [0.0; 3])] {
        let options = format!("-vp 0 0 1 -vd 0 0 -1 -vu 0 1 0 -vh 60 {clip}");
        driver.look(&look(&options, REST)).unwrap();
        let frame = draw(&mut driver);
        assert!(frame.picture.pixels.iter().all(|pixel| *pixel == shown), "{clip}");
    }
}

#[test]
fn light_of_the_scene_before_an_edit_is_shown_until_new_light_comes() {
    let (sections, raycaster) = floor();
    let new = || {
        let mut driver =
            TestViewer::new(surfaces_driver(Arc::clone(&sections), Arc::clone(&raycaster), None));
        driver.look(&look(DOWN, REST)).unwrap();
        driver
    };
    let all = samples(&sections[0], 400_000);
    let (old, present) = all.split_at(all.len() / 3);
    // The floor was painted since.
    let diagonal = sections[0].diagonal();
    let before = |(beam, sample): &(BeamKey, Sample)| {
        let distance = sample.distance(diagonal);
        (*beam, Sample::encode(sample.coords, [3.0 * LIGHT, 0.0, 0.0], distance, diagonal, 0))
    };
    let old: Vec<_> = old.iter().map(before).collect();
    let shown = |driver: &mut TestViewer| {
        draw(driver);
        finish(driver);
        draw(driver).picture.pixels
    };
    let green = |pixels: &[[f32; 3]]| {
        pixels.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / pixels.len() as f64
    };
    let insert = |driver: &mut TestViewer, samples: &[(BeamKey, Sample)]| {
        samples.iter().for_each(|(beam, sample)| driver.insert(*beam, 1, &[*sample]));
    };
    let insert_earlier = |driver: &mut TestViewer| {
        old.iter().for_each(|(beam, sample)| driver.insert_earlier(*beam, 1, &[*sample]));
    };
    let mut driver = new();
    insert_earlier(&mut driver);
    let mut last = green(&shown(&mut driver));
    assert_eq!(last, 0.0, "only the light before is known");
    // It goes with each new sample, though none of its own beams are traced.
    let mut begin = 0;
    for end in [present.len() / 20, present.len() / 8, present.len()] {
        insert(&mut driver, &present[begin..end]);
        let now = green(&shown(&mut driver));
        assert!(now > last, "{now} after {last}");
        (begin, last) = (end, now);
    }
    let (mut other, mut without) = (new(), new());
    insert(&mut other, present);
    insert_earlier(&mut other);
    assert_eq!(shown(&mut driver), shown(&mut other), "the order does not matter");
    insert(&mut without, present);
    let expected = shown(&mut without);
    assert!(green(&expected) - last < 0.01 * green(&expected), "{last}");
    for (beam, sample) in &old {
        assert!(driver.remove_earlier(*beam, 1, &[*sample]));
    }
    assert_eq!(shown(&mut driver), expected, "nothing of it is left");
    for driver in [&mut driver, &mut without] {
        driver.look(&look(ASIDE, REST)).unwrap();
    }
    assert_eq!(shown(&mut driver), shown(&mut without));
}
