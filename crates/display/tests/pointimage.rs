//! The render cache: what pictures show, and what is asked for.
#![allow(clippy::unwrap_used, reason = "tests")]

mod pointimage_scenes;

use glam::{DAffine3, DVec3};
use holo_display::pointimage::{
    EmptyPixels, Moment, Place, PointImage, PointImageParams, Sample, Smoothing, Stage, Stages, best_beam,
};
use holo_display::{SelectOptions, WantedBeam, select_beams};
use holo_picture::View;
use holo_section::{Section, SectionSpec, ViewClass};
use pointimage_scenes::{answer, ball, checker, room, view, whole_picture};
use std::collections::HashSet;

fn moment(view: View, samples: &[Sample], wanted: usize) -> Moment<'_> {
    Moment { view, predicted: None, samples, wanted }
}

#[test]
fn a_sample_for_each_pixel_is_the_picture() {
    let size = (97, 61);
    let eye = view(DVec3::new(0.3, -1.0, 0.2), 12.0, size);
    let params = PointImageParams { smoothing: Smoothing::Gaps, ..PointImageParams::default() };
    let mut cache = PointImage::new(size, params).unwrap();
    let samples = whole_picture(&eye, size, &room);
    // Depth edges lose the points behind them to the cull, as in the papers.
    cache.set_stages(Stages { depth_cull: false, ..Stages::ALL });
    let picture = cache.frame(&moment(eye, &samples, 0)).picture();
    assert_eq!(cache.point_count(), samples.len());
    for (pixel, sample) in picture.pixels.iter().zip(&samples) {
        let largest = sample.radiance[0].max(sample.radiance[1]).max(sample.radiance[2]);
        for (shown, stored) in pixel.iter().zip(sample.radiance) {
            assert!((shown - stored).abs() <= largest / 256.0, "{pixel:?} for {:?}", sample.radiance);
        }
    }
}

/// 64 random bits of an index (splitmix64).
fn random(index: u64) -> u64 {
    let mut bits = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ bits >> 31
}

/// A wall at `depth` in front of a view along +y.
fn wall(origin: DVec3, direction: DVec3, depth: f64) -> Place {
    Place::At(origin + direction * (depth / direction.y))
}

#[test]
fn points_behind_a_sparse_surface_are_culled_as_often_as_the_threshold_says() {
    let size = (160, 160);
    let eye = view(DVec3::ZERO, 0.0, size);
    let light = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    // In each pixel a point at depth 3 or, with probability 1/2, at depth 1 instead.
    let samples: Vec<_> = whole_picture(&eye, size, &|origin, direction| (wall(origin, direction, 3.0), light[0], 0))
        .into_iter()
        .enumerate()
        .map(|(index, far)| {
            let is_near = random(index as u64) >> 63 == 1;
            let Place::At(place) = far.place else { unreachable!() };
            if is_near { Sample::new(Place::At(place / 3.0), light[1]) } else { far }
        })
        .collect();
    let far_points = samples.iter().filter(|sample| sample.radiance == light[0]).count();
    let mut cache = PointImage::new(
        size,
        PointImageParams { smoothing: Smoothing::Gaps, empty: EmptyPixels::Black, ..PointImageParams::default() },
    )
    .unwrap();
    let mut kept = |stages| {
        cache.set_stages(stages);
        let frame = cache.frame(&moment(eye, if stages == Stages::ALL { &[] } else { &samples }, 0));
        let [_, green, _] = frame.channels();
        frame.has_point().zip(green).filter(|&(has_point, &green)| has_point && green > 0.5).count()
    };
    assert_eq!(kept(Stages { depth_cull: false, ..Stages::ALL }), far_points);
    // Of n near and m far points (itself among them) a far one is kept if 3 (n + m) <= 1.1 (n + 3 m): with at most one near of 9.
    let expected = far_points as f64 * 9.0 / 256.0;
    // Neighbours' fates depend on each other: up to 25 of them, so 5 times the deviation of independent ones. And 4 of those.
    let allowed = 4.0 * 5.0 * expected.sqrt();
    let found = kept(Stages::ALL) as f64;
    println!("{found} of {far_points} points show through, {expected:.0} expected");
    assert!((found - expected).abs() < allowed, "{found} of {far_points} points show through, {expected:.0} expected");
}

