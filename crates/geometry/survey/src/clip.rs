//! Clips polygons to a box (Sutherland & Hodgman 1974).

use glam::DVec3;

/// Returns the part of a triangle within the box from zero to `size`. It is empty, or a convex
/// polygon of up to nine corners.
pub(crate) fn to_box(triangle: [DVec3; 3], size: DVec3) -> Vec<DVec3> {
    let inside = |p: &DVec3| p.cmpge(DVec3::ZERO).all() && p.cmple(size).all();
    if triangle.iter().all(inside) {
        return triangle.to_vec();
    }
    let mut polygon = triangle.to_vec();
    for axis in 0..3 {
        polygon = cut(&polygon, |p| p[axis]);
        polygon = cut(&polygon, |p| size[axis] - p[axis]);
    }
    polygon
}

/// Returns the part of a convex polygon in which `height` is at least 0.
fn cut(polygon: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &to) in polygon.iter().enumerate() {
        let from = polygon[(i + polygon.len() - 1) % polygon.len()];
        let (a, b) = (height(from), height(to));
        if (a >= 0.0) != (b >= 0.0) {
            kept.push(from + (to - from) * (a / (a - b)));
        }
        if b >= 0.0 {
            kept.push(to);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_part_within_the_box_is_left() {
        let floor = [[-10.0, -10.0], [30.0, -10.0], [-10.0, 30.0]];
        let polygon = to_box(floor.map(|[x, y]| DVec3::new(x, y, 0.5)), DVec3::ONE);
        assert_eq!(polygon.len(), 4);
        assert!(polygon.iter().all(|p| (0.0..=1.0).contains(&p.x) && (0.0..=1.0).contains(&p.y)));
        let beside = floor.map(|[x, y]| DVec3::new(x, y, 2.0));
        assert!(to_box(beside, DVec3::ONE).is_empty());
    }
}
