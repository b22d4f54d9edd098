//! Blurrier levels of a cube: means of its texels.

use crate::face::{FACES, solid_angle};

/// A texel of a level, or a mean of several.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LevelTexel {
    /// Mean radiance of the valid part.
    pub radiance: [f32; 3],
    /// Mean of 1 / depth of the valid part.
    pub inverse_depth: f32,
    /// The share that is valid, from 0 to 1.
    pub valid: f32,
}
const _: () = assert!(size_of::<LevelTexel>() == 20);

/// Means of blocks of texels.
#[derive(Clone, Debug)]
pub(crate) struct CubeLevel {
    resolution: u32,
    /// Empty until the level is made for the first time: not every cube is looked up with a blur.
    texels: Vec<LevelTexel>,
}

/// Sums weighted texels.
#[derive(Default)]
pub(crate) struct WeightedTexels {
    radiance: [f32; 3],
    inverse_depth: f32,
    weight: f32,
}

impl WeightedTexels {
    #[inline]
    pub fn add(&mut self, texel: &LevelTexel, weight: f32) {
        let weight = weight * texel.valid;
        (0..3).for_each(|c| self.radiance[c] += weight * texel.radiance[c]);
        self.inverse_depth += weight * texel.inverse_depth;
        self.weight += weight;
    }

    /// Returns the mean, whose weights would have the sum `whole` if everything were valid.
    #[inline]
    pub fn mean(self, whole: f32) -> LevelTexel {
        if self.weight <= 0.0 {
            return LevelTexel::default();
        }
        let scale = 1.0 / self.weight;
        LevelTexel {
            radiance: self.radiance.map(|c| scale * c),
            inverse_depth: scale * self.inverse_depth,
            valid: self.weight / whole,
        }
    }
}

impl CubeLevel {
    /// Returns all levels below a resolution, without light.
    pub fn all_below(resolution: u32) -> Vec<CubeLevel> {
        let halved = |side: &u32| (*side > 1).then_some(side / 2);
        let level = |resolution: u32| CubeLevel { resolution, texels: Vec::new() };
        std::iter::successors(halved(&resolution), halved).map(level).collect()
    }

    /// Sets a face to the means of four texels each of the finer level. Returns the face.
    pub fn average(&mut self, face: usize, finer: &[LevelTexel]) -> Vec<LevelTexel> {
        let side = self.resolution as usize;
        self.texels.resize(FACES * side * side, LevelTexel::default());
        let own = &mut self.texels[face * side * side..][..side * side];
        for (number, texel) in own.iter_mut().enumerate() {
            let (column, row) = (number % side, number / side);
            let (mut sum, mut whole) = (WeightedTexels::default(), 0.0);
            for (right, below) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (x, y) = (2 * column + right, 2 * row + below);
                let weight = solid_angle((x as u32, y as u32), 2 * self.resolution);
                sum.add(&finer[2 * side * y + x], weight);
                whole += weight;
            }
            *texel = sum.mean(whole);
        }
        own.to_vec()
    }

    /// Returns a texel.
    #[inline]
    pub fn texel(&self, face: usize, (column, row): (u32, u32)) -> LevelTexel {
        let side = self.resolution as usize;
        let number = (face * side + row as usize) * side + column as usize;
        self.texels.get(number).copied().unwrap_or_default()
    }
}
