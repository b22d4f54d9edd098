//! Points that outlive their driver, when an object of the scene is moved.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::sync::Arc;

use crate::scenes::view;
use crate::viewer::TestViewer;
use glam::{DAffine3, DVec3};
use holo_display::{Frame, FrameRequest, ObjectMotion};
use holo_driver_rendercache::{PointImageParams, PointMemory, pointimage_driver_with_memory};
use holo_picture::View;
use holo_section::{BeamKey, Sample, Section, SectionSpec, ViewClass};

const SIZE: (u32, u32) = (96, 72);
/// Light of the wall, and of the sheet before it.
const WALL: [f32; 3] = [0.2, 0.2, 0.2];
const SHEET: [f32; 3] = [0.1, 0.8, 0.1];
/// Half the side of the sheet, its distance, and how far it moves to the right.
const HALF: f64 = 0.5;
const AT: f64 = 2.5;
const STEP: f64 = 1.3;

fn sections() -> Arc<[Section]> {
    let axes = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
    let (grid, class) = ([8; 3], ViewClass::Interior);
    let spec = SectionSpec { origin: [-1.0; 3], axes, grid, class, obstructions: true };
    Arc::from([Section::new(spec).unwrap()])
}

fn look() -> FrameRequest {
    FrameRequest { view: view(DVec3::ZERO, 0.0, SIZE), size: SIZE, is_moving: false }
}

/// Returns the light of what a ray meets, and its distance: a sheet at x, or the wall behind it.
fn seen(eye: DVec3, direction: DVec3, x: f64) -> ([f32; 3], f64) {
    let on_sheet = eye + direction * (AT / direction.y) - DVec3::new(x, AT, 0.0);
    match on_sheet.abs().max_element() < HALF {
        true => (SHEET, AT / direction.y),
        false => (WALL, 5.0 / direction.y),
    }
}

