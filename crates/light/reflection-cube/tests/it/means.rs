//! What a texel makes of its samples.

use crate::{Numbers, fill, light, sample};
use glam::Vec3;
use holo_reflection_cube::{CubeAnswer, ReflectionCube, ReflectionSample};

#[test]
fn a_texel_has_the_mean_of_its_samples_by_their_paths() {
    let mut cube = ReflectionCube::new(Vec3::ONE, 16);
    let direction = cube.grid().direction_of(77);
    let (mut sum, mut paths) = (0.0, 0.0);
    let mut numbers = Numbers(3);
    for _ in 0..1000 {
        let (value, count) = (numbers.uniform(), 1 + (4.0 * numbers.uniform()) as u16);
        cube.insert(&ReflectionSample { count, ..sample(&cube, direction, 2.0, value) });
        sum += f32::from(count) * value;
        paths += f32::from(count);
    }
    let known = cube.light_of(77).expect("valid");
    assert!((known.radiance[0] - sum / paths).abs() < 1e-4);
    assert!((known.radiance[2] - 3.0 * sum / paths).abs() < 3e-4);
    assert!((known.distance - 2.0).abs() < 1e-4);
    assert_eq!(f32::from(known.count), paths);
    assert_eq!(cube.statistics().valid, 1);
}

#[test]
fn a_texel_that_counts_no_further_keeps_the_expectation() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 8);
    let direction = cube.grid().direction_of(0);
    let mut numbers = Numbers(4);
    for _ in 0..40_000 {
        let value = 2.0 * numbers.uniform();
        cube.insert(&ReflectionSample { count: 50, ..sample(&cube, direction, 1.0, value) });
    }
    assert_eq!(cube.light_of(0).expect("valid").count, u16::MAX);
    // About 1300 samples count: the standard error is 0.016 / √2.
    let mean = cube.light_of(0).expect("valid").radiance[0];
    assert!((mean - 1.0).abs() < 0.06, "{mean}");
}

#[test]
fn the_order_of_samples_changes_nothing_but_rounding() {
    let cubes = [false, true].map(|is_reversed| {
        let mut cube = ReflectionCube::new(Vec3::ZERO, 8);
        let mut order: Vec<u64> = (0..20_000).collect();
        if is_reversed {
            order.reverse();
        }
        for number in order {
            let mut numbers = Numbers(number.wrapping_mul(0x9E37_79B9_7F4A_7C15));
            numbers.uniform();
            let direction = numbers.direction();
            cube.insert(&sample(&cube, direction, 1.0 + numbers.uniform(), numbers.uniform()));
        }
        cube
    });
    let [one, other] = cubes;
    for texel in 0..one.grid().len() {
        let (one, other) = (one.light_of(texel), other.light_of(texel));
        let (one, other) = (one.expect("valid"), other.expect("valid"));
        assert!((one.radiance[0] - other.radiance[0]).abs() < 1e-5);
        assert!((one.distance - other.distance).abs() < 1e-4);
    }
}

#[test]
fn a_later_generation_replaces_an_earlier_one_and_never_the_reverse() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 8);
    let of = |value, generation| ReflectionSample {
        generation,
        ..sample(&ReflectionCube::new(Vec3::ZERO, 8), Vec3::X, 1.0, value)
    };
    let texel = cube.grid().texel_of(Vec3::X);
    let value = |cube: &ReflectionCube| cube.light_of(texel).expect("valid").radiance[0];
    (0..10).for_each(|_| assert!(cube.insert(&of(1.0, 3))));
    cube.insert(&of(5.0, 2));
    assert_eq!(value(&cube), 1.0);
    cube.insert(&of(7.0, 4));
    assert_eq!((value(&cube), cube.light_of(texel).expect("valid").count), (7.0, 1));
}

#[test]
fn samples_that_are_no_light_are_refused_and_change_nothing() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 8);
    let good = sample(&cube, Vec3::X, 1.0, 1.0);
    let bad = [
        ReflectionSample { radiance: [f32::NAN, 0.0, 0.0], ..good },
        ReflectionSample { radiance: [0.0, f32::INFINITY, 0.0], ..good },
        ReflectionSample { radiance: [0.0, 0.0, -1.0], ..good },
        ReflectionSample { distance: f32::NAN, ..good },
        ReflectionSample { distance: -1.0, ..good },
        ReflectionSample { distance: 0.0, ..good },
        ReflectionSample { direction: Vec3::ZERO, ..good },
        ReflectionSample { direction: Vec3::splat(f32::NAN), distance: f32::INFINITY, ..good },
        ReflectionSample { count: 0, ..good },
    ];
    assert!(bad.iter().all(|sample| !cube.insert(sample)));
    assert_eq!(cube.statistics().valid, 0);
    assert!(cube.insert(&good));
    cube.refresh_levels();
    for direction in [Vec3::ZERO, Vec3::splat(f32::NAN), Vec3::splat(f32::INFINITY)] {
        // Such rays have no answer that means anything, but one comes.
        _ = cube.look_up(Vec3::ONE, direction, 0.0..=1.0);
        _ = cube.look_up(direction, Vec3::X, 0.0..=1.0);
    }
}

#[test]
fn rays_that_may_hit_the_object_itself_are_always_traced() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 8);
    fill(&mut cube, |_| (2.0, 1.0));
    cube.mark_self_hit(Vec3::X);
    let answer = |cube: &ReflectionCube, direction| cube.look_up(Vec3::ZERO, direction, 0.0..=1.0);
    assert_eq!(answer(&cube, Vec3::X), CubeAnswer::MustTrace);
    assert_eq!(light(answer(&cube, Vec3::Y)).radiance[0], 1.0);
    assert_eq!(answer(&cube.resized(32), Vec3::X), CubeAnswer::MustTrace);
    let statistics = cube.statistics();
    assert_eq!((statistics.marked, statistics.valid, statistics.texels), (1, 384, 384));
}

#[test]
fn a_cube_of_another_resolution_has_the_same_light() {
    let mut cube = ReflectionCube::new(Vec3::ONE, 32);
    fill(&mut cube, |d| (3.0 + d.x, 1.0 + 0.5 * d.y));
    for resolution in [8, 16, 32, 64, 128] {
        let other = cube.resized(resolution);
        assert_eq!(other.statistics().valid, other.grid().len());
        let mut numbers = Numbers(5);
        for _ in 0..1000 {
            let direction = numbers.direction();
            let of = |cube: &ReflectionCube| light(cube.look_up(Vec3::ONE, direction, 0.0..=0.0));
            let coarse = 1.5 / resolution.min(32) as f32;
            assert!((of(&cube).radiance[0] - of(&other).radiance[0]).abs() < coarse);
        }
    }
    let count = |cube: &ReflectionCube, texel| cube.light_of(texel).expect("valid").count;
    let finer = cube.resized(64);
    assert!((0..finer.grid().len()).all(|texel| count(&finer, texel) == 1));
    let coarser = cube.resized(16);
    assert!((0..coarser.grid().len()).all(|texel| count(&coarser, texel) == 4));
}
