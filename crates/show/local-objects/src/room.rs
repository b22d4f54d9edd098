//! The scene that objects are carried into, if its model is known: what rays meet there.
//!
//! Without it, a frame's distances stand for it. They are right except in mirrors and behind panes.

use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};
use holo_optics::{dielectric, pane, reflect, refract};
use holo_picture::View;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::Bsdf;
use rayon::prelude::*;

use crate::surface::MIRROR;

/// Most panes that a ray passes.
const MOST_PANES: usize = 8;

/// Share of light from which a face of glass reflects all of it.
pub(crate) const TOTAL: f32 = 0.999;

/// Share of the way to a light behind which nothing hides it: the light itself is there, as far as
/// a probe knows its place.
const NEARLY_ALL: f64 = 0.99;

/// The model of the scene that objects are carried into.
#[derive(Clone, Debug)]
pub struct Room {
    raycaster: Arc<Raycaster>,
    /// Mirrors or smooth solid glass.
    has_mirrors: bool,
    has_gloss: bool,
    has_panes: bool,
    /// Its bounds, once they are asked for: all corners are looked at.
    bounds: Arc<OnceLock<(DVec3, DVec3)>>,
}

/// A ray that a mirror or solid glass of the room sends on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DeflectedRay {
    pub origin: DVec3,
    pub direction: DVec3,
    /// The share of light that the mirror reflects, or that passes the face of glass.
    pub colour: Vec3,
    /// The direction in which glass reflects, too, and the share of light: of both faces, as those
    /// of a slab. `None` for mirrors, and where the ray leaves the glass.
    pub reflection: Option<(Vec3, f32)>,
}

/// A surface of the room that takes shadows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoomSurface {
    /// In the scene.
    pub place: DVec3,
    /// Unit normal on the side that is seen.
    pub normal: Vec3,
    /// The share of light that it reflects diffusely.
    pub reflectance: Vec3,
    /// In the room's own coordinates.
    at: SurfacePoint,
}

impl Room {
    /// Returns the room of a scene.
    #[must_use]
    pub fn new(raycaster: Arc<Raycaster>) -> Room {
        let materials = &raycaster.scene().materials;
        let has_mirrors = materials.iter().any(|material| is_smooth(&material.bsdf));
        let is_pane = |bsdf: &Bsdf| matches!(bsdf, Bsdf::ThinGlass { .. });
        let is_glossy = |bsdf: &Bsdf| {
            !is_pane(bsdf) && !matches!(bsdf, Bsdf::Diffuse { .. } | Bsdf::Mirror { .. })
        };
        let has_gloss = materials.iter().any(|material| is_glossy(&material.bsdf));
        let has_panes = materials.iter().any(|material| is_pane(&material.bsdf));
        Room { raycaster, has_mirrors, has_gloss, has_panes, bounds: Arc::default() }
    }

    /// Returns where a ray to the sky leaves the bounds of the room, relative to its beginning, and
    /// the normal of that face, inwards. Windows are near there: seen from elsewhere, the sky's
    /// light comes through the same ones. `None` if the ray begins outside.
    pub(crate) fn leaves(&self, origin: DVec3, direction: Vec3) -> Option<(Vec3, Vec3)> {
        let (low, high) = self.bounds.get_or_init(|| self.raycaster.scene().bounds());
        let direction = direction.as_dvec3();
        let mut first: Option<(f64, DVec3)> = None;
        for axis in 0..3 {
            if !(low[axis]..=high[axis]).contains(&origin[axis]) {
                return None;
            }
            let towards = direction[axis];
            let face = if towards > 0.0 { high[axis] } else { low[axis] };
            let along = (face - origin[axis]) / towards;
            if along.is_finite() && first.is_none_or(|(nearest, _)| along < nearest) {
                first = Some((along, -DVec3::AXES[axis] * towards.signum()));
            }
        }
        first.map(|(along, normal)| ((direction * along).as_vec3(), normal.as_vec3()))
    }

    /// Returns whether the room has mirrors or solid glass, in which objects are seen.
    pub(crate) fn has_mirrors(&self) -> bool {
        self.has_mirrors
    }

