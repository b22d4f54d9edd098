//! What rays do at surfaces that are not there everywhere, and at faces that lie at one place.

use glam::Vec3;

use super::{Covers, Raycaster};
use crate::chance;
use crate::coincident::{self, Coincident};
use crate::{Hit, Ray};

/// Most holes of surfaces that a ray passes. After that many it hits nothing. A tree has some
/// dozens.
const MAX_HOLES: usize = 1024;

impl Raycaster {
    /// Returns the same caster for rays of light: they meet a surface with the probability of its
    /// opacity. The answer is a function of the ray.
    #[must_use]
    pub fn by_chance(&self) -> Self {
        let covers = if self.has_covers() { Covers::Chance } else { Covers::None };
        Self { covers, ..self.clone() }
    }

    /// Returns the same caster for rays that meet every surface with an opacity above 0.
    #[must_use]
    pub fn of_all_covers(&self) -> Self {
        let covers = if self.has_covers() { Covers::Holes } else { Covers::None };
        Self { covers, ..self.clone() }
    }

    /// Returns the share of light that passes a hit without meeting a face there. `direction` is
    /// that of the ray.
    #[must_use]
    pub fn uncovered_share(&self, hit: &Hit, direction: Vec3) -> f32 {
        let passes = |hit: &Hit| 1.0 - self.scene.opacity(hit.triangle, hit.u, hit.v);
        match &self.coincident {
            Some(coincident) if coincident.shares(hit.triangle) => {
                self.at_place(coincident, direction, hit).iter().map(passes).product()
            }
            _ => passes(hit),
        }
    }

    /// Returns whether any surface is not there everywhere.
    #[must_use]
    pub fn has_covers(&self) -> bool {
        self.covers != Covers::None
    }

    /// Returns the triangles at whose place, in part, another triangle lies, in rising order.
    /// Triangles of instances and boundaries of solid glass are left out.
    #[must_use]
    pub fn coincident(&self) -> Vec<u32> {
        self.coincident.as_ref().map_or_else(Vec::new, |coincident| coincident.triangles())
    }

    /// Returns the share of rays that see a point of a triangle and not another face at its place.
    /// `direction` goes towards it.
    #[must_use]
    #[inline]
    pub fn shown(&self, triangle: u32, u: f32, v: f32, direction: Vec3) -> f32 {
        match &self.coincident {
            None => 1.0,
            Some(coincident) => self.shown_of(coincident, triangle, [u, v], direction),
        }
    }

    #[cold]
    fn shown_of(
        &self,
        coincident: &Coincident,
        triangle: u32,
        [u, v]: [f32; 2],
        direction: Vec3,
    ) -> f32 {
        if !coincident.shares(triangle) {
            return 1.0;
        }
        let hit = Hit { t: 0.0, triangle, u, v };
        let before = self.at_place(coincident, direction, &hit).into_iter();
        let before = before.take_while(|hit| hit.triangle != triangle);
        let passes = before.map(|hit| 1.0 - self.scene.opacity(hit.triangle, hit.u, hit.v));
        passes.product()
    }

    /// Returns whether the first triangle along a ray may not be what the ray meets.
    #[inline]
    pub(super) fn has_choices(&self) -> bool {
        self.has_covers() || self.coincident.is_some()
    }

    /// Returns what a ray meets at `hit`, or the next one if the ray passes there.
    #[cold]
    pub(super) fn choose(&self, ray: &Ray, skip: [u32; 2], mut hit: Hit) -> Option<Hit> {
        let mut rest = *ray;
        for _ in 0..MAX_HOLES {
            let met = match &self.coincident {
                Some(coincident) => self.met_at_place(coincident, ray, skip, &hit),
                None => Some(hit).filter(|hit| self.is_met(ray, hit)),
            };
            if met.is_some() {
                return met;
            }
            rest.t_min = hit.t;
            hit = self.query_whole(&rest, skip)?;
        }
        None
    }

    /// Returns whether a surface is there for a ray that hits it.
    fn is_met(&self, ray: &Ray, hit: &Hit) -> bool {
        if !self.has_covers() {
            return true;
        }
        let opacity = self.scene.opacity(hit.triangle, hit.u, hit.v);
        match self.covers {
            Covers::Chance if opacity < 1.0 => chance::meets(ray, hit.triangle, opacity),
            _ => opacity > 0.0,
        }
    }

    /// Returns what a ray meets of the faces at the place of a hit.
    fn met_at_place(
        &self,
        coincident: &Coincident,
        ray: &Ray,
        skip: [u32; 2],
        hit: &Hit,
    ) -> Option<Hit> {
        if !coincident.shares(hit.triangle) {
            return Some(*hit).filter(|hit| self.is_met(ray, hit));
        }
        // The ray begins or ends at the place of this face.
        let is_there = |other: u32| coincident.lies_in_plane(&self.facets, hit.triangle, other);
        if skip.into_iter().any(is_there) {
            return None;
        }
        let faces = self.at_place(coincident, ray.direction, hit);
        faces.into_iter().find(|face| self.is_met(ray, face))
    }

    /// Returns the faces at the place of a hit that a ray in `direction` may meet, in the order in
    /// which it does. Those that face away are the back of a sheet, if others face the ray.
    fn at_place(&self, coincident: &Coincident, direction: Vec3, hit: &Hit) -> Vec<Hit> {
        let (point, _) = self.surface_point(hit);
        let others = coincident.at(&self.facets, &self.hierarchy, hit.triangle, point);
        let others = others.into_iter().map(|(triangle, [u, v])| Hit { triangle, u, v, ..*hit });
        let rank = |hit: &Hit| coincident::rank(&self.scene, &self.facets, hit.triangle, direction);
        let mut faces: Vec<Hit> = std::iter::once(*hit).chain(others).collect();
        faces.sort_unstable_by_key(rank);
        let side = rank(&faces[0]).0;
        faces.retain(|face| rank(face).0 == side);
        faces
    }
}
