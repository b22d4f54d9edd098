//! The triangulation against its definition: every cone is empty, after any insertions and removals.

use glam::DVec3;
use holo_driver_mesh::{BASE, GridDirection, HullPoint, SphereTriangulation, is_in_cone};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

fn direction(vector: [f64; 3]) -> GridDirection {
    GridDirection::nearest(DVec3::from_array(vector)).unwrap()
}

/// Returns the triangles by their directions, each from its least corner.
fn canonical(mesh: &SphereTriangulation) -> BTreeSet<[GridDirection; 3]> {
    let turned = |corners: [u32; 3]| {
        let mut corners = corners.map(|corner| mesh.direction(corner));
        let least = (0..3).min_by_key(|&at| corners[at]).unwrap();
        corners.rotate_left(least);
        corners
    };
    mesh.triangles().map(turned).collect()
}

/// Fails unless the triangles tile the sphere, none is flipped, and each edge passes the test of
/// the cone. By convexity, all cones are then empty.
fn check(mesh: &SphereTriangulation) {
    let triangles: Vec<[u32; 3]> = mesh.triangles().collect();
    let mut edges = BTreeMap::new();
    for &[a, b, c] in &triangles {
        assert!(mesh.is_left([a, b, c]), "a flipped triangle");
        for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert_eq!(edges.insert((from, to), opposite), None, "an edge has two triangles");
        }
    }
    let (v, e, f) = (mesh.vertex_count(), edges.len() / 2, triangles.len());
    assert_eq!(v + f, e + 2, "Euler's formula: {v} - {e} + {f}");
    let point = |vertex: u32| HullPoint::from(mesh.direction(vertex));
    for (&(from, to), &near) in &edges {
        let far = edges[&(to, from)];
        let [a, b, c, d] = [from, to, near, far].map(point);
        assert!(!is_in_cone(&a, &b, &c, &d), "an edge is to be swapped");
    }
}

/// Fails unless no cone of a triangle contains any vertex at all.
fn check_all(mesh: &SphereTriangulation) {
    let used: BTreeSet<u32> = mesh.triangles().flatten().collect();
    let points: Vec<HullPoint> = used.iter().map(|&vertex| mesh.direction(vertex).into()).collect();
    for corners in mesh.triangles() {
        let [a, b, c] = corners.map(|corner| HullPoint::from(mesh.direction(corner)));
        for point in &points {
            let is_corner = corners.iter().any(|&at| mesh.direction(at) == point.direction);
            assert!(is_corner || !is_in_cone(&a, &b, &c, point), "a cone is not empty");
        }
    }
}

/// A step of a test.
#[derive(Clone, Debug)]
enum Step {
    Insert([f64; 3]),
    /// Removes one of the vertices that were inserted.
    Remove(usize),
}

/// Vectors on a coarse lattice, so that many are on one circle or great circle, poles and antipodes
/// among them; and vectors that are very near to each other.
fn vector() -> impl Strategy<Value = [f64; 3]> {
    let lattice = [-3..=3_i32, -3..=3, -3..=3].prop_map(|v| v.map(f64::from));
    let near = [-1e-5..1e-5_f64, -1e-5..1e-5, 1.0..1.000_01];
    let any = [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0];
    let all = prop_oneof![3 => lattice, 1 => near, 2 => any];
    all.prop_filter("no direction", |v| v.iter().any(|&c| c != 0.0))
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![2 => vector().prop_map(Step::Insert), 1 => (0..64_usize).prop_map(Step::Remove)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_cones_are_empty_after_any_insertions_and_removals(
        steps in proptest::collection::vec(step(), 1..80)
    ) {
        let mut mesh = SphereTriangulation::new();
        let mut inserted: Vec<u32> = Vec::new();
        for step in &steps {
            match step {
                Step::Insert(vector) => {
                    let vertex = mesh.insert(direction(*vector));
                    assert_eq!(mesh.direction(vertex), direction(*vector));
                    if vertex >= BASE && !inserted.contains(&vertex) {
                        inserted.push(vertex);
                    }
                }
                Step::Remove(at) if !inserted.is_empty() => {
                    mesh.remove(inserted.swap_remove(at % inserted.len()));
                }
                Step::Remove(_) => {}
            }
            check(&mesh);
            assert_eq!(mesh.vertex_count(), BASE as usize + inserted.len());
        }
        check_all(&mesh);
        // The same directions, in another order, make the same triangles.
        let mut again = SphereTriangulation::new();
        let mut left: Vec<GridDirection> =
            inserted.iter().map(|&vertex| mesh.direction(vertex)).collect();
        left.sort_unstable();
        left.into_iter().for_each(|direction| { again.insert(direction); });
        prop_assert_eq!(canonical(&mesh), canonical(&again));
    }
}

#[test]
fn the_icosahedron_has_twenty_faces() {
    let mesh = SphereTriangulation::new();
    check(&mesh);
    check_all(&mesh);
    assert_eq!((mesh.vertex_count(), mesh.triangles().count()), (12, 20));
}

#[test]
fn coincident_directions_at_any_distance_are_one_vertex() {
    let mut mesh = SphereTriangulation::new();
    let near = mesh.insert(direction([3e-8, 4e-8, 5e-8]));
    assert_eq!(mesh.insert(direction([3e9, 4e9, 5e9])), near);
    assert_eq!(mesh.insert(direction([-3e9, -4e9, -5e9])), near + 1);
    check(&mesh);
    assert_eq!(mesh.vertex_count(), 14);
}

#[test]
fn a_corner_of_the_icosahedron_is_found_and_stays() {
    let mut mesh = SphereTriangulation::new();
    let corner = mesh.insert(mesh.direction(3));
    mesh.remove(corner);
    check(&mesh);
    assert_eq!((corner, mesh.vertex_count()), (3, 12));
}

#[test]
fn a_dense_regular_grid_is_triangulated_and_taken_out_again() {
    let mut mesh = SphereTriangulation::new();
    let empty = canonical(&mesh);
    let mut vertices = BTreeSet::new();
    for face in 0..8 {
        for x in 0..=24 {
            for y in 0..=24 - x {
                vertices.insert(mesh.insert(GridDirection::on_face(face, x << 14, y << 14)));
            }
        }
    }
    check(&mesh);
    vertices.iter().for_each(|&vertex| mesh.remove(vertex));
    check(&mesh);
    assert_eq!(canonical(&mesh), empty);
}
