//! Tests that the answer "no" about a shaft is never wrong, and not too rare.
#![allow(clippy::expect_used, reason = "a test fails by it")]

use crate::common::{Mesh, Random};
use glam::{DVec3, Vec3};
use holo_raycast::{Raycaster, Shaft};

/// Returns a parallelogram from a corner and two edges.
fn parallelogram(corner: DVec3, u: DVec3, v: DVec3) -> [DVec3; 4] {
    [corner, corner + u, corner + u + v, corner + v]
}

fn random_shaft(random: &mut Random) -> Shaft {
    let mut vector = |size: f32| (random.cube() * size).as_dvec3();
    let from = parallelogram(vector(2.0), vector(0.4), vector(0.4));
    let through = parallelogram(vector(2.0), vector(0.4), vector(0.4));
    Shaft { from, through, between: random.next().is_multiple_of(2) }
}

/// Traces random rays of a shaft as a worker does, in world coordinates, and returns the first hit.
fn some_hit(
    raycaster: &Raycaster,
    shaft: &Shaft,
    rays: usize,
    random: &mut Random,
) -> Option<DVec3> {
    (0..rays).find_map(|_| {
        let mut point = |corners: &[DVec3; 4]| {
            let (mut s, mut t) = (f64::from(random.unit()), f64::from(random.unit()));
            // Mostly near the edges, where an inexact plane would show.
            if random.next().is_multiple_of(2) {
                (s, t) = (s.round(), t.round());
            }
            corners[0] + (corners[1] - corners[0]) * s + (corners[3] - corners[0]) * t
        };
        let (from, to) = (point(&shaft.from), point(&shaft.through));
        let direction = (to - from).normalize_or_zero();
        let origin = if shaft.between { from } else { to };
        let (ray, _) = raycaster.localize(origin, direction)?;
        raycaster.nearest(&ray).map(|_| direction)
    })
}

#[test]
fn a_shaft_that_may_not_hit_has_no_ray_that_does() {
    let mut random = Random(1);
    let (mut unseen, mut missed) = (0, 0);
    for round in 0..60 {
        let mesh = match round % 4 {
            0 => Mesh::soup(3 + random.below(40), 0.3, &mut random),
            1 => Mesh::sphere(2, random.cube(), 0.3),
            // A few triangles larger than the shafts, and slivers.
            2 => Mesh::soup(2, 3.0, &mut random),
            _ => Mesh::sliver_box(Vec3::new(0.3, 0.2, 0.4), 1, 20),
        };
        let raycaster = mesh.raycaster();
        for _ in 0..150 {
            let shaft = random_shaft(&mut random);
            let may = raycaster.may_hit(&shaft);
            let hit = some_hit(&raycaster, &shaft, if may { 100 } else { 400 }, &mut random);
            assert!(may || hit.is_none(), "round {round}: {shaft:?} meets something along {hit:?}");
            unseen += usize::from(!may);
            missed += usize::from(may && hit.is_none());
        }
    }
    assert!(unseen > 2000, "{unseen}");
    // Some of the others have a ray that hits and was not tried, or touch the shaft.
    assert!(
        missed * 8 < unseen,
        "{missed} shafts that seem to meet nothing are not recognised, {unseen} are"
    );
}

#[test]
fn a_triangle_that_barely_touches_a_shaft_is_met() {
    let shaft = Shaft {
        from: parallelogram(DVec3::ZERO, DVec3::X, DVec3::Y),
        through: parallelogram(DVec3::Z, DVec3::X, DVec3::Y),
        between: false,
    };
    // At z = 3 the shaft extends from -2 to 3. A triangle has a corner just inside or just outside.
    let with_corner_at = |x: f32, z: f32| {
        let mut mesh = Mesh::default();
        mesh.push([Vec3::new(x, 0.5, z), Vec3::new(x + 3.0, 0.0, z), Vec3::new(x + 3.0, 1.0, z)]);
        mesh.raycaster().may_hit(&shaft)
    };
    assert!(with_corner_at(3.0, 3.0));
    assert!(with_corner_at(2.999, 3.0));
    assert!(!with_corner_at(3.01, 3.0));
    // Objects between or before the parallelograms count only on request.
    assert!(!with_corner_at(0.5, 0.5) && !with_corner_at(0.5, -1.0));
    let mut mesh = Mesh::default();
    mesh.push([Vec3::new(0.5, 0.5, 0.5), Vec3::new(3.0, 0.0, 0.5), Vec3::new(3.0, 1.0, 0.5)]);
    assert!(mesh.raycaster().may_hit(&Shaft { between: true, ..shaft }));
}

#[test]
fn degenerate_and_infinite_shafts_get_an_answer() {
    let mut random = Random(5);
    let raycaster = Mesh::soup(50, 0.5, &mut random).raycaster();
    let point = [DVec3::ONE * 3.0; 4];
    let _ = raycaster.may_hit(&Shaft { from: point, through: point, between: true });
    let line = parallelogram(DVec3::ZERO, DVec3::X, DVec3::X);
    assert!(raycaster.may_hit(&Shaft { from: line, through: line, between: true }));
    let bad = parallelogram(DVec3::splat(f64::NAN), DVec3::X, DVec3::Y);
    assert!(raycaster.may_hit(&Shaft { from: bad, through: point, between: false }));
    let nothing = Mesh::default();
    let empty = Raycaster::build(nothing.scene()).expect("built");
    assert!(!empty.may_hit(&random_shaft(&mut random)));
}
