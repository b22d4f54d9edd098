//! Numbers in [0, 1) for the passes of a pixel, and directions by them: the first two dimensions of
//! Sobol's sequence, shuffled and scrambled for each use (Burley 2020, "Practical hash-based Owen scrambling").
//!
//! Invariant: over the first 2ᵏ passes, each use has one number in each interval of length 2⁻ᵏ.

use std::f32::consts::PI;

use glam::Vec3;
use holo_display::mix;

/// The numbers of one pass of one pixel.
pub(crate) struct PassNumbers {
    pixel: u32,
    pass: u32,
    uses: u32,
}

impl PassNumbers {
    pub(crate) fn new(pixel: u32, pass: u32) -> PassNumbers {
        PassNumbers { pixel, pass, uses: 0 }
    }

    /// Returns the next number.
    #[inline]
    pub(crate) fn one(&mut self) -> f32 {
        let (index, seed) = self.next_use();
        unit(scrambled(index.reverse_bits(), seed))
    }

    /// Returns the next pair of numbers.
    #[inline]
    pub(crate) fn two(&mut self) -> (f32, f32) {
        let (index, seed) = self.next_use();
        let first = unit(scrambled(index.reverse_bits(), seed));
        (first, unit(scrambled(second_dimension(index), mix(seed, 1))))
    }

    /// Returns the shuffled number of the pass, and a seed, for the next use.
    #[inline]
    fn next_use(&mut self) -> (u32, u32) {
        self.uses += 1;
        let seed = mix(self.pixel, self.uses);
        (scrambled(self.pass, seed), mix(seed, 2))
    }
}

/// Scrambles a number so that each bit depends on the higher ones.
#[inline]
fn scrambled(x: u32, seed: u32) -> u32 {
    // A hash whose bits depend on the lower ones (Laine & Karras 2011).
    let mut x = x.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47c_u32, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

/// Returns the second number of Sobol's sequence.
#[inline]
fn second_dimension(mut index: u32) -> u32 {
    let (mut number, mut direction) = (0, 1_u32 << 31);
    while index != 0 {
        if index & 1 != 0 {
            number ^= direction;
        }
        index >>= 1;
        direction ^= direction >> 1;
    }
    number
}

#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / (1 << 24) as f32
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
