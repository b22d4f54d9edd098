//! Directions as integers, and the two predicates of the triangulation.
//!
//! A direction is an integer point of the octahedron |x| + |y| + |z| = 2²⁰. So equal directions are
//! equal numbers, and barycentric coordinates on a face of the octahedron need no division.
//!
//! The triangulation is the convex hull of the directions as unit vectors (the Delaunay
//! triangulation on the sphere). A unit vector is the integer point over its length, which is
//! rounded to 2⁻⁴¹ of a step. With that, both predicates are exact in integers.
//!
//! Invariants:
//! - The rounding moves no vector by more than 2⁻⁶⁰ of its length. Two directions differ by at
//!   least 2⁻²⁰, so each is a corner of the hull: 2⁻⁴³ above the plane of its neighbours.
//! - No four directions are on one circle: of those that are, the greatest one (in the order of its
//!   coordinates) counts as an infinitesimal bit nearer to the centre. So the triangulation of a
//!   set of directions is unique.

use std::cmp::Ordering;

use glam::DVec3;

/// Bits of a coordinate.
pub const BITS: u32 = 20;
/// The sum of the coordinates' absolute values.
pub const STEPS: i32 = 1 << BITS;
/// Fraction bits of lengths. A length has 61 bits and a determinant 60, so that the sum of four
/// products fits into 128 bits.
const LENGTH_FRACTION: u32 = 41;

/// A direction: coordinates whose absolute values have the sum `STEPS`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GridDirection([i32; 3]);

/// A direction with its length, for predicates.
#[derive(Clone, Copy, Debug)]
pub struct HullPoint {
    /// The direction.
    pub direction: GridDirection,
    /// Length of the integer vector, in 2⁻⁴¹ of a step, rounded down.
    length: u64,
}

impl GridDirection {
    /// Returns the direction nearest to a vector of any length. `None` for zero, infinity and NaN.
    pub fn nearest(vector: DVec3) -> Option<GridDirection> {
        let largest = vector.abs().max_element();
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        let shares = vector.abs() / largest;
        let steps = f64::from(STEPS) / shares.element_sum();
        let x = (shares.x * steps).round() as i32;
        let y = ((shares.y * steps).round() as i32).min(STEPS - x);
        Some(Self::on_face(Self::face_of(vector), x, y))
    }

    /// Returns the direction on a face with these first two coordinates, without signs. Their sum
    /// is at most `STEPS`.
    pub fn on_face(face: usize, x: i32, y: i32) -> GridDirection {
        let sign = |axis: usize| if face >> axis & 1 == 1 { -1 } else { 1 };
        GridDirection([x * sign(0), y * sign(1), (STEPS - x - y) * sign(2)])
    }

    /// Returns the face of the octahedron: a bit for each negative coordinate.
    pub fn face(self) -> usize {
        (0..3).map(|axis| usize::from(self.0[axis] < 0) << axis).sum()
    }

    /// Returns the first two coordinates on the face, without signs.
    pub fn place(self) -> [i32; 2] {
        [self.0[0].abs(), self.0[1].abs()]
    }

    /// Returns the unit vector.
    pub fn unit(self) -> DVec3 {
        DVec3::from_array(self.0.map(f64::from)).normalize()
    }

    fn face_of(vector: DVec3) -> usize {
        let negative = |axis: usize| usize::from(vector[axis] < 0.0) << axis;
        negative(0) | negative(1) | negative(2)
    }
}

impl From<GridDirection> for HullPoint {
    fn from(direction: GridDirection) -> HullPoint {
        let squares = direction.0.map(|coordinate| u128::from(coordinate.unsigned_abs()).pow(2));
        let squared: u128 = squares.iter().sum();
        HullPoint { direction, length: (squared << (2 * LENGTH_FRACTION)).isqrt() as u64 }
    }
}

