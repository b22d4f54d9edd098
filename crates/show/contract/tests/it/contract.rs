//! What every driver must do. A wrapper that forwards too little fails here.

use holo_contract::{RoomSample, SUBJECTS, Subject, SubjectViewer, TestRoom};
use holo_display::Frame;

/// More pixels than a view whose first picture is its best.
const SIZE: (u32, u32) = (400, 300);
const VIEW: &str = "-vp 2.6 1.2 1.5 -vd 0.1 1 -0.15 -vu 0 0 1 -vh 75";
const BESIDE: &str = "-vp 2.8 1.3 1.5 -vd 0.2 1 -0.15 -vu 0 0 1 -vh 75";

fn bits(frame: &Frame) -> Vec<[u32; 3]> {
    frame.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn mean(frame: &Frame) -> f64 {
    let sum: f64 = frame.picture.pixels.iter().map(|pixel| f64::from(pixel[1])).sum();
    sum / frame.picture.pixels.len() as f64
}

/// Returns a viewer of the room's view with these samples.
fn viewer(room: &TestRoom, subject: &Subject, samples: &[RoomSample]) -> SubjectViewer {
    let mut viewer = subject.make(room);
    viewer.look(&room.view(VIEW, SIZE), SIZE, false);
    viewer.insert(samples);
    viewer
}

fn samples(room: &TestRoom, seed: u64) -> Vec<RoomSample> {
    let mut samples = room.samples_of_view(&room.view(VIEW, SIZE), 40_000, seed);
    samples.extend(room.samples(10_000, seed));
    samples
}

#[test]
fn an_interrupt_ends_a_frame_at_rest_but_no_first_one_and_none_for_a_file() {
    let room = TestRoom::new();
    for subject in &SUBJECTS {
        let mut viewer = viewer(&room, subject, &samples(&room, 1));
        viewer.interrupt().set();
        assert!(viewer.draw().is_some(), "{}: the first frame", subject.name);
        viewer.settle();
        let at_rest = viewer.draw();
        assert_eq!(at_rest.is_none(), subject.ends_early, "{}: at rest", subject.name);
        // Fails if it is interrupted.
        viewer.draw_for_file();
        viewer.interrupt().clear();
        assert!(viewer.draw().is_some(), "{}: without interrupt", subject.name);
    }
}

#[test]
fn earlier_light_is_shown_and_fades() {
    let room = TestRoom::new();
    let (present, before) = (samples(&room, 1), samples(&room, 2));
    let (few, bright) = (&present[..2000], room.brighter(&before, 8.0));
    for subject in &SUBJECTS {
        let drawn = |viewer: &mut SubjectViewer| {
            viewer.settle();
            viewer.draw_for_file()
        };
        let without = drawn(&mut viewer(&room, subject, few));
        let mut edited = viewer(&room, subject, few);
        edited.insert_earlier(&bright);
        let with_earlier = drawn(&mut edited);
        assert!(mean(&with_earlier) > 1.2 * mean(&without), "{}: it is shown", subject.name);
        assert_eq!(edited.remove_earlier(&bright), subject.forgets_earlier, "{}", subject.name);
        if subject.forgets_earlier {
            assert!(bits(&drawn(&mut edited)) == bits(&without), "{}: it fades", subject.name);
        }
    }
}

#[test]
fn the_order_of_samples_changes_no_bit() {
    let room = TestRoom::new();
    let samples = samples(&room, 3);
    let backwards: Vec<RoomSample> = samples.iter().rev().copied().collect();
    for subject in SUBJECTS.iter().filter(|subject| subject.ignores_order) {
        let drawn = |samples: &[RoomSample], pause: bool| {
            let (early, late) = samples.split_at(samples.len() / 3);
            let mut viewer = viewer(&room, subject, early);
            if pause {
                viewer.draw().unwrap();
            }
            viewer.insert(late);
            viewer.settle();
            bits(&viewer.draw_for_file())
        };
        let once = drawn(&samples, false);
        assert!(once == drawn(&backwards, false), "{}: backwards", subject.name);
        assert!(once == drawn(&samples, true), "{}: with a frame between", subject.name);
    }
}

#[test]
fn the_same_calls_draw_the_same_bits() {
    let room = TestRoom::new();
    let (samples, beside) = (samples(&room, 4), room.view(BESIDE, SIZE));
    for subject in &SUBJECTS {
        let drawn = || {
            let mut viewer = viewer(&room, subject, &samples);
            let first = bits(&viewer.draw().unwrap());
            viewer.look(&beside, SIZE, true);
            (first, bits(&viewer.draw().unwrap()))
        };
        assert!(drawn() == drawn(), "{}", subject.name);
    }
}

#[test]
fn a_driver_without_a_scene_works() {
    let room = TestRoom::new();
    let samples = samples(&room, 5);
    for subject in SUBJECTS.iter().filter(|subject| subject.needs_no_scene) {
        let mut viewer = viewer(&room, subject, &samples);
        let frame = viewer.draw().unwrap();
        let lit = frame.picture.pixels.iter().filter(|pixel| pixel[1] > 0.0).count();
        assert!(4 * lit > frame.depth.len(), "{}: {lit} pixels", subject.name);
        let depths = viewer.depths();
        assert!(depths.iter().any(|depth| *depth > 0.0), "{}", subject.name);
        let with_depth = frame.depth.iter().filter(|depth| **depth > 0.0).count();
        assert!(4 * with_depth > frame.depth.len(), "{}: {with_depth} pixels", subject.name);
    }
}

#[test]
fn nothing_is_known_before_the_first_view() {
    let room = TestRoom::new();
    for subject in &SUBJECTS {
        let mut unused = subject.make(&room);
        unused.insert(&room.samples(100, 6));
        assert!(unused.draw().is_none(), "{}", subject.name);
        assert!(unused.depths().is_empty() && unused.uncovered().is_empty(), "{}", subject.name);
    }
}

#[test]
fn a_moving_eye_wants_no_live_rays() {
    let room = TestRoom::new();
    let past = room.view("-vp 2.6 0.1 2.85 -vd 0.2 1 -0.5 -vu 0 0 1 -vh 80", SIZE);
    let mut wanting = 0;
    for subject in &SUBJECTS {
        let mut viewer = subject.make(&room);
        viewer.look(&past, SIZE, false);
        wanting += usize::from(!viewer.uncovered().is_empty());
        viewer.look(&past, SIZE, true);
        assert!(viewer.uncovered().is_empty(), "{}", subject.name);
    }
    assert!(wanting >= 5, "{wanting} drivers want live rays at rest");
}

#[test]
fn a_driver_with_room_shows_samples_of_one_view_in_the_next() {
    let room = TestRoom::new();
    let beside = room.view(BESIDE, SIZE);
    for subject in &SUBJECTS {
        let mut viewer = viewer(&room, subject, &samples(&room, 8));
        if viewer.room() == 0 {
            continue;
        }
        viewer.look(&beside, SIZE, false);
        viewer.settle();
        let frame = viewer.draw().unwrap();
        assert!(frame.samples_used > 10_000, "{}: {}", subject.name, frame.samples_used);
    }
}

#[test]
fn several_views_of_one_light_show_what_each_would_alone() {
    let room = TestRoom::new();
    let (here, beside) = (room.view(VIEW, SIZE), room.view(BESIDE, SIZE));
    let samples = samples(&room, 9);
    for subject in &SUBJECTS {
        let mut left = subject.make(&room);
        let mut right = left.beside();
        left.look(&here, SIZE, false);
        right.look(&beside, SIZE, false);
        left.insert(&samples);
        let mut alone = subject.make(&room);
        alone.look(&beside, SIZE, false);
        alone.insert(&samples);
        let drawn = [&mut left, &mut right, &mut alone].map(|viewer| {
            viewer.settle();
            bits(&viewer.draw_for_file())
        });
        assert!(drawn[1] == drawn[2], "{}: as alone", subject.name);
        assert!(drawn[0] != drawn[1], "{}: different views", subject.name);
        // A view that has gone leaves the others as they are.
        drop(left);
        right.insert(&samples[..100]);
        alone.insert(&samples[..100]);
        assert!(bits(&right.draw_for_file()) == bits(&alone.draw_for_file()), "{}", subject.name);
    }
}