    /// Returns whether the room has metals, coats or glass, in which objects are seen at rest.
    pub(crate) fn has_gloss(&self) -> bool {
        self.has_gloss || self.has_panes
    }

    /// Returns whether the room has panes, which objects are seen through.
    pub(crate) fn has_panes(&self) -> bool {
        self.has_panes
    }

    /// Returns the ray that a mirror or solid glass sends on, if a hit is on such a surface.
    pub(crate) fn deflected(&self, hit: &Hit, direction: DVec3) -> Option<DeflectedRay> {
        let scene = self.raycaster.scene();
        let Hit { triangle, u, v, .. } = *hit;
        let bsdf = scene.material(triangle).bsdf;
        if !is_smooth(&bsdf) {
            return None;
        }
        let at = self.raycaster.surface(triangle, u, v);
        let eye = -direction.as_vec3();
        let front = scene.smooth_normal(triangle, u, v).unwrap_or(at.normal);
        let normal = if front.dot(eye) < 0.0 { -front } else { front };
        let mirrored = reflect(eye, normal);
        let (towards, colour, reflection) = match bsdf {
            Bsdf::Dielectric { ior, transmittance, .. } => {
                let enters = at.normal.dot(eye) >= 0.0;
                let cosine = normal.dot(eye).clamp(0.0, 1.0);
                let eta = if enters { ior } else { 1.0 / ior };
                match dielectric(cosine, eta) {
                    (share, _) if share > TOTAL => (mirrored, Vec3::ONE, None),
                    (share, beyond) => (
                        refract(eye, normal, beyond, eta),
                        Vec3::from(transmittance) * (1.0 - share),
                        enters.then(|| (mirrored, pane(cosine, ior))),
                    ),
                }
            }
            _ => (mirrored, scene.reflectance(triangle, u, v, 0.0).into(), None),
        };
        let origin = spawn(at.point, at.error, at.normal, towards);
        Some(DeflectedRay {
            origin: scene.origin + origin.as_dvec3(),
            direction: towards.as_dvec3().normalize(),
            colour,
            reflection,
        })
    }

    pub(crate) fn raycaster(&self) -> &Raycaster {
        &self.raycaster
    }

    /// Returns the distances of a view's surfaces from the eye, as a [`Frame`](holo_display::Frame)
    /// has them.
    #[must_use]
    pub fn depth(&self, view: &View, size: (u32, u32)) -> Vec<f32> {
        let of = |pixel: u32| {
            let (x, y) = View::pixel_centre(size, pixel % size.0.max(1), pixel / size.0.max(1));
            let Some((origin, direction, _)) = view.clipped_ray(x, y) else { return 0.0 };
            self.nearest(origin, direction).map_or(f32::INFINITY, |(_, distance)| distance as f32)
        };
        (0..size.0 * size.1).into_par_iter().map(of).collect()
    }

    /// Returns whether a hit is on a mirror or on solid glass, which look different from each place.
    pub(crate) fn is_mirror(&self, hit: &Hit) -> bool {
        is_smooth(&self.raycaster.scene().material(hit.triangle).bsdf)
    }

    /// Returns the first surface along a ray that is no pane, and its distance.
    pub(crate) fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<(Hit, f64)> {
        self.through_panes(origin, direction, f64::INFINITY, |_| ())
    }

    /// Returns the first surface along a ray, up to a distance, that is no pane, and its distance.
    /// Calls `pass` with each pane before it.
    pub(crate) fn through_panes(
        &self,
        origin: DVec3,
        direction: DVec3,
        far: f64,
        mut pass: impl FnMut(&Hit),
    ) -> Option<(Hit, f64)> {
        let (mut ray, skipped) = self.raycaster.localize(origin, direction)?;
        ray.t_max = (far - skipped) as f32;
        let mut from = holo_raycast::NO_TRIANGLE;
        for _ in 0..MOST_PANES {
            let hit = self.raycaster.nearest_from(&ray, from)?;
            if !matches!(self.raycaster.scene().material(hit.triangle).bsdf, Bsdf::ThinGlass { .. })
            {
                return Some((hit, f64::from(hit.t) + skipped));
            }
            pass(&hit);
            (ray.t_min, from) = (hit.t, hit.triangle);
        }
        None
    }