#[test]
fn a_moved_object_is_shown_where_it_went() {
    let size = (64, 48);
    let eye = view(DVec3::ZERO, 0.0, size);
    let mut cache =
        PointImage::new(size, PointImageParams { smoothing: Smoothing::Gaps, ..Default::default() }).unwrap();
    let at = |x: f64, z: f64| Place::At(DVec3::new(x, 4.0, z));
    let thing = Sample { object: 7, ..Sample::new(at(0.0, 0.0), [1.0, 0.0, 0.0]) };
    let other = Sample { object: 8, ..Sample::new(at(-1.0, 0.5), [0.0, 0.0, 1.0]) };
    cache.frame(&moment(eye, &[thing, other], 0));
    let motion = DAffine3::from_rotation_z(0.2) * DAffine3::from_translation(DVec3::new(0.7, 0.0, -0.4));
    assert_eq!(cache.move_object(7, &motion), 1);
    assert_eq!(cache.move_object(9, &motion), 0);
    let picture = cache.frame(&moment(eye, &[], 0)).picture();
    let shown = |place: DVec3| {
        let (x, y, _) = eye.project(place).unwrap();
        let (column, row) = View::pixel_at(size, x, y).unwrap();
        picture.get(column, row).unwrap()
    };
    assert_eq!(shown(motion.transform_point3(DVec3::new(0.0, 4.0, 0.0))), [1.0, 0.0, 0.0]);
    assert_eq!(shown(DVec3::new(-1.0, 4.0, 0.5)), [0.0, 0.0, 1.0]);
}

#[test]
fn aged_objects_are_asked_for_first_and_leave() {
    let size = (64, 64);
    let eye = view(DVec3::ZERO, 0.0, size);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    // Object 1 on the left half, object 2 on the right.
    let halves = |origin: DVec3, direction: DVec3| {
        (wall(origin, direction, 2.0), [0.5; 3], if direction.x < 0.0 { 1 } else { 2 })
    };
    cache.frame(&moment(eye, &whole_picture(&eye, size, &halves), 0));
    assert_eq!(cache.age_object(1, 200), 32 * 64);
    let frame = cache.frame(&moment(eye, &[], 400));
    let left = frame.requests().filter(|(_, _, direction)| direction.x < 0.0).count();
    assert!(left > 380, "{left} of 400 requests are for the aged half");
    assert_eq!(cache.age_where(255, |_, place| place.x > 0.0), 32 * 64);
    assert_eq!(cache.point_count(), 32 * 64);
}

/// Over a turn of 90 degrees a second at 30 frames a second: the share of pixels without a point among 3×3 in the whole picture, and in
/// columns that have just come into view, with the number of the latter.
fn holes(prediction: bool) -> (f64, f64, usize) {
    let size = (160, 120);
    let pixels = size.0 * size.1;
    let params = PointImageParams {
        stages: Stages { prediction, prefilter: false, depth_cull: false, ..Stages::ALL },
        empty: EmptyPixels::Black,
        ..PointImageParams::default()
    };
    let mut cache = PointImage::new(size, params).unwrap();
    let at = |frame: u32| view(DVec3::new(0.0, -1.0, 0.0), 3.0 * f64::from(frame), size);
    let mut samples = whole_picture(&at(0), size, &room);
    let (mut all, mut new, mut frames) = (0, 0, 0);
    for frame in 0..60 {
        let wanted = (pixels / 32) as usize;
        let shown = cache.frame(&Moment { view: at(frame), predicted: Some(at(frame + 1)), samples: &samples, wanted });
        if frame >= 10 {
            let green = shown.channels()[1];
            all += green.iter().filter(|&&green| green == 0.0).count();
            // 3 degrees are the last 9 columns. Of two blocks of 4 columns, all new, the middle.
            new +=
                green[160..118 * 160].chunks(160).flat_map(|row| &row[154..158]).filter(|&&green| green == 0.0).count();
            frames += 1;
        }
        samples = answer(&shown, &room);
    }
    let strip = frames * 4 * 117;
    (all as f64 / f64::from(pixels) / frames as f64, new as f64 / strip as f64, strip)
}

