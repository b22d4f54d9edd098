//! Samples that look from elsewhere count where colours do not depend on the direction, and nowhere
//! else.

#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::*;
use glam::DVec3;
use holo_display::{Search, UsefulBeam};
use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_picture::View;
use holo_section::{BeamId, ViewClass};
use std::collections::BTreeSet;
use std::sync::Arc;

const SIZE: (u32, u32) = (128, 96);

/// The room with a glossy far wall, which is bright if seen from the eye's side.
fn glossy(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let (colour, distance) = room(origin, direction);
    let p = origin + direction * distance;
    if (p.x - ROOM.x).abs() > 1e-6 {
        return (colour, distance);
    }
    let lobe = (0.1 + 0.9 * (-20.0 * (direction.y * direction.y + direction.z * direction.z)).exp())
        as f32;
    ([lobe, lobe, 0.9 * lobe], distance)
}

/// Returns samples of beams in all directions: the first few of each beam's own sequence.
fn of_beams(scene: Scene, beams: &[BeamId], each: u32, noise: Noise) -> Vec<Stored> {
    let (section, mut random) = (room_section(8), Random(5));
    let mut stored = Vec::new();
    for &beam in beams {
        let sampler = section.beam_sampler(0, beam, None).unwrap();
        stored.extend((0..each).map(|number| {
            traced(scene, &section, beam, sampler.coords(number), &mut random, noise)
        }));
    }
    stored
}

/// Returns the errors of two pictures: of a view's own samples, and of these with samples of all
/// surface beams.
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

fn all_beams(tree: &Quadtree) -> Vec<UsefulBeam> {
    tree.surface_beams(Search::Thorough).map_or_else(Vec::new, |search| search())
}

fn surface_beams(tree: &Quadtree) -> Vec<BeamId> {
    all_beams(tree).into_iter().map(|(key, _)| key.beam).collect()
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

/// Traces random rays of the room's section. Returns how many end on a visible surface, and how
/// many of these belong to the given beams.
fn rays_that_end_in(view: &View, asked: &BTreeSet<BeamId>) -> (u32, u32) {
    let section = room_section(8);
    let mut random = Random(8);
    let (mut ends_there, mut found) = (0, 0);
    for _ in 0..20_000 {
        let [from, to] = [(); 2].map(|()| DVec3::new(random.unit(), random.unit(), random.unit()));
        let (from, to) = (section.local_to_world(from), section.local_to_world(to));
        let Some(hit) = section.line(from, to - from) else { continue };
        let ray = section.ray(hit.pair, hit.coords);
        let start = section.trace_start(&ray);
        let end = ray.origin
            + ray.direction * (start + room(ray.origin + ray.direction * start, ray.direction).1);
        let is_seen = view.project(end).is_some_and(|(x, y, distance)| {
            let clear = room(view.vp, (end - view.vp).normalize()).1;
            (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y) && distance < 1.001 * clear
        });
        if is_seen {
            ends_there += 1;
            found += u32::from(asked.contains(&section.beam(hit.pair)));
        }
    }
    (ends_there, found)
}

#[test]
fn surface_beams_hold_most_samples_that_end_on_what_is_seen() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let own = near_samples(room, &section, &view, 4000, 3, clean);
    let tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &own);
    let asked: BTreeSet<BeamId> = surface_beams(&tree).into_iter().collect();
    let (ends_there, found) = rays_that_end_in(&view, &asked);
    println!("{found} of {ends_there} rays are of {} beams", asked.len());
    assert!(ends_there > 1000 && f64::from(found) > 0.95 * f64::from(ends_there));
    let all = section.beam_count();
    assert!((asked.len() as u64) < all / 2, "{} of {all} beams", asked.len());
}

