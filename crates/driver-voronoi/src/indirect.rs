//! Indirect light on diffuse surfaces from the records that a holodeck carries (Ward, Rubinstein and Clear 1988).
//!
//! Invariant: light comes only from records in sight of the surface, on its own side.

use super::shade::Shadings;
use super::surfaces::{Caster, Seen, Surfaces};
use holo_light::Store;
use holo_raycast::SurfacePoint;

/// Sum of weights with which no more records are looked for.
const ENOUGH: f32 = 3.0;

/// Bound on the rounding of a point's coordinates, relative to the largest: of f32 through two turns.
const ROUNDING: f32 = 2e-6;

/// Records, and the scene in which they are in sight or not.
pub(crate) struct Indirect<'a> {
    pub store: &'a Store,
    pub caster: &'a Caster<'a>,
    pub shadings: &'a Shadings,
}

impl Indirect<'_> {
    /// Indirect light on a diffuse surface, in steps of radiance over albedo; `None` if there is no record near or it is not
    /// diffuse.
    pub fn light(&self, seen: &Seen, surfaces: &Surfaces) -> Option<[f32; 3]> {
        let shading = self
            .shadings
            .materials
            .get(seen.material as usize)
            .filter(|shading| shading.is_diffuse)?;
        let (position, normal) = match surfaces.images.get(usize::from(seen.image)) {
            Some(image) => image.back(seen.position, seen.normal),
            None => (seen.position, seen.normal),
        };
        let (point, normal) = (self.caster.place(position), self.caster.towards(normal));
        let error = glam::Vec3::splat(point.abs().max_element() * ROUNDING);
        let at = SurfacePoint { point, error, normal, triangle: seen.triangle() };
        let raycaster = self.caster.raycaster();
        let found = self.store.irradiance(point, normal, ENOUGH, |record| {
            raycaster.parted(&at, normal, record.point.into(), record.normal.into())
        })?;
        // Where the albedo was raised to be divided by, there is less light than it seems.
        let share = shading.albedo_share / (std::f32::consts::PI * self.shadings.unit);
        Some((found.irradiance * share).to_array())
    }
}
