//! Motions of the eye: geometry that must hold for every pose, and paces that do not depend on
//! frames.

#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

use glam::DVec3;
use holo_picture::{View, ViewSpec};
use holo_walk::{Controls, Pose, Walker};
use proptest::prelude::*;

const SIZE: (u32, u32) = (1280, 720);

fn vector(side: f64) -> impl Strategy<Value = DVec3> {
    [-side..side, -side..side, -side..side].prop_map(DVec3::from_array)
}

fn pose() -> impl Strategy<Value = Pose> {
    (vector(10.0), 0.0..std::f64::consts::TAU, -1.4..1.4).prop_map(|(eye, around, height)| {
        let level = DVec3::new(f64::cos(around), f64::sin(around), 0.0);
        Pose {
            eye,
            direction: level * f64::cos(height) + DVec3::Z * f64::sin(height),
            up: DVec3::Z,
        }
    })
}

fn view(pose: &Pose) -> View {
    View::new(pose.eye, pose.direction, pose.up, Some(70.0), None, SIZE).unwrap()
}

/// Where a pose sees a point that lies before it.
fn seen(pose: &Pose, point: DVec3) -> (f64, f64) {
    let (x, y, _) = view(pose).project(point).unwrap();
    (x, y)
}

/// A point that the pose sees at picture coordinates.
fn point(pose: &Pose, x: f64, y: f64, distance: f64) -> DVec3 {
    let (origin, direction) = view(pose).ray(x, y);
    origin + direction * distance
}

fn walker(line: &str) -> Walker {
    let mut spec = ViewSpec::default();
    spec.apply_line(line).unwrap();
    Walker::new(spec, 1.0).unwrap()
}

proptest! {
    #[test]
    fn the_point_that_one_moves_towards_stays_under_the_cursor(
        pose in pose(), x in 0.0..1.0, y in 0.0..1.0, distance in 0.5..50.0, seconds in -1.0..1.0,
    ) {
        let point = point(&pose, x, y, distance);
        let moved = pose.glide(point, seconds, 0.1);
        prop_assert_eq!(moved.direction, pose.direction);
        let (there_x, there_y) = seen(&moved, point);
        prop_assert!((there_x - x).abs() < 1e-6 && (there_y - y).abs() < 1e-6);
    }

    #[test]
    fn the_point_that_one_moves_around_stays_under_the_cursor_and_as_far(
        pose in pose(), x in 0.0..1.0, y in 0.0..1.0, distance in 0.5..50.0,
        right in -3.0..3.0, up in -3.0..3.0,
    ) {
        let point = point(&pose, x, y, distance);
        let moved = pose.orbit(point, right, up);
        let (there_x, there_y) = seen(&moved, point);
        prop_assert!((there_x - x).abs() < 1e-6 && (there_y - y).abs() < 1e-6);
        prop_assert!((moved.eye.distance(point) / distance - 1.0).abs() < 1e-9);
    }

    #[test]
    fn no_turn_looks_along_the_up_vector_and_the_horizon_stays_level(
        pose in pose(), turns in proptest::collection::vec((-7.0..7.0, -7.0..7.0), 1..20),
    ) {
        let turned = turns.iter().fold(pose, |pose, &(right, up)| pose.turn(right, up));
        prop_assert_eq!(turned.eye, pose.eye);
        prop_assert!((turned.direction.length() - 1.0).abs() < 1e-9);
        prop_assert!(turned.direction.cross(turned.up).length() > 0.01);
        prop_assert!(view(&turned).right().dot(DVec3::Z).abs() < 1e-9);
    }

    #[test]
    fn how_far_held_keys_bring_one_does_not_depend_on_the_frames(
        cuts in proptest::collection::vec(0.001..0.2, 1..40),
        ahead in -1.0..1.0, right in -1.0..1.0, rise in -1.0..1.0,
    ) {
        let controls = Controls { ahead, right, rise, ..Controls::default() };
        let mut many = walker("-vp 0 0 0 -vd 1 1 .3 -vu 0 0 1");
        let mut one = many.clone();
        (many.controls, one.controls) = (controls, controls);
        for &seconds in &cuts {
            many.advance(seconds, None, DVec3::X);
        }
        one.advance(cuts.iter().sum(), None, DVec3::X);
        prop_assert!(many.pose().eye.distance(one.pose().eye) < 1e-9);
    }

    #[test]
    fn a_locked_height_stays_whatever_one_does(
        steps in proptest::collection::vec((0_u8..5, -1.0..1.0, vector(5.0)), 1..30),
    ) {
        let mut walker = walker("-vp 1 2 1.6 -vd 1 1 .3 -vu 0 0 1");
        walker.height_is_locked = true;
        for (kind, amount, point) in steps {
            let under = Some(point);
            match kind {
                0 => walker.orbit(amount, amount, under, DVec3::X),
                1 => walker.wheel(amount, under, DVec3::X),
                2 => walker.shift(amount, amount, amount),
                3 => walker.turn(amount, amount),
                _ => {
                    walker.controls = Controls {
                        rise: amount, glide: -amount, over: 1.0, tilt: amount, ..Controls::default()
                    };
                    walker.advance(0.1, under, DVec3::X)
                }
            };
            prop_assert!((walker.pose().eye.z - 1.6).abs() < 1e-9);
        }
    }
}

