//! Panes of thin glass between a surface and a lamp: shadow rays continue behind them.
//!
//! Invariant: the share that a pane passes is the share left of a path that goes straight through
//! it. Everything else blocks, including solid glass. A scene without panes pays nothing, and
//! neither does a shadow ray without panes on its way. The ray caster decides which rays pass
//! surfaces that are partly covered; these are no panes.

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, Scene};

use crate::fresnel::pane;

/// Most surfaces of a path, and most panes on one of its shadow rays.
pub(crate) const MAX_DEPTH: u32 = 1024;

/// A material of thin glass.
#[derive(Clone, Copy, Debug)]
struct Pane {
    ior: f32,
    transmittance: Vec3,
}

impl Pane {
    /// Returns the share of light that passes at a hit, from either side, at a cosine.
    fn passes(self, scene: &Scene, hit: &Hit, cosine: f32) -> Vec3 {
        let clear = self.transmittance * (1.0 - pane(cosine.abs(), self.ior));
        if scene.shading.is_none() {
            return clear;
        }
        let Hit { triangle, u, v, .. } = *hit;
        let glass = scene.glass_share(triangle, u, v).unwrap_or(1.0);
        let texture = scene.base_texture(triangle, u, v, 0.0).unwrap_or([1.0; 3]);
        clear * glass * Vec3::from(texture).clamp(Vec3::ZERO, Vec3::ONE)
    }
}

/// The panes of a scene.
#[derive(Debug)]
pub(crate) struct Panes {
    /// Indexed by material; empty if no material is thin glass.
    materials: Vec<Option<Pane>>,
}

impl Panes {
    pub(crate) fn new(scene: &Scene) -> Self {
        let of = |bsdf: &Bsdf| match *bsdf {
            Bsdf::ThinGlass { ior, transmittance } => {
                Some(Pane { ior, transmittance: transmittance.into() })
            }
            _ => None,
        };
        let mut materials: Vec<_> = scene.materials.iter().map(|m| of(&m.bsdf)).collect();
        if materials.iter().all(Option::is_none) {
            materials.clear();
        }
        Self { materials }
    }

    /// Returns a set without panes, so that panes block like walls: for rays that test direct
    /// visibility.
    pub(crate) fn closed() -> Self {
        Self { materials: Vec::new() }
    }

    /// Returns the share of light, by channel, that travels straight from one surface point to the
    /// other.
    #[inline]
    pub(crate) fn between(
        &self,
        raycaster: &Raycaster,
        from: &SurfacePoint,
        to: &SurfacePoint,
    ) -> Vec3 {
        match raycaster.blocker(from, to) {
            None => Vec3::ONE,
            Some(triangle) if self.at(raycaster, triangle).is_some() => {
                self.through(raycaster, *from, to)
            }
            Some(_) => Vec3::ZERO,
        }
    }

    /// Returns the share of light, by channel, that travels straight from the sky in a direction to
    /// a surface point.
    #[inline]
    pub(crate) fn to_sky(
        &self,
        raycaster: &Raycaster,
        from: &SurfacePoint,
        direction: Vec3,
    ) -> Vec3 {
        if self.materials.is_empty() {
            let ray = Ray::new(spawn(from.point, from.error, from.normal, direction), direction);
            let is_hidden = raycaster.occluded_from(&ray, from.triangle);
            return if is_hidden { Vec3::ZERO } else { Vec3::ONE };
        }
        let (mut share, mut from) = (Vec3::ONE, *from);
        for _ in 0..MAX_DEPTH {
            let ray = Ray::new(spawn(from.point, from.error, from.normal, direction), direction);
            let Some(hit) = raycaster.nearest_from(&ray, from.triangle) else { return share };
            let Some(pane) = self.at(raycaster, hit.triangle) else { break };
            from = raycaster.surface(hit.triangle, hit.u, hit.v);
            share *= pane.passes(raycaster.scene(), &hit, direction.dot(from.normal));
        }
        Vec3::ZERO
    }

    #[inline]
    fn at(&self, raycaster: &Raycaster, triangle: u32) -> Option<Pane> {
        *self.materials.get(raycaster.scene().material_id(triangle) as usize)?
    }

    /// Implements [`between`](Self::between) for a segment that at least one pane crosses.
    #[cold]
    fn through(&self, raycaster: &Raycaster, mut from: SurfacePoint, to: &SurfacePoint) -> Vec3 {
        let mut share = Vec3::ONE;
        for _ in 0..MAX_DEPTH {
            let Some(hit) = raycaster.nearest_between(&from, to) else { return share };
            let Some(pane) = self.at(raycaster, hit.triangle) else { break };
            from = raycaster.surface(hit.triangle, hit.u, hit.v);
            share *= pane.passes(
                raycaster.scene(),
                &hit,
                (to.point - from.point).normalize_or_zero().dot(from.normal),
            );
        }
        Vec3::ZERO
    }
}
