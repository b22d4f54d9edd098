//! Tests whether a triangle meets the interior of a parallelepiped, by separating axes.
//!
//! In its own coordinates the parallelepiped is the unit cube. A triangle and an open cube are
//! disjoint (touching allowed) exactly if one of 13 directions separates them. These are the cube's
//! 3 face normals, the triangle's normal, and the 9 products of an edge of one with an edge of the
//! other (Akenine-Möller 2001).

use glam::{DMat3, DVec3};

/// The interior of a parallelepiped, slightly shrunk.
pub(crate) struct OpenBox {
    /// Maps coordinates relative to `corner` to those of the unit cube.
    to_local: DMat3,
    corner: DVec3,
    /// Half the sides in local coordinates: ½ each, minus the rounding.
    half: DVec3,
}

impl OpenBox {
    /// Makes the box. `None` if it has no interior: no volume, not finite, or thinner than twice
    /// `rounding` (in world units).
    pub(crate) fn new(corner: DVec3, axes: [DVec3; 3], rounding: f64) -> Option<OpenBox> {
        let matrix = DMat3::from_cols(axes[0], axes[1], axes[2]);
        let to_local = matrix.inverse_or_zero();
        if !(corner.is_finite() && matrix.is_finite() && to_local.is_finite())
            || to_local == DMat3::ZERO
        {
            return None;
        }
        // If a point moves by `rounding` in every world coordinate, each local one changes by this
        // much.
        let rows = to_local.transpose();
        let moved = |row: DVec3| rounding * row.abs().element_sum();
        let slack = DVec3::new(moved(rows.x_axis), moved(rows.y_axis), moved(rows.z_axis));
        let half = DVec3::splat(0.5) - slack;
        (half.min_element() > 0.0).then_some(OpenBox { to_local, corner, half })
    }

    /// Returns whether a triangle, in the coordinates of `corner`, meets the interior.
    pub(crate) fn meets(&self, triangle: [DVec3; 3]) -> bool {
        let [a, b, c] = triangle.map(|p| self.to_local * (p - self.corner) - 0.5);
        let beyond = |axis: DVec3| {
            let (pa, pb, pc) = (axis.dot(a), axis.dot(b), axis.dot(c));
            let reach = axis.abs().dot(self.half);
            pa.min(pb).min(pc) >= reach || pa.max(pb).max(pc) <= -reach
        };
        // The cube's faces first, because they reject nearly all triangles.
        if [DVec3::X, DVec3::Y, DVec3::Z].into_iter().any(beyond) {
            return false;
        }
        let edges = [b - a, c - b, a - c];
        let separated = |axis: DVec3| axis != DVec3::ZERO && beyond(axis);
        let by_edges = edges
            .iter()
            .any(|edge| [DVec3::X, DVec3::Y, DVec3::Z].iter().any(|u| separated(u.cross(*edge))));
        !by_edges && !separated(edges[0].cross(edges[1]))
    }
}