#[test]
fn the_more_useful_half_of_the_surface_beams_holds_most_samples_that_end_on_what_is_seen() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let own = near_samples(room, &section, &view, 400, 3, clean);
    let tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &own);
    let mut beams = all_beams(&tree);
    assert!(beams.is_sorted_by(|one, next| one.0 < next.0));
    assert!(beams.iter().all(|(_, useful)| (0.0..=1.0).contains(useful)));
    beams.sort_by(|one, other| other.1.total_cmp(&one.1));
    let found = |beams: &[UsefulBeam]| {
        let beams = beams.iter().map(|(key, _)| key.beam).collect();
        rays_that_end_in(&view, &beams).1
    };
    let (first, last) = beams.split_at(beams.len() / 2);
    assert!(found(first) > 2 * found(last), "{} {}", found(first), found(last));
}

#[test]
fn a_quick_search_finds_the_more_useful_beams() {
    let (section, view) = (room_section(12), room_view(SIZE));
    let own = near_samples(room, &section, &view, 400, 3, clean);
    let tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &own);
    let quick = tree.surface_beams(Search::Quick).unwrap()();
    assert!(quick.is_sorted_by(|one, next| one.0 < next.0));
    let all = all_beams(&tree);
    let each = |beams: &[UsefulBeam]| {
        let beams: BTreeSet<BeamId> = beams.iter().map(|(key, _)| key.beam).collect();
        f64::from(rays_that_end_in(&view, &beams).1) / beams.len() as f64
    };
    assert!(2 * quick.len() < all.len(), "{} of {}", quick.len(), all.len());
    assert!(each(&quick) > 1.5 * each(&all), "{} {}", each(&quick), each(&all));
}

/// The far section is on the other side of a wall, but a display knows of no walls.
#[test]
fn beams_of_sections_that_are_further_from_what_is_seen_come_last() {
    let (near, view) = (room_section(8), room_view(SIZE));
    let far = section([-20.0, 2.5, 1.5], [4.0, 3.0, 3.0], [8; 3], ViewClass::Interior, false);
    let sections: Arc<[_]> = Arc::from([far, near.clone()]);
    let mut tree = Quadtree::new(sections, view, SIZE, QuadtreeParams::default());
    for (beam, sample) in near_samples(room, &near, &view, 4000, 3, clean) {
        tree.insert(key(1, beam), 1, &[sample]);
    }
    let mean = |section: u16| {
        let beams = all_beams(&tree).into_iter().filter(|(key, _)| key.section == section);
        let useful: Vec<f64> = beams.map(|(_, useful)| f64::from(useful)).collect();
        assert!(useful.len() > 1000, "{}", useful.len());
        useful.iter().sum::<f64>() / useful.len() as f64
    };
    assert!(20.0 * mean(0) < mean(1), "{} {}", mean(0), mean(1));
}

#[test]
fn depths_are_those_of_the_drawn_picture() {
    let (section, view) = (room_section(8), room_view(SIZE));
    // From one sample for each pixel to one for 200, where most leaves are filled from larger ones.
    for count in [12_000, 1000, 60] {
        let own = near_samples(room, &section, &view, count, 3, clean);
        let tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &own);
        let (drawn, depths) = (tree.draw().depth, tree.depth());
        let (columns, rows) = (SIZE.0 as usize / 4, SIZE.1 as usize / 4);
        assert_eq!(depths.len(), columns * rows);
        let same = depths.iter().enumerate().filter(|&(square, &depth)| {
            let pixel = (4 * (square / columns) + 2) * SIZE.0 as usize + 4 * (square % columns) + 2;
            (f64::from(depth / drawn[pixel])).ln().abs() < 0.08
        });
        let same = same.count();
        println!("{count} samples: {same} of {} depths are those drawn", depths.len());
        assert!(same * 20 > depths.len() * 19, "{count}: {same} of {}", depths.len());
    }
}

#[test]
fn nothing_is_asked_for_while_nothing_is_shown() {
    let tree = Quadtree::new(
        Arc::from([room_section(4)]),
        room_view(SIZE),
        SIZE,
        QuadtreeParams::default(),
    );
    assert!(tree.surface_beams(Search::Thorough).is_none() && tree.depth().is_empty());
}
