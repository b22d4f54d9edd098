//! Tests of beam selection: the views of Figure 3 of the paper, coverage, weights.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::*;
use glam::DVec3;
use holo_display::{SelectOptions, Selection, select_beams, viewpoint_radius};
use holo_picture::View;
use holo_section::{BeamId, Section, ViewClass};
use std::collections::HashMap;

const SIZE: (u32, u32) = (320, 240);

fn unit_cube(class: ViewClass) -> Section {
    section([0.0; 3], [1.0; 3], [4; 3], class, class == ViewClass::Interior)
}

fn select(sections: &[Section], view: &View) -> Selection {
    select_beams(sections, view, SIZE, &SelectOptions::default())
}

/// Returns the weight of the beams that leave section `number` through wall `wall`, and the weight
/// of all its beams.
fn exit_weight(sections: &[Section], selection: &Selection, number: u16, wall: u8) -> (f64, f64) {
    let of = |only: Option<u8>| {
        selection
            .beams
            .iter()
            .filter(|wanted| wanted.key.section == number)
            .filter(|wanted| {
                let pair = sections[usize::from(number)].cells(wanted.key.beam).unwrap();
                only.is_none_or(|wall| pair.exit.wall == wall)
            })
            .map(|wanted| f64::from(wanted.weight))
            .sum()
    };
    (of(Some(wall)), of(None))
}

fn total(selection: &Selection) -> f64 {
    selection.beams.iter().map(|wanted| f64::from(wanted.weight)).sum()
}

const ALL: f64 = (SIZE.0 * SIZE.1) as f64;

#[test]
fn view_a_inside_an_interior_section_is_fully_covered() {
    let sections = [unit_cube(ViewClass::Interior)];
    let selection = select(&sections, &view([0.4, 0.5, 0.5], [1.0, 0.5, 0.5], 40.0, SIZE));
    assert_eq!(selection.covered.fraction(), 1.0);
    assert!((total(&selection) - ALL).abs() < 0.01);
    // The view is 40° wide and 0.6 before the wall, so it sees 0.44 × 0.33 of that wall alone.
    let (through, all) = exit_weight(&sections, &selection, 0, 1);
    assert_eq!(through, all);
    // Every beam points forwards.
    for wanted in &selection.beams {
        let pair = sections[0].cells(wanted.key.beam).unwrap();
        let ray = sections[0].ray(pair, holo_section::RayCoords([128; 4]));
        assert!(ray.direction.x > 0.0);
    }
}

#[test]
fn view_b_outside_and_looking_away_is_covered_where_lines_meet_the_section_behind() {
    let sections = [unit_cube(ViewClass::Interior)];
    // One unit beyond the wall x = 1, looking away from it.
    let seen = view([2.0, 0.5, 0.5], [3.0, 0.5, 0.5], 40.0, SIZE);
    let selection = select(&sections, &seen);
    let (through, all) = exit_weight(&sections, &selection, 0, 1);
    assert_eq!(through, all, "rays leave towards the eye");
    // Backwards, the picture is the wall's pinhole image. It spans ±tan 20° = ±0.364, all of it on
    // the wall, which spans ±0.5.
    assert_eq!(selection.covered.fraction(), 1.0);

    // At 100° the wall fills the middle ±0.5 of ±1.19 horizontally and of ±0.894 vertically.
    let wide = view([2.0, 0.5, 0.5], [3.0, 0.5, 0.5], 100.0, SIZE);
    let selection = select(&sections, &wide);
    let half = 50_f64.to_radians().tan();
    let expected = (0.5 / half) * (0.5 / (half * 0.75));
    // Only strata on the wall's border vary with the jitter: about 400 of 19200.
    assert!(
        (selection.covered.fraction() - expected).abs() < 0.01,
        "{} {expected}",
        selection.covered.fraction()
    );
}

