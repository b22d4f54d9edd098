//! Division of polygons into triangles.
//!
//! The triangles have the polygon's winding and use only its corners, so that neighbours still
//! share edges. If a fan from the first corner covers the polygon, the fan is used. Other simple
//! polygons, with bridges to holes too, are divided by cutting ears. For all others a fan is used
//! and the caller is informed.

use glam::{DVec2, DVec3};

/// Most corners of a polygon whose ears are cut; the time may grow with their cube.
const MAX_EAR_CORNERS: usize = 1024;

/// Appends triangles as indices into `corners` (at least three). Returns false if the polygon
/// crosses itself or is too long to be divided properly; then the triangles may overlap.
pub(crate) fn triangulate(corners: &[DVec3], triangles: &mut Vec<[usize; 3]>) -> bool {
    let fan = |triangles: &mut Vec<[usize; 3]>| {
        triangles.extend((2..corners.len()).map(|k| [0, k - 1, k]))
    };
    if corners.len() == 3 {
        fan(triangles);
        return true;
    }
    let normal = newell_normal(corners);
    let forwards = |k: usize| {
        let (first, last) = (corners[k - 1] - corners[0], corners[k] - corners[0]);
        // Corners on an edge turn neither way, and rounding must not make them turn backwards.
        let rounding = 8.0 * f64::EPSILON * first.length() * last.length() * normal.length();
        first.cross(last).dot(normal) >= -rounding
    };
    if (2..corners.len()).all(forwards) {
        fan(triangles);
        return true;
    }
    if corners.len() > MAX_EAR_CORNERS {
        fan(triangles);
        return false;
    }
    cut_ears(&project(corners, normal), triangles)
}

/// Returns the normal of a polygon, planar or not, whose length is twice its area (Newell).
fn newell_normal(corners: &[DVec3]) -> DVec3 {
    // Relative to a corner, so that nothing cancels far from the origin.
    let relative = |k: usize| corners[k % corners.len()] - corners[0];
    (0..corners.len()).map(|k| relative(k).cross(relative(k + 1))).sum()
}

/// Projects the polygon onto the coordinate plane that it faces most, so that it runs
/// counter-clockwise.
fn project(corners: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    let size = normal.abs();
    let up = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let (mut u, mut v) = ((up + 1) % 3, (up + 2) % 3);
    if normal[up] < 0.0 {
        std::mem::swap(&mut u, &mut v);
    }
    corners.iter().map(|p| DVec2::new(p[u] - corners[0][u], p[v] - corners[0][v])).collect()
}

fn cut_ears(points: &[DVec2], triangles: &mut Vec<[usize; 3]>) -> bool {
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut at = 0;
    let mut tried = 0;
    while left.len() > 3 {
        let n = left.len();
        let ear = [left[(at + n - 1) % n], left[at % n], left[(at + 1) % n]];
        if is_ear(points, &left, ear) {
            triangles.push(ear);
            left.remove(at % n);
            // Advance by one: alternate corners give better triangles than a fan.
            at = (at + 1) % (n - 1);
            tried = 0;
            continue;
        }
        at = (at + 1) % n;
        tried += 1;
        if tried == n {
            triangles.extend((2..n).map(|k| [left[0], left[k - 1], left[k]]));
            return false;
        }
    }
    triangles.push([left[0], left[1], left[2]]);
    true
}

fn is_ear(points: &[DVec2], left: &[usize], ear: [usize; 3]) -> bool {
    let [a, b, c] = ear.map(|k| points[k]);
    let side = |from: DVec2, to: DVec2, p: DVec2| (to - from).perp_dot(p - from);
    if side(a, b, c) <= 0.0 {
        return false;
    }
    // Both ends of a bridge to a hole lie at the same point, and must not block each other.
    let blocks = |p: DVec2| {
        p != a
            && p != b
            && p != c
            && side(a, b, p) >= 0.0
            && side(b, c, p) >= 0.0
            && side(c, a, p) >= 0.0
    };
    !left.iter().any(|&k| !ear.contains(&k) && blocks(points[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn doubled_areas(corners: &[DVec3], triangles: &[[usize; 3]]) -> Vec<DVec3> {
        triangles
            .iter()
            .map(|t| (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]))
            .collect()
    }

    /// Checks that triangles cover the polygon once: all have its winding, and their areas sum to
    /// its area.
    fn assert_covers(corners: &[DVec3]) {
        let mut triangles = Vec::new();
        assert!(triangulate(corners, &mut triangles));
        assert_eq!(triangles.len(), corners.len() - 2);
        let normal = newell_normal(corners);
        let areas = doubled_areas(corners, &triangles);
        for area in &areas {
            assert!(area.dot(normal) >= -1e-12 * normal.length_squared(), "{triangles:?}");
        }
        let sum: f64 = areas.iter().map(|a| a.length()).sum();
        assert!((sum - normal.length()).abs() <= 1e-9 * normal.length(), "{sum} {normal}");
    }

    #[test]
    fn an_arrowhead_is_covered_from_whichever_corner_it_begins() {
        let arrow =
            [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0]].map(|[x, y]| DVec3::new(x, 3.0, y));
        for first in 0..4 {
            let mut turned = arrow;
            turned.rotate_left(first);
            assert_covers(&turned);
            turned.reverse();
            assert_covers(&turned);
        }
    }

    #[test]
    fn a_square_with_a_bridged_hole_is_covered() {
        let ring = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ];
        assert_covers(&ring.map(|[x, y]| DVec3::new(y, x, 1.0)));
    }

    #[test]
    fn a_polygon_that_crosses_itself_is_reported() {
        let bow =
            [[0.0, 0.0], [3.0, 3.0], [3.0, 0.0], [0.0, 2.0], [1.0, -4.0], [-2.0, 1.0], [4.0, 1.0]];
        let mut triangles = Vec::new();
        assert!(!triangulate(&bow.map(|[x, y]| DVec3::new(x, y, 0.0)), &mut triangles));
        assert_eq!(triangles.len(), 5);
    }

    proptest! {
        /// Polygons that are star-shaped around a point, mostly concave, in any plane.
        #[test]
        fn star_shaped_polygons_are_covered(
            radii in prop::collection::vec(0.1..10.0f64, 4..40),
            x in prop::array::uniform3(-1.0..1.0f64),
            y in prop::array::uniform3(-1.0..1.0f64),
            centre in prop::array::uniform3(-100.0..100.0f64),
        ) {
            let (x, y) = (DVec3::from_array(x), DVec3::from_array(y));
            prop_assume!(x.cross(y).length() > 0.01);
            let step = std::f64::consts::TAU / radii.len() as f64;
            let corner = |(k, r): (usize, &f64)| {
                let (sin, cos) = (k as f64 * step).sin_cos();
                DVec3::from_array(centre) + x * (r * cos) + y * (r * sin)
            };
            assert_covers(&radii.iter().enumerate().map(corner).collect::<Vec<_>>());
        }
    }
}
