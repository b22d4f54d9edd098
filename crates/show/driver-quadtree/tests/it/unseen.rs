//! Pixels of beams that see nothing.

use crate::common::*;
use holo_display::{Frame, SelectOptions, select_beams};
use holo_driver_quadtree::{LeafSize, Quadtree, QuadtreeParams};
use holo_section::BeamId;
use std::collections::HashSet;
use std::sync::Arc;

const SIZE: (u32, u32) = (48, 36);
const SKY: [f32; 3] = [0.25, 0.5, 1.0];

fn params() -> QuadtreeParams {
    QuadtreeParams { sky: SKY.into(), ..QuadtreeParams::default() }
}

fn bits(frame: &Frame) -> (Vec<[u32; 3]>, Vec<u32>, [u64; 4]) {
    (
        frame.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect(),
        frame.depth.iter().map(|depth| depth.to_bits()).collect(),
        [frame.uncovered_pixels, frame.empty_pixels, frame.unseen_pixels, frame.samples_used],
    )
}

#[test]
fn pixels_of_unseen_beams_show_the_sky_exactly_and_no_others_do() {
    let (section, view) = (room_section(4), room_view(SIZE));
    let stored = near_samples(room, &section, &view, 20_000, 1, one_path);
    // Leaves of one pixel: what a pixel shows depends on no other's noise.
    let params = QuadtreeParams { leaf: LeafSize::Fixed(0), ..params() };
    let plain = quadtree(&section, &view, SIZE, params.clone(), &stored).draw();
    // Every second beam of the view counts as unseen, though samples land in its pixels.
    let selection =
        select_beams(std::slice::from_ref(&section), &view, SIZE, &SelectOptions::default());
    let unseen: HashSet<BeamId> =
        selection.beams.iter().step_by(2).map(|wanted| wanted.key.beam).collect();
    let mut tree = quadtree(&section, &view, SIZE, params, &stored);
    unseen.iter().for_each(|&beam| tree.insert_unseen(key(0, beam)));
    let frame = tree.draw();
    let mut shown = 0;
    for row in 0..SIZE.1 {
        for column in 0..SIZE.0 {
            let (x, y) = (
                (f64::from(column) + 0.5) / f64::from(SIZE.0),
                1.0 - (f64::from(row) + 0.5) / f64::from(SIZE.1),
            );
            let (eye, along) = view.ray(x, y);
            let beam = section.line(eye, along).map(|hit| section.beam(hit.pair));
            let pixel = (row * SIZE.0 + column) as usize;
            if beam.is_some_and(|beam| unseen.contains(&beam)) {
                shown += 1;
                assert_eq!((frame.picture.pixels[pixel], frame.depth[pixel]), (SKY, f32::INFINITY));
            } else {
                assert_eq!(frame.picture.pixels[pixel], plain.picture.pixels[pixel]);
                assert_eq!(frame.depth[pixel], plain.depth[pixel]);
            }
        }
    }
    assert!(shown > 300 && shown < 1400, "{shown}");
    assert_eq!((frame.unseen_pixels, plain.unseen_pixels), (shown, 0));
}

#[test]
fn without_samples_unseen_pixels_are_known_and_the_rest_are_empty() {
    let (section, view) = (room_section(4), room_view(SIZE));
    let selection =
        select_beams(std::slice::from_ref(&section), &view, SIZE, &SelectOptions::default());
    let mut tree = Quadtree::new(Arc::from([section]), view, SIZE, params());
    let covered = u64::from(SIZE.0 * SIZE.1) - tree.draw().uncovered_pixels;
    selection
        .beams
        .iter()
        .step_by(3)
        .for_each(|wanted| tree.insert_unseen(key(0, wanted.key.beam)));
    let frame = tree.draw();
    assert!(frame.unseen_pixels > 0 && frame.empty_pixels > 0);
    assert_eq!(frame.unseen_pixels + frame.empty_pixels, covered);
    assert_eq!(frame.samples_used, 0);
}

#[test]
fn when_a_beam_becomes_known_changes_no_bit() {
    let (section, view) = (room_section(4), room_view(SIZE));
    let stored = near_samples(room, &section, &view, 5_000, 2, one_path);
    let selection =
        select_beams(std::slice::from_ref(&section), &view, SIZE, &SelectOptions::default());
    let unseen: Vec<BeamId> =
        selection.beams.iter().step_by(2).map(|wanted| wanted.key.beam).collect();
    let mut last = quadtree(&section, &view, SIZE, params(), &stored);
    unseen.iter().for_each(|&beam| last.insert_unseen(key(0, beam)));
    let mut first = Quadtree::new(Arc::from([section.clone()]), view, SIZE, params());
    unseen.iter().rev().chain(&unseen).for_each(|&beam| first.insert_unseen(key(0, beam)));
    insert(&mut first, &stored);
    assert_eq!(bits(&last.draw()), bits(&first.draw()));
    // Unknown sections and beams change nothing.
    let known = bits(&first.draw());
    first.insert_unseen(key(0, BeamId(section.beam_count())));
    first.insert_unseen(key(9, unseen[0]));
    assert_eq!(bits(&first.draw()), known);
}
