//! Panes of thin glass, and surfaces of partial opacity, between a surface and a lamp: shadow rays
//! continue behind them.
//!
//! Invariant: the share that passes is the expectation over paths that go straight through.
//! Everything else blocks, including solid glass. A scene without panes and partial covers pays
//! nothing. Neither does a shadow ray without panes on its way, unless the scene has partial
//! covers: then every shadow ray looks for its nearest surface, as it would if chance decided.
//!
//! A surface of opacity a passes the share 1 - a of every shadow ray, and not all of a share 1 - a
//! of the rays. Sunlight behind two curtains of opacity 0.7 would otherwise arrive along one ray of
//! eleven, eleven times as bright.

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, Scene};

use holo_optics::pane;

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
    /// Meets every surface of partial opacity; `None` if the scene has none.
    of_all_covers: Option<Raycaster>,
}

impl Panes {
    pub(crate) fn new(raycaster: &Raycaster) -> Self {
        let scene = raycaster.scene();
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
        let of_all_covers = scene.has_partial_covers().then(|| raycaster.of_all_covers());
        Self { materials, of_all_covers }
    }

    /// Returns a set without panes, so that panes block like walls: for rays that test direct
    /// visibility.
    pub(crate) fn closed() -> Self {
        Self { materials: Vec::new(), of_all_covers: None }
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
        if let Some(raycaster) = &self.of_all_covers {
            return self.through(raycaster, *from, to);
        }
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
        let raycaster = self.of_all_covers.as_ref().unwrap_or(raycaster);
        if self.materials.is_empty() && self.of_all_covers.is_none() {
            let ray = Ray::new(spawn(from.point, from.error, from.normal, direction), direction);
            let is_hidden = raycaster.occluded_from(&ray, from.triangle);
            return if is_hidden { Vec3::ZERO } else { Vec3::ONE };
        }
        let (mut share, mut from) = (Vec3::ONE, *from);
        for _ in 0..MAX_DEPTH {
            let ray = Ray::new(spawn(from.point, from.error, from.normal, direction), direction);
            let Some(hit) = raycaster.nearest_from(&ray, from.triangle) else { return share };
            from = raycaster.surface(hit.triangle, hit.u, hit.v);
            share *= self.passed(raycaster, &hit, direction, from.normal);
            if share == Vec3::ZERO {
                break;
            }
        }
        Vec3::ZERO
    }

    /// Returns the share of light, by channel, that goes straight on at a hit.
    #[inline]
    fn passed(&self, raycaster: &Raycaster, hit: &Hit, direction: Vec3, normal: Vec3) -> Vec3 {
        let pane = self.at(raycaster, hit.triangle);
        let glass = pane
            .map_or(Vec3::ZERO, |pane| pane.passes(raycaster.scene(), hit, direction.dot(normal)));
        match &self.of_all_covers {
            None => glass,
            Some(_) => {
                let uncovered = raycaster.uncovered_share(hit, direction);
                Vec3::splat(uncovered) + glass * (1.0 - uncovered)
            }
        }
    }

    #[inline]
    fn at(&self, raycaster: &Raycaster, triangle: u32) -> Option<Pane> {
        *self.materials.get(raycaster.scene().material_id(triangle) as usize)?
    }

    /// Implements [`between`](Self::between) for a segment that panes or covers may cross.
    fn through(&self, raycaster: &Raycaster, mut from: SurfacePoint, to: &SurfacePoint) -> Vec3 {
        let mut share = Vec3::ONE;
        for _ in 0..MAX_DEPTH {
            let Some(hit) = raycaster.nearest_between(&from, to) else { return share };
            from = raycaster.surface(hit.triangle, hit.u, hit.v);
            let direction = (to.point - from.point).normalize_or_zero();
            share *= self.passed(raycaster, &hit, direction, from.normal);
            if share == Vec3::ZERO {
                break;
            }
        }
        Vec3::ZERO
    }
}
