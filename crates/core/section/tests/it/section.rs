//! Sections: refused specifications, default grids, distances.

use crate::common::{Rng, SHEARED, UNIT, scaled, section, spec};
use holo_section::{DVec3, Section, SectionError, ViewClass, ray_eye_distance};

#[test]
fn bad_specifications_are_refused_with_their_reason() {
    let refused = |origin, axes, grid| Section::new(spec(origin, axes, grid)).unwrap_err();
    assert!(matches!(refused([f64::NAN, 0.0, 0.0], UNIT, [4; 3]), SectionError::Coordinate(_)));
    assert!(matches!(
        refused([0.0; 3], scaled(UNIT, f64::INFINITY), [4; 3]),
        SectionError::Coordinate(_)
    ));
    assert!(matches!(refused([0.0; 3], scaled(UNIT, 1e200), [4; 3]), SectionError::Coordinate(_)));
    assert_eq!(refused([0.0; 3], UNIT, [4, 0, 4]), SectionError::Grid([4, 0, 4]));
    assert_eq!(refused([0.0; 3], UNIT, [4, 4, 65]), SectionError::Grid([4, 4, 65]));
    for axes in [
        [[0.0; 3]; 3],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
        [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1e-7]],
        scaled(UNIT, 1e-300),
    ] {
        assert!(
            matches!(refused([0.0; 3], axes, [4; 3]), SectionError::Degenerate { .. }),
            "{axes:?}"
        );
    }
    let error = refused([1e12, 0.0, 0.0], scaled(UNIT, 1e-3), [4; 3]);
    assert!(matches!(error, SectionError::Unresolved { .. }));
    assert!(error.to_string().contains("move the scene nearer"), "{error}");
}

#[test]
fn default_grids_have_near_cubic_cells_and_the_recommended_number_of_beams() {
    let mut rng = Rng(20);
    for _ in 0..2000 {
        let lengths = [0; 3].map(|_| rng.between(-3.0, 3.0).exp());
        let axes = [[lengths[0], 0.0, 0.0], [0.0, lengths[1], 0.0], [0.0, 0.0, lengths[2]]];
        let grid = Section::default_grid(axes);
        assert!(grid.iter().all(|n| (4..=24).contains(n)));
        let beams = section([0.0; 3], axes, grid).beam_count();
        assert!((50_000..=500_000).contains(&beams), "{lengths:?}: {grid:?} has {beams}");
        // Except at the limits of 4 and 24, cells are cubes up to rounding.
        if grid.iter().all(|n| (5..24).contains(n)) {
            let edges = [0, 1, 2].map(|i| lengths[i] / f64::from(grid[i]));
            let ratio = edges.into_iter().fold(0.0, f64::max)
                / edges.into_iter().fold(f64::INFINITY, f64::min);
            assert!(ratio < 1.25, "{lengths:?}: {grid:?}");
        }
    }
    let cube = Section::default_grid(UNIT);
    assert_eq!(cube, [cube[0]; 3]);
    for odd in [0.0, f64::NAN, f64::INFINITY] {
        assert!(Section::default_grid(scaled(UNIT, odd)).iter().all(|n| (4..=24).contains(n)));
    }
}

#[test]
fn the_diagonal_is_the_longest_of_the_four() {
    assert!((section([0.0; 3], UNIT, [4; 3]).diagonal() - 3f64.sqrt()).abs() < 1e-15);
    let sheared = section([0.0; 3], [[1.0, 0.0, 0.0], [-0.9, 1.0, 0.0], [0.0, 0.0, 1.0]], [4; 3]);
    assert!((sheared.diagonal() - (1.9f64 * 1.9 + 1.0 + 1.0).sqrt()).abs() < 1e-15);
    assert!((sheared.volume() - 1.0).abs() < 1e-15);
}

#[test]
fn local_coordinates_invert_and_contain_the_inside() {
    let mut rng = Rng(21);
    let section = section([10.0, -20.0, 30.0], SHEARED, [4; 3]);
    for _ in 0..10_000 {
        let local =
            DVec3::new(rng.between(-1.0, 2.0), rng.between(-1.0, 2.0), rng.between(-1.0, 2.0));
        let world = section.local_to_world(local);
        assert!((section.world_to_local(world) - local).length() < 1e-13);
        assert_eq!(
            section.contains(world),
            local.cmpge(DVec3::ZERO).all() && local.cmple(DVec3::ONE).all()
        );
    }
}

#[test]
fn tracing_starts_at_the_exit_wall_only_for_interior_sections_without_obstructions() {
    for (class, obstructions, at_exit) in [
        (ViewClass::Interior, true, false),
        (ViewClass::Interior, false, true),
        (ViewClass::Exterior, true, false),
        (ViewClass::Exterior, false, false),
    ] {
        let mut given = spec([0.0; 3], UNIT, [4; 3]);
        (given.class, given.obstructions) = (class, obstructions);
        let section = Section::new(given).unwrap();
        let mut rng = Rng(23);
        let ray = section.ray(rng.pair(&section), rng.coords());
        assert_eq!(section.trace_start(&ray), if at_exit { ray.length } else { 0.0 });
    }
}

#[test]
fn the_distance_of_a_ray_from_an_eye_is_its_lines() {
    let section = section([0.0; 3], UNIT, [1; 3]);
    let hit = section.line(DVec3::new(0.5, 0.5, -1.0), DVec3::Z).unwrap();
    let ray = section.ray(hit.pair, hit.coords);
    // The ray runs along z through (½ + ½ step, ½ + ½ step). Eyes are beside it and far behind it.
    let off = 0.5 + 0.5 / 256.0;
    assert!((ray_eye_distance(&ray, DVec3::new(off + 0.3, off - 0.4, -50.0)) - 0.5).abs() < 1e-12);
}
