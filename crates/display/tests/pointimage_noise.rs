//! The render cache with noisy samples: smoother than the papers' while moving, the box filter at rest all the same.

#![allow(clippy::unwrap_used, reason = "tests")]

mod pointimage_scenes;

use glam::DVec3;
use holo_display::pointimage::{Moment, PointImage, PointImageParams, Sample};
use holo_picture::{Picture, View};
use pointimage_scenes::{answer, room, view, whole_picture};

const SIZE: (u32, u32) = (120, 90);

/// Makes samples noisy without bias: twice the light or none, as a path that meets a lamp or does not.
fn noisy(samples: &mut [Sample], seed: u64, stated: bool) {
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

fn error(picture: &Picture, view: &View) -> f64 {
    let truth = whole_picture(view, SIZE, &room);
    let of = |(pixel, truth): (&[f32; 3], &Sample)| -> f64 {
        (0..3).map(|i| f64::from(pixel[i] - truth.radiance[i]).powi(2)).sum()
    };
    picture.pixels.iter().zip(&truth).map(of).sum::<f64>() / truth.len() as f64
}

/// Mean square error over a walk with a sample for eight pixels a frame.
fn walk(noise_smoothing: f32, stated: bool) -> f64 {
    let mut cache = PointImage::new(SIZE, PointImageParams { noise_smoothing, ..PointImageParams::default() }).unwrap();
    let at = |frame: u64| view(DVec3::new(-2.0 + 0.02 * frame as f64, -2.0, 0.0), frame as f64, SIZE);
    let (mut samples, mut sum) = (Vec::new(), 0.0);
    for frame in 0..60 {
        let (view, predicted) = (at(frame), Some(at(frame + 1)));
        let wanted = (SIZE.0 * SIZE.1 / 8) as usize;
        let shown = cache.frame(&Moment { view, predicted, samples: &samples, wanted });
        if frame >= 30 {
            sum += error(&shown.picture(), &view) / 30.0;
        }
        samples = answer(&shown, &room);
        noisy(&mut samples, frame, stated);
    }
    sum
}

#[test]
fn stated_noise_is_smoothed_over_more_pixels() {
    let (papers, ours) = (walk(0.0, true), walk(PointImageParams::default().noise_smoothing, true));
    println!("mean square error {papers:.4} with the papers' filters, {ours:.4}");
    assert!(ours < 0.7 * papers, "{ours} after {papers}");
}

#[test]
fn without_stated_noise_the_filters_are_the_papers() {
    assert_eq!(walk(0.0, false), walk(1000.0, false));
}

#[test]
fn at_rest_other_pixels_light_fades_from_noisy_pictures() {
    let view = view(DVec3::new(-1.0, -2.0, 0.0), 20.0, SIZE);
    let errors = [0.0, 8.0].map(|noise_smoothing| {
        let params = PointImageParams { noise_smoothing, ..PointImageParams::default() };
        let mut cache = PointImage::new(SIZE, params).unwrap();
        let (mut samples, wanted) = (Vec::new(), (SIZE.0 * SIZE.1) as usize);
        for frame in 0..400 {
            let shown = cache.frame(&Moment { view, predicted: None, samples: &samples, wanted });
            samples = answer(&shown, &room);
            noisy(&mut samples, frame, true);
        }
        cache.frame(&Moment { view, predicted: None, samples: &samples, wanted: 0 }).picture()
    });
    // The same requests, the same samples: with n of each pixel the two differ by 8/(n + 8) of what the filter would change.
    let largest = errors[0].pixels.iter().zip(&errors[1].pixels).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
    println!("largest difference {largest:.4}");
    assert!(largest > 0.0 && largest < 0.05, "{largest}");
}
