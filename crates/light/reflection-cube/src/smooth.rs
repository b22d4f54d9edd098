//! Smooth look-ups in a cube and its levels, also across the edges of faces.

use crate::cube::ReflectionCube;
use crate::face::FacePoint;
use crate::levels::{LevelTexel, WeightedTexels};
use glam::Vec3;

/// Least share of a look-up's weights that must be of valid texels. The nearest texel alone has a
/// quarter or more.
const LEAST_VALID: f32 = 0.24;

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
        let resolution = self.resolution() >> level;
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

    /// Returns the columns and rows of the four texels of a level around a point, with their weights
    /// in a linear interpolation. They may be beyond the edge of the face.
    #[inline]
    fn places_around(&self, level: usize, point: FacePoint) -> [((i32, i32), f32); 4] {
        let side = (self.resolution() >> level) as f32;
        let at = |place: f32| 0.5 * (place + 1.0) * side - 0.5;
        let (x, y) = (at(point.across), at(point.down));
        let (left, top) = (x.floor(), y.floor());
        let (right_share, below_share) = (x - left, y - top);
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, below)| {
            let across = if right == 1 { right_share } else { 1.0 - right_share };
            let down = if below == 1 { below_share } else { 1.0 - below_share };
            ((left as i32 + right, top as i32 + below), across * down)
        })
    }

    /// Returns the four texels around a direction of any length except 0, with their weights in a
    /// linear interpolation of values at the middles of texels. The weights add up to 1.
    #[must_use]
    #[inline]
    pub fn texels_around(&self, direction: Vec3) -> [(usize, f32); 4] {
        let point = FacePoint::of(direction);
        self.places_around(0, point).map(|(place, weight)| {
            let middle = FacePoint::middle(point.face, place, self.resolution());
            (self.texel_of(middle.direction()), weight)
        })
    }

    /// Returns the mean of the four texels of a level around a point, each by its weight and its
    /// valid share. `None` if too little is valid there.
    #[inline]
    pub(crate) fn smooth(&self, level: usize, point: FacePoint) -> Option<LevelTexel> {
        let mut sum = WeightedTexels::default();
        for (place, weight) in self.places_around(level, point) {
            sum.add(&self.texel_around(level, point.face, place), weight);
        }
        // Blocks of a level count fully if they know anything: a mean of few texels is a mean.
        let least = if level == 0 { LEAST_VALID } else { f32::MIN_POSITIVE };
        Some(sum.mean(1.0)).filter(|mean| mean.valid >= least)
    }

    /// Returns the mean over an angle around a point, radians, between two levels. `None` if
    /// nothing is known there.
    pub(crate) fn blurred(&self, spread: f32, point: FacePoint) -> Option<LevelTexel> {
        let level = (spread / self.spread_of(0)).max(1.0).log2();
        let level = level.min(self.levels().len() as f32);
        let (sharp, more) = (level.floor() as usize, level.fract());
        if more == 0.0 {
            return self.smooth(sharp, point);
        }
        let blurry = self.smooth(sharp + 1, point)?;
        let Some(sharp) = self.smooth(sharp, point) else { return Some(blurry) };
        let mix = |one: f32, other: f32| one + more * (other - one);
        Some(LevelTexel {
            radiance: [0, 1, 2].map(|c| mix(sharp.radiance[c], blurry.radiance[c])),
            inverse_depth: mix(sharp.inverse_depth, blurry.inverse_depth),
            valid: mix(sharp.valid, blurry.valid),
        })
    }
}
