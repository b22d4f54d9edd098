//! Look-ups of rays that leave the object beside the centre.
//!
//! The texels' depths are a surface around the centre. A look-up follows the ray to this surface,
//! and takes the light of the point that it meets. With `q` the point relative to the centre and
//! `I` the inverse depth in its direction, `depth(q) · I - 1` is negative before the surface and
//! positive behind it. On a plane it is linear along the ray, so the secant method is exact there.
//! Before the sky it is -1.
//!
//! A ray that passes behind an edge meets nothing there. It is taken to see what is beyond the
//! edge.

use crate::cube::{CubeAnswer, CubeLight, ReflectionCube};
use crate::face::{FACE_AXES, FacePoint, depth};
use glam::Vec3;
use std::ops::RangeInclusive;

/// Most points of a ray that are compared with the depths.
const MOST_STEPS: usize = 6;

/// Relative difference of depth, in texels, at which a ray meets the surface.
const CLOSE: f32 = 0.25;

/// Relative difference of depth at which a ray meets a curved surface when the search ends.
const NEARLY: f32 = 0.1;

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
        if self.is_marked(self.grid().texel_of(direction)) {
            return CubeAnswer::MustTrace;
        }
        let (towards, distance) = self.seen(origin, direction);
        let point = FacePoint::of(towards);
        let (mut angle, most) = (spread.start().max(self.spread_of(0)), *spread.end());
        loop {
            if let Some(radiance) = self.blurred(angle, point) {
                let own = || {
                    let inverse = self.inverse_depth(towards).unwrap_or(0.0);
                    towards.length() / (depth(towards) * inverse)
                };
                return CubeAnswer::Light(CubeLight {
                    radiance,
                    distance: distance.unwrap_or_else(own),
                    spread: angle,
                    count: self.count_of(self.grid().texel_of(towards)),
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
        let blurred = |level| Some(self.smooth(level, point)?.inverse_depth);
        let sharp = self.inverse_depth_between(point);
        sharp.or_else(|| (1..=self.levels().len()).find_map(blurred))
    }

    /// Returns the direction from the centre to what a ray sees that leaves the object at `origin`
    /// in a unit direction. It is a unit vector.
    #[must_use]
    #[inline]
    pub fn direction_seen(&self, origin: Vec3, direction: Vec3) -> Vec3 {
        self.seen(origin, direction).0.normalize_or(direction)
    }

    /// Returns how far a point is behind the surface.
    #[inline]
    fn behind(&self, point: Vec3) -> Option<f32> {
        Some(depth(point) * self.inverse_depth(point)? - 1.0)
    }

    /// Returns the point where a ray meets the surface of depths, relative to the centre, and its
    /// distance along the ray. If the ray leaves for the sky or nothing is known, it is the
    /// direction without a distance.
    fn seen(&self, origin: Vec3, direction: Vec3) -> (Vec3, Option<f32>) {
        let from = origin - self.centre();
        let nowhere = (direction, None);
        if from == Vec3::ZERO {
            return nowhere;
        }
        let Some(inverse) = self.inverse_depth(direction) else { return nowhere };
        // The first guess is exact on planes that face the centre's axes, as walls often do.
        let [axis, ..] = FACE_AXES[FacePoint::of(direction).face];
        let guess = (1.0 / inverse - from.dot(axis)) / direction.dot(axis);
        let is_ahead = guess > 0.0 && guess.is_finite();
        let mut distance = if is_ahead { guess } else { 2.0 * from.length() };
        let close = CLOSE / self.grid().resolution() as f32;
        let here = self.behind(from).unwrap_or(-1.0);
        let mut before = RayPoint { distance: 0.0, behind: here.min(-close) };
        let mut after: Option<RayPoint> = None;
        let mut last: Option<RayPoint> = None;
        for _ in 0..MOST_STEPS {
            let point = from + distance * direction;
            let Some(behind) = self.behind(point) else { return nowhere };
            let here = RayPoint { distance, behind };
            if behind.abs() < close {
                return (point, Some(distance));
            }
            match behind < 0.0 {
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
            let farther = || distance / (1.0 + behind).max(0.25);
            distance = by_last.or(by_ends).unwrap_or_else(farther);
            last = Some(here);
        }
        let at = |end: RayPoint| (from + end.distance * direction, Some(end.distance));
        let Some(after) = after else {
            return if -before.behind < NEARLY { at(before) } else { nowhere };
        };
        if after.behind.min(-before.behind) < NEARLY {
            return at(if -before.behind < after.behind { before } else { after });
        }
        // The farther side of an edge has the lesser inverse depth.
        let far = |end: RayPoint| self.inverse_depth(at(end).0).unwrap_or(0.0);
        (at(if far(before) < far(after) { before } else { after }).0, None)
    }
}
