//! The render cache with samples that it did not ask for one by one: a holodeck's, stored ones and
//! traced ones.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::scenes::{moment, random, room, squared_error, truth, view, wall, whole_picture};
use glam::DVec3;
use holo_display::{SelectOptions, WantedBeam, best_beam, select_beams};
use holo_driver_rendercache::{Place, PointImage, PointImageParams, RayResult, Smoothing};
use holo_picture::{Picture, View};
use holo_section::{Section, SectionSpec, ViewClass};
use std::collections::HashSet;

#[test]
fn rays_that_a_renderer_chose_by_itself_tend_to_the_box_filter_too() {
    let size = (72, 54);
    let pixels = u64::from(size.0 * size.1);
    let eye = view(DVec3::new(-1.0, -2.0, 0.3), 20.0, size);
    let (truth, variance) = truth(&eye, size, &room);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    // Points from elsewhere first, of the same scene but half as bright: what is stored may be
    // worth little.
    let from = view(DVec3::new(-1.5, -2.0, 0.3), 14.0, size);
    let dim = |origin: DVec3, direction: DVec3| {
        let (place, radiance) = room(origin, direction);
        (place, radiance.map(|channel| 0.5 * channel))
    };
    let stored = whole_picture(&from, size, &dim);
    cache.frame(&moment(from, &stored, 0));
    cache.frame(&moment(eye, &[], 0));
    let mut errors = Vec::new();
    for count in 0..pixels * 200 {
        let (x, y) = (random(2 * count), random(2 * count + 1));
        let unit = |bits: u64| (bits >> 11) as f64 / (1_u64 << 53) as f64;
        let (x, y) = (unit(x), unit(y));
        let (origin, direction) = eye.ray(x, y);
        let (column, row) = View::pixel_at(size, x, y).unwrap();
        let (place, radiance) = room(origin, direction);
        let tag = cache.pixel_tag(column, row).unwrap();
        cache.insert(&[RayResult { tag, noise: f32::INFINITY, ..RayResult::new(place, radiance) }]);
        if count % 1000 == 0 {
            // Stored ones that come in between must not push them out.
            cache.insert(&stored[..100]);
        }
        if count + 1 == pixels * 50 || count + 1 == pixels * 200 {
            errors.push(squared_error(&cache.frame(&moment(eye, &[], 0)).picture(), &truth));
        }
    }
    assert_eq!(cache.pixel_tag(size.0, 0), None);
    println!(
        "squared error after 50 and 200 rays a pixel: {:.2e}, {:.2e}; of one {variance:.2e}",
        errors[0], errors[1]
    );
    let ratio = errors[0] / errors[1];
    assert!((2.5..6.5).contains(&ratio), "{ratio}");
    let alone = variance / 200.0;
    assert!(errors[1] < 1.5 * alone, "{} where independent rays would leave {alone}", errors[1]);
}

/// Returns the picture of a view after samples of half of its pixels came. `turn` turned a cache
/// with points of another view to it.
fn after_samples(turn: impl FnOnce(&mut PointImage, View)) -> Picture {
    let size = (64, 48);
    let (before, eye) = (view(DVec3::ZERO, 0.0, size), view(DVec3::new(0.3, 0.0, 0.0), 4.0, size));
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    cache.frame(&moment(before, &whole_picture(&before, size, &room), 0));
    turn(&mut cache, eye);
    for sample in whole_picture(&eye, size, &room).into_iter().step_by(2) {
        let Place::At(place) = sample.place else { continue };
        let (x, y, _) = eye.project(place).unwrap();
        let (column, row) = View::pixel_at(size, x, y).unwrap();
        let tag = cache.pixel_tag(column, row).unwrap();
        cache.insert(&[RayResult { tag, noise: 0.1, ..sample }]);
    }
    cache.frame(&moment(eye, &[], 0)).picture()
}

#[test]
fn samples_find_the_points_of_a_view_that_was_aimed_at_as_they_find_those_of_a_frame() {
    let aimed = after_samples(|cache, eye| cache.aim(&eye));
    let framed = after_samples(|cache, eye| {
        cache.frame(&moment(eye, &[], 0));
    });
    assert_eq!(aimed.pixels, framed.pixels);
    let unprepared = after_samples(|_, _| {});
    assert_ne!(unprepared.pixels, framed.pixels, "samples do not know this view");
}

#[test]
fn samples_of_other_views_never_replace_the_pixels_of_this_one() {
    let size = (64, 48);
    let eye = view(DVec3::ZERO, 0.0, size);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    cache.frame(&moment(eye, &[], 0));
    // Pixel after pixel, as a file has beam after beam; in between samples of what lies beside the
    // picture.
    for row in 0..size.1 {
        for column in 0..size.0 {
            let (x, y) = View::pixel_centre(size, column, row);
            let (origin, direction) = eye.ray(x, y);
            let sample = RayResult::new(wall(origin, direction, 2.0), [1.0; 3]);
            let beside = RayResult::new(wall(origin, eye.ray(1.1, y).1, 2.0), [0.0; 3]);
            for _ in 0..3 {
                let tag = cache.pixel_tag(column, row).unwrap();
                cache.insert(&[RayResult { tag, ..sample }, beside]);
            }
        }
    }
    let frame = cache.frame(&moment(eye, &[], 0));
    // At the end 0.86 of the slots are taken by pixels: eight groups of eight of them have nothing
    // else with chance 0.86⁶⁴ = 6e-5.
    let lost = frame.depth().filter(|&depth| depth == 0.0).count();
    assert!(lost <= 1, "{lost} pixels have lost their points");
}