#[test]
fn prediction_asks_for_each_block_that_turns_into_view() {
    let ((all_without, without, _), (all_with, with, strip)) = (holes(false), holes(true));
    println!("holes at 90 degrees/s, mismatch 32: {all_without:.4} without prediction, {all_with:.4} with");
    println!("in columns that were just turned into view: {without:.4} without, {with:.4} with");
    assert!(all_with < all_without);
    // Without prediction nothing can be there yet.
    assert_eq!(without, 1.0);
    // With it each block of 4×4 has one point, anywhere. Of a window of 3×3 around the i-th pixel of a block, 3, or 2 and 1, columns lie
    // in the block and in its neighbour; likewise rows. Nothing is there if no block's point falls into its part of the window.
    let parts = |i| if i == 1 || i == 2 { [3.0, 0.0] } else { [2.0, 1.0] };
    let mut expected = 0.0;
    for (i, j) in (0..16).map(|pixel| (pixel % 4, pixel / 4)) {
        expected += parts(i).iter().flat_map(|x| parts(j).map(|y| 1.0 - x * y / 16.0)).product::<f64>() / 16.0;
    }
    // Pixels up to 4 apart depend on each other: at most 81 of them. Four deviations.
    let allowed = 4.0 * (81.0 * expected * (1.0 - expected) / strip as f64).sqrt();
    assert!((with - expected).abs() < allowed, "{with} of the new pixels are empty, {expected} expected");
}

/// Box-filtered truth, and the mean variance of a ray within its pixel, from 24×24 rays a pixel.
fn truth(view: &View, size: (u32, u32), scene: pointimage_scenes::Scene) -> (Vec<f32>, f64) {
    let fine = 24;
    let mut sums = vec![0.0; (size.0 * size.1) as usize];
    let mut squares = 0.0;
    for row in 0..size.1 * fine {
        for column in 0..size.0 * fine {
            let (x, y) = View::pixel_centre((size.0 * fine, size.1 * fine), column, row);
            let (origin, direction) = view.ray(x, y);
            let radiance = scene(origin, direction).1[0];
            sums[(row / fine * size.0 + column / fine) as usize] += radiance / (fine * fine) as f32;
            squares += f64::from(radiance).powi(2) / f64::from(size.0 * size.1 * fine * fine);
        }
    }
    let of_means = sums.iter().map(|&mean| f64::from(mean).powi(2)).sum::<f64>() / sums.len() as f64;
    (sums, squares - of_means)
}

fn squared_error(shown: &[f32], truth: &[f32]) -> f64 {
    shown.iter().zip(truth).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / truth.len() as f64
}

#[test]
fn a_picture_at_rest_tends_to_the_box_filter() {
    let size = (72, 54);
    let pixels = (size.0 * size.1) as usize;
    let eye = view(DVec3::new(-1.0, -2.0, 0.3), 20.0, size);
    let (truth, variance) = truth(&eye, size, &room);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    // It comes from elsewhere, with points and history of other views.
    let mut samples = Vec::new();
    for frame in 0..10 {
        let from = view(DVec3::new(-1.5, -2.0, 0.3), 10.0 + f64::from(frame), size);
        samples = answer(&cache.frame(&moment(from, &samples, pixels / 2)), &room);
    }
    let mut errors = Vec::new();
    for frame in 1..=800 {
        let shown = cache.frame(&moment(eye, &samples, pixels / 4));
        if frame == 200 || frame == 800 {
            errors.push(squared_error(shown.channels()[0], &truth));
        }
        samples = answer(&shown, &room);
    }
    println!(
        "squared error after 50 and 200 samples a pixel: {:.2e}, {:.2e}; of one {variance:.2e}",
        errors[0], errors[1]
    );
    // Random rays: a quarter of the squared error for four times as many. Bias would stay.
    let ratio = errors[0] / errors[1];
    assert!((2.5..6.5).contains(&ratio), "{ratio}");
    // And no more of it than as many independent rays would leave.
    let alone = variance / 200.0;
    assert!(errors[1] < 1.5 * alone, "{} where independent rays would leave {alone}", errors[1]);
}

