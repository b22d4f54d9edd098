//! Tests of the render cache: its pictures, and the rays that it requests.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::scenes::{
    answer, ball, checker, moment, random, room, squared_error, truth, view, wall, whole_picture,
};
use glam::DVec3;
use holo_driver_rendercache::{
    EmptyPixels, Moment, Place, PointImage, PointImageParams, RayResult, Smoothing, Stage, Stages,
};
use holo_picture::View;

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
            assert!(
                (shown - stored).abs() <= largest / 256.0,
                "{pixel:?} for {:?}",
                sample.radiance
            );
        }
    }
}

#[test]
fn points_behind_a_sparse_surface_are_culled_as_often_as_the_threshold_says() {
    let size = (160, 160);
    let eye = view(DVec3::ZERO, 0.0, size);
    let light = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    // In each pixel a point at depth 3 or, with probability 1/2, at depth 1 instead.
    let samples: Vec<_> =
        whole_picture(&eye, size, &|origin, direction| (wall(origin, direction, 3.0), light[0]))
            .into_iter()
            .enumerate()
            .map(|(index, far)| {
                let is_near = random(index as u64) >> 63 == 1;
                let Place::At(place) = far.place else { unreachable!() };
                if is_near { RayResult::new(Place::At(place / 3.0), light[1]) } else { far }
            })
            .collect();
    let far_points = samples.iter().filter(|sample| sample.radiance == light[0]).count();
    let mut cache = PointImage::new(
        size,
        PointImageParams {
            smoothing: Smoothing::Gaps,
            empty: EmptyPixels::Black,
            ..PointImageParams::default()
        },
    )
    .unwrap();
    let mut kept = |stages| {
        cache.set_stages(stages);
        let samples = if stages == Stages::ALL { &[][..] } else { &samples };
        let frame = cache.frame(&moment(eye, samples, 0));
        let pixels = frame.picture().pixels;
        let shown = frame.depth().zip(pixels);
        shown.filter(|(depth, [_, green, _])| *depth > 0.0 && *green > 0.5).count()
    };
    assert_eq!(kept(Stages { depth_cull: false, ..Stages::ALL }), far_points);
    // Among n near and m far points, itself included, a far one stays if 3 (n + m) <= 1.1 (n + 3
    // m). So at most one of the nine is near.
    let expected = far_points as f64 * 9.0 / 256.0;
    // Up to 25 neighbours depend on each other, so the deviation is up to 5 times that of
    // independent points. Four such deviations are allowed.
    let allowed = 4.0 * 5.0 * expected.sqrt();
    let found = kept(Stages::ALL) as f64;
    println!("{found} of {far_points} points show through, {expected:.0} expected");
    assert!(
        (found - expected).abs() < allowed,
        "{found} of {far_points} points show through, {expected:.0} expected"
    );
}

