//! From rays to lines and back: ray coordinates are exact, and lines meet sections where geometry
//! says.
// Clippy allows these in tests, but not in the tests' helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use crate::common::{Rng, SHEARED, UNIT, scaled, section, spec};
use holo_section::{CellIndex, CellPair, DVec3, LineHit, RayCoords, Section, SectionError};
use proptest::prelude::*;

fn assert_exact(section: &Section, pair: CellPair, coords: RayCoords) {
    let ray = section.ray(pair, coords);
    let hit = section.line(ray.origin, ray.direction);
    let found = hit.map(|h| (h.pair, h.coords));
    assert_eq!(found, Some((pair, coords)), "{:?}: {ray:?} -> {hit:?}", section.spec());
}

/// Sections of every size, place, shape and grid for which the system must work.
fn all_sections() -> Vec<Section> {
    let mut sections = Vec::new();
    for size in [1e-4, 1.0, 37.5, 1e4, 1e8] {
        for place in [[0.0; 3], [1e7, 0.0, 0.0], [-1e7, 1e7, 1e7]] {
            for axes in [UNIT, SHEARED, [[-3.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]]] {
                for grid in [[1; 3], [3, 4, 5], [8; 3], [64; 3], [1, 64, 7]] {
                    match Section::new(spec(place, scaled(axes, size), grid)) {
                        Ok(section) => sections.push(section),
                        // Refused only where f64 has no room: a 256th of a cell is then about the
                        // world's resolution.
                        Err(SectionError::Unresolved { .. }) => {
                            assert!(
                                size == 1e-4
                                    && place[0] != 0.0
                                    && grid.contains(&64)
                                    && axes != UNIT
                            );
                        }
                        Err(other) => panic!("{other}"),
                    }
                }
            }
        }
    }
    assert!(sections.len() >= 5 * 3 * 3 * 5 - 8);
    sections
}

#[test]
fn a_stored_ray_is_found_again_exactly() {
    let mut rng = Rng(1);
    for section in all_sections() {
        for _ in 0..4000 {
            let (pair, coords) = (rng.pair(&section), rng.coords());
            assert_exact(&section, pair, coords);
        }
    }
}

#[test]
fn a_grazing_ray_is_found_again_exactly() {
    // In some rays, both ends lie within a few steps of the edge that their walls share. In others,
    // one end does, and the other is as far away as possible.
    let mut rng = Rng(2);
    for section in all_sections() {
        let grid = section.spec().grid;
        for _ in 0..2000 {
            let mut pair = rng.pair(&section);
            let mut bytes = [0u8; 4];
            for (cell, bytes) in
                [&mut pair.entry, &mut pair.exit].into_iter().zip(bytes.chunks_mut(2))
            {
                let (u, v) = cell.directions();
                for ((index, n), byte) in
                    [(&mut cell.u, grid[u]), (&mut cell.v, grid[v])].into_iter().zip(bytes)
                {
                    let low = rng.below(2) == 0;
                    *index = if low { 0 } else { n as u16 - 1 };
                    *byte = if low { rng.below(3) as u8 } else { 255 - rng.below(3) as u8 };
                }
            }
            assert_exact(&section, pair, RayCoords(bytes));
        }
    }
}

#[test]
fn every_value_of_each_byte_is_found_again_exactly() {
    let mut rng = Rng(3);
    for section in [
        section([0.0; 3], UNIT, [8; 3]),
        section([1e7, -1e7, 3.0], SHEARED, [64; 3]),
        section([5.0, 6.0, 7.0], scaled(SHEARED, 1e-4), [3, 4, 5]),
    ] {
        for _ in 0..60 {
            let (pair, base) = (rng.pair(&section), rng.coords());
            for place in 0..4 {
                for value in 0..=255 {
                    let mut coords = base;
                    coords.0[place] = value;
                    assert_exact(&section, pair, coords);
                }
            }
        }
    }
}

