//! A view as the three dot products that projection takes, in f32, relative to the points' origin.
//!
//! Always true: a point is mapped to a pixel only if it is in front of the eye and all its numbers are finite.

use glam::DVec3;
use holo_picture::View;

/// Distance at which things infinitely far away are kept: far enough that no walk moves them, with room for products in f32.
const FAR: f64 = 1e15;
/// Smallest depth that is in front of the eye: its reciprocal is finite.
pub(super) const NEAREST: f32 = 1e-30;

/// Position for something infinitely far away, relative to any origin.
pub(super) fn far_away(direction: DVec3) -> DVec3 {
    direction.normalize_or_zero() * FAR
}

/// Column, row and depth of a point are `x·p/z·p`, `y·p/z·p` and `z·p`, with `p` = (position, 1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Map {
    pub x: [f32; 4],
    pub y: [f32; 4],
    pub z: [f32; 4],
}

impl Map {
    /// `width` and `height` are the picture's in pixels, perhaps a fraction of the view's.
    pub fn new(view: &View, origin: DVec3, width: f64, height: f64) -> Self {
        let (tan_x, tan_y) = view.tan_half();
        let forward = view.vd;
        let eye = view.vp - origin;
        let row = |axis: DVec3| {
            let offset = -axis.dot(eye);
            [axis.x as f32, axis.y as f32, axis.z as f32, offset as f32]
        };
        Self {
            x: row(view.right() * (0.5 * width / tan_x) + forward * (0.5 * width)),
            y: row(view.up() * (-0.5 * height / tan_y) + forward * (0.5 * height)),
            z: row(forward),
        }
    }

    /// Column, row and depth; meaningless unless the depth is at least [`NEAREST`].
    #[inline(always)]
    pub fn project(&self, p: [f32; 3]) -> (f32, f32, f32) {
        let dot = |row: &[f32; 4]| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
        let depth = dot(&self.z);
        let inverse = 1.0 / depth;
        (dot(&self.x) * inverse, dot(&self.y) * inverse, depth)
    }
}
