//! The render cache gives the same bits on any number of threads, and survives any numbers.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::scenes::{answer, on_threads, room, view};
use glam::DVec3;
use holo_driver_rendercache::{
    EmptyPixels, Moment, Place, PointImage, PointImageError, PointImageParams, RayResult,
    Smoothing, Stages,
};
use holo_picture::View;
use proptest::prelude::*;

/// All bits of a walk with a rest: pictures and rays.
fn walk(size: (u32, u32), params: PointImageParams) -> Vec<u64> {
    let mut cache = PointImage::new(size, params).unwrap();
    let at = |frame: u32| {
        let step = f64::from(frame.min(6));
        view(DVec3::new(0.1 * step, -2.0, 0.05 * step), 4.0 * step, size)
    };
    let mut samples = Vec::new();
    let mut bits = Vec::new();
    for frame in 0..12 {
        let wanted = (size.0 * size.1).div_ceil(3) as usize;
        let shown = cache.frame(&Moment {
            view: at(frame),
            predicted: Some(at(frame + 1)),
            samples: &samples,
            wanted,
        });
        bits.extend(
            shown
                .picture()
                .pixels
                .as_flattened()
                .iter()
                .map(|channel| u64::from(channel.to_bits())),
        );
        bits.extend(
            shown.requests().flat_map(|(_, _, direction)| direction.to_array().map(f64::to_bits)),
        );
        samples = answer(&shown, &room);
    }
    bits
}

#[test]
fn threads_do_not_change_a_bit() {
    for size in [(1, 1), (3, 200), (130, 67), (257, 97), (300, 1), (20, 1040)] {
        for (smoothing, prefilter_window) in
            [(Smoothing::WhereOld, 7), (Smoothing::Everywhere, 3), (Smoothing::Gaps, 9)]
        {
            let params =
                PointImageParams { smoothing, prefilter_window, ..PointImageParams::default() };
            let on = |threads| on_threads(threads, || walk(size, params.clone()));
            let one = on(1);
            for threads in [1, 2, 5] {
                assert!(one == on(threads), "{size:?} {smoothing:?} {threads}");
            }
        }
    }
}

#[test]
fn another_seed_asks_for_other_rays() {
    let run = |seed| walk((64, 64), PointImageParams { seed, ..PointImageParams::default() });
    assert_ne!(run(1), run(2));
}

#[test]
fn a_picture_of_four_thousand_columns_works() {
    let size = (3840, 2160);
    let mut cache = PointImage::new(size, PointImageParams::default()).unwrap();
    let eye = view(DVec3::ZERO, 0.0, size);
    let mut samples = Vec::new();
    for _ in 0..2 {
        samples = answer(
            &cache.frame(&Moment { view: eye, predicted: None, samples: &samples, wanted: 8000 }),
            &room,
        );
    }
    // The columns and rows at the ends are requested like all others: all 20 by 20 parts of the
    // picture.
    let mut parts = [0; 400];
    for sample in &samples {
        let Place::At(place) = sample.place else { continue };
        let (x, y, _) = eye.project(place).unwrap();
        parts[(y * 20.0) as usize * 20 + (x * 20.0) as usize] += 1;
    }
    assert!(parts.iter().all(|&part| part > 0), "{parts:?}");
}

#[test]
fn bad_settings_are_errors_with_a_reason() {
    let with = |change: fn(&mut PointImageParams)| {
        let mut params = PointImageParams::default();
        change(&mut params);
        PointImage::new((8, 8), params).unwrap_err().to_string()
    };
    assert_eq!(
        with(|params| params.points_per_pixel = f64::NAN),
        "points_per_pixel is NaN: it must be 1 to 8"
    );
    assert!(with(|params| params.cull_threshold = -1.0).starts_with("cull_threshold"));
    assert!(with(|params| params.check_every = 1).starts_with("check_every"));
    let size = PointImage::new((0, 8), PointImageParams::default());
    assert!(matches!(size, Err(PointImageError::Size(_))));
}

/// Numbers of all kinds: ordinary, huge, tiny, not numbers.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -10.0..10.0,
        1 => any::<f64>(),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(0.0),
    ]
}

fn sample() -> impl Strategy<Value = RayResult> {
    let place = (prop::array::uniform3(number()), any::<bool>());
    (place, prop::array::uniform3(number()), number()).prop_map(
        |((place, is_near), radiance, noise)| {
            let place = if is_near { Place::At(place.into()) } else { Place::Toward(place.into()) };
            let sample = RayResult::new(place, radiance.map(|channel| channel as f32));
            RayResult { noise: noise as f32, ..sample }
        },
    )
}

/// Eye and direction.
fn eye() -> impl Strategy<Value = ([f64; 3], [f64; 3])> {
    (prop::array::uniform3(-1e3..1e3), prop::array::uniform3(-1.0..1.0))
}

/// Shows frames from some eyes, giving any samples as answers to requests.
fn look_around(
    cache: &mut PointImage,
    size: (u32, u32),
    eyes: Vec<([f64; 3], [f64; 3])>,
    samples: &[RayResult],
    wanted: usize,
) -> Result<(), TestCaseError> {
    let mut returned = samples.to_vec();
    for (eye, direction) in eyes {
        let direction = DVec3::from(direction) + DVec3::new(0.0, 1e-3, 0.0);
        let toward = |direction| View::new(eye.into(), direction, DVec3::Z, None, None, size).ok();
        let Some(view) = toward(direction) else { continue };
        let predicted = toward(direction + DVec3::X);
        let frame = cache.frame(&Moment { view, predicted, samples: &returned, wanted });
        let shown = frame.picture();
        let is_light = |channel: &f32| channel.is_finite() && *channel >= 0.0;
        prop_assert!(shown.pixels.as_flattened().iter().all(is_light));
        let (asked, ahead) = frame.request_counts();
        prop_assert!(asked <= wanted && ahead <= wanted / 2);
        for (_, origin, direction) in frame.requests() {
            prop_assert!(origin.is_finite() && (direction.length() - 1.0).abs() < 1e-6);
        }
        // Their positions are unrelated to the requests.
        let answers = frame.requests().zip(samples.iter().cycle());
        returned = answers.map(|((tag, ..), sample)| RayResult { tag, ..*sample }).collect();
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn no_number_makes_it_panic_or_shows(
        size in (1_u32..90, 1_u32..90),
        eyes in prop::collection::vec(eye(), 1..5),
        samples in prop::collection::vec(sample(), 0..200),
        wanted in 0_usize..5000,
        parts in prop::array::uniform8(any::<bool>()),
        black in any::<bool>(),
    ) {
        let mut stages = Stages::ALL;
        for (name, on) in Stages::NAMES.into_iter().zip(parts) {
            stages.switch(name, on);
        }
        let empty = if black { EmptyPixels::Black } else { EmptyPixels::KeepLast };
        let params = PointImageParams { stages, empty, ..PointImageParams::default() };
        let mut cache = PointImage::new(size, params).unwrap();
        look_around(&mut cache, size, eyes, &samples, wanted)?;
        prop_assert!(cache.point_count() <= 2 * (size.0 * size.1) as usize + 256);
    }
}