#[test]
fn rays_that_a_renderer_chose_by_itself_tend_to_the_box_filter_too() {
    let size = (72, 54);
    let pixels = u64::from(size.0 * size.1);
    let eye = view(DVec3::new(-1.0, -2.0, 0.3), 20.0, size);
    let (truth, variance) = truth(&eye, size, &room);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    // Points from elsewhere first, of the same scene but half as bright: what is stored may be worth little.
    let from = view(DVec3::new(-1.5, -2.0, 0.3), 14.0, size);
    let dim = |origin: DVec3, direction: DVec3| {
        let (place, radiance, object) = room(origin, direction);
        (place, radiance.map(|channel| 0.5 * channel), object)
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
        let (place, radiance, object) = room(origin, direction);
        let tag = cache.pixel_tag(column, row).unwrap();
        cache.insert(&[Sample { tag, object, noise: f32::INFINITY, ..Sample::new(place, radiance) }]);
        if count % 1000 == 0 {
            // Stored ones that come in between must not push them out.
            cache.insert(&stored[..100]);
        }
        if count + 1 == pixels * 50 || count + 1 == pixels * 200 {
            errors.push(squared_error(cache.frame(&moment(eye, &[], 0)).channels()[0], &truth));
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

#[test]
fn what_other_views_left_never_pushes_out_the_pixels_of_this_one() {
    let size = (64, 48);
    let eye = view(DVec3::ZERO, 0.0, size);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    cache.frame(&moment(eye, &[], 0));
    // Pixel after pixel, as a file has beam after beam; in between samples of what lies beside the picture.
    for row in 0..size.1 {
        for column in 0..size.0 {
            let (x, y) = View::pixel_centre(size, column, row);
            let (origin, direction) = eye.ray(x, y);
            let sample = Sample::new(wall(origin, direction, 2.0), [1.0; 3]);
            let beside = Sample::new(wall(origin, eye.ray(1.1, y).1, 2.0), [0.0; 3]);
            for _ in 0..3 {
                let tag = cache.pixel_tag(column, row).unwrap();
                cache.insert(&[Sample { tag, ..sample }, beside]);
            }
        }
    }
    let frame = cache.frame(&moment(eye, &[], 0));
    // At the end 0.86 of the slots are taken by pixels: eight groups of eight of them have nothing else with chance 0.86⁶⁴ = 6e-5.
    let lost = frame.has_point().filter(|has| !has).count();
    assert!(lost <= 1, "{lost} pixels have lost their points");
}

#[test]
fn without_resampling_no_ray_goes_through_an_old_point() {
    let size = (64, 48);
    let through = |resampling| {
        let params = PointImageParams { stages: Stages { resampling, ..Stages::ALL }, ..Default::default() };
        let mut cache = PointImage::new(size, params).unwrap();
        let eye = view(DVec3::ZERO, 0.0, size);
        let samples = whole_picture(&eye, size, &room);
        cache.frame(&moment(eye, &samples, 0));
        cache.age_where(100, |_, _| true);
        let shown = cache.frame(&moment(eye, &[], 500));
        // Points are kept in f32.
        let is_through = |direction: DVec3| {
            samples
                .iter()
                .any(|sample| matches!(sample.place, Place::At(at) if at.normalize().dot(direction) > 1.0 - 1e-12))
        };
        let rays: Vec<_> = shown.requests().collect();
        (rays.iter().filter(|(_, _, direction)| is_through(*direction)).count(), rays.len())
    };
    let (with, asked) = through(true);
    // Culled points are not asked again.
    assert!(with > asked * 9 / 10 && asked > 400, "{with} of {asked}");
    assert_eq!(through(false).0, 0);
}

#[test]
fn a_change_of_light_is_noticed_at_rest_without_being_told() {
    let size = (48, 36);
    let pixels = (size.0 * size.1) as usize;
    let eye = view(DVec3::ZERO, 0.0, size);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    let mut samples = Vec::new();
    let mut mean = 0.0;
    for frame in 0..240 {
        let light = if frame < 100 { 0.5 } else { 1.0 };
        let scene = |origin: DVec3, direction: DVec3| (wall(origin, direction, 2.0), [light; 3], 0);
        let shown = cache.frame(&moment(eye, &samples, pixels / 4));
        mean = shown.channels()[0].iter().sum::<f32>() / pixels as f32;
        samples = answer(&shown, &scene);
        assert!(frame != 100 || (mean - 0.5).abs() < 1e-3, "{mean}");
    }
    assert!((mean - 1.0).abs() < 1e-3, "{mean}: the old light is still there");
}

#[test]
fn stated_noise_is_not_taken_for_change() {
    let size = (48, 36);
    let pixels = (size.0 * size.1) as usize;
    let eye = view(DVec3::ZERO, 0.0, size);
    let run = |stated: f32| {
        let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
        let mut samples = Vec::new();
        let mut count = 0;
        for _ in 0..400 {
            let shown = cache.frame(&moment(eye, &samples, pixels / 4));
            samples = answer(&shown, &|origin, direction| (wall(origin, direction, 2.0), [0.0; 3], 0));
            for sample in &mut samples {
                count += 1;
                // Uniform in 0.5..1.5: deviation 0.29.
                sample.radiance = [0.5 + (random(count) >> 40) as f32 / (1 << 24) as f32; 3];
                sample.noise = stated;
            }
        }
        squared_error(cache.frame(&moment(eye, &samples, 0)).channels()[0], &vec![1.0; pixels])
    };
    let (silent, stated) = (run(0.0), run(0.29));
    println!("squared error with silent noise {silent:.2e}, with stated noise {stated:.2e}");
    assert!(stated < 0.5 * silent, "{stated}, {silent}");
}

#[test]
fn points_out_of_view_leave_first_and_only_if_eviction_is_on() {
    let size = (64, 48);
    let run = |eviction| {
        let params = PointImageParams { stages: Stages { eviction, ..Stages::ALL }, ..Default::default() };
        let mut cache = PointImage::new(size, params).unwrap();
        let behind = view(DVec3::ZERO, 180.0, size);
        cache.frame(&moment(behind, &whole_picture(&behind, size, &room), 0));
        let ahead = view(DVec3::ZERO, 0.0, size);
        let few: Vec<_> = whole_picture(&ahead, size, &room).into_iter().step_by(24).collect();
        for _ in 0..20 {
            cache.frame(&moment(ahead, &few, 0));
        }
        (cache.point_count(), 20 * few.len())
    };
    let ((with, new), (without, _)) = (run(true), run(false));
    assert!(with <= new, "{with} points are left after {new} new ones");
    assert!(without > 3000, "{without}");
}

#[test]
fn nothing_is_computed_when_nothing_changes() {
    let size = (64, 48);
    let eye = view(DVec3::ZERO, 0.0, size);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    let before = cache.frame(&moment(eye, &whole_picture(&eye, size, &room), 0)).picture();
    let mut stages = Vec::new();
    let after = cache.frame_watched(&moment(eye, &[], 0), &mut |stage| stages.push(stage)).picture();
    assert_eq!(stages, [Stage::UpdatePoints]);
    assert_eq!(before, after);
}

#[test]
fn an_empty_cache_asks_everywhere() {
    let size = (256, 256);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    let eye = view(DVec3::ZERO, 0.0, size);
    let frame = cache.frame(&moment(eye, &[], 4096));
    assert!(frame.channels().iter().all(|plane| plane.iter().all(|&channel| channel == 0.0)));
    let mut blocks = [0; 64];
    for (_, _, direction) in frame.requests() {
        let (x, y) = eye.project_direction(direction).unwrap();
        blocks[(y * 8.0) as usize * 8 + (x * 8.0) as usize] += 1;
    }
    let total: usize = blocks.iter().sum();
    assert!((3900..=4096).contains(&total), "{total}");
    // 64 each; independent random pixels would leave the range of 40..88 in about one block of 400.
    assert!(blocks.iter().all(|count| (40..88).contains(count)), "{blocks:?}");
}

#[test]
fn infinitely_far_things_turn_with_the_view_and_stay_with_a_walk() {
    let size = (64, 48);
    let mut cache =
        PointImage::new(size, PointImageParams { smoothing: Smoothing::Gaps, ..Default::default() }).unwrap();
    let toward = DVec3::new(0.1, 1.0, 0.05);
    let sun = [Sample::new(Place::Toward(toward), [1e6, 9e5, 8e5])];
    for (eye, degrees) in [(DVec3::ZERO, 0.0), (DVec3::new(300.0, -50.0, 20.0), 0.0), (DVec3::ZERO, 8.0)] {
        let eye = view(eye, degrees, size);
        let picture = cache.frame(&moment(eye, if degrees == 0.0 { &sun[..] } else { &[] }, 0)).picture();
        let (x, y) = eye.project_direction(toward).unwrap();
        let (column, row) = View::pixel_at(size, x, y).unwrap();
        assert!(picture.get(column, row).unwrap()[0] > 9.9e5);
    }
}

#[test]
fn the_ball_of_the_room_is_where_rays_say() {
    // The scenes themselves, which other tests take for granted.
    let hit = ball(DVec3::ZERO, DVec3::Y, DVec3::new(0.0, 5.0, 0.0), 1.0).unwrap();
    assert!((hit - 4.0).abs() < 1e-12);
    assert!(checker(DVec3::splat(0.1), 1.0) != checker(DVec3::new(1.1, 0.1, 0.1), 1.0));
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
    let left: Vec<_> = samples.into_iter().filter(|s| matches!(s.place, Place::At(at) if is_left(at))).collect();
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    let frame = cache.frame(&moment(eye, &left, 1000));
    let weighed = frame.weigh(&sections, &beams, 0.75);
    assert!(weighed.is_sorted_by_key(|beam| (beam.section, beam.beam)));
    assert_eq!(weighed.iter().map(|beam| beam.beam).collect::<HashSet<_>>().len(), weighed.len());
    // Weights of the beams whose middle ray goes left and right from the eye.
    let halves = |beams: &[WantedBeam]| {
        let mut halves = [0.0; 2];
        for beam in beams {
            let x = f64::from(size.0) * 0.5;
            let on_left = (0..size.0 * size.1).find_map(|pixel| {
                let (column, row) = (pixel % size.0, pixel / size.0);
                let (px, py) = View::pixel_centre(size, column, row);
                let (origin, direction) = eye.ray(px, py);
                (best_beam(&sections, origin, direction)? == (0, beam.beam)).then_some(f64::from(column) < x)
            });
            if let Some(on_left) = on_left {
                halves[usize::from(!on_left)] += f64::from(beam.weight);
            }
        }
        halves
    };
    let ([left_before, right_before], [left_after, right_after]) = (halves(&beams), halves(&weighed));
    println!(
        "left and right: {left_before:.0} and {right_before:.0} pixels, then {left_after:.0} and {right_after:.0}"
    );
    // The known half asks for (nearly) nothing: it keeps a quarter of its weight, and what beams across the middle get.
    assert!(left_after < 0.4 * left_before && right_after > 1.6 * right_before);
    let total = |beams: &[WantedBeam]| beams.iter().map(|beam| f64::from(beam.weight)).sum::<f64>();
    assert!((total(&weighed) / total(&beams) - 1.0).abs() < 1e-4);
    // Nothing asked for: nothing changes.
    assert_eq!(cache.frame(&moment(eye, &[], 0)).weigh(&sections, &beams, 0.75), beams);
}