/// The samples of the view, one for each pixel, as far as the sheet hides nothing.
fn samples(x: f64) -> Vec<(BeamKey, Sample)> {
    let (look, sections) = (look(), sections());
    let section = &sections[0];
    let sample = |pixel: u32| {
        let (x_of_pixel, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
        let (eye, direction) = look.view.ray(x_of_pixel, y);
        let hit = section.line(eye, direction).unwrap();
        let (light, distance) = seen(eye, direction, x);
        let distance = distance - hit.entry_t;
        let sample = Sample::encode(hit.coords, light, distance, section.diagonal(), 0);
        (BeamKey { section: 0, beam: section.beam(hit.pair) }, sample)
    };
    (0..SIZE.0 * SIZE.1).map(sample).collect()
}

fn viewer(memory: &PointMemory) -> TestViewer {
    let params = PointImageParams::default();
    let driver = pointimage_driver_with_memory(sections(), [0.0; 3], params, memory.clone());
    let mut viewer = TestViewer::new(driver);
    viewer.look(&look()).unwrap();
    viewer.viewpoint_radius(&look(), AT);
    viewer
}

/// A motion of the sheet to the right, or away.
fn motion(to_now: Option<DAffine3>) -> ObjectMotion {
    let lay_on = |point: DVec3| {
        let from_middle = point - DVec3::new(0.0, AT, 0.0);
        from_middle.y.abs() < 0.01 && from_middle.abs().max_element() < HALF + 0.01
    };
    let (name, sphere) = ("sheet".to_owned(), (DVec3::new(0.0, AT, 0.0), HALF * 2f64.sqrt()));
    ObjectMotion { name, lay_on: Arc::new(lay_on), to_now, sphere }
}

fn to_the_right() -> ObjectMotion {
    motion(Some(DAffine3::from_translation(DVec3::new(STEP, 0.0, 0.0))))
}

/// Returns a driver that goes on with the points of one that knows the sheet in the middle.
fn next_driver(memory: &PointMemory, motions: &[ObjectMotion]) -> TestViewer {
    let mut first = viewer(memory);
    for (key, sample) in samples(0.0) {
        first.insert(key, 1, &[sample]);
    }
    first.draw();
    drop(first);
    memory.go_on(motions);
    viewer(memory)
}

/// Squared error of the picture with the sheet at x, and of the pixels that its move uncovers.
fn errors(frame: &Frame, x: f64) -> [f64; 2] {
    let mut sums = [[0.0, 0.0]; 2];
    for pixel in 0..SIZE.0 * SIZE.1 {
        let (column, row) = (pixel % SIZE.0, pixel / SIZE.0);
        let (at, up) = View::pixel_centre(SIZE, column, row);
        let (eye, direction) = look().view.ray(at, up);
        let shown = frame.picture.get(column, row).unwrap();
        let error: f64 = (shown.iter().zip(seen(eye, direction, x).0))
            .map(|(shown, truth)| f64::from(shown - truth).powi(2))
            .sum();
        let is_uncovered =
            seen(eye, direction, 0.0).0 == SHEET && seen(eye, direction, x).0 == WALL;
        for (sum, counts) in sums.iter_mut().zip([true, is_uncovered]) {
            if counts {
                *sum = [sum[0] + error, sum[1] + 1.0];
            }
        }
    }
    sums.map(|[sum, count]| sum / count.max(1.0))
}

#[test]
fn a_moved_object_is_shown_at_its_new_place_before_any_sample_and_leaves_no_ghost() {
    let moved = next_driver(&PointMemory::default(), &[to_the_right()]).draw();
    let [all, uncovered] = errors(&moved, STEP);
    // Without the motion, the object stays where it was until samples come.
    let [all_before, ghost] = errors(&next_driver(&PointMemory::default(), &[]).draw(), STEP);
    println!("squared error {all:.5} and {uncovered:.5}; unmoved {all_before:.5}, {ghost:.5}");
    assert!(all < 0.1 * all_before && uncovered < 0.05 * ghost);
}

#[test]
fn samples_of_the_scene_before_bring_no_ghost_back_and_hide_no_moved_object() {
    let memory = PointMemory::default();
    let mut driver = next_driver(&memory, &[to_the_right()]);
    for (key, sample) in samples(0.0) {
        driver.insert_earlier(key, 1, &[sample]);
    }
    let [all, uncovered] = errors(&driver.draw(), STEP);
    println!("squared error {all:.5}, uncovered {uncovered:.5}");
    assert!(all < 0.005 && uncovered < 0.02);
    // Nor in a driver that begins with nothing but them.
    drop(driver);
    memory.forget();
    let mut anew = viewer(&memory);
    for (key, sample) in samples(0.0) {
        anew.insert_earlier(key, 1, &[sample]);
    }
    let [all, uncovered] = errors(&anew.draw(), STEP);
    println!("from nothing: squared error {all:.5}, uncovered {uncovered:.5}");
    // Nothing is known of what was behind it: at worst it is black.
    assert!(all < 0.02 && uncovered < 0.12);
    // Present samples correct everything.
    for (key, sample) in samples(STEP) {
        anew.insert(key, 1, &[sample]);
    }
    let [all, uncovered] = errors(&anew.draw(), STEP);
    assert!(all < 0.002 && uncovered < 1e-4, "{all} {uncovered}");
}

#[test]
fn an_object_that_is_gone_or_has_another_size_leaves_no_points() {
    let gone = next_driver(&PointMemory::default(), &[motion(None)]).draw();
    let is_sheet = |pixel: &&[f32; 3]| pixel[1] > 2.0 * pixel[0];
    assert_eq!(gone.picture.pixels.iter().filter(is_sheet).count(), 0);
    let grown = motion(Some(DAffine3::from_scale(DVec3::splat(1.5))));
    let grown = next_driver(&PointMemory::default(), &[grown]).draw();
    assert_eq!(grown.picture.pixels.iter().filter(is_sheet).count(), 0);
}

#[test]
fn points_are_taken_once_and_only_if_the_next_driver_goes_on() {
    let memory = PointMemory::default();
    let known =
        |viewer: &mut TestViewer| viewer.draw().depth.iter().filter(|depth| **depth > 0.0).count();
    let mut first = next_driver(&memory, &[]);
    assert!(known(&mut first) > 1000);
    // The points are with the first one.
    assert_eq!(known(&mut viewer(&memory)), 0);
    drop(first);
    assert_eq!(known(&mut viewer(&memory)), 0, "nobody has said that it goes on");
    let first = next_driver(&memory, &[]);
    memory.forget();
    drop(first);
    memory.forget();
    memory.go_on(&[]);
    assert_eq!(known(&mut viewer(&memory)), 0, "they were forgotten");
}
