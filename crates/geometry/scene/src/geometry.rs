//! Triangles as arrays, and what follows from their corners alone.

use crate::SceneError;
use crate::limits::{MAX_COORDINATE, MAX_POSITIONS, MAX_TRIANGLES};
use glam::{DVec3, Vec3};

/// Triangles as a scene stores them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry<'a> {
    /// Corners of triangles.
    pub positions: &'a [[f32; 3]],
    /// Three indices into `positions` for each triangle.
    pub triangles: &'a [[u32; 3]],
    /// An index into the scene's materials for each triangle.
    pub material_ids: &'a [u32],
}

/// Returns the least and greatest corner of triangles in world coordinates.
pub(crate) fn world_bounds(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
) -> Result<(DVec3, DVec3), SceneError> {
    check_limit("positions", positions.len(), MAX_POSITIONS)?;
    check_limit("triangles", triangles.len(), MAX_TRIANGLES)?;
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (triangle, corners) in triangles.iter().enumerate() {
        for &index in corners {
            let count = positions.len();
            let &position = positions.get(index as usize).ok_or(SceneError::PositionIndex {
                triangle,
                index,
                count,
            })?;
            if !(position.abs().max_element() <= MAX_COORDINATE && position.is_finite()) {
                return Err(SceneError::Position(index as usize));
            }
            low = low.min(position);
            high = high.max(position);
        }
    }
    Ok((low, high))
}

pub(crate) fn check_limit(
    what: &'static str,
    count: usize,
    limit: usize,
) -> Result<(), SceneError> {
    if count > limit {
        return Err(SceneError::Limit { what, count: count as u64, limit: limit as u64 });
    }
    Ok(())
}

/// Returns the normal of a triangle, whose length is twice its area. `None` if that is zero within
/// the rounding of `f64`.
pub(crate) fn doubled_area_normal([a, b, c]: [Vec3; 3]) -> Option<DVec3> {
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    // Each component is a difference of two products, with an error below 4 half units of
    // |ab|·|ac|.
    let rounding = 2.0 * f64::EPSILON * ab.length() * ac.length();
    (normal.length() > rounding).then_some(normal)
}
