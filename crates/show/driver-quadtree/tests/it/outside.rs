//! The eye is between two sections: objects stand before the section that it looks into.

#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::*;
use glam::DVec3;
use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_section::{Section, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (160, 120);

/// A bright post one unit ahead of the eye, before a dark wall beyond the section that is looked
/// into.
fn post(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let to_post = (1.0 - origin.x) / direction.x;
    if to_post > 0.0 && (origin.y + direction.y * to_post).abs() < 0.2 {
        return ([1.0, 0.8, 0.1], to_post);
    }
    let to_wall = (8.0 - origin.x) / direction.x;
    if to_wall > 0.0 { ([0.05, 0.1, 0.2], to_wall) } else { ([0.0; 3], f64::INFINITY) }
}

/// The section behind the eye, whose rays see the post, and the one beyond the post.
fn sections() -> [Section; 2] {
    let section =
        |x: f64| section([x, -2.0, -2.0], [2.0, 4.0, 4.0], [8; 3], ViewClass::Interior, true);
    [section(-2.5), section(2.0)]
}

#[test]
fn what_stands_before_a_section_hides_what_its_rays_see_however_many_they_are() {
    let [behind, ahead] = sections();
    let seen = view([0.0; 3], [1.0, 0.0, 0.0], 60.0, SIZE);
    let before = view([-1.0, 0.3, 0.1], [1.0, 0.0, 0.0], 60.0, SIZE);
    let reference = truth(post, &seen, SIZE, 4);
    let pixels = f64::from(SIZE.0 * SIZE.1);
    for (few, many) in [(0.2, 0.5), (0.2, 4.0), (1.0, 8.0)] {
        let sections = Arc::from([behind.clone(), ahead.clone()]);
        let mut tree = Quadtree::new(sections, seen, SIZE, QuadtreeParams::default());
        for (number, section, from, density) in
            [(0, &behind, &before, few), (1, &ahead, &seen, many)]
        {
            for (beam, sample) in
                near_samples(post, section, from, (pixels * density) as usize, 5, clean)
            {
                tree.insert(key(number, beam), 1, &[sample]);
            }
        }
        let frame = tree.draw();
        // Pixels nine or more from the post's edges show one surface only.
        let is_bright = |pixel: &[f32; 3]| pixel[0] > 0.5;
        let (mut wrong, mut looked_at) = ([0, 0], [0, 0]);
        for (row, column) in
            (0..SIZE.1).flat_map(|row| (8..SIZE.0 - 8).map(move |column| (row, column)))
        {
            let at = |column: u32| (row * SIZE.0 + column) as usize;
            let here = is_bright(&reference[at(column)]);
            if (column - 8..=column + 8).any(|column| is_bright(&reference[at(column)]) != here) {
                continue;
            }
            looked_at[usize::from(here)] += 1;
            wrong[usize::from(here)] +=
                u32::from(is_bright(&frame.picture.pixels[at(column)]) != here);
        }
        println!("{few} and {many} samples a pixel: wrong {wrong:?} of {looked_at:?}");
        assert!(looked_at.iter().all(|&count| count > 2000));
        for (wrong, looked_at) in wrong.into_iter().zip(looked_at) {
            assert!(
                f64::from(wrong) < 0.03 * f64::from(looked_at),
                "{few}, {many}: {wrong} of {looked_at}"
            );
        }
    }
}
