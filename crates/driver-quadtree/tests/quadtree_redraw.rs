//! Drawing only when it is time, and only what has changed.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::*;
use holo_display::{Frame, Quadtree, QuadtreeParams, SelectOptions, select_beams};
use std::time::Duration;

const SIZE: (u32, u32) = (96, 72);
const PIXELS: u64 = (SIZE.0 * SIZE.1) as u64;
const SOON: Duration = Duration::from_millis(1);
const LATE: Duration = Duration::from_millis(33);

fn empty(params: QuadtreeParams) -> Quadtree {
    quadtree(&room_section(8), &room_view(SIZE), SIZE, params, &[])
}

fn bits(frame: &Frame) -> (Vec<[u32; 3]>, Vec<u32>, [u64; 4]) {
    (
        frame.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect(),
        frame.depth.iter().map(|depth| depth.to_bits()).collect(),
        [frame.uncovered_pixels, frame.empty_pixels, frame.unseen_pixels, frame.samples_used],
    )
}

#[test]
fn drawing_waits_for_a_burst_of_samples_or_for_time_and_does_nothing_while_nothing_changes() {
    let stored = near_samples(room, &room_section(8), &room_view(SIZE), 60_000, 4, clean);
    let mut tree = empty(QuadtreeParams::default());
    assert!(tree.redraw(LATE).is_some(), "a new view is drawn");
    assert!(tree.redraw(LATE).is_none() && tree.redraw(Duration::from_secs(10)).is_none());
    insert(&mut tree, &stored[..100]);
    assert!(tree.redraw(SOON).is_none());
    assert!(tree.redraw(LATE).is_some());
    insert(&mut tree, &stored[..49_000]);
    assert!(tree.redraw(SOON).is_none());
    insert(&mut tree, &stored[49_000..51_000]);
    assert!(tree.redraw(SOON).is_some());
    assert!(tree.redraw(SOON).is_none());
    tree.look(room_view(SIZE));
    assert!(tree.redraw(LATE).is_some());
}

/// Samples that pass the eye and, if asked for, those of a batch, which also look from elsewhere.
fn samples(noise: Noise, batch: bool) -> Vec<Stored> {
    let (section, view) = (room_section(8), room_view(SIZE));
    let mut stored = near_samples(room, &section, &view, 40_000, 4, noise);
    if batch {
        stored.extend(batch_samples(room, &section, &view, SIZE, 40_000, 5, noise));
    }
    let mut random = Random(3);
    for last in (1..stored.len()).rev() {
        stored.swap(last, (random.bits() % (last as u64 + 1)) as usize);
    }
    stored
}

#[test]
fn pictures_in_a_burst_are_nearly_as_good_as_those_of_all_samples_and_at_rest_they_are_the_same() {
    let reference = truth(room, &room_view(SIZE), SIZE, 8);
    for (name, noise, batch) in [
        ("clean", clean as Noise, false),
        ("clean, batch", clean, true),
        ("16 paths, batch", some_paths, true),
        ("1 path", one_path, false),
    ] {
        let mut tree = empty(QuadtreeParams::default());
        let (mut worst, mut start) = (0.0_f64, 0);
        let stored = samples(noise, batch);
        // Bursts of a few samples, of as many as a quarter of all so far, and of more.
        // The first picture is a draft.
        insert(&mut tree, &stored[..10]);
        tree.redraw(LATE);
        start += 10;
        for more in [30, 1, 200, 900, 30, 300, 1500, 3000, 700, 5000, 4000, 9000, 14_000, 70] {
            insert(&mut tree, &stored[start..start + more]);
            start += more;
            let burst = tree.redraw(LATE).unwrap().clone();
            let all = tree.draw();
            assert!(
                burst.samples_used <= all.samples_used
                    && 5 * burst.samples_used >= 4 * all.samples_used
            );
            assert_eq!(burst.depth.iter().filter(|&&depth| depth == 0.0).count(), 0);
            let (error, best) =
                (relative_error(&burst, &reference), relative_error(&all, &reference));
            println!("{name}, {more} more: error {error:.5}, with all {best:.5}");
            worst = worst.max(error / best);
        }
        assert!(worst < 1.25, "{name}: {worst:.2} times the error");
        let rest = tree.redraw(LATE).map(bits).unwrap();
        assert!(rest == bits(&tree.draw()), "{name}");
        assert!(tree.redraw(LATE).is_none());
    }
}

