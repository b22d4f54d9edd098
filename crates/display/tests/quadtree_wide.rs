//! Samples that look from elsewhere: used where what they show does not depend on the direction, and nowhere else.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::*;
use glam::DVec3;
use holo_display::{Quadtree, QuadtreeParams};
use holo_section::BeamId;
use std::collections::BTreeSet;
use std::sync::Arc;

const SIZE: (u32, u32) = (128, 96);

/// The room, its far wall a gloss: bright for those who see it from the side that the eye is on.
fn glossy(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let (colour, distance) = room(origin, direction);
    let p = origin + direction * distance;
    if (p.x - ROOM.x).abs() > 1e-6 {
        return (colour, distance);
    }
    let lobe = (0.1 + 0.9 * (-20.0 * (direction.y * direction.y + direction.z * direction.z)).exp()) as f32;
    ([lobe, lobe, 0.9 * lobe], distance)
}

/// Samples of beams in all directions: for each beam the first few of its own sequence.
fn of_beams(scene: Scene, beams: &[BeamId], each: u32, noise: Noise) -> Vec<Stored> {
    let (section, mut random) = (room_section(8), Random(5));
    let mut stored = Vec::new();
    for &beam in beams {
        let sampler = section.beam_sampler(0, beam, None).unwrap();
        stored
            .extend((0..each).map(|number| traced(scene, &section, beam, sampler.coords(number), &mut random, noise)));
    }
    stored
}

/// Errors of the picture of a view's own samples, one a pixel, and of that with those of all surface beams.
fn errors(scene: Scene, noise: Noise, own_a_pixel: f64) -> (f64, f64) {
    let (section, view) = (room_section(8), room_view(SIZE));
    let reference = truth(scene, &view, SIZE, 8);
    let own = (f64::from(SIZE.0 * SIZE.1) * own_a_pixel) as usize;
    let own = near_samples(scene, &section, &view, own, 3, noise);
    let mut tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &own);
    let alone = relative_error(&tree.draw(), &reference);
    let others = of_beams(scene, &surface_beams(&tree), 20, noise);
    insert(&mut tree, &others);
    (alone, relative_error(&tree.draw(), &reference))
}

fn surface_beams(tree: &Quadtree) -> Vec<BeamId> {
    tree.surface_beams().into_iter().map(|(_, beam)| beam).collect()
}

#[test]
fn samples_from_everywhere_make_a_noisy_picture_of_diffuse_walls_much_better() {
    let (alone, both) = errors(room, one_path, 1.0);
    println!("error {alone:.4} alone, {both:.4} with the others");
    assert!(both < 0.5 * alone, "{both} after {alone}");
}

#[test]
fn samples_from_elsewhere_do_not_spoil_a_gloss() {
    for (noise, own) in [(clean as Noise, 1.0), (some_paths, 4.0), (one_path, 16.0)] {
        let (alone, both) = errors(glossy, noise, own);
        println!("{own} a pixel: error {alone:.5} alone, {both:.5} with the others");
        assert!(both < 1.2 * alone, "{both} after {alone}");
    }
}

#[test]
fn surface_beams_hold_most_samples_that_end_on_what_is_seen() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let own = near_samples(room, &section, &view, 4000, 3, clean);
    let tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &own);
    let asked: BTreeSet<BeamId> = surface_beams(&tree).into_iter().collect();
    let mut random = Random(8);
    let (mut ends_there, mut found) = (0, 0);
    for _ in 0..20_000 {
        let [from, to] = [(); 2].map(|()| DVec3::new(random.unit(), random.unit(), random.unit()));
        let (from, to) = (section.local_to_world(from), section.local_to_world(to));
        let Some(hit) = section.line(from, to - from) else { continue };
        let ray = section.ray(hit.pair, hit.coords);
        let start = section.trace_start(&ray);
        let end = ray.origin + ray.direction * (start + room(ray.origin + ray.direction * start, ray.direction).1);
        let is_seen = view.project(end).is_some_and(|(x, y, distance)| {
            let clear = room(view.vp, (end - view.vp).normalize()).1;
            (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y) && distance < 1.001 * clear
        });
        if is_seen {
            ends_there += 1;
            found += u32::from(asked.contains(&section.beam(hit.pair)));
        }
    }
    println!("{found} of {ends_there} rays are of {} beams", asked.len());
    assert!(ends_there > 1000 && f64::from(found) > 0.95 * f64::from(ends_there));
    let all = section.beam_count();
    assert!((asked.len() as u64) < all / 2, "{} of {all} beams", asked.len());
}

#[test]
fn nothing_is_asked_for_while_nothing_is_shown() {
    let tree = Quadtree::new(Arc::from([room_section(4)]), room_view(SIZE), SIZE, QuadtreeParams::default());
    assert!(tree.surface_beams().is_empty());
}
