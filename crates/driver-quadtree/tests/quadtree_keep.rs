//! Samples kept across views.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::*;
use glam::DVec3;
use holo_display::REFETCH_DEGREES;
use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_picture::View;
use std::sync::Arc;

const SIZE: (u32, u32) = (96, 72);

fn turned(degrees: f64) -> View {
    let view = room_view(SIZE);
    let (sin, cos) = degrees.to_radians().sin_cos();
    let along =
        DVec3::new(view.vd.x * cos - view.vd.y * sin, view.vd.x * sin + view.vd.y * cos, view.vd.z);
    View::new(view.vp + DVec3::new(0.1, -0.05, 0.0), along, DVec3::Z, Some(60.0), None, SIZE)
        .unwrap()
}

fn driver(keep: usize, stored: &[Stored]) -> Quadtree {
    let params = QuadtreeParams { keep, ..QuadtreeParams::default() };
    quadtree(&room_section(8), &room_view(SIZE), SIZE, params, stored)
}

#[test]
fn a_look_a_little_aside_shows_what_a_new_driver_with_the_same_samples_would() {
    let section = room_section(8);
    let stored = batch_samples(room, &section, &room_view(SIZE), SIZE, 20_000, 4, some_paths);
    let mut kept = driver(1_000_000, &stored);
    for degrees in [3.0, 9.0, 17.0] {
        assert!(kept.look(turned(degrees)));
        let mut anew = Quadtree::new(
            Arc::from([section.clone()]),
            turned(degrees),
            SIZE,
            QuadtreeParams::default(),
        );
        insert(&mut anew, &stored);
        let (kept, anew) = (kept.draw(), anew.draw());
        assert_eq!(kept.picture.pixels, anew.picture.pixels);
        assert!(kept.samples_used > 1000);
    }
}

#[test]
fn a_look_far_aside_forgets_all() {
    let stored = near_samples(room, &room_section(8), &room_view(SIZE), 5000, 4, clean);
    let mut kept = driver(1_000_000, &stored);
    assert!(!kept.look(turned(REFETCH_DEGREES + 1.0)));
    assert_eq!(kept.draw().samples_used, 0);
    // And for good: looking back does not bring them back.
    assert!(!kept.look(turned(0.0)));
    assert_eq!(kept.draw().samples_used, 0);
}

#[test]
fn no_more_samples_are_kept_than_asked_for_and_the_newest_stay() {
    let stored = near_samples(room, &room_section(8), &room_view(SIZE), 5000, 4, clean);
    let mut kept = driver(1000, &stored);
    assert!(kept.look(room_view(SIZE)));
    let used = kept.draw().samples_used;
    assert!((400..=1000).contains(&used), "{used}");
    let newest = driver(0, &stored[stored.len() - used as usize..]);
    assert_eq!(kept.draw().picture.pixels, newest.draw().picture.pixels);
    let mut none = driver(0, &stored);
    assert!(!none.look(room_view(SIZE)));
    assert_eq!(none.draw().samples_used, 0);
}

/// The ball before its wall: few samples of a batch pass the eye, so that some see past its edge.
#[test]
fn samples_of_several_depths_are_counted_by_how_they_are_resolved() {
    let (section, view) = (room_section(4), room_view(SIZE));
    let count = |stored: &[Stored]| {
        let (frame, depths) =
            quadtree(&section, &view, SIZE, QuadtreeParams::default(), stored).draw_and_count();
        println!("{depths:?} of {} pixels", SIZE.0 * SIZE.1);
        (frame, depths)
    };
    let batch = batch_samples(room, &section, &view, SIZE, 30_000, 4, clean);
    let (_, few) = count(&batch);
    assert!(few.remaining + few.by_leaves + few.by_near_samples > 0);
    // Samples through the eye resolve what they are added to, and leave no pixel that has both open.
    let both: Vec<Stored> =
        batch.into_iter().chain(near_samples(room, &section, &view, 200_000, 5, clean)).collect();
    let (_, many) = count(&both);
    assert!(many.by_near_samples > few.by_near_samples);
    assert!(many.remaining * 20 <= few.remaining, "{many:?} after {few:?}");
}
