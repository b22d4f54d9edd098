//! What leaves a cube when the scene changes.

use crate::{fill, sample};
use glam::Vec3;
use holo_reflection_cube::{ReflectionCube, ReflectionSample};

const CENTRE: Vec3 = Vec3::new(1.0, 2.0, 3.0);

/// A cube in the middle of a hollow ball of radius 5, with sky above.
fn cube() -> ReflectionCube {
    let mut cube = ReflectionCube::new(CENTRE, 64);
    fill(&mut cube, |direction| (if direction.y > 0.8 { f32::INFINITY } else { 5.0 }, 1.0));
    cube
}

/// The least angle between a direction and a box seen from the centre, sampled on the box.
fn angle_to_box(direction: Vec3, least: Vec3, most: Vec3) -> f32 {
    let mut angle = f32::INFINITY;
    for number in 0..1000 {
        let share = Vec3::new(
            (number % 10) as f32 / 9.0,
            (number / 10 % 10) as f32 / 9.0,
            (number / 100) as f32 / 9.0,
        );
        let point = least + share * (most - least) - CENTRE;
        angle = angle.min(direction.angle_between(point));
    }
    angle
}

#[test]
fn an_edit_flushes_what_lies_there_and_behind_and_nothing_else() {
    let mut cube = cube();
    let (least, most) = (CENTRE + Vec3::new(2.0, -1.0, 0.0), CENTRE + Vec3::new(2.5, 0.0, 1.0));
    let flushed = cube.flush((least, most), 0.0, 1);
    let texel = 2.0 / 64.0;
    let mut inside = 0;
    for number in 0..cube.len() {
        let angle = angle_to_box(cube.direction_of(number), least, most);
        let is_valid = cube.light_of(number).is_some();
        // The box's points lie 0.06 apart, seen from the centre.
        if angle < 0.02 {
            assert!(!is_valid, "{angle}");
            inside += 1;
        }
        assert!(angle < 3.0 * texel || is_valid, "{angle}");
    }
    assert!(inside > 100 && flushed >= inside);
    assert_eq!(cube.statistics().valid, cube.len() - flushed);
}

#[test]
fn an_edit_behind_what_is_seen_flushes_nothing() {
    let mut cube = cube();
    let below = CENTRE + Vec3::new(0.0, -7.0, 0.0);
    assert_eq!(cube.flush((below - 1.0, below + 1.0), 0.0, 1), 0);
    // The sky has nothing before it.
    let above = CENTRE + Vec3::new(0.0, 70.0, 0.0);
    let flushed = cube.flush((above - 5.0, above + 5.0), 0.0, 1);
    // The box covers about (10 / 65)² steradians of it.
    let least = 64 * 64 * 100 / (65 * 65) / 4;
    assert!(flushed >= least && flushed < 3 * least, "{flushed} {least}");
}

#[test]
fn slack_flushes_what_rays_from_the_surface_may_see() {
    let corner = CENTRE + Vec3::new(3.0, -0.1, -0.1);
    let changed = (corner, corner + Vec3::new(0.2, 0.2, 0.2));
    let flushed = [0.0, 0.5, 1.0].map(|slack| cube().flush(changed, slack, 1));
    assert!(0 < flushed[0] && flushed[0] < flushed[1] && flushed[1] < flushed[2]);
    // With a slack of 3.5, the box contains the centre.
    assert_eq!(cube().flush(changed, 3.5, 1), cube().len());
}

#[test]
fn flushed_texels_take_no_sample_from_before_the_edit() {
    let mut cube = cube();
    let point = CENTRE + Vec3::X * 5.0;
    assert!(cube.flush((point - 0.1, point + 0.1), 0.0, 2) > 0);
    let texel = cube.texel_of(Vec3::X);
    let late = sample(&cube, Vec3::X, 5.0, 9.0);
    cube.insert(&ReflectionSample { generation: 1, ..late });
    assert_eq!(cube.light_of(texel), None);
    assert_eq!(cube.resized(32).light_of(cube.resized(32).texel_of(Vec3::X)), None);
    cube.insert(&ReflectionSample { generation: 2, ..late });
    assert_eq!(cube.light_of(texel).expect("valid").radiance[0], 9.0);
}
