//! Chance: whether a ray meets a surface that is there with a probability.
//!
//! Invariants:
//! - The answer is a function of the ray and the triangle. So all queries along a ray agree.
//! - Over rays, the share that meets a surface is its opacity, and answers for different triangles
//!   are independent.

use glam::Vec3;

use crate::{Hit, Ray};

/// Returns a number in [0, 1) that depends on all bits of these words.
fn uniform(words: [u32; 7], salt: u64) -> f32 {
    let mut state = salt;
    for word in words {
        // The finalizer of splitmix64.
        state = (state ^ u64::from(word)).wrapping_add(0x9e37_79b9_7f4a_7c15);
        state = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        state = (state ^ state >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        state ^= state >> 31;
    }
    (state >> 40) as f32 / (1 << 24) as f32
}

/// Returns whether a ray meets a triangle that is there with probability `opacity`.
pub(crate) fn meets(ray: &Ray, triangle: u32, opacity: f32) -> bool {
    let [a, b, c] = ray.origin.to_array().map(f32::to_bits);
    let [d, e, f] = ray.direction.to_array().map(f32::to_bits);
    uniform([a, b, c, d, e, f, triangle], 1) < opacity
}

/// Returns whether a ray that hits a surface in `direction` meets the share `share` of it. Use it
/// for surfaces that are one of two things.
#[must_use]
pub fn is_in_share(hit: &Hit, direction: Vec3, share: f32) -> bool {
    let [d, e, f] = direction.to_array().map(f32::to_bits);
    uniform([hit.u.to_bits(), hit.v.to_bits(), hit.t.to_bits(), d, e, f, hit.triangle], 2) < share
}