#[test]
fn many_samples_from_elsewhere_take_one_point_a_pixel_and_the_nearer_surface_is_shown() {
    let size = (64, 48);
    let eye = view(DVec3::ZERO, 0.0, size);
    let params =
        PointImageParams { moving_mean: 1000, smoothing: Smoothing::Gaps, ..Default::default() };
    let mut cache = PointImage::new(size, params).unwrap();
    cache.frame(&moment(eye, &[], 0));
    let mut count = 0;
    // Beam after beam: 40 noisy samples a pixel, uniform in 0.5..1.5 at depth 2; on the left every
    // other one looks behind, at depth 3.
    for pixel in 0..size.0 * size.1 {
        let (column, row) = (pixel % size.0, pixel / size.0);
        let (x, y) = View::pixel_centre(size, column, row);
        let (origin, direction) = eye.ray(x, y);
        for turn in 0..40 {
            let behind = column < 32 && turn % 2 == 0;
            count += 1;
            let light =
                if behind { 9.0 } else { 0.5 + (random(count) >> 40) as f32 / (1 << 24) as f32 };
            let tag = cache.guess_tag(column, row).unwrap();
            let place = wall(origin, direction, if behind { 3.0 } else { 2.0 });
            cache.insert(&[RayResult {
                tag,
                noise: f32::INFINITY,
                ..RayResult::new(place, [light; 3])
            }]);
        }
    }
    assert_eq!(cache.point_count(), (size.0 * size.1) as usize);
    let shown = cache.frame(&moment(eye, &[], 0)).picture();
    // Variance 1/12: of means of 40 and 20.
    for (columns, of) in [(0..32, 20.0), (32..64, 40.0)] {
        let pixels = (0..size.1).flat_map(|row| columns.clone().map(move |column| (column, row)));
        let errors: Vec<f64> =
            pixels.map(|(x, y)| (f64::from(shown.get(x, y).unwrap()[0]) - 1.0).powi(2)).collect();
        let expected = 1.0 / 12.0 / of;
        let found = errors.iter().sum::<f64>() / errors.len() as f64;
        // Squares of normal errors: relative deviation sqrt(2/n) each; four of those, and 1/256 for
        // the packing.
        let allowed = 4.0 * expected * (2.0 / errors.len() as f64).sqrt() + 1.0 / 256.0_f64.powi(2);
        assert!((found - expected).abs() < allowed, "squared error {found}, {expected} expected");
    }
    // A ray of this view: it comes in, and no guess touches it any more.
    let (x, y) = View::pixel_centre(size, 40, 20);
    let (origin, direction) = eye.ray(x, y);
    let own = RayResult::new(wall(origin, direction, 2.0), [7.0; 3]);
    cache.insert(&[RayResult { tag: cache.pixel_tag(40, 20).unwrap(), ..own }]);
    cache.insert(&[RayResult {
        tag: cache.guess_tag(40, 20).unwrap(),
        ..RayResult::new(own.place, [1.0; 3])
    }]);
    assert_eq!(cache.frame(&moment(eye, &[], 0)).picture().get(40, 20), Some([7.0; 3]));
}

#[test]
fn beams_are_wanted_where_pixels_want_rays_and_no_weight_is_lost() {
    let size = (128, 96);
    let eye = view(DVec3::ZERO, 0.0, size);
    let spec = SectionSpec {
        origin: [-4.5, -3.5, -1.4],
        axes: [[9.0, 0.0, 0.0], [0.0, 7.0, 0.0], [0.0, 0.0, 2.8]],
        grid: [8, 6, 4],
        class: ViewClass::Interior,
        obstructions: true,
    };
    let sections = [Section::new(spec).unwrap()];
    let beams = select_beams(&sections, &eye, size, &SelectOptions::default()).beams;
    // The left half of the picture is known.
    let samples = whole_picture(&eye, size, &room);
    let is_left = |direction: DVec3| direction.x < 0.0;
    let left: Vec<_> =
        samples.into_iter().filter(|s| matches!(s.place, Place::At(at) if is_left(at))).collect();
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    let frame = cache.frame(&moment(eye, &left, 1000));
    let weighed = frame.weigh(&sections, &beams, 0.75);
    assert!(weighed.is_sorted_by_key(|beam| beam.key));
    assert_eq!(weighed.iter().map(|beam| beam.key).collect::<HashSet<_>>().len(), weighed.len());
    // Weights of the beams whose middle ray goes left and right from the eye.
    let halves = |beams: &[WantedBeam]| {
        let mut halves = [0.0; 2];
        for beam in beams {
            let x = f64::from(size.0) * 0.5;
            let on_left = (0..size.0 * size.1).find_map(|pixel| {
                let (column, row) = (pixel % size.0, pixel / size.0);
                let (px, py) = View::pixel_centre(size, column, row);
                let (origin, direction) = eye.ray(px, py);
                (best_beam(&sections, origin, direction)? == beam.key)
                    .then_some(f64::from(column) < x)
            });
            if let Some(on_left) = on_left {
                halves[usize::from(!on_left)] += f64::from(beam.weight);
            }
        }
        halves
    };
    let ([left_before, right_before], [left_after, right_after]) =
        (halves(&beams), halves(&weighed));
    println!(
        "left and right: {left_before:.0} and {right_before:.0} pixels, \
         then {left_after:.0} and {right_after:.0}"
    );
    // The known half asks for (nearly) nothing: it keeps a quarter of its weight, and what beams
    // across the middle get.
    assert!(left_after < 0.4 * left_before && right_after > 1.6 * right_before);
    let total = |beams: &[WantedBeam]| beams.iter().map(|beam| f64::from(beam.weight)).sum::<f64>();
    assert!((total(&weighed) / total(&beams) - 1.0).abs() < 1e-4);
    // Without a request, nothing changes.
    assert_eq!(cache.frame(&moment(eye, &[], 0)).weigh(&sections, &beams, 0.75), beams);
}