#[test]
fn a_tenth_of_the_way_is_gone_in_a_tenth_of_a_second_whatever_the_frame_rate() {
    let start = Pose { eye: DVec3::ZERO, direction: DVec3::X, up: DVec3::Z };
    let point = DVec3::new(10.0, 0.0, 0.0);
    for frames in [1, 2, 7, 100] {
        let step = 0.1 / f64::from(frames);
        let end = (0..frames).fold(start, |pose, _| pose.glide(point, step, 0.1));
        assert!((end.eye.x - 1.0).abs() < 1e-9, "{frames} frames: {}", end.eye.x);
        let back = (0..frames).fold(end, |pose, _| pose.glide(point, -step, 0.1));
        assert!(back.eye.x.abs() < 1e-9, "backward is the way back");
    }
}

#[test]
fn gliding_never_passes_the_point() {
    let start = Pose { eye: DVec3::ZERO, direction: DVec3::X, up: DVec3::Z };
    let near = start.glide(DVec3::X, 1e3, 0.1);
    assert!((near.eye.x - 0.9).abs() < 1e-9);
    // If the eye is nearer already, it stays there, and may move away.
    let nearer = Pose { eye: DVec3::X * 0.95, ..start };
    assert_eq!(nearer.glide(DVec3::X, 1.0, 0.1).eye.x, 0.95);
    assert!(nearer.glide(DVec3::X, -1.0, 0.1).eye.x < 0.95);
}

#[test]
fn walking_is_level_at_a_persons_pace_in_metres() {
    // A view that looks down steeply walks as fast as a level one.
    let mut spec = ViewSpec::default();
    spec.apply_line("-vp 0 0 1600 -vd 0 1 -2 -vu 0 0 1").unwrap();
    let mut walker = Walker::new(spec, 0.001).unwrap();
    walker.controls = Controls { ahead: 1.0, ..Controls::default() };
    assert!(walker.advance(1.0, None, DVec3::X));
    assert!(walker.pose().eye.distance(DVec3::new(0.0, 1400.0, 1600.0)) < 1e-6);
    // Diagonal motion is no faster than straight motion.
    walker.controls = Controls { ahead: 1.0, right: 1.0, ..Controls::default() };
    let before = walker.pose().eye;
    walker.advance(1.0, None, DVec3::X);
    assert!((walker.pose().eye.distance(before) - 1400.0).abs() < 1e-6);
}

#[test]
fn right_is_right_and_up_is_up() {
    let ahead = Pose { eye: DVec3::ZERO, direction: DVec3::Y, up: DVec3::Z };
    assert!(ahead.turn(0.1, 0.0).direction.x > 0.0);
    assert!(ahead.turn(0.0, 0.1).direction.z > 0.0);
    assert!(ahead.walk(0.0, 1.0, 0.0).eye.x > 0.0);
}

#[test]
fn the_history_has_the_views_where_one_stayed_and_home_is_where_one_began() {
    let mut walker = walker("-vp 0 0 0 -vd 0 1 0 -vu 0 0 1");
    walker.stay();
    walker.shift(1.0, 0.0, 0.0);
    walker.shift(1.0, 0.0, 0.0);
    walker.stay();
    assert!(walker.go_to(DVec3::new(5.0, 5.0, 0.0)));
    assert!(walker.back());
    assert_eq!(walker.pose().eye, DVec3::Y * 2.0);
    assert!(walker.back());
    assert_eq!(walker.pose().eye, DVec3::ZERO);
    assert!(!walker.back());
    assert!(walker.forward());
    assert_eq!(walker.pose().eye, DVec3::Y * 2.0);
    assert!(walker.go_home());
    assert_eq!(walker.pose().eye, DVec3::ZERO);
}

#[test]
fn a_view_that_is_none_is_refused_and_changes_nothing() {
    let mut walker = walker("-vp 0 0 0 -vd 0 1 0 -vu 0 0 1 -vh 50");
    let before = *walker.view();
    for line in ["-vd 0 0 0", "-vd 0 0 2", "-vu 0 1 0"] {
        let mut change = ViewSpec::default();
        change.apply_line(line).unwrap();
        assert!(!walker.look(&change), "{line}");
        assert_eq!(*walker.view(), before);
    }
    assert!(Walker::new(ViewSpec::default(), 1.0).is_none());
}

#[test]
fn a_motion_that_goes_on_ends_where_it_would() {
    let start = Pose { eye: DVec3::ZERO, direction: DVec3::Y, up: DVec3::Z };
    let half = start.walk(1.0, 0.5, 0.0).turn(0.2, 0.0);
    let end = half.ahead(&start, 1.0);
    assert!((end.eye - 2.0 * half.eye).length() < 1e-12);
    let angle = start.direction.angle_between(end.direction);
    assert!((angle - 0.4).abs() < 1e-6, "{angle}");
    assert_eq!(start.ahead(&start, 5.0), start);
}