/// Turns by 90 degrees a second at 30 frames a second. Returns the share of pixels without a point
/// among 3×3, first in the whole picture, then in columns that have just come into view. The third
/// value is the number of pixels in these columns.
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
        let shown = cache.frame(&Moment {
            view: at(frame),
            predicted: Some(at(frame + 1)),
            samples: &samples,
            wanted,
        });
        if frame >= 10 {
            let green: Vec<_> = shown.picture().pixels.iter().map(|pixel| pixel[1]).collect();
            all += green.iter().filter(|&&green| green == 0.0).count();
            // 3 degrees are the last 9 columns. The middle of two blocks of 4 columns, all new.
            new += green[160..118 * 160]
                .chunks(160)
                .flat_map(|row| &row[154..158])
                .filter(|&&green| green == 0.0)
                .count();
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
    println!(
        "holes at 90 degrees/s, a sample for 32 pixels: {all_without:.4} without prediction, \
         {all_with:.4} with"
    );
    println!("in columns that were just turned into view: {without:.4} without, {with:.4} with");
    assert!(all_with < all_without);
    // Without prediction nothing can be there yet.
    assert_eq!(without, 1.0);
    // The window of 3×3 around the i-th pixel of a block has 3 columns in the block. At the border,
    // it has 2 in the block and 1 in the neighbour.
    let parts = |i| if i == 1 || i == 2 { [3.0, 0.0] } else { [2.0, 1.0] };
    let mut expected = 0.0;
    for (i, j) in (0..16).map(|pixel| (pixel % 4, pixel / 4)) {
        expected +=
            parts(i).iter().flat_map(|x| parts(j).map(|y| 1.0 - x * y / 16.0)).product::<f64>()
                / 16.0;
    }
    // Pixels up to 4 apart depend on each other: at most 81 of them. Four deviations.
    let allowed = 4.0 * (81.0 * expected * (1.0 - expected) / strip as f64).sqrt();
    assert!(
        (with - expected).abs() < allowed,
        "{with} of the new pixels are empty, {expected} expected"
    );
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
            errors.push(squared_error(&shown.picture(), &truth));
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
fn the_oldest_points_are_asked_for_first() {
    let size = (64, 64);
    let eye = view(DVec3::ZERO, 0.0, size);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    let far_wall = |origin: DVec3, direction: DVec3| (wall(origin, direction, 2.0), [0.5; 3]);
    let samples = whole_picture(&eye, size, &far_wall);
    cache.frame(&moment(eye, &samples, 0));
    // The points of the right half are confirmed again and again, and the others grow old.
    for _ in 0..3 {
        let right: Vec<_> = (0..size.0 * size.1)
            .filter(|pixel| pixel % size.0 >= 32)
            .map(|pixel| {
                let tag = cache.guess_tag(pixel % size.0, pixel / size.0).unwrap();
                RayResult { tag, ..samples[pixel as usize] }
            })
            .collect();
        cache.frame(&moment(eye, &right, 0));
    }
    let frame = cache.frame(&moment(eye, &[], 400));
    let left = frame.requests().filter(|(_, _, direction)| direction.x < 0.0).count();
    assert!(left > 380, "{left} of 400 requests are for the old half");
}

#[test]
fn without_resampling_no_ray_goes_through_an_old_point() {
    let size = (64, 48);
    let through = |resampling| {
        // Culled points are not requested again.
        let stages = Stages { resampling, depth_cull: false, ..Stages::ALL };
        let mut cache =
            PointImage::new(size, PointImageParams { stages, ..Default::default() }).unwrap();
        let eye = view(DVec3::ZERO, 0.0, size);
        let samples = whole_picture(&eye, size, &room);
        cache.frame(&moment(eye, &samples, 0));
        // A few samples beside the picture let the points grow older.
        let behind = whole_picture(&view(DVec3::ZERO, 180.0, size), size, &room);
        let shown = cache.frame(&moment(eye, &behind[..300], 500));
        // Points are kept in f32.
        let is_through = |direction: DVec3| {
            samples.iter().any(|sample| {
                matches!(sample.place, Place::At(at)
                    if at.normalize().dot(direction) > 1.0 - 1e-12)
            })
        };
        let rays: Vec<_> = shown.requests().collect();
        (rays.iter().filter(|(_, _, direction)| is_through(*direction)).count(), rays.len())
    };
    let (with, asked) = through(true);
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
        let scene = |origin: DVec3, direction: DVec3| (wall(origin, direction, 2.0), [light; 3]);
        let shown = cache.frame(&moment(eye, &samples, pixels / 4));
        mean = shown.picture().pixels.iter().map(|pixel| pixel[0]).sum::<f32>() / pixels as f32;
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
            samples = answer(&shown, &|origin, direction| (wall(origin, direction, 2.0), [0.0; 3]));
            for sample in &mut samples {
                count += 1;
                // Uniform in 0.5..1.5: deviation 0.29.
                sample.radiance = [0.5 + (random(count) >> 40) as f32 / (1 << 24) as f32; 3];
                sample.noise = stated;
            }
        }
        squared_error(&cache.frame(&moment(eye, &samples, 0)).picture(), &vec![1.0; pixels])
    };
    let (silent, stated) = (run(0.0), run(0.29));
    println!("squared error with silent noise {silent:.2e}, with stated noise {stated:.2e}");
    assert!(stated < 0.5 * silent, "{stated}, {silent}");
}

#[test]
fn points_out_of_view_leave_first_and_only_if_eviction_is_on() {
    let size = (64, 48);
    let run = |eviction| {
        let params =
            PointImageParams { stages: Stages { eviction, ..Stages::ALL }, ..Default::default() };
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
    let after =
        cache.frame_watched(&moment(eye, &[], 0), &mut |stage| stages.push(stage)).picture();
    assert_eq!(stages, [Stage::UpdatePoints]);
    assert_eq!(before, after);
}

#[test]
fn an_empty_cache_asks_everywhere() {
    let size = (256, 256);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    let eye = view(DVec3::ZERO, 0.0, size);
    let frame = cache.frame(&moment(eye, &[], 4096));
    assert!(frame.picture().pixels.iter().all(|pixel| *pixel == [0.0; 3]));
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
    let mut cache = PointImage::new(
        size,
        PointImageParams { smoothing: Smoothing::Gaps, ..Default::default() },
    )
    .unwrap();
    let toward = DVec3::new(0.1, 1.0, 0.05);
    let sun = [RayResult::new(Place::Toward(toward), [1e6, 9e5, 8e5])];
    for (eye, degrees) in
        [(DVec3::ZERO, 0.0), (DVec3::new(300.0, -50.0, 20.0), 0.0), (DVec3::ZERO, 8.0)]
    {
        let eye = view(eye, degrees, size);
        let picture =
            cache.frame(&moment(eye, if degrees == 0.0 { &sun[..] } else { &[] }, 0)).picture();
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
