//! Frames of every driver in every phase, compared bit by bit with those of earlier versions.
//!
//! `golden.txt` has a line for each frame: its name, a hash of all its bits, and the mean of its
//! green channel, so that a change shows its size. After a wanted change, run the test with
//! `HOLO_GOLDEN=write` and explain the differences in the commit.

use holo_contract::{SUBJECTS, Subject, TestRoom};
use holo_display::Frame;
use holo_picture::{Picture, View};
use std::fmt::Write;
use std::path::Path;

/// More pixels than a view whose first picture is its best.
const LARGE: (u32, u32) = (400, 300);
const SMALL: (u32, u32) = (96, 72);

/// Towards the mirror, the coats and the veil, past the pane.
const AHEAD: &str = "-vp 2.6 1.2 1.5 -vd 0.1 1 -0.15 -vu 0 0 1 -vh 75";
/// The next step of a walk.
const BESIDE: &str = "-vp 2.7 1.25 1.5 -vd 0.2 1 -0.15 -vu 0 0 1 -vh 75";
/// Through the pane and out of the window.
const OUT: &str = "-vp 1.5 2.6 1.4 -vd 1 -0.05 -0.1 -vu 0 0 1 -vh 70";
/// From outside the sections, which cover a part of it.
const PAST: &str = "-vp 2.6 0.1 2.85 -vd 0.2 1 -0.5 -vu 0 0 1 -vh 80";

/// Mixes a number into a hash.
fn mixed(hash: u64, bits: u32) -> u64 {
    holo_display::split_mix(hash ^ u64::from(bits))
}

/// The lines of frames.
#[derive(Default)]
struct GoldenLines(String);

impl GoldenLines {
    fn add_picture(&mut self, name: &str, picture: &Picture, further: &[f32]) {
        let channels = picture.pixels.iter().flatten().chain(further);
        let hash = channels.fold(0, |hash, channel| mixed(hash, channel.to_bits()));
        let green: f64 = picture.pixels.iter().map(|pixel| f64::from(pixel[1])).sum();
        let mean = green / picture.pixels.len() as f64;
        writeln!(self.0, "{hash:016x} {mean:.6} {name}").unwrap();
    }

    fn add(&mut self, name: &str, frame: &Frame) {
        let counts = [
            frame.uncovered_pixels,
            frame.empty_pixels,
            frame.unseen_pixels,
            frame.guessed_pixels,
            frame.gleam_pixels,
            frame.samples_used,
        ];
        let certainty = frame.certainty.iter().flat_map(|c| [c.error, c.samples as f32]);
        let counts = counts.into_iter().map(|count| count as f32);
        let further: Vec<f32> =
            frame.depth.iter().copied().chain(certainty).chain(counts).collect();
        self.add_picture(name, &frame.picture, &further);
    }
}

/// Draws a walk: a view from nothing to its best frame, a step, a stop, an edit, and a view with
/// live rays.
fn walk(lines: &mut GoldenLines, room: &TestRoom, subject: &Subject, size: (u32, u32)) {
    let named = |phase: &str| format!("{}, {} × {}, {phase}", subject.name, size.0, size.1);
    let [ahead, beside, out, past] =
        [AHEAD, BESIDE, OUT, PAST].map(|options| room.view(options, size));
    let count = u64::from(size.0) * u64::from(size.1) / 2;
    let mut viewer = subject.make(room);
    let mut draw = |viewer: &mut holo_contract::SubjectViewer, phase: &str| {
        lines.add(&named(phase), &viewer.draw().unwrap());
    };
    viewer.look(&ahead, size, false);
    draw(&mut viewer, "without samples");
    viewer.look(&ahead, size, false);
    viewer.insert_unseen(&room.unseen());
    viewer.insert(&room.samples(count, 1));
    viewer.insert(&room.samples_of_view(&ahead, count, 2));
    draw(&mut viewer, "first");
    viewer.insert(&room.samples_of_view(&ahead, count, 3));
    draw(&mut viewer, "at rest");
    viewer.settle();
    draw(&mut viewer, "refined");
    draw(&mut viewer, "refined again");
    lines.add(&named("for a file"), &viewer.draw_for_file());
    if let Some(part) = viewer.draw_half(&out, size) {
        lines.add_picture(&named("a part"), &part, &[]);
    }
    let mut draw = |viewer: &mut holo_contract::SubjectViewer, phase: &str| {
        lines.add(&named(phase), &viewer.draw().unwrap());
    };
    viewer.look(&beside, size, true);
    draw(&mut viewer, "moving");
    viewer.look(&beside, size, false);
    viewer.insert(&room.samples_of_view(&beside, count, 4));
    draw(&mut viewer, "stopped");
    viewer.settle();
    draw(&mut viewer, "refined after a stop");
    viewer.look(&out, size, false);
    viewer.insert(&room.samples_of_view(&out, count, 5));
    let earlier = room.brighter(&room.samples_of_view(&out, count / 4, 6), 3.0);
    viewer.insert_earlier(&earlier);
    viewer.settle();
    draw(&mut viewer, "edited");
    viewer.remove_earlier(&earlier);
    viewer.settle();
    draw(&mut viewer, "long after the edit");
    viewer.look(&past, size, false);
    viewer.insert(&room.samples(count / 2, 7));
    viewer.insert_live(room, &past, size);
    viewer.settle();
    draw(&mut viewer, "with live rays");
}

fn all_lines() -> String {
    let room = TestRoom::new();
    let mut lines = GoldenLines::default();
    for subject in &SUBJECTS {
        walk(&mut lines, &room, subject, SMALL);
        if !subject.needs_no_scene {
            walk(&mut lines, &room, subject, LARGE);
        }
    }
    lines.0
}

#[test]
fn frames_are_those_of_earlier_versions_bit_by_bit() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/golden.txt");
    let drawn = all_lines();
    if std::env::var("HOLO_GOLDEN").is_ok_and(|order| order == "write") {
        std::fs::write(&path, &drawn).unwrap();
    }
    let golden = std::fs::read_to_string(&path).unwrap();
    let differing: Vec<String> = golden
        .lines()
        .zip(drawn.lines())
        .filter(|(golden, drawn)| golden != drawn)
        .map(|(golden, drawn)| format!("was {golden}\nis  {drawn}"))
        .collect();
    assert!(differing.is_empty(), "{} frames differ:\n{}", differing.len(), differing.join("\n"));
    assert_eq!(golden.lines().count(), drawn.lines().count());
}

#[test]
fn the_room_s_views_see_every_kind_of_surface() {
    let room = TestRoom::new();
    let views = [AHEAD, OUT].map(|options| room.view(options, LARGE));
    let mut seen = std::collections::BTreeSet::new();
    for pixel in 0..LARGE.0 * LARGE.1 {
        let (x, y) = View::pixel_centre(LARGE, pixel % LARGE.0, pixel / LARGE.0);
        for (origin, direction) in views.map(|view| view.ray(x, y)) {
            let Some((ray, _)) = room.raycaster.localize(origin, direction) else { continue };
            if let Some(hit) = room.raycaster.nearest(&ray) {
                seen.insert(room.raycaster.scene().material(hit.triangle).name.clone());
            }
        }
    }
    let of_materials = ["wall", "floor", "mirror", "pane", "coat", "metal", "veil"];
    let missing: Vec<_> = of_materials.iter().filter(|name| !seen.contains(**name)).collect();
    assert!(missing.is_empty(), "{missing:?} of {seen:?}");
}
