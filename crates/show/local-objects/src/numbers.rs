//! Numbers in [0, 1) for the passes of a pixel, and directions by them.
//!
//! Invariant: over the first 2ᵏ passes, each use has one number in each interval of length 2⁻ᵏ.

use std::f32::consts::PI;

use glam::Vec3;
use holo_sobol::{SobolPair, mix, unit};

/// The numbers of one pass of one pixel.
pub(crate) struct PassNumbers {
    pixel: u32,
    /// The number of the pass with its bits reversed.
    reversed: u32,
    uses: u32,
}

impl PassNumbers {
    pub(crate) fn new(pixel: u32, pass: u32) -> PassNumbers {
        PassNumbers { pixel, reversed: pass.reverse_bits(), uses: 0 }
    }

    /// Returns the next number.
    #[inline]
    pub(crate) fn one(&mut self) -> f32 {
        self.two().0
    }

    /// Returns the next pair of numbers.
    #[inline]
    pub(crate) fn two(&mut self) -> (f32, f32) {
        self.uses += 1;
        let keys = mix(u64::from(self.pixel) << 32 | u64::from(self.uses));
        let [x, y] = SobolPair { keys }.point(self.reversed);
        (unit(x), unit(y))
    }
}

/// Returns a direction above a surface, with a probability in proportion to its cosine.
pub(crate) fn cosine_direction(normal: Vec3, (u, v): (f32, f32)) -> Vec3 {
    let (right, ahead) = normal.any_orthonormal_pair();
    let (radius, angle) = (u.sqrt(), 2.0 * PI * v);
    let up = (1.0 - u).max(0.0).sqrt();
    right * (radius * angle.cos()) + ahead * (radius * angle.sin()) + normal * up
}

/// Returns a direction in a cone around an axis, with the same probability everywhere in it.
pub(crate) fn in_cone(axis: Vec3, least_cosine: f32, (u, v): (f32, f32)) -> Vec3 {
    let cosine = 1.0 - u * (1.0 - least_cosine);
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (right, ahead) = axis.any_orthonormal_pair();
    let angle = 2.0 * PI * v;
    right * (sine * angle.cos()) + ahead * (sine * angle.sin()) + axis * cosine
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_power_of_two_of_passes_is_stratified_in_each_use() {
        for count in [4_usize, 16, 64] {
            for skipped in 0..3 {
                let (mut ones, mut twos) = (vec![0; count], vec![0; count]);
                for pass in 0..count as u32 {
                    let mut numbers = PassNumbers::new(77, pass);
                    (0..skipped).for_each(|_| _ = numbers.one());
                    ones[(numbers.one() * count as f32) as usize] += 1;
                    let side = count.isqrt() as f32;
                    let (x, y) = numbers.two();
                    twos[(y * side) as usize * side as usize + (x * side) as usize] += 1;
                }
                assert!(ones.iter().all(|&found| found == 1), "{ones:?}");
                assert!(twos.iter().all(|&found| found == 1), "{twos:?}");
            }
        }
    }
}
