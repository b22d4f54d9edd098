//! The eye is in a room, and there are samples of the room behind its wall.

#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::*;
use glam::DVec3;
use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_section::{Section, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (160, 120);
const PIXELS: f64 = (SIZE.0 * SIZE.1) as f64;
const BROWN: [f32; 3] = [0.2, 0.1, 0.05];

/// A thin wall between two rooms. It is brown towards the eye's room and white towards the other,
/// whose far wall is green.
fn rooms(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let (from_left, to_right) = (origin.x < 4.0, direction.x > 0.0);
    let (colour, wall) = match (from_left, to_right) {
        (true, true) => (BROWN, 4.0),
        (false, false) => ([1.0; 3], 4.0),
        (false, true) => ([0.02, 0.6, 0.1], 8.0),
        (true, false) => ([0.0; 3], 0.0),
    };
    (colour, (wall - origin.x) / direction.x)
}

/// The section of the eye's room and that of the other.
fn sections() -> [Section; 2] {
    let section =
        |x: f64| section([x, 0.0, 0.0], [3.0, 4.0, 4.0], [8; 3], ViewClass::Interior, true);
    [section(0.5), section(4.5)]
}

/// Returns the share of pixels that do not show the brown wall. `own` and `other` are samples for
/// each pixel from the eye's room and from the other. Rays of the other room come towards the eye,
/// or go on where the eye's rays end.
fn wrong(own: f64, other: f64, is_towards_eye: bool) -> f64 {
    let [room, behind] = sections();
    let seen = view([1.0, 2.0, 2.0], [4.0, 2.0, 2.0], 60.0, SIZE);
    let mut random = Random(9);
    let mut tree = Quadtree::new(
        Arc::from([room.clone(), behind.clone()]),
        seen,
        SIZE,
        QuadtreeParams::default(),
    );
    for (beam, sample) in near_samples(rooms, &room, &seen, (PIXELS * own) as usize, 3, clean) {
        tree.insert(key(0, beam), 1, &[sample]);
    }
    for _ in 0..(PIXELS * other) as usize {
        let (eye, along) = seen.ray(random.unit(), random.unit());
        let hit = if is_towards_eye {
            behind.line(eye + 50.0 * along, -along)
        } else {
            behind.line(eye, along)
        };
        if let Some(hit) = hit {
            let (beam, sample) =
                traced(rooms, &behind, behind.beam(hit.pair), hit.coords, &mut random, clean);
            tree.insert(key(1, beam), 1, &[sample]);
        }
    }
    let is_wrong =
        |pixel: &&[f32; 3]| (0..3).any(|channel| (pixel[channel] - BROWN[channel]).abs() > 0.03);
    tree.draw().picture.pixels.iter().filter(is_wrong).count() as f64 / PIXELS
}

#[test]
fn the_other_side_of_a_thin_wall_is_not_shown() {
    for (own, other) in [(0.1, 1.0), (1.0, 1.0), (1.0, 8.0)] {
        let wrong = wrong(own, other, true);
        println!("{own} and {other} samples a pixel: {wrong:.4} wrong");
        assert_eq!(wrong, 0.0, "{own}, {other}");
    }
}

#[test]
fn what_rays_see_that_begin_behind_a_wall_is_not_shown_before_it_however_many_they_are() {
    for (own, other) in [(0.5, 0.1), (0.5, 2.0), (1.0, 8.0)] {
        let wrong = wrong(own, other, false);
        println!("{own} and {other} samples a pixel: {wrong:.4} wrong");
        assert!(wrong < 0.02, "{own}, {other}: {wrong}");
    }
}
