//! Where depth jumps: which of two samples' depths may be of one surface.
//!
//! Invariant: what met nothing is one surface, beyond all others.

use crate::Quadtree;

/// Difference from which on depths jump (Larson & Simmons 1999, §2.4.4): 2 %.
const STEP: f32 = 0.02;
/// Tangent of the angle to its normal under which a surface may be seen: it falls away by so many pixels' widths from one to the next.
/// 75 degrees.
const STEEPEST: f32 = 3.7;
/// Differences that are a jump however far apart two samples are.
const MOST: f32 = 0.1;

/// Tells jumps from slants, in a view.
pub(crate) struct Steps<'a>(pub &'a Quadtree);

impl Steps<'_> {
    /// By how much, as a share, depths of one surface differ at most at a distance of `apart` pixels.
    fn slant(&self, depth: f32, apart: f32) -> f32 {
        STEP + STEEPEST * self.0.pixel_share(depth) * apart
    }

    /// Whether two samples so many pixels apart may be of one surface.
    pub fn is_one_surface(&self, depth: f32, other: f32, apart: f32) -> bool {
        let (near, far) = (depth.min(other), depth.max(other));
        if far.is_infinite() {
            return near.is_infinite();
        }
        far - near <= near * self.slant(near, apart).min(MOST)
    }

    /// Whether the first of two samples so many pixels apart is of a surface in front of the other's.
    pub fn is_in_front(&self, front: f32, depth: f32, apart: f32) -> bool {
        front.is_finite() && (depth - front > front * self.slant(front, apart))
    }

    /// Whether something at the first depth may be in front of something at the other, however near they are.
    pub fn may_be_in_front(&self, front: f32, depth: f32) -> bool {
        depth - front > front * STEP
    }
}