/// Returns the determinant of three directions: positive if they are counterclockwise, seen from
/// outside the sphere; 0 on a great circle.
pub fn determinant(a: &HullPoint, b: &HullPoint, c: &HullPoint) -> i64 {
    let [a, b, c] = [a, b, c].map(|point| point.direction.0.map(i64::from));
    // Each product is below 2⁶⁰, and each bracket below 2⁶¹.
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// Returns whether `d` is in the cone through the counterclockwise directions `a`, `b` and `c`
/// (Larson & Simmons 1999, Figure 8c).
pub fn is_in_cone(a: &HullPoint, b: &HullPoint, c: &HullPoint, d: &HullPoint) -> bool {
    let terms = [
        (a, determinant(b, c, d)),
        (b, -determinant(a, c, d)),
        (c, determinant(a, b, d)),
        (d, -determinant(a, b, c)),
    ];
    let product =
        |(point, factor): &(&HullPoint, i64)| i128::from(point.length) * i128::from(*factor);
    let volume: i128 = terms.iter().map(product).sum();
    match volume.cmp(&0) {
        Ordering::Greater => true,
        Ordering::Less => false,
        Ordering::Equal => {
            let moved = terms.iter().filter(|(_, factor)| *factor != 0);
            moved.max_by_key(|(point, _)| point.direction).is_some_and(|(_, factor)| *factor > 0)
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(x: f64, y: f64, z: f64) -> HullPoint {
        GridDirection::nearest(DVec3::new(x, y, z)).unwrap().into()
    }

    #[test]
    fn a_direction_is_within_a_step_of_its_vector_at_any_length() {
        for length in [1e-300, 1e-7, 1.0, 1e9, 1e300] {
            let vector = DVec3::new(0.3, -0.5, 0.812);
            let direction = GridDirection::nearest(vector * length).unwrap();
            assert!(direction.unit().angle_between(vector) < 2.0 / f64::from(STEPS), "{length}");
            assert_eq!(direction.face(), 2);
        }
        for none in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
            assert_eq!(GridDirection::nearest(none), None);
        }
    }

    #[test]
    fn poles_and_signed_zeros_are_one_direction() {
        let pole = GridDirection::nearest(DVec3::new(0.0, 0.0, 2.0)).unwrap();
        assert_eq!(pole, GridDirection::nearest(DVec3::new(-0.0, -0.0, 1.0)).unwrap());
        assert_eq!(pole, GridDirection::on_face(pole.face(), 0, 0));
    }

    #[test]
    fn a_circle_contains_a_fifth_direction_only_by_the_rule_of_ties() {
        // Four directions at one height.
        let [a, b, c, d] =
            [(3.0, 0.0), (0.0, 3.0), (-3.0, 0.0), (0.0, -3.0)].map(|(x, y)| point(x, y, 4.0));
        // Exactly one of the two diagonals is right.
        assert_ne!(is_in_cone(&a, &b, &c, &d), is_in_cone(&b, &c, &d, &a));
        assert!(is_in_cone(&a, &b, &c, &point(0.0, 0.0, 1.0)));
        assert!(!is_in_cone(&a, &b, &c, &point(0.0, 0.0, -1.0)));
    }

    proptest! {
        #[test]
        fn the_cone_is_the_same_for_every_rotation_of_its_corners(
            numbers in proptest::collection::vec(-1.0..1.0_f64, 12)
        ) {
            let all: Vec<HullPoint> =
                numbers.chunks(3).map(|n| point(n[0], n[1], n[2] + 1e-9)).collect();
            let [a, mut b, mut c, d] = [all[0], all[1], all[2], all[3]];
            if determinant(&a, &b, &c) < 0 {
                std::mem::swap(&mut b, &mut c);
            }
            let is_in = is_in_cone(&a, &b, &c, &d);
            prop_assert_eq!(is_in, is_in_cone(&b, &c, &a, &d));
            let [u, v, w, x] = [a, b, c, d].map(|point| point.direction.unit());
            let height = (v - u).cross(w - u).normalize_or_zero().dot(x - u);
            prop_assert!(height.abs() < 1e-9 || is_in == (height > 0.0), "{height}");
        }
    }
}
