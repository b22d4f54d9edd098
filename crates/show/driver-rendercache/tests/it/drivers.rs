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
use holo_section::{BeamKey, RayCoords, Sample, Section, SectionSpec, ViewClass};

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
    // Another size has the parts that were chosen.
    driver.switch("prefilter", false);
    let small = (40, 30);
    driver.look(&look(view(DVec3::ZERO, 0.0, small), small)).unwrap();
    insert(&mut driver, &look(view(DVec3::ZERO, 0.0, small), small), 3, CHECKS);
    let stages = draw(&mut driver).0;
    assert!(stages.contains(&interpolation) && !stages.contains(&prefilter), "{stages:?}");
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
        assert!(
            driver.rays(None).is_some_and(|rays| rays.is_empty()) && driver.depths().is_empty()
        );
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
    for driver in [&mut cache, &mut frameless] {
        driver.look(&ahead()).unwrap();
        let mut count = 0;
        for _ in 0..40 {
            for (BeamKey { section: number, beam }, coords) in driver.rays(None).unwrap() {
                let section = section();
                let ray = section.ray(section.cells(beam).unwrap(), coords);
                // Rays lie on a lattice: they pass the eye within a step of it.
                let distance = ray.direction.cross(ray.origin).length();
                assert!(number == 0 && distance < 2.0 / 8.0 / 256.0, "{distance}");
                count += 1;
            }
        }
        assert!(count >= 40, "{}: {count}", driver.name());
    }
}

/// Answers rays as a server does: a wall five units ahead, lit by `light`. Returns their pixels in
/// the view `of`.
fn answer(
    driver: &mut TestViewer,
    rays: &[(BeamKey, RayCoords)],
    of: &FrameRequest,
    (paths, light): (u16, &dyn Fn(u32) -> f32),
) -> Vec<(u32, u32)> {
    let section = section();
    let mut pixels = Vec::new();
    for (&(key, coords), number) in rays.iter().zip(0..) {
        let ray = section.ray(section.cells(key.beam).unwrap(), coords);
        let distance = (5.0 - ray.origin.y) / ray.direction.y;
        let sample =
            Sample::encode(coords, [light(number); 3], distance, section.diagonal(), number);
        driver.insert(key, paths, &[sample]);
        let seen = of.view.project(ray.origin + ray.direction * distance);
        pixels.extend(seen.and_then(|(x, y, _)| View::pixel_at(of.size, x, y)));
    }
    pixels
}

#[test]
fn points_survive_another_size_and_every_start_and_stop_of_a_motion() {
    let light = |driver: &mut TestViewer| {
        let frame = draw(driver).1;
        let lit = frame.picture.pixels.iter().filter(|pixel| pixel[0] > 0.4).count();
        (lit as f64 / frame.depth.len() as f64, frame)
    };
    for mut driver in both() {
        driver.look(&ahead()).unwrap();
        driver.viewpoint_radius(&ahead(), 5.0);
        insert(&mut driver, &ahead(), 1, [0.5; 2]);
        assert_eq!(light(&mut driver).0, 1.0);
        for (size, is_moving) in [((24, 18), true), (SIZE, false), ((30, 24), true), (SIZE, false)]
        {
            let next = FrameRequest { is_moving, ..look(view(DVec3::ZERO, 0.0, size), size) };
            driver.look(&next).unwrap();
            let (share, frame) = light(&mut driver);
            assert_eq!(frame.picture.size(), size);
            assert!(share > 0.999, "{}: {share} of {size:?} is known", driver.name());
        }
    }
}

#[test]
fn a_late_sample_is_used_as_its_request_meant_it() {
    // Frameless rendering shows it in its pixel, and the render cache at its place, also outside
    // the present view.
    let [mut cache, mut frameless] = both();
    for driver in [&mut cache, &mut frameless] {
        driver.look(&ahead()).unwrap();
        let rays = driver.rays(None).unwrap();
        let aside = look(view(DVec3::ZERO, 90.0, SIZE), SIZE);
        driver.look(&aside).unwrap();
        let requested = answer(driver, &rays, &ahead(), (16, &|_| 0.5));
        let later = draw(driver).1;
        assert_eq!(later.samples_used, rays.len() as u64, "{}", driver.name());
        let lit = later.picture.pixels.iter().filter(|pixel| pixel[0] > 0.4).count();
        if driver.name() == "frameless" {
            let shown =
                requested.iter().filter(|(x, y)| later.picture.get(*x, *y).unwrap()[0] > 0.4);
            // A ray on the lattice may pass through the neighbour of its pixel.
            assert!(lit == rays.len() && 2 * shown.count() > lit, "{lit} of {}", rays.len());
        } else {
            assert_eq!(lit, 0, "it is not in view");
            driver.look(&ahead()).unwrap();
            let back = draw(driver).1;
            let known = back.depth.iter().filter(|depth| **depth > 0.0).count();
            assert!(2 * known > rays.len(), "{known} points of {} rays", rays.len());
        }
    }
}

