//! Solid surroundings: walls and furniture stop the eye, floors and stairs carry it.
//!
//! The eye is a body: a sphere that keeps a distance from surfaces, above points at the height of
//! the waist and of the knee. A body that comes to a wall slides along it. Surfaces below the eye
//! that are higher than a step are furniture, also if they are thin, like table-tops.

use glam::{DQuat, DVec3};

use crate::Pose;

/// Distance that the body keeps from walls and furniture while it walks, metres.
const RADIUS: f64 = 0.2;

/// Distance that the eye keeps from the surface that it approaches or backs up to, metres.
pub(crate) const KEPT: f64 = 0.25;

/// Highest step that a walk climbs or goes down, metres. Stairs have steps of up to 0.2 m, and
/// seats are higher than 0.35 m.
const STEP: f64 = 0.3;

/// Greatest height of an eye that walks, metres. Higher eyes fly, and nothing carries them.
const TALLEST: f64 = 2.5;

/// Longest part of a walk that is one straight line, metres: less than a stair's tread.
const STRIDE: f64 = 0.1;

/// Most straight lines of a walk. Longer walks have longer lines.
const MOST_STRIDES: f64 = 64.0;

/// Largest angle of an orbit that is one straight line, radians.
const ARC: f64 = 0.03;

/// Most times that a line is bent at walls.
const MOST_BENDS: usize = 3;

/// Turns from the way at which a stride is tried, radians.
const TURNS: [f64; 5] = [0.0, 0.8, -0.8, 1.4, -1.4];

/// A surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Distance along the ray, scene units.
    pub distance: f64,
    /// The unit normal on the side that the ray meets.
    pub normal: DVec3,
}

/// What the eye moves among.
pub trait Surroundings: std::fmt::Debug + Send + Sync {
    /// Returns the first surface along a ray of unit direction, if there is any.
    fn surface(&self, from: DVec3, towards: DVec3) -> Option<Surface>;

    /// Returns whether a point is in the house, about.
    fn is_in_house(&self, point: DVec3) -> bool;
}

/// A body that moves among surroundings, in a scene with `metre` units to a metre.
#[derive(Clone, Copy)]
pub(crate) struct Body<'a> {
    pub world: &'a dyn Surroundings,
    pub metre: f64,
}

