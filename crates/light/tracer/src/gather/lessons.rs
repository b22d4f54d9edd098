//! The vertices of one path whose reflected light teaches cells.

use glam::Vec3;

use super::place::Spot;
use crate::policy::Carried;

/// Most cells that a path teaches. Later vertices continue without teaching, which loses no light.
const MOST: usize = 4;

/// A vertex whose light teaches a cell, and what the path had collected before it.
#[derive(Clone, Copy, Debug)]
struct Lesson {
    spot: Spot,
    albedo: Vec3,
    /// Radiance that the path brought up to this vertex.
    radiance: Vec3,
    /// Weight of the light of this vertex in what the path brings; 0 if a cell's light has taken
    /// its place.
    throughput: Vec3,
}

/// The lessons of a path, in the order of its vertices.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lessons {
    count: usize,
    lessons: [Option<Lesson>; MOST],
}

impl Lessons {
    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    #[inline]
    pub(super) fn is_full(&self) -> bool {
        self.count == MOST
    }

    /// Begins a lesson at a vertex: from here on, the path collects the light of this vertex alone.
    /// `is_known`: a cell's light has been counted already.
    pub(super) fn begin(
        &mut self,
        spot: Spot,
        albedo: Vec3,
        carried: &mut Carried,
        is_known: bool,
    ) {
        let throughput = if is_known { Vec3::ZERO } else { *carried.throughput };
        let lesson = Lesson { spot, albedo, radiance: *carried.radiance, throughput };
        if let Some(free) = self.lessons.get_mut(self.count) {
            *free = Some(lesson);
            self.count += 1;
        }
        // Roulette must see what the light is worth in the picture or, if it only teaches, in the
        // cell.
        *carried.worth = if is_known { Vec3::ONE } else { *carried.worth * throughput };
        (*carried.throughput, *carried.radiance) = (Vec3::ONE, Vec3::ZERO);
    }

    /// Ends all lessons of a path that has collected `radiance` since the last one. Calls `teach`
    /// with the light and the albedo of each vertex, and returns the radiance of the whole path.
    pub(super) fn end(self, mut radiance: Vec3, mut teach: impl FnMut(Spot, Vec3, Vec3)) -> Vec3 {
        for lesson in self.lessons.iter().rev().flatten() {
            if radiance.is_finite() {
                teach(lesson.spot, radiance, lesson.albedo);
            }
            // 0 times infinity must not reach the picture.
            radiance = match lesson.throughput == Vec3::ZERO {
                true => lesson.radiance,
                false => lesson.radiance + lesson.throughput * radiance,
            };
        }
        radiance
    }
}
