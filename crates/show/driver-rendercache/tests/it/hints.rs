//! Hints: objects that move, and places that are likely to change.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::scenes::{Hit, answer, ball, checker, moment, view, wall};
use glam::{DAffine3, DVec3};
use holo_driver_rendercache::{Place, PointImage, PointImageError, PointImageParams, RayResult};
use holo_picture::{Picture, View};

const SIZE: (u32, u32) = (96, 72);
const BALL: u32 = 7;
const RADIUS: f64 = 0.5;

/// A dim wall behind a checkered ball, and whether the ball was hit.
fn scene(centre: DVec3, origin: DVec3, direction: DVec3) -> (Hit, bool) {
    match ball(origin, direction, centre, RADIUS) {
        Some(distance) => {
            let place = origin + direction * distance;
            let light = checker(place - centre, 0.25);
            ((Place::At(place), [light; 3]), true)
        }
        None => ((wall(origin, direction, 5.0), [0.1; 3]), false),
    }
}

/// The squared error of the pixels of the ball, which moves a unit to the right in a second, with
/// 27 new samples in each of 30 frames. With `hints`, the cache is told of the motion.
fn error_of_a_moving_ball(hints: bool) -> f64 {
    let eye = view(DVec3::ZERO, 0.0, SIZE);
    let mut cache = PointImage::new(SIZE, PointImageParams::default()).unwrap();
    let at = |frame: usize| DVec3::new(-0.5 + frame as f64 / 30.0, 3.0, 0.0);
    let object = |centre: DVec3, samples: Vec<RayResult>| -> Vec<RayResult> {
        let on_ball =
            |place| matches!(place, Place::At(at) if (centre - at).length() < RADIUS + 1e-6);
        let known = |sample: RayResult| RayResult {
            object: if on_ball(sample.place) { BALL } else { 0 },
            ..sample
        };
        samples.into_iter().map(known).collect()
    };
    let trace = |centre: DVec3| move |origin, direction| scene(centre, origin, direction).0;
    // At rest first, until every pixel is known.
    let mut samples = Vec::new();
    for _ in 0..20 {
        let frame = cache.frame(&moment(eye, &samples, 1000));
        samples = object(at(0), answer(&frame, &trace(at(0))));
    }
    let (mut error, mut pixels) = (0.0, 0);
    for number in 1..=30 {
        if hints {
            let step = DAffine3::from_translation(at(number) - at(number - 1));
            assert!(cache.move_object(BALL, &step).unwrap() > 50);
        }
        let frame = cache.frame(&moment(eye, &samples, 27));
        let shown: Picture = frame.picture();
        samples = object(at(number), answer(&frame, &trace(at(number))));
        for pixel in 0..SIZE.0 * SIZE.1 {
            let (column, row) = (pixel % SIZE.0, pixel / SIZE.0);
            let (x, y) = View::pixel_centre(SIZE, column, row);
            let (origin, direction) = eye.ray(x, y);
            let (now, is_ball) = scene(at(number), origin, direction);
            if is_ball {
                let found = shown.get(column, row).unwrap()[0];
                error += f64::from(found - now.1[0]).powi(2);
                pixels += 1;
            }
        }
    }
    error / f64::from(pixels)
}

#[test]
fn an_object_that_is_said_to_move_is_shown_far_better_than_one_that_is_not() {
    let [with, without] = [true, false].map(error_of_a_moving_ball);
    let gain = 10.0 * (without / with).log10();
    println!("squared error {with:.4}, without hints {without:.4}: {gain:.1} dB");
    // 1999, §4.2: transforms "significantly" improve the tracking of moving objects.
    assert!(gain > 4.0, "{gain} dB");
}

#[test]
fn points_of_other_objects_stay_and_only_rigid_motions_are_taken() {
    let eye = view(DVec3::ZERO, 0.0, SIZE);
    let mut cache = PointImage::new(SIZE, PointImageParams::default()).unwrap();
    let sample = |x: f64, object| {
        let place = Place::At(DVec3::new(x, 3.0, 0.0));
        RayResult { object, ..RayResult::new(place, [1.0; 3]) }
    };
    cache.frame(&moment(eye, &[sample(-0.5, 1), sample(0.5, 2), sample(0.9, 0)], 0));
    let turn = DAffine3::from_rotation_z(0.1);
    let shear =
        DAffine3::from_cols_array(&[1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    for wrong in [
        DAffine3::from_scale(DVec3::splat(2.0)),
        DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)),
        DAffine3::from_translation(DVec3::new(f64::NAN, 0.0, 0.0)),
        shear,
    ] {
        assert!(matches!(cache.move_object(1, &wrong), Err(PointImageError::NotRigid)));
    }
    assert_eq!(
        (cache.move_object(3, &turn).unwrap(), cache.move_object(0, &turn).unwrap()),
        (0, 0)
    );
    let up = DAffine3::from_translation(DVec3::new(0.0, 0.0, 0.5));
    assert_eq!(cache.move_object(1, &up).unwrap(), 1);
    let frame = cache.frame(&moment(eye, &[], 0));
    let known = |x: f64, z: f64| {
        let (x, y, _) = eye.project(DVec3::new(x, 3.0, z)).unwrap();
        let (column, row) = View::pixel_at(SIZE, x, y).unwrap();
        frame.depth().nth((row * SIZE.0 + column) as usize).unwrap() > 0.0
    };
    assert!(known(-0.5, 0.5) && !known(-0.5, 0.0), "it has moved");
    assert!(known(0.5, 0.0) && known(0.9, 0.0), "the others have not");
}

#[test]
fn points_that_are_likely_to_change_leave_sooner() {
    let eye = view(DVec3::ZERO, 0.0, SIZE);
    // The frames until the points are gone, while as many others come as there are slots.
    let lifetime = |hint: bool, is_changing: bool| {
        let mut cache = PointImage::new(SIZE, PointImageParams::default()).unwrap();
        let place = Place::At(DVec3::new(0.0, 3.0, 0.0));
        let old = RayResult { is_changing, ..RayResult::new(place, [1.0; 3]) };
        cache.frame(&moment(eye, &[old], 0));
        if hint {
            assert_eq!(cache.expect_changes(DVec3::new(0.1, 3.0, 0.0), 0.2), 1);
        }
        // Beside the picture.
        let others: Vec<RayResult> = (0..400)
            .map(|number| {
                let place = DVec3::new(6.0 + 0.001 * f64::from(number), 3.0, 0.0);
                RayResult::new(Place::At(place), [0.5; 3])
            })
            .collect();
        let shown = |cache: &mut PointImage| {
            let frame = cache.frame(&moment(eye, &others, 0));
            frame.depth().any(|depth| depth > 0.0)
        };
        (0..400).find(|_| !shown(&mut cache)).unwrap()
    };
    let (usual, marked, hinted) =
        (lifetime(false, false), lifetime(false, true), lifetime(true, false));
    println!("points live {usual} frames, {marked} and {hinted} if they are likely to change");
    assert!(marked < usual && hinted < usual);
}
