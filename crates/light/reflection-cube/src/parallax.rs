//! Look-ups of rays that leave the object beside the centre.
//!
//! The texels' depths are a surface around the centre. A look-up follows the ray to this surface,
//! and takes the light of the point that it meets. With `q` the point relative to the centre and
//! `I` the inverse depth in its direction, `depth(q) · I - 1` is negative before the surface and
//! positive behind it. On a plane it is linear along the ray, so the secant method is exact there.

use crate::cube::{CubeAnswer, CubeLight, ReflectionCube};
use crate::face::{FacePoint, depth};
use glam::Vec3;
use std::ops::RangeInclusive;

/// Most points of a ray that are compared with the depths.
const MOST_STEPS: usize = 6;

/// Relative difference of depth, in texels, at which the search ends.
const CLOSE: f32 = 0.25;

/// A point of a ray before or behind the surface.
#[derive(Clone, Copy)]
struct RayPoint {
    distance: f32,
    /// Relative depth behind the surface; negative before it.
    behind: f32,
}

impl RayPoint {
    /// Returns where the line through two points reaches the surface.
    fn secant(self, other: RayPoint) -> f32 {
        let slope = (other.behind - self.behind) / (other.distance - self.distance);
        self.distance - self.behind / slope
    }
}

impl ReflectionCube {
    /// Returns the light along a ray that leaves the object at `origin` in a unit direction.
    ///
    /// The light is averaged over the least angle of `spread`, radians. Where no texel is valid
    /// within this angle, it is averaged over the least larger angle that knows something, up to
    /// the end of the range.
    #[must_use]
    pub fn look_up(
        &self,
        origin: Vec3,
        direction: Vec3,
        spread: RangeInclusive<f32>,
    ) -> CubeAnswer {
        if self.is_marked(self.texel_of(direction)) {
            return CubeAnswer::MustTrace;
        }
        let from = origin - self.centre();
        let (towards, distance) =
            if from == Vec3::ZERO { (direction, None) } else { self.met(from, direction) };
        let point = FacePoint::of(towards);
        let (mut angle, most) = (spread.start().max(self.spread_of(0)), *spread.end());
        loop {
            if let Some(texel) = self.blurred(angle, point) {
                let own = || towards.length() / (depth(towards) * texel.inverse_depth);
                return CubeAnswer::Light(CubeLight {
                    radiance: texel.radiance,
                    distance: distance.unwrap_or_else(own),
                    spread: angle,
                });
            }
            angle *= 2.0;
            if angle > most.min(self.spread_of(self.levels().len())) {
                return CubeAnswer::Unknown;
            }
        }
    }

    /// Returns the inverse depth in a direction, from the sharpest level that knows it.
    fn inverse_depth(&self, towards: Vec3) -> Option<f32> {
        let point = FacePoint::of(towards);
        (0..=self.levels().len()).find_map(|level| Some(self.smooth(level, point)?.inverse_depth))
    }

    /// Returns the point where a ray meets the surface of depths, relative to the centre, and its
    /// distance along the ray. If the ray leaves for the sky or nothing is known, it is the
    /// direction without a distance.
    fn met(&self, from: Vec3, direction: Vec3) -> (Vec3, Option<f32>) {
        let nowhere = (direction, None);
        let Some(inverse) = self.inverse_depth(direction).filter(|inverse| *inverse > 0.0) else {
            return nowhere;
        };
        // The first guess is exact on planes that face the centre's axes, as walls often do.
        let face = FacePoint::of(direction);
        let axis = FacePoint { across: 0.0, down: 0.0, ..face }.direction();
        let guess = (1.0 / inverse - from.dot(axis)) / direction.dot(axis);
        if !(guess > 0.0 && guess.is_finite()) {
            return nowhere;
        }
        let close = CLOSE / self.resolution() as f32;
        let mut before = RayPoint { distance: 0.0, behind: -1.0 };
        let mut after: Option<RayPoint> = None;
        let mut last: Option<RayPoint> = None;
        let mut distance = guess;
        for _ in 0..MOST_STEPS {
            let point = from + distance * direction;
            let Some(inverse) = self.inverse_depth(point) else { return nowhere };
            let here = RayPoint { distance, behind: depth(point) * inverse - 1.0 };
            if here.behind.abs() < close {
                break;
            }
            match here.behind < 0.0 {
                true => before = here,
                false => after = Some(here),
            }
            let is_between = |distance: &f32| {
                *distance > before.distance
                    && after.is_none_or(|after| *distance < after.distance)
                    && distance.is_finite()
            };
            let by_last = last.map(|last| last.secant(here)).filter(is_between);
            let by_ends = after.map(|after| before.secant(after)).filter(is_between);
            let farther = || distance / (1.0 + here.behind).max(0.1);
            distance = by_last.or(by_ends).unwrap_or_else(farther);
            last = Some(here);
        }
        (from + distance * direction, Some(distance))
    }
}
