//! Smooth look-ups in a cube and its levels, also across the edges of faces.

use crate::cube::ReflectionCube;
use crate::face::FacePoint;
use crate::levels::{LevelTexel, WeightedTexels};

/// Least share of a look-up's weights that must be of valid texels. The nearest texel alone has a
/// quarter or more.
const LEAST_VALID: f32 = 0.24;

/// Relative difference of the inverse depths of texels that show one surface.
const ONE_SURFACE: f32 = 0.1;

impl ReflectionCube {
    /// Returns a texel of a level.
    #[inline]
    fn texel_at(&self, level: usize, face: usize, (column, row): (u32, u32)) -> LevelTexel {
        match level.checked_sub(1) {
            None => self.finest(face, (column, row)),
            Some(above) => self.levels()[above].texel(face, (column, row)),
        }
    }

    /// Returns a texel of a level. Beyond the edge of the face, it is a texel of another face, with
    /// the depth that this face would give it.
    #[inline]
    fn texel_around(
        &self,
        level: usize,
        face: usize,
        at @ (column, row): (i32, i32),
    ) -> LevelTexel {
        let resolution = self.grid().resolution() >> level;
        let inside = 0..resolution as i32;
        if inside.contains(&column) && inside.contains(&row) {
            return self.texel_at(level, face, (column as u32, row as u32));
        }
        let beyond = FacePoint::middle(face, at, resolution);
        let other = FacePoint::of(beyond.direction());
        let texel = self.texel_at(level, other.face, other.texel(resolution));
        let closer = beyond.across.abs().max(beyond.down.abs());
        LevelTexel { inverse_depth: closer * texel.inverse_depth, ..texel }
    }

    /// Returns the mean of the four texels of a level around a point, each by its weight and its
    /// valid share. `None` if too little is valid there.
    #[inline]
    pub(crate) fn smooth(&self, level: usize, point: FacePoint) -> Option<LevelTexel> {
        let mut sum = WeightedTexels::default();
        for (place, weight) in point.around(self.grid().resolution() >> level) {
            sum.add(&self.texel_around(level, point.face, place), weight);
        }
        // Blocks of a level count fully if they know anything: a mean of few texels is a mean.
        let least = if level == 0 { LEAST_VALID } else { f32::MIN_POSITIVE };
        Some(sum.mean(1.0)).filter(|mean| mean.valid >= least)
    }

    /// Returns the inverse depth at a point: interpolated between the four texels around it, or
    /// that of the nearest where they show several surfaces. `None` if too little is valid there.
    #[inline]
    pub(crate) fn inverse_depth_between(&self, point: FacePoint) -> Option<f32> {
        let around = point.around(self.grid().resolution()).map(|(place, weight)| {
            let texel = self.texel_around(0, point.face, place);
            (texel.inverse_depth, weight * texel.valid)
        });
        let valid: f32 = around.iter().map(|(_, weight)| weight).sum();
        if valid < LEAST_VALID {
            return None;
        }
        let known = around.iter().filter(|(_, weight)| *weight > 0.0);
        let (least, most) = known.fold((f32::INFINITY, 0.0_f32), |(least, most), (inverse, _)| {
            (least.min(*inverse), most.max(*inverse))
        });
        if most - least <= ONE_SURFACE * most {
            return Some(
                around.iter().map(|(inverse, weight)| inverse * weight).sum::<f32>() / valid,
            );
        }
        let nearest = around.iter().max_by(|one, other| one.1.total_cmp(&other.1));
        nearest.map(|(inverse, _)| *inverse)
    }

    /// Returns the mean radiance over an angle around a point, radians, between two levels. `None`
    /// if nothing is known there.
    pub(crate) fn blurred(&self, spread: f32, point: FacePoint) -> Option<[f32; 3]> {
        let level = (spread / self.spread_of(0)).max(1.0).log2();
        let level = level.min(self.levels().len() as f32);
        let (sharp, more) = (level.floor() as usize, level.fract());
        let radiance = |level| Some(self.smooth(level, point)?.radiance);
        if more == 0.0 {
            return radiance(sharp);
        }
        let blurry = radiance(sharp + 1)?;
        let Some(sharp) = radiance(sharp) else { return Some(blurry) };
        Some([0, 1, 2].map(|c| sharp[c] + more * (blurry[c] - sharp[c])))
    }
}