#[test]
fn view_c_inside_an_exterior_section_is_fully_covered() {
    let sections = [unit_cube(ViewClass::Exterior)];
    let selection = select(&sections, &view([0.7, 0.5, 0.5], [0.0, 0.5, 0.5], 100.0, SIZE));
    assert_eq!(selection.covered.fraction(), 1.0);
    // The wall x = 0 spans ±0.5 at distance 0.7. The rest of the picture shows its four neighbours.
    let (through, all) = exit_weight(&sections, &selection, 0, 0);
    let half = 0.7 * 50_f64.to_radians().tan();
    let expected = (0.5 / half) * (0.5 / (half * 0.75));
    assert!((through / all - expected).abs() < 0.01, "{} {expected}", through / all);
    assert_eq!(exit_weight(&sections, &selection, 0, 1).0, 0.0);
}

#[test]
fn view_d_outside_an_exterior_section_is_covered_where_rays_meet_the_section() {
    let sections = [unit_cube(ViewClass::Exterior)];
    // The eye looks along the plane of the face y = 0, so only rays to the left can meet the
    // section.
    let seen = view([-1.0, 0.0, 0.5], [0.0, 0.0, 0.5], 60.0, SIZE);
    let selection = select(&sections, &seen);
    let mut expected = 0.0;
    let side = 400;
    for row in 0..side {
        for column in 0..side {
            // Slopes of the ray; left is +y. The ray meets the section if it crosses the face x =
            // 0, because no ray from here enters through the face y = 0.
            let across = (1.0 - 2.0 * (f64::from(column) + 0.5) / f64::from(side))
                * 30_f64.to_radians().tan();
            let up = (1.0 - 2.0 * (f64::from(row) + 0.5) / f64::from(side))
                * 30_f64.to_radians().tan()
                * 0.75;
            expected += f64::from(u8::from((0.0..1.0).contains(&across) && up.abs() < 0.5));
        }
    }
    expected /= f64::from(side * side);
    assert!(expected > 0.4 && expected < 0.6);
    assert!(
        (selection.covered.fraction() - expected).abs() < 0.01,
        "{} {expected}",
        selection.covered.fraction()
    );
    assert!((total(&selection) - selection.covered.pixels).abs() < 0.01);
    for wanted in &selection.beams {
        assert_eq!(sections[0].cells(wanted.key.beam).unwrap().entry.wall, 0);
    }
}

#[test]
fn the_nearest_of_several_sections_gets_most_weight_and_others_a_small_share() {
    let at = |x: f64| section([x, 0.0, 0.0], [1.0; 3], [4; 3], ViewClass::Interior, true);
    // Sections around the eye, farther ahead, ahead, farther behind, and behind.
    let sections = [at(2.0), at(6.0), at(4.0), at(-2.0), at(0.0)];
    let seen = view([2.5, 0.5, 0.5], [3.0, 0.5, 0.5], 4.0, SIZE);
    let selection = select(&sections, &seen);
    let weights: Vec<f64> =
        (0..5).map(|number| exit_weight(&sections, &selection, number, 1).1 / ALL).collect();
    let expected = [0.875, 0.0, 0.0625, 0.0, 0.0625];
    for (weight, expected) in weights.iter().zip(expected) {
        assert!((weight - expected).abs() < 1e-4, "{weights:?}");
    }
    let alone = SelectOptions { others_share: 0.0, ..SelectOptions::default() };
    let selection = select_beams(&sections, &seen, SIZE, &alone);
    assert!(selection.beams.iter().all(|wanted| wanted.key.section == 0));

    // Without the section around the eye, the one ahead comes before the one behind.
    let selection = select(&sections[1..], &seen);
    let weights: Vec<f64> =
        (0..4).map(|number| exit_weight(&sections[1..], &selection, number, 1).1 / ALL).collect();
    for (weight, expected) in weights.iter().zip([0.0, 0.9375, 0.0, 0.0625]) {
        assert!((weight - expected).abs() < 1e-4, "{weights:?}");
    }
}

