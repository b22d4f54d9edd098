//! The rays that mirrors of a room send on.

use glam::DVec3;
use holo_raycast::Hit;

use crate::room::{MirroredRay, Room};

/// Most mirrors that a ray follows.
const MOST_MIRRORS: usize = 4;

/// The rays that mirrors of the room send on, one after the other, with what each meets.
pub(super) struct MirroredRays<'a> {
    room: &'a Room,
    direction: DVec3,
    hit: Option<(Hit, f64)>,
    mirrors: usize,
}

impl<'a> MirroredRays<'a> {
    /// `hit` is what a ray in this direction meets first.
    pub(super) fn new(
        room: &'a Room,
        direction: DVec3,
        hit: Option<(Hit, f64)>,
    ) -> MirroredRays<'a> {
        MirroredRays { room, direction, hit, mirrors: 0 }
    }
}

impl Iterator for MirroredRays<'_> {
    type Item = (MirroredRay, Option<(Hit, f64)>);

    fn next(&mut self) -> Option<Self::Item> {
        self.mirrors += 1;
        let (hit, _) = self.hit.filter(|_| self.mirrors <= MOST_MIRRORS)?;
        let ray = self.room.mirrored(&hit, self.direction)?;
        self.direction = ray.direction;
        self.hit = self.room.nearest(ray.origin, ray.direction);
        Some((ray, self.hit))
    }
}