#[test]
fn a_ray_runs_from_its_entry_to_its_exit_wall() {
    let mut rng = Rng(4);
    let section = section([3.0, -2.0, 1.0], SHEARED, [3, 4, 5]);
    for _ in 0..10_000 {
        let (pair, coords) = (rng.pair(&section), rng.coords());
        let ray = section.ray(pair, coords);
        let bytes = coords.0.map(|b| (f64::from(b) + 0.5) / 256.0);
        for (cell, bytes, point) in [
            (pair.entry, &bytes[..2], ray.origin),
            (pair.exit, &bytes[2..], ray.origin + ray.direction * ray.length),
        ] {
            let local = section.world_to_local(point);
            let (axis, n) = (cell.axis(), section.spec().grid.map(f64::from));
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            assert!((local[axis] - f64::from(cell.wall & 1)).abs() < 1e-14);
            assert!((local[u] - (f64::from(cell.u) + bytes[0]) / n[u]).abs() < 1e-14);
            assert!((local[v] - (f64::from(cell.v) + bytes[1]) / n[v]).abs() < 1e-14);
        }
        assert!((ray.direction.length() - 1.0).abs() < 1e-15);
        let hit = section.line(ray.origin, ray.direction * 2.0).unwrap();
        assert!(
            hit.entry_t.abs() < 1e-12
                && (hit.exit_t * 2.0 - ray.length).abs() < 1e-12 * ray.length.max(1.0)
        );
        let back = section.line(ray.origin, -ray.direction).unwrap();
        assert_eq!((back.pair.entry, back.pair.exit), (pair.exit, pair.entry));
    }
}

/// Where the line meets the wall's parallelogram, by Cramer's rule: (t, u, v) with u and v in
/// fractions of the wall.
fn meet_wall(
    section: &Section,
    origin: DVec3,
    direction: DVec3,
    wall: u8,
) -> Option<(f64, f64, f64)> {
    let axes = section.spec().axes.map(DVec3::from_array);
    let axis = usize::from(wall / 2);
    let (u, v) = (axes[(axis + 1) % 3], axes[(axis + 2) % 3]);
    let corner = DVec3::from_array(section.spec().origin) + axes[axis] * f64::from(wall % 2);
    let solve = |a: DVec3, b: DVec3, c: DVec3| a.dot(b.cross(c));
    let (rhs, det) = (origin - corner, solve(u, v, -direction));
    let found =
        (solve(u, v, rhs) / det, solve(rhs, v, -direction) / det, solve(u, rhs, -direction) / det);
    ((0.0..1.0).contains(&found.1) && (0.0..1.0).contains(&found.2)).then_some(found)
}

#[test]
fn any_line_meets_the_walls_that_a_wall_by_wall_intersection_finds() {
    let mut rng = Rng(5);
    let section = section([3.0, -2.0, 1.0], SHEARED, [3, 4, 5]);
    let centre = section.local_to_world(DVec3::splat(0.5));
    let (mut hits, mut misses) = (0, 0);
    for _ in 0..100_000 {
        // Origins in front of, inside and behind the section.
        let origin = centre + rng.direction() * rng.between(0.0, 3.0);
        let direction = rng.direction() * rng.between(0.1, 10.0);
        let mut expected: Vec<_> = (0..6u8)
            .filter_map(|w| meet_wall(&section, origin, direction, w).map(|(t, u, v)| (t, w, u, v)))
            .collect();
        expected.sort_by(|a, b| a.0.total_cmp(&b.0));
        let hit = section.line(origin, direction);
        let &[(entry_t, entry_wall, u0, v0), (exit_t, exit_wall, u1, v1)] = &expected[..] else {
            assert!(expected.is_empty(), "the model found {expected:?}");
            assert_eq!(hit, None);
            misses += 1;
            continue;
        };
        hits += 1;
        let hit = hit.unwrap();
        assert_eq!((hit.pair.entry.wall, hit.pair.exit.wall), (entry_wall, exit_wall));
        assert!((hit.entry_t - entry_t).abs() < 1e-9 && (hit.exit_t - exit_t).abs() < 1e-9);
        let n = section.spec().grid.map(f64::from);
        let [eu, ev, xu, xv] = hit.coords.0;
        for (cell, bytes, place) in
            [(hit.pair.entry, [eu, ev], [u0, v0]), (hit.pair.exit, [xu, xv], [u1, v1])]
        {
            let (du, dv) = cell.directions();
            for (cells, index, byte, fraction) in
                [(n[du], cell.u, bytes[0], place[0]), (n[dv], cell.v, bytes[1], place[1])]
            {
                let step = fraction * cells * 256.0;
                let middle = f64::from(index) * 256.0 + f64::from(byte) + 0.5;
                assert!(
                    (step - middle).abs() < 0.5 + 1e-9,
                    "{step} is not in the step around {middle}"
                );
            }
        }
    }
    assert!(hits > 10_000 && misses > 10_000);
}

