//! The render cache with noisy samples: smoother than the papers' while moving, the box filter at
//! rest all the same.

#![allow(clippy::unwrap_used, reason = "tests")]

use crate::scenes::{Hit, Scene, answer, room, squared_error, view, whole_picture};
use glam::DVec3;
use holo_driver_rendercache::{Moment, PointImage, PointImageParams, RayResult};
use holo_picture::{Picture, View};

const SIZE: (u32, u32) = (120, 90);

/// Makes samples noisy without bias: twice the light or none, as a path that meets a lamp or does
/// not.
fn noisy(samples: &mut [RayResult], seed: u64, stated: bool) {
    for (index, sample) in (0_u64..).zip(samples) {
        let mut z = (seed << 32 | index).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let factor = if z >> 63 == 0 { 0.3 } else { 1.7 };
        let largest = sample.radiance[0].max(sample.radiance[1]).max(sample.radiance[2]);
        sample.noise = if stated { 0.7 * largest } else { 0.0 };
        sample.radiance = sample.radiance.map(|channel| factor * channel);
    }
}

fn error(picture: &Picture, view: &View, scene: Scene) -> f64 {
    let truth = whole_picture(view, SIZE, scene);
    let of = |(pixel, truth): (&[f32; 3], &RayResult)| -> f64 {
        (0..3).map(|i| f64::from(pixel[i] - truth.radiance[i]).powi(2)).sum()
    };
    picture.pixels.iter().zip(&truth).map(of).sum::<f64>() / truth.len() as f64
}

/// The room without checks: nothing for a wide filter to blur but the corners and the ball.
fn plain(origin: DVec3, direction: DVec3) -> Hit {
    let (place, radiance) = room(origin, direction);
    // The ball alone has little blue.
    (place, if radiance[2] > 0.5 * radiance[0] { [0.5, 0.5, 0.4] } else { radiance })
}

/// Mean square error over a walk with a sample for eight pixels a frame.
fn walk(scene: Scene, noise_smoothing: f32, stated: bool) -> f64 {
    let mut cache =
        PointImage::new(SIZE, PointImageParams { noise_smoothing, ..PointImageParams::default() })
            .unwrap();
    let at =
        |frame: u64| view(DVec3::new(-2.0 + 0.02 * frame as f64, -2.0, 0.0), frame as f64, SIZE);
    let (mut samples, mut sum) = (Vec::new(), 0.0);
    for frame in 0..60 {
        let (view, predicted) = (at(frame), Some(at(frame + 1)));
        let wanted = (SIZE.0 * SIZE.1 / 8) as usize;
        let shown = cache.frame(&Moment { view, predicted, samples: &samples, wanted });
        if frame >= 30 {
            sum += error(&shown.picture(), &view, scene) / 30.0;
        }
        samples = answer(&shown, scene);
        noisy(&mut samples, frame, stated);
    }
    sum
}

#[test]
fn stated_noise_is_smoothed_over_more_pixels() {
    // Fine checks bear no blur: there the gain is small, but it is one.
    for (name, scene, share) in [("checks", &room as Scene, 1.0), ("plain walls", &plain, 0.5)] {
        let smoothing = PointImageParams::default().noise_smoothing;
        let (papers, ours) = (walk(scene, 0.0, true), walk(scene, smoothing, true));
        println!("{name}: mean square error {papers:.4} with the papers' filters, {ours:.4}");
        assert!(ours < share * papers, "{name}: {ours} after {papers}");
    }
}

#[test]
fn without_stated_noise_the_filters_are_the_papers() {
    assert_eq!(walk(&room, 0.0, false), walk(&room, 1000.0, false));
}

#[test]
fn at_rest_other_pixels_light_fades_from_noisy_pictures() {
    let view = view(DVec3::new(-1.0, -2.0, 0.0), 20.0, SIZE);
    let errors = [0.0, 8.0].map(|noise_smoothing| {
        let params = PointImageParams { noise_smoothing, ..PointImageParams::default() };
        let mut cache = PointImage::new(SIZE, params).unwrap();
        let (mut samples, wanted) = (Vec::new(), (SIZE.0 * SIZE.1 / 4) as usize);
        for frame in 0..800 {
            let shown = cache.frame(&Moment { view, predicted: None, samples: &samples, wanted });
            samples = answer(&shown, &room);
            noisy(&mut samples, frame, true);
        }
        cache.frame(&Moment { view, predicted: None, samples: &samples, wanted: 0 }).picture()
    });
    // Both have the same requests and samples. With n samples of each pixel, the two differ by 8/(n
    // + 8) of the filter's change, which is less than 0.5. Because an eighth of the requests check
    // points, n is above 150.
    let differences =
        errors[0].pixels.iter().zip(&errors[1].pixels).map(|(a, b)| f64::from((a[0] - b[0]).abs()));
    let (sum, largest) =
        differences.fold((0.0, 0.0_f64), |(sum, largest), each| (sum + each, largest.max(each)));
    let mean = sum / f64::from(SIZE.0 * SIZE.1);
    println!("errors {:?}", [&errors[0], &errors[1]].map(|picture| error(picture, &view, &room)));
    println!("mean difference {mean:.4}, largest {largest:.4}");
    assert!(mean > 0.0 && mean < 0.5 * 8.0 / 158.0, "{mean}");
}

#[test]
fn noise_at_rest_falls_as_that_of_a_mean() {
    let view = view(DVec3::new(-1.0, -2.0, 0.0), 20.0, SIZE);
    let light = 0.5;
    // Every ray finds the same light: what is left is noise alone.
    let scene = |origin: DVec3, direction: DVec3| (room(origin, direction).0, [light; 3]);
    let params = PointImageParams { noise_smoothing: 0.0, ..PointImageParams::default() };
    let check_every = f64::from(params.check_every);
    let mut cache = PointImage::new(SIZE, params).unwrap();
    let pixels = (SIZE.0 * SIZE.1) as usize;
    let (mut samples, mut counts) = (Vec::new(), vec![0.0_f64; pixels]);
    for frame in 1..=1600 {
        let shown =
            cache.frame(&Moment { view, predicted: None, samples: &samples, wanted: pixels / 4 });
        if [100, 400, 1600].contains(&frame) {
            // Two values as far from the mean as 0.7 of it. One request in `check_every` goes to
            // see whether a point has changed.
            let variance = f64::from(0.7 * light).powi(2);
            let expected = counts
                .iter()
                .map(|count| variance / (count * (1.0 - 1.0 / check_every)))
                .sum::<f64>();
            let expected = expected / pixels as f64;
            let found = squared_error(&shown.picture(), &vec![light; pixels]);
            println!("after {frame} frames {found:.3e}, {expected:.3e} expected");
            // The mean of squares of 10800 means is known to 1.4 %: four deviations, and 4 % for
            // how checks are dealt out.
            assert!(
                (found / expected - 1.0).abs() < 0.1,
                "{found} after {frame} frames, {expected} expected"
            );
        }
        for (_, _, direction) in shown.requests() {
            let (x, y) = view.project_direction(direction).unwrap();
            let (column, row) = View::pixel_at(SIZE, x, y).unwrap();
            counts[(row * SIZE.0 + column) as usize] += 1.0;
        }
        samples = answer(&shown, &scene);
        noisy(&mut samples, 10_000 + frame, true);
    }
}
