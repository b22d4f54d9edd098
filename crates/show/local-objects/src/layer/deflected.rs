//! The rays that mirrors and solid glass of a room send on.

use glam::DVec3;
use holo_raycast::Hit;

use crate::room::{DeflectedRay, Room};

/// Most mirrors and faces of glass that a ray follows: the walls of a vitrine have eight.
const MOST_SURFACES: usize = 8;

/// The rays that mirrors and solid glass of the room send on, one after the other, with what each
/// meets.
pub(super) struct DeflectedRays<'a> {
    room: &'a Room,
    /// Origin and direction.
    ray: (DVec3, DVec3),
    hit: Option<(Hit, f64)>,
    surfaces: usize,
}

impl<'a> DeflectedRays<'a> {
    /// `hit` is what a ray meets first, from this origin in this direction.
    pub(super) fn new(
        room: &'a Room,
        ray: (DVec3, DVec3),
        hit: Option<(Hit, f64)>,
    ) -> DeflectedRays<'a> {
        DeflectedRays { room, ray, hit, surfaces: 0 }
    }
}

impl Iterator for DeflectedRays<'_> {
    type Item = (DeflectedRay, Option<(Hit, f64)>);

    fn next(&mut self) -> Option<Self::Item> {
        self.surfaces += 1;
        let (hit, distance) = self.hit.filter(|_| self.surfaces <= MOST_SURFACES)?;
        let (origin, direction) = self.ray;
        let mut ray = self.room.deflected(&hit, direction)?;
        ray.colour *= self.room.left_by_panes(origin, direction, distance);
        self.ray = (ray.origin, ray.direction);
        self.hit = self.room.nearest(ray.origin, ray.direction);
        Some((ray, self.hit))
    }
}