    /// Returns the share of light that the panes along a ray leave, up to a distance.
    pub(crate) fn left_by_panes(&self, origin: DVec3, direction: DVec3, far: f64) -> Vec3 {
        let mut left = Vec3::ONE;
        if self.has_panes {
            self.through_panes(origin, direction, far, |hit| {
                left *= self.left_by_pane(hit, direction.as_vec3());
            });
        }
        left
    }

    /// Returns the share of light that passes a pane; all of it at other surfaces.
    pub(crate) fn left_by_pane(&self, hit: &Hit, direction: Vec3) -> Vec3 {
        let scene = self.raycaster.scene();
        let Bsdf::ThinGlass { ior, transmittance } = scene.material(hit.triangle).bsdf else {
            return Vec3::ONE;
        };
        let smooth = scene.smooth_normal(hit.triangle, hit.u, hit.v);
        let normal = smooth.unwrap_or_else(|| self.raycaster.geometric_normal(hit.triangle));
        Vec3::from(transmittance) * (1.0 - pane(normal.dot(direction).abs().min(1.0), ior))
    }

    /// Returns the surface at a hit, if it takes shadows: mirrors, metals, glass and lamps do not.
    pub(crate) fn surface(&self, hit: &Hit, direction: Vec3, width: f32) -> Option<RoomSurface> {
        let scene = self.raycaster.scene();
        let material = scene.material(hit.triangle);
        let is_diffuse = matches!(material.bsdf, Bsdf::Diffuse { .. } | Bsdf::Coated { .. });
        if !is_diffuse || material.emits() {
            return None;
        }
        let at = self.raycaster.surface(hit.triangle, hit.u, hit.v);
        let normal = scene.smooth_normal(hit.triangle, hit.u, hit.v).unwrap_or(at.normal);
        let normal = if at.normal.dot(direction) > 0.0 { -normal } else { normal };
        let reflectance = scene.reflectance(hit.triangle, hit.u, hit.v, width).into();
        let place = scene.origin + at.point.as_dvec3();
        Some(RoomSurface { place, normal, reflectance, at })
    }

    /// Returns whether the room hides what is at this distance from one of its surfaces.
    pub(crate) fn hides_from(&self, from: &RoomSurface, direction: Vec3, distance: f64) -> bool {
        let origin = spawn(from.at.point, from.at.error, from.at.normal, direction);
        let ray = Ray { t_max: (NEARLY_ALL * distance) as f32, ..Ray::new(origin, direction) };
        self.is_dark(ray, from.at.triangle)
    }

    /// Returns whether nothing of the room is between a place and one of its surfaces.
    pub(crate) fn sees(&self, from: DVec3, place: DVec3) -> bool {
        let way = place - from;
        let distance = way.length();
        !self.hides(from, (way / distance.max(f64::MIN_POSITIVE)).as_vec3(), distance)
    }

    /// Returns whether the room hides what is at this distance from a place.
    pub(crate) fn hides(&self, place: DVec3, direction: Vec3, distance: f64) -> bool {
        let Some((ray, skipped)) = self.raycaster.localize(place, direction.as_dvec3()) else {
            return false;
        };
        let t_max = (NEARLY_ALL * distance - skipped) as f32;
        self.is_dark(Ray { t_max, ..ray }, holo_raycast::NO_TRIANGLE)
    }

    /// Returns whether no light passes along a ray. Light passes panes.
    fn is_dark(&self, ray: Ray, from: u32) -> bool {
        let (mut ray, mut from) = (ray, from);
        for _ in 0..MOST_PANES {
            let Some(hit) = self.raycaster.nearest_from(&ray, from) else { return false };
            if !matches!(self.raycaster.scene().material(hit.triangle).bsdf, Bsdf::ThinGlass { .. })
            {
                return true;
            }
            (ray.t_min, from) = (hit.t, hit.triangle);
        }
        false
    }
}

/// Returns whether a surface is a mirror or smooth solid glass.
fn is_smooth(bsdf: &Bsdf) -> bool {
    match bsdf {
        Bsdf::Mirror { .. } => true,
        Bsdf::Conductor { alpha, .. } | Bsdf::Dielectric { alpha, .. } => *alpha < MIRROR,
        _ => false,
    }
}