impl Body<'_> {
    /// Returns where a walk from one pose to another ends. Walls bend it, and floors carry it.
    pub fn walk(&self, from: &Pose, to: Pose) -> Pose {
        let way = to.eye - from.eye;
        let rise = from.up * way.dot(from.up);
        let level = way - rise;
        let strides = (level.length() / (STRIDE * self.metre)).ceil().clamp(1.0, MOST_STRIDES);
        let mut eye = from.eye;
        for _ in 0..strides as usize {
            eye = self.stride(eye, level / strides, from.up);
        }
        Pose { eye: self.stop(eye, rise, RADIUS), ..to }
    }

    /// Returns where a straight line from one pose to another ends. It stops before a wall.
    pub fn fly(&self, from: &Pose, to: Pose) -> Pose {
        Pose { eye: self.stop(from.eye, to.eye - from.eye, KEPT), ..to }
    }

    /// Moves around a point in small parts, up to a wall. `part` returns the pose after a share of
    /// the motion.
    pub fn orbit(&self, from: Pose, angle: f64, part: impl Fn(f64) -> Pose) -> Pose {
        let parts = (angle.abs() / ARC).ceil().clamp(1.0, 256.0) as usize;
        let mut pose = from;
        for number in 1..=parts {
            let next = part(number as f64 / parts as f64);
            let way = next.eye - pose.eye;
            let reached = self.stop(pose.eye, way, KEPT);
            if reached.distance(next.eye) > 1e-6 * way.length() {
                return pose;
            }
            pose = next;
        }
        pose
    }

    /// Returns the end of a way that stops at this many metres before a surface.
    fn stop(&self, from: DVec3, way: DVec3, metres: f64) -> DVec3 {
        let length = way.length();
        let Some(towards) = way.try_normalize() else { return from };
        let free = self.free(from, towards, metres * self.metre).map_or(length, |(free, _)| free);
        from + towards * free.min(length)
    }

    /// Returns the distance after which a ray is this near to a surface, and the surface's normal.
    fn free(&self, from: DVec3, towards: DVec3, radius: f64) -> Option<(f64, DVec3)> {
        let Surface { distance, normal } = self.world.surface(from, towards)?;
        // Along a slanting ray, the surface is near earlier.
        let facing = (-normal.dot(towards)).clamp(0.05, 1.0);
        Some(((distance - radius / facing).max(0.0), normal))
    }

    /// Makes one stride on the level plane, and follows the floor. Before furniture, it turns
    /// aside.
    fn stride(&self, from: DVec3, way: DVec3, up: DVec3) -> DVec3 {
        let height = self.height(from, up);
        let carried = height.filter(|height| *height <= TALLEST * self.metre);
        for turn in TURNS {
            let way = DQuat::from_axis_angle(up, turn) * way * turn.cos();
            let to = self.slide(from, way, up, carried);
            let Some(before) = carried else { return to };
            let ahead = way.normalize_or_zero() * (RADIUS * self.metre);
            let is_high = |eye: DVec3| {
                self.height(eye, up).is_some_and(|after| before - after > STEP * self.metre)
            };
            if is_high(to) || is_high(to + ahead) {
                continue;
            }
            let after = self.height(to, up).unwrap_or(before);
            return match (after - before).abs() <= STEP * self.metre {
                // A low ceiling above a step stops the climb.
                true => self.stop(to, up * (before - after), RADIUS.min(before / self.metre)),
                false => to,
            };
        }
        from
    }

    /// Returns the end of a way on the level plane that walls bend.
    fn slide(&self, from: DVec3, way: DVec3, up: DVec3, carried: Option<f64>) -> DVec3 {
        let radius = RADIUS * self.metre;
        let (mut eye, mut way) = (from, way);
        for _ in 0..MOST_BENDS {
            let Some(towards) = way.try_normalize() else { break };
            let length = way.length();
            let mut first: Option<(f64, DVec3)> = None;
            for probe in self.probes(eye, towards, up, carried) {
                let free = self.free(probe, towards, radius);
                first = match (first, free) {
                    (Some(a), Some(b)) if a.0 <= b.0 => Some(a),
                    (a, b) => b.or(a),
                };
            }
            let Some((free, normal)) = first.filter(|(free, _)| *free < length) else {
                return eye + way;
            };
            eye += towards * free;
            let wall = (normal - up * normal.dot(up)).try_normalize();
            let Some(wall) = wall else { break };
            let rest = towards * (length - free);
            way = rest - wall * rest.dot(wall);
        }
        eye
    }

    /// Returns the height above the surface below.
    fn height(&self, eye: DVec3, up: DVec3) -> Option<f64> {
        Some(self.world.surface(eye, -up)?.distance)
    }

    /// Returns the points of the body that must not touch anything: the eye, and above a floor also
    /// the waist and the knee; each in the middle and at both sides.
    fn probes(
        &self,
        eye: DVec3,
        towards: DVec3,
        up: DVec3,
        carried: Option<f64>,
    ) -> impl Iterator<Item = DVec3> {
        let side = towards.cross(up).normalize_or_zero() * (0.8 * RADIUS * self.metre);
        let knee = carried.map(|height| height - 1.1 * STEP * self.metre);
        let below = knee.filter(|depth| *depth > 0.0).unwrap_or(0.0);
        let depths = if below > 0.0 { vec![0.0, 0.5 * below, below] } else { vec![0.0] };
        let middles: Vec<DVec3> = depths.into_iter().map(|depth| eye - up * depth).collect();
        let body = *self;
        middles.into_iter().flat_map(move |middle| {
            // A side that is in a wall already would see what is behind the wall.
            let beside = |side: DVec3| body.stop(middle, side, 0.0);
            [middle, beside(0.9 * side), beside(-0.9 * side)]
        })
    }
}