#[test]
fn what_a_burst_brought_is_counted_as_in_a_whole_picture() {
    let mut tree = empty(QuadtreeParams::default());
    let stored = samples(clean, true);
    tree.redraw(LATE);
    for (number, some) in stored.chunks(997).take(12).enumerate() {
        insert(&mut tree, some);
        let burst = tree
            .redraw(LATE)
            .map(|frame| (frame.empty_pixels, frame.uncovered_pixels, frame.samples_used));
        let (empty, uncovered, used) = burst.unwrap();
        let all = tree.draw();
        // A pixel's first sample is always shown.
        assert_eq!((empty, uncovered), (all.empty_pixels, all.uncovered_pixels), "burst {number}");
        assert!(used > 0 && empty < PIXELS);
    }
}

#[test]
fn beams_that_see_nothing_are_shown_at_once() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let sky = [0.25, 0.5, 1.0];
    let mut tree = empty(QuadtreeParams { sky, ..QuadtreeParams::default() });
    insert(&mut tree, &near_samples(room, &section, &view, 5000, 4, clean));
    tree.redraw(LATE);
    let selection =
        select_beams(std::slice::from_ref(&section), &view, SIZE, &SelectOptions::default());
    for wanted in selection.beams.iter().step_by(3) {
        tree.insert_unseen(0, wanted.beam);
        let burst = tree.redraw(LATE).unwrap();
        let shown = burst.picture.pixels.iter().filter(|pixel| **pixel == sky).count() as u64;
        assert_eq!(shown, burst.unseen_pixels);
        let unseen = burst.unseen_pixels;
        assert_eq!(unseen, tree.draw().unseen_pixels);
    }
    assert!(tree.draw().unseen_pixels > PIXELS / 8);
}

#[test]
fn bursts_that_follow_each_other_draw_some_thousand_pixels_each_until_there_is_time_for_all() {
    let size = (280, 210);
    let (section, view) = (room_section(8), room_view(size));
    let reference = truth(room, &view, size, 8);
    let mut tree = quadtree(&section, &view, size, QuadtreeParams::default(), &[]);
    insert(&mut tree, &near_samples(room, &section, &view, 5000, 1, some_paths));
    assert!(tree.redraw(LATE).is_some(), "a draft");
    let mut last = tree.redraw(LATE).unwrap().clone();
    let mut errors = vec![relative_error(&last, &reference)];
    for seed in 2..42 {
        insert(&mut tree, &near_samples(room, &section, &view, 50_100, seed, some_paths));
        let burst = tree.redraw(Duration::ZERO).unwrap().clone();
        let pairs = burst.picture.pixels.iter().zip(&last.picture.pixels);
        let changed = pairs.filter(|(now, before)| now != before).count();
        assert!(changed > 0 && changed < 9000, "{changed} pixels");
        errors.push(relative_error(&burst, &reference));
        last = burst;
    }
    let all = relative_error(&tree.draw(), &reference);
    println!("errors {errors:.4?}, with all {all:.5}");
    // Each pixel has had its turn twice, the last time with half of the samples or more.
    let reached = errors[errors.len() - 1];
    assert!(reached < 0.2 * errors[0] && reached < 2.0 * all, "{errors:?} {all}");
    insert(&mut tree, &near_samples(room, &section, &view, 100, 99, some_paths));
    let late = tree.redraw(LATE).unwrap().clone();
    let error = relative_error(&late, &reference);
    assert!(error < 1.25 * all, "{error} {all}");
    // Nearly all pixels have grown since they were drawn: the whole picture is drawn at once, and none is needed at rest.
    assert!(bits(&late) == bits(&tree.draw()));
    assert!(tree.redraw(LATE).is_none());
}
