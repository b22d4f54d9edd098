//! Distinguishes jumps in depth from slanted surfaces: whether two samples may lie on one surface.
//!
//! Invariant: rays that hit nothing see one surface behind all others.

use crate::Quadtree;

/// Least relative difference of depths that is a jump (Larson & Simmons 1999, §2.4.4): 2 %.
const STEP: f32 = 0.02;
/// Tangent of the largest angle between a ray and a surface's normal, 75 degrees. From one pixel to
/// the next, depth then changes by so many widths of a pixel's footprint.
const STEEPEST: f32 = 3.7;
/// Relative difference that is a jump at any distance between two samples.
const MOST: f32 = 0.1;

/// Distinguishes jumps from slants in a view.
pub(super) struct DepthSteps<'a>(pub &'a Quadtree);

impl DepthSteps<'_> {
    /// Returns the largest relative difference of depths of one surface at a distance of `apart`
    /// pixels.
    fn slant(&self, depth: f32, apart: f32) -> f32 {
        STEP + STEEPEST * self.0.pixel_share(depth) * apart
    }

    /// Returns whether two samples `apart` pixels apart may lie on one surface.
    pub fn is_one_surface(&self, depth: f32, other: f32, apart: f32) -> bool {
        let (near, far) = (depth.min(other), depth.max(other));
        if far.is_infinite() {
            return near.is_infinite();
        }
        far - near <= near * self.slant(near, apart).min(MOST)
    }

    /// Returns whether the first of two samples `apart` pixels apart lies on a surface in front of
    /// the other's.
    pub fn is_in_front(&self, front: f32, depth: f32, apart: f32) -> bool {
        front.is_finite() && (depth - front > front * self.slant(front, apart))
    }

    /// Returns whether a sample at depth `front` may be in front of one at `depth`, at any distance
    /// between them.
    pub fn may_be_in_front(&self, front: f32, depth: f32) -> bool {
        depth - front > front * STEP
    }
}
