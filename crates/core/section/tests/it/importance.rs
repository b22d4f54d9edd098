//! Importance against an independent convex hull, and the order of beams.

use crate::common::{SHEARED, UNIT, chi2, chi2_limit, section};
use holo_section::{BeamId, BeamOrder, CellIndex, DVec3, ImportanceTable, Section};
use std::collections::HashSet;

fn corners(section: &Section, cell: CellIndex) -> [DVec3; 4] {
    let (u, v) = cell.directions();
    let n = section.spec().grid.map(f64::from);
    [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(du, dv)| {
        let mut local = DVec3::ZERO;
        local[cell.axis()] = f64::from(cell.side());
        local[u] = f64::from(cell.u + du) / n[u];
        local[v] = f64::from(cell.v + dv) / n[v];
        section.local_to_world(local)
    })
}

/// Returns the area of the convex hull of coplanar points, by Andrew's monotone chain in the plane.
fn planar_hull_area(points: &[DVec3], normal: DVec3) -> f64 {
    let (x, y) = normal.any_orthonormal_pair();
    let mut flat: Vec<(f64, f64)> = points.iter().map(|p| (p.dot(x), p.dot(y))).collect();
    flat.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let turn = |a: (f64, f64), b: (f64, f64), c: (f64, f64)| {
        (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0)
    };
    let chain = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut hull: Vec<(f64, f64)> = Vec::new();
        for p in points {
            while hull.len() >= 2 && turn(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut flat.iter().copied());
    hull.extend(chain(&mut flat.iter().rev().copied()));
    (0..hull.len())
        .map(|i| (hull[i], hull[(i + 1) % hull.len()]))
        .map(|(a, b)| a.0 * b.1 - a.1 * b.0)
        .sum::<f64>()
        / 2.0
}

/// Returns the volume of the convex hull. It tries every plane through three points: a facet has
/// all other points on one side.
fn hull_volume(mut points: Vec<DVec3>) -> f64 {
    let scale = points.iter().map(|&p| (p - points[0]).length()).fold(0.0, f64::max);
    let mut distinct: Vec<DVec3> = Vec::new();
    points.retain(|&p| {
        let new = distinct.iter().all(|&q| (p - q).length() > 1e-9 * scale);
        if new {
            distinct.push(p);
        }
        new
    });
    let centre = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut facets = HashSet::new();
    let mut volume = 0.0;
    for i in 0..points.len() {
        for j in i + 1..points.len() {
            for k in j + 1..points.len() {
                let normal = (points[j] - points[i]).cross(points[k] - points[i]);
                if normal.length() < 1e-9 * scale * scale {
                    continue;
                }
                let normal = normal.normalize();
                let side: Vec<f64> = points.iter().map(|&p| (p - points[i]).dot(normal)).collect();
                let tolerance = 1e-9 * scale;
                if side.iter().any(|&s| s > tolerance) && side.iter().any(|&s| s < -tolerance) {
                    continue;
                }
                let on: Vec<usize> =
                    (0..points.len()).filter(|&m| side[m].abs() <= tolerance).collect();
                if facets.insert(on.clone()) {
                    let on: Vec<DVec3> = on.into_iter().map(|m| points[m]).collect();
                    volume += planar_hull_area(&on, normal)
                        * (points[i] - centre).dot(normal).abs()
                        / 3.0;
                }
            }
        }
    }
    volume
}

#[test]
fn the_hull_model_knows_the_volume_of_a_cube_and_a_tetrahedron() {
    let cube = (0..8)
        .map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)))
        .collect();
    assert!((hull_volume(cube) - 1.0).abs() < 1e-12);
    assert!(
        (hull_volume(vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]) - 1.0 / 6.0).abs() < 1e-12
    );
}

#[test]
fn importance_is_the_volume_of_the_convex_hull_of_the_two_cells() {
    for section in [
        section([0.0; 3], UNIT, [4; 3]),
        section([1.0, 2.0, 3.0], SHEARED, [4; 3]),
        section([0.0; 3], SHEARED, [1, 5, 3]),
        section([-5.0, 0.0, 9.0], [[-2.0, 0.0, 0.0], [0.0, 0.0, 30.0], [0.0, 7.0, 0.0]], [2, 3, 4]),
    ] {
        let table = ImportanceTable::new(&section);
        for beam in (0..section.beam_count()).map(BeamId) {
            let pair = section.cells(beam).unwrap();
            let points = corners(&section, pair.entry)
                .into_iter()
                .chain(corners(&section, pair.exit))
                .collect();
            let (expected, found) = (hull_volume(points), table.of(pair));
            assert!(
                (expected - found).abs() < 1e-9 * expected,
                "{pair:?}: {found}, hull {expected}"
            );
        }
    }
}

#[test]
fn the_total_is_the_sum_over_all_beams() {
    for grid in [[1, 1, 1], [3, 4, 5], [12, 1, 1], [8, 8, 8]] {
        let section = section([0.0; 3], SHEARED, grid);
        let table = ImportanceTable::new(&section);
        let beams = (0..section.beam_count()).map(BeamId);
        let sum: f64 = beams.map(|beam| table.of(section.cells(beam).unwrap())).sum();
        assert!((table.total() - sum).abs() < 1e-11 * sum, "{grid:?}: {} and {sum}", table.total());
    }
}

#[test]
fn a_beam_order_visits_every_beam_once() {
    for n in (0..200).chain([255, 256, 257, 7298, 122_880]) {
        let order = BeamOrder::new(n, 42);
        let seen: HashSet<BeamId> = (0..n).map(|i| order.at(i)).collect();
        assert_eq!(seen.len() as u64, n);
        assert!(seen.iter().all(|b| b.0 < n));
        assert_eq!(order.at(n), order.at(0));
    }
    // The largest grid and greater numbers take no memory and overflow nothing.
    for n in [30 * 64u64.pow(4), u64::MAX] {
        assert!(BeamOrder::new(n, 1).at(n - 1).0 < n);
    }
}

#[test]
fn every_eighth_of_a_beam_order_is_spread_over_all_beams_and_keys_differ() {
    let n = 122_880u64;
    let (one, other) = (BeamOrder::new(n, 1), BeamOrder::new(n, 2));
    for part in 0..8 {
        let mut counts = [0u32; 240];
        for i in part * n / 8..(part + 1) * n / 8 {
            counts[(one.at(i).0 * 240 / n) as usize] += 1;
        }
        let found = chi2(&counts, n as f64 / 8.0 / 240.0);
        assert!(found < chi2_limit(239.0), "chi² {found}");
    }
    let same = (0..n).filter(|&i| one.at(i) == other.at(i)).count();
    // The number of fixed points of a random permutation is Poisson(1): above 12 once in 10¹⁰.
    assert!(same <= 12, "{same}");
}