#[test]
fn selected_beams_hold_nearly_all_weight_of_a_dense_view() {
    for (grid, least) in [(8, 0.998), (24, 0.995)] {
        let sections = [room_section(grid)];
        let seen = room_view(SIZE);
        let share = |options: &SelectOptions| {
            let selection = select_beams(&sections, &seen, SIZE, options);
            let wanted: HashMap<BeamId, f32> =
                selection.beams.iter().map(|wanted| (wanted.key.beam, wanted.weight)).collect();
            let mut random = Random(5);
            let rays = 200_000;
            let met = (0..rays)
                .filter(|_| {
                    let (eye, direction) = seen.ray(random.unit(), random.unit());
                    let hit = sections[0].line(eye, direction).unwrap();
                    wanted.contains_key(&sections[0].beam(hit.pair))
                })
                .count();
            (met as f64 / f64::from(rays), selection.beams.len())
        };
        let (coarse, beams) = share(&SelectOptions::default());
        let (fine, all) = share(&SelectOptions { pixels_a_side: 1, ..SelectOptions::default() });
        println!(
            "{grid}³: {coarse:.4} of the weight in {beams} beams; with more rays {fine:.4} in {all}"
        );
        assert!(coarse > least, "{grid}: {coarse}");
        assert!(fine > 0.9995, "{grid}: {fine}");
    }
}

#[test]
fn a_huge_picture_takes_no_more_rays_than_a_large_one() {
    let sections = [room_section(6)];
    let of_size = |size: (u32, u32)| {
        select_beams(&sections, &room_view(size), size, &SelectOptions::default())
    };
    let (large, huge) = (of_size((800, 600)), of_size((8_000, 6_000)));
    assert!(large.covered.rays == huge.covered.rays && huge.covered.rays <= 1 << 16);
    assert!((total(&huge) / (8_000.0 * 6_000.0) - 1.0).abs() < 1e-4);
}

#[test]
fn weights_are_numbers_of_pixels() {
    let sections = [room_section(6)];
    let seen = room_view(SIZE);
    let selection = select(&sections, &seen);
    assert!((total(&selection) - ALL).abs() < 0.01);
    let mut exact: HashMap<BeamId, f64> = HashMap::new();
    for row in 0..4 * SIZE.1 {
        for column in 0..4 * SIZE.0 {
            let (x, y) = View::pixel_centre((4 * SIZE.0, 4 * SIZE.1), column, row);
            let (eye, direction) = seen.ray(x, y);
            let hit = sections[0].line(eye, direction).unwrap();
            *exact.entry(sections[0].beam(hit.pair)).or_default() += 1.0 / 16.0;
        }
    }
    // A stratum is 4 pixels. Only strata on a cell's border are uncertain, each with a standard
    // deviation of at most 2 pixels. The outline of a cell of n pixels is about 4√n pixels, or 2√n
    // strata, long.
    let mut chi = 0.0;
    for wanted in &selection.beams {
        let pixels = exact[&wanted.key.beam];
        let deviation = (8.0 * pixels.sqrt()).sqrt() + 2.0;
        let error = (f64::from(wanted.weight) - pixels) / deviation;
        assert!(error.abs() < 4.0, "{pixels} {}", wanted.weight);
        chi += error * error;
    }
    assert!(chi / (selection.beams.len() as f64) < 1.2, "{chi} over {}", selection.beams.len());
}

#[test]
fn selection_repeats_and_depends_on_its_seed() {
    let sections = [room_section(16)];
    let seen = room_view(SIZE);
    assert_eq!(select(&sections, &seen), select(&sections, &seen));
    let other = select_beams(
        &sections,
        &seen,
        SIZE,
        &SelectOptions { seed: 1, ..SelectOptions::default() },
    );
    assert_ne!(select(&sections, &seen), other);
    assert!(select(&[], &seen).beams.is_empty());
    assert_eq!(select(&[], &seen).covered.fraction(), 0.0);
}

#[test]
fn the_viewpoint_radius_is_the_width_of_a_sample_at_the_nearest_surface() {
    let seen = view([0.0; 3], [1.0, 0.0, 0.0], 90.0, (100, 100));
    // The view is 90° wide: 2 units at distance 1, so a pixel at distance 5 is 0.1 wide.
    assert!((viewpoint_radius(&seen, (100, 100), 5.0, 1.0) - 0.1).abs() < 1e-12);
    assert!((viewpoint_radius(&seen, (100, 100), 5.0, 4.0) - 0.05).abs() < 1e-12);
    let (eye, left) = seen.ray(0.5 - 0.005, 0.5);
    let right = seen.ray(0.5 + 0.005, 0.5).1;
    let width = (DVec3::new(5.0, 0.0, 0.0) + eye).distance(eye)
        * (left / left.x - right / right.x).length();
    assert!((width - 0.1).abs() < 1e-12);
}