fn unit_line(origin: [f64; 3], direction: [f64; 3]) -> Option<LineHit> {
    section([0.0; 3], UNIT, [2; 3]).line(DVec3::from_array(origin), DVec3::from_array(direction))
}

#[test]
fn a_boundary_belongs_to_exactly_one_side() {
    // A position between two cells belongs to the upper one.
    let hit = unit_line([-1.0, 0.5, 0.25], [1.0, 0.0, 0.0]).unwrap();
    assert_eq!((hit.pair.entry, hit.coords.0[0]), (CellIndex { wall: 0, u: 1, v: 0 }, 0));
    assert_eq!((hit.entry_t, hit.exit_t), (1.0, 2.0));
    // A line in the plane that two sections share belongs to exactly one of them, in either
    // direction.
    let upper = section([1.0, 0.0, 0.0], UNIT, [2; 3]);
    for direction in [DVec3::Y, -DVec3::Z, DVec3::new(0.0, 0.3, 0.4)] {
        let origin = DVec3::new(1.0, 0.3, 0.3);
        let lower = section([0.0; 3], UNIT, [2; 3]).line(origin, direction);
        assert_eq!(lower.is_some() as u8 + upper.line(origin, direction).is_some() as u8, 1);
    }
}

#[test]
fn lines_through_edges_and_corners_enter_and_leave_by_different_walls() {
    for (origin, direction) in [
        ([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]),
        ([2.0, -1.0, 0.5], [-1.0, 1.0, 0.0]),
        ([0.0, 0.0, 0.5], [1.0, 1.0, 0.1]),
        ([0.5, 0.0, 1.0], [0.0, 1.0, -1.0]),
    ] {
        let hit = unit_line(origin, direction).unwrap();
        assert_ne!(hit.pair.entry.wall, hit.pair.exit.wall);
        assert!(hit.entry_t < hit.exit_t);
    }
    // A line that only touches an edge or a corner misses.
    assert_eq!(unit_line([-1.0, 1.0, 0.5], [1.0, -1.0, 0.0]), None);
    assert_eq!(unit_line([1.0, -1.0, 0.0], [-1.0, 1.0, -0.5]), None);
}

#[test]
fn lines_of_impossible_numbers_meet_nothing() {
    assert_eq!(unit_line([0.5; 3], [0.0; 3]), None);
    assert_eq!(unit_line([f64::NAN, 0.5, 0.5], [1.0, 0.0, 0.0]), None);
    assert_eq!(unit_line([0.5; 3], [1.0, f64::NAN, 0.0]), None);
    assert_eq!(unit_line([0.5; 3], [f64::INFINITY, 0.0, 0.0]), None);
    assert_eq!(unit_line([-1.0, 1.5, 0.5], [1.0, 0.0, 0.0]), None);
    // The length of a direction does not matter, however extreme.
    for scale in [1e-300, 1e300] {
        assert_eq!(unit_line([0.1, 0.2, 0.3], [scale, 0.0, 0.0]).unwrap().pair.exit.wall, 1);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_line_of_any_numbers_meets_a_valid_beam_or_nothing(
        origin in prop::array::uniform3(any::<f64>()),
        direction in prop::array::uniform3(any::<f64>()),
        near in prop::array::uniform3(-2.0..2.0f64), small in any::<bool>(),
    ) {
        let section = section([0.0; 3], SHEARED, [3, 4, 5]);
        let origin = DVec3::from_array(if small { near } else { origin });
        if let Some(hit) = section.line(origin, DVec3::from_array(direction)) {
            prop_assert!(section.contains_pair(hit.pair));
            prop_assert_eq!(section.cells(section.beam(hit.pair)), Some(hit.pair));
        }
    }
}
