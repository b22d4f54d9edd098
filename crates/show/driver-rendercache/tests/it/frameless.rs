//! The frameless driver: each pixel once a round, newest view first, box filter at rest.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::scenes::view;
use glam::DVec3;
use holo_driver_rendercache::frameless::Frameless;
use std::collections::HashSet;

#[test]
fn every_pixel_is_asked_for_once_a_round_in_another_order() {
    for size in [(1, 1), (2, 1), (7, 5), (64, 64), (130, 67)] {
        let mut frameless = Frameless::new(size, view(DVec3::ZERO, 0.0, size), 3).unwrap();
        let pixels = (size.0 * size.1) as usize;
        // The ray gives the pixel, because the tag is opaque.
        let pixel_of = |direction: DVec3, size: (u32, u32)| {
            let (x, y) = view(DVec3::ZERO, 0.0, size).project_direction(direction).unwrap();
            holo_picture::View::pixel_at(size, x, y).unwrap()
        };
        let mut rounds = Vec::new();
        for _ in 0..2 {
            let round: Vec<_> = frameless
                .requests(pixels)
                .map(|(_, _, direction)| pixel_of(direction, size))
                .collect();
            assert_eq!(round.iter().collect::<HashSet<_>>().len(), pixels, "{size:?}");
            rounds.push(round);
        }
        // Two random orders of n pixels agree in one place on average.
        let same = rounds[0].iter().zip(&rounds[1]).filter(|(a, b)| a == b).count();
        assert!(
            pixels < 30 || same < 10,
            "{size:?}: {same} pixels come at the same time in both rounds"
        );
    }
}

#[test]
fn a_pixel_shows_the_newest_view_and_then_its_mean() {
    let size = (4, 4);
    let mut frameless = Frameless::new(size, view(DVec3::ZERO, 0.0, size), 1).unwrap();
    let old: Vec<_> = frameless.requests(16).map(|request| request.0).collect();
    frameless.look(view(DVec3::ZERO, 10.0, size));
    let new: Vec<_> = frameless.requests(16).map(|request| request.0).collect();
    let again: Vec<_> = frameless.requests(16).map(|request| request.0).collect();
    new.iter().for_each(|&tag| frameless.insert(tag, [1.0, 2.0, 3.0]));
    // Late, and then damaged: nothing changes.
    old.iter().for_each(|&tag| frameless.insert(tag, [9.0; 3]));
    again.iter().for_each(|&tag| frameless.insert(tag, [f32::NAN, 0.0, 0.0]));
    assert!(frameless.picture().pixels.iter().all(|&pixel| pixel == [1.0, 2.0, 3.0]));
    again.iter().for_each(|&tag| frameless.insert(tag, [2.0, 2.0, 1.0]));
    assert!(frameless.picture().pixels.iter().all(|&pixel| pixel == [1.5, 2.0, 2.0]));
}

#[test]
fn a_guess_is_shown_until_the_first_ray_comes_and_counts_for_nothing() {
    let size = (4, 3);
    let mut frameless = Frameless::new(size, view(DVec3::ZERO, 0.0, size), 3).unwrap();
    assert_eq!(frameless.has_colour().filter(|&has| has).count(), 0);
    let tag = frameless.pixel_tag(2, 1).unwrap();
    assert_eq!(frameless.pixel_tag(4, 0), None);
    let shown = |frameless: &Frameless| frameless.picture().get(2, 1).unwrap();
    frameless.guess(tag, [f32::NAN; 3]);
    assert_eq!(shown(&frameless), [0.0; 3]);
    frameless.guess(tag, [5.0; 3]);
    assert_eq!(shown(&frameless), [5.0; 3]);
    frameless.insert(tag, [1.0; 3]);
    frameless.insert(tag, [3.0; 3]);
    frameless.guess(tag, [9.0; 3]);
    assert_eq!(shown(&frameless), [2.0; 3]);
    assert_eq!(frameless.has_colour().filter(|&has| has).count(), 1);
    // Another view: what is shown may be guessed anew, after which rays of the old one are too
    // late.
    frameless.look(view(DVec3::ZERO, 10.0, size));
    frameless.guess(frameless.pixel_tag(2, 1).unwrap(), [4.0; 3]);
    frameless.insert(tag, [7.0; 3]);
    assert_eq!(shown(&frameless), [4.0; 3]);
}
