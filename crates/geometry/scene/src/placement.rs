//! Affine maps from a mesh's coordinates to the scene's.
//!
//! Invariant: a corner's place is the same bits wherever it is computed. It is made by fixed
//! operations in f64, and rounded once.

use glam::{DVec3, Vec3};

use crate::shading::{Octahedral, from_octahedral};
use crate::smooth;

/// Bound on the stretch of a [`Placement`], on that of its inverse, and on their product.
///
/// It keeps the rounding of an inverse far below that of f32, and all numbers of a ray in a mesh's
/// coordinates far from the limits of f32. Models in millimetres have 1000.
pub const MAX_STRETCH: f64 = 1e6;

/// An affine map from a mesh's coordinates to the scene's, which are relative to its origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    rows: [[f64; 4]; 3],
    inverse: [[f64; 3]; 3],
    is_mirrored: bool,
}

impl Placement {
    /// Makes a placement of its rows. Row i gives coordinate i: factors to x, y and z, and a sum.
    /// `None` if the map is not finite or stretches beyond [`MAX_STRETCH`], as flat ones do.
    #[must_use]
    pub fn new(rows: [[f64; 4]; 3]) -> Option<Placement> {
        if !rows.as_flattened().iter().all(|number| number.is_finite()) {
            return None;
        }
        let [a, b, c] = rows.map(|[x, y, z, _]| DVec3::new(x, y, z));
        let columns = [b.cross(c), c.cross(a), a.cross(b)];
        let determinant = a.dot(columns[0]);
        let inverse = [0, 1, 2].map(|axis| columns.map(|column| column[axis] / determinant));
        let (stretch, shrink) = (greatest(rows.map(|[x, y, z, _]| [x, y, z])), greatest(inverse));
        // False for NaN.
        let fits =
            stretch <= MAX_STRETCH && shrink <= MAX_STRETCH && stretch * shrink <= MAX_STRETCH;
        fits.then_some(Placement { rows, inverse, is_mirrored: determinant < 0.0 })
    }

    /// Returns the rows.
    #[must_use]
    pub fn rows(&self) -> &[[f64; 4]; 3] {
        &self.rows
    }

    /// Returns the rows of the inverse for directions.
    #[must_use]
    pub fn inverse(&self) -> &[[f64; 3]; 3] {
        &self.inverse
    }

    /// Returns whether it turns a right hand into a left one. The second and third corner of each
    /// triangle are then exchanged, so that fronts stay fronts.
    #[must_use]
    #[inline]
    pub fn is_mirrored(&self) -> bool {
        self.is_mirrored
    }

    /// Returns the place of a point.
    #[must_use]
    #[inline]
    pub fn point(&self, point: [f32; 3]) -> Vec3 {
        Vec3::from_array(self.rows.map(|row| coordinate(&row, point)))
    }

    /// Returns the corners of a triangle, or their attributes, in the scene's order.
    #[inline]
    pub(crate) fn ordered<T>(&self, [a, b, c]: [T; 3]) -> [T; 3] {
        if self.is_mirrored { [a, c, b] } else { [a, b, c] }
    }

    /// Returns the normals of a triangle's corners in the scene's coordinates and order. `corners`
    /// are its places in the mesh.
    pub(crate) fn normals(
        &self,
        corners: [[f32; 3]; 3],
        normals: [Octahedral; 3],
    ) -> [Octahedral; 3] {
        if !smooth::is_curved(&normals) {
            return normals;
        }
        let [a, b, c] = corners.map(|corner| Vec3::from(corner).as_dvec3());
        let facet = self.normal((b - a).cross(c - a)).normalize_or_zero();
        let placed = normals.map(|normal| {
            self.normal(from_octahedral(normal).as_dvec3()).normalize_or_zero().as_vec3()
        });
        smooth::packed(facet, self.ordered(placed))
    }

    /// Returns a normal in the scene's coordinates, with another length.
    fn normal(&self, normal: DVec3) -> DVec3 {
        // By the transpose of the inverse.
        let [a, b, c] = self.inverse.map(DVec3::from_array);
        a * normal.x + b * normal.y + c * normal.z
    }
}

/// Returns a coordinate of a placed point by a row of the placement.
#[must_use]
#[inline(always)]
pub fn coordinate(row: &[f64; 4], [x, y, z]: [f32; 3]) -> f32 {
    (row[0] * f64::from(x) + row[1] * f64::from(y) + row[2] * f64::from(z) + row[3]) as f32
}

/// Returns the greatest factor by which a map may enlarge a vector's greatest coordinate.
#[must_use]
pub fn greatest(rows: [[f64; 3]; 3]) -> f64 {
    // `max` would drop a NaN.
    let sums = rows.map(|row| row.iter().map(|c| c.abs()).sum::<f64>());
    sums.into_iter().fold(0.0, |most, sum| if sum <= most { most } else { sum })
}