#[test]
fn the_render_cache_asks_for_what_the_expected_view_lacks() {
    let mut cache = render_cache();
    let moving = FrameRequest { is_moving: true, ..ahead() };
    cache.look(&moving).unwrap();
    cache.viewpoint_radius(&moving, 5.0);
    insert(&mut cache, &moving, 1, [0.5; 2]);
    let expected = view(DVec3::ZERO, 40.0, SIZE);
    let beyond = |rays: Vec<(BeamKey, RayCoords)>| {
        let section = section();
        let outside = |&&(key, coords): &&(BeamKey, RayCoords)| {
            let ray = section.ray(section.cells(key.beam).unwrap(), coords);
            moving
                .view
                .project_direction(ray.direction)
                .is_none_or(|(x, y)| !(-0.01..1.01).contains(&x) || !(-0.01..1.01).contains(&y))
        };
        (rays.iter().filter(outside).count(), rays.len())
    };
    let mut counts = (0, 0);
    for _ in 0..20 {
        let (outside, all) = beyond(cache.rays(Some(&expected)).unwrap());
        counts = (counts.0 + outside, counts.1 + all);
    }
    let share = counts.0 as f64 / counts.1 as f64;
    assert!((0.3..=0.55).contains(&share), "{share} of the rays");
    assert_eq!(beyond(cache.rays(None).unwrap()).0, 0);
    // Without prediction, too.
    cache.switch("prediction", false);
    assert_eq!(beyond(cache.rays(Some(&expected)).unwrap()).0, 0);
}

#[test]
fn frameless_rendering_asks_for_every_pixel_once_before_any_again() {
    let [_, mut frameless] = both();
    frameless.look(&ahead()).unwrap();
    let mut rays = Vec::new();
    while rays.len() < (SIZE.0 * SIZE.1) as usize {
        rays.extend(frameless.rays(None).unwrap());
    }
    rays.truncate((SIZE.0 * SIZE.1) as usize);
    let mut pixels = answer(&mut frameless, &rays, &ahead(), (16, &|_| 0.5));
    let first: Vec<u32> = pixels.iter().take(40).map(|&(_, row)| row).collect();
    assert!(first.iter().any(|row| *row < 12) && first.iter().any(|row| *row > 24), "{first:?}");
    pixels.sort_unstable();
    pixels.dedup();
    // A ray on the lattice may pass through the neighbour of its pixel.
    let share = pixels.len() as f64 / rays.len() as f64;
    assert!(share > 0.7, "{share} of the pixels");
}

#[test]
fn the_render_cache_learns_the_noise_of_samples_and_then_notices_a_change_of_light() {
    let noisy =
        |number: u32| 0.5 + 0.1 * ((number.wrapping_mul(0x9E37_79B9) >> 16) as f32 / 65536.0 - 0.5);
    let mut cache = render_cache();
    cache.look(&ahead()).unwrap();
    cache.viewpoint_radius(&ahead(), 5.0);
    for turn in 0..40 {
        let rays = cache.rays(None).unwrap();
        answer(&mut cache, &rays, &ahead(), (16, &|number| noisy(number + 1000 * turn)));
    }
    // The eye moves a little. Then the light goes down to a tenth.
    let moved = look(view(DVec3::new(0.01, 0.0, 0.0), 0.0, SIZE), SIZE);
    cache.look(&moved).unwrap();
    let dark = |cache: &mut TestViewer| {
        let frame = draw(cache).1;
        frame.picture.pixels.iter().filter(|pixel| pixel[0] < 0.2).count()
    };
    assert_eq!(dark(&mut cache), 0);
    for turn in 0..60 {
        let rays = cache.rays(None).unwrap();
        answer(&mut cache, &rays, &moved, (16, &|number| 0.1 * noisy(number + 1000 * turn)));
    }
    // With unknown noise a point averages up to eight samples of both lights.
    let share = dark(&mut cache) as f64 / f64::from(SIZE.0 * SIZE.1);
    assert!(share > 0.5, "{share} of the pixels are dark");
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
