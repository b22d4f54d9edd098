//! A model at a pose, and rays against it.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3, Vec3};
use holo_picture::relative_luminance;
use holo_raycast::{NO_TRIANGLE, Ray, Raycaster};
use holo_scene::{Bsdf, Scene};

use crate::error::{MOST_TRIANGLES, ObjectError};
use crate::numbers::{PassNumbers, in_cone};
use crate::pose::ObjectPose;
use crate::surface::ObjectSurface;

/// Least cosine between a shading normal and the direction to the eye: a surface that is seen faces
/// the eye.
const LEAST_COSINE: f32 = 0.02;

/// Most panes that a ray of shadow passes.
const MOST_PANES: usize = 16;

/// Rays by which it is found how much light a model takes.
const RAYS: u32 = 1024;

/// A model that can be carried into a scene.
pub struct ObjectModel {
    raycaster: Raycaster,
    /// The model's up axis, a unit vector of its coordinates.
    up: DVec3,
    /// Length of a unit of the model, in units of the scene that it comes into.
    unit: f64,
    /// The middle of its base.
    base: DVec3,
    /// The middle of its bounds.
    middle: DVec3,
    /// Greatest distance of its points from there.
    radius: f64,
    /// The share of the light on its way through the sphere around it that it takes.
    darkness: f32,
    /// True if some surface is glass, so that rays of shadow may pass it.
    has_glass: bool,
    /// True if some surface is smooth enough to show its surroundings.
    pub(crate) is_shiny: bool,
}

impl ObjectModel {
    /// Prepares a model. `up` is its up axis, and `unit` the length of its unit in units of the
    /// scene that it comes into.
    ///
    /// # Errors
    /// If it has no triangles or too many, or cannot be traced.
    pub fn new(scene: Scene, up: DVec3, unit: f64) -> Result<ObjectModel, ObjectError> {
        let triangles = scene.triangles().len();
        match triangles {
            0 => return Err(ObjectError::Empty),
            1..=MOST_TRIANGLES => {}
            _ => return Err(ObjectError::TooLarge(triangles)),
        }
        let up = up.try_normalize().filter(|_| unit.is_normal() && unit > 0.0);
        let up = up.ok_or(ObjectError::Axes)?;
        let (low, high) = scene.bounds();
        let middle = (low + high) * 0.5;
        let points = || scene.points().map(|point| scene.origin + point.as_dvec3() - middle);
        let radius = points().map(DVec3::length).fold(0.0, f64::max);
        let lowest = points().map(|point| point.dot(up)).fold(f64::INFINITY, f64::min);
        let uses =
            |is: fn(&Bsdf) -> bool| scene.materials.iter().any(|material| is(&material.bsdf));
        let has_glass =
            uses(|bsdf| matches!(bsdf, Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. }));
        let is_shiny = uses(|bsdf| !matches!(bsdf, Bsdf::Diffuse { .. }));
        let raycaster = Raycaster::build(Arc::new(scene))?.by_chance();
        Ok(ObjectModel {
            darkness: darkness(&raycaster, middle, radius),
            raycaster,
            up,
            unit,
            base: middle + up * lowest,
            middle,
            radius,
            has_glass,
            is_shiny,
        })
    }

    /// Returns the model's scene.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        self.raycaster.scene()
    }

    /// Returns its up axis, in its own coordinates.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// Returns the length of its unit, in units of the scene that it comes into.
    #[must_use]
    pub fn unit(&self) -> f64 {
        self.unit
    }

    /// Returns the middle of its base, in its own coordinates.
    #[must_use]
    pub fn base(&self) -> DVec3 {
        self.base
    }
}

/// A model at a place in a scene.
#[derive(Clone)]
pub struct LocalObject {
    model: Arc<ObjectModel>,
    pose: ObjectPose,
    /// Turns the model's directions into the scene's.
    rotation: DQuat,
    /// Length of the model's unit in the scene.
    scale: f64,
    centre: DVec3,
    radius: f64,
}

/// A point of an object that a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObjectHit {
    /// Distance along the ray, scene units.
    pub distance: f64,
    /// The triangle, and barycentric weights of its second and third corner.
    pub triangle: u32,
    pub u: f32,
    pub v: f32,
}

impl LocalObject {
    /// Returns a model at a pose, upright in a scene with this up axis.
    ///
    /// # Errors
    /// If the pose is not possible.
    pub fn new(
        model: Arc<ObjectModel>,
        pose: ObjectPose,
        up: DVec3,
    ) -> Result<LocalObject, ObjectError> {
        pose.check()?;
        let up = up.try_normalize().ok_or(ObjectError::Axes)?;
        let upright = DQuat::from_rotation_arc(model.up, up);
        let rotation = DQuat::from_axis_angle(up, pose.turn.to_radians()) * upright;
        let scale = pose.scale * model.unit;
        let centre = pose.at + rotation * ((model.middle - model.base) * scale);
        let radius = model.radius * scale;
        Ok(LocalObject { model, pose, rotation, scale, centre, radius })
    }

    /// Returns the model.
    #[must_use]
    pub fn model(&self) -> &Arc<ObjectModel> {
        &self.model
    }

    /// Returns the pose.
    #[must_use]
    pub fn pose(&self) -> ObjectPose {
        self.pose
    }

    /// Returns the rows of the map from the model's world coordinates to the scene's.
    #[must_use]
    pub fn place(&self) -> [[f64; 4]; 3] {
        let turn = DMat3::from_quat(self.rotation) * self.scale;
        let sum = self.pose.at - turn * self.model.base;
        [0, 1, 2].map(|axis| turn.row(axis).extend(sum[axis]).to_array())
    }

    /// Returns the middle of the sphere around the object, in the scene.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Returns the radius of the sphere around the object, scene units.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Returns the share of the light on its way through the sphere around it that it takes.
    pub(crate) fn darkness(&self) -> f32 {
        self.model.darkness
    }

    /// Returns whether some of its surfaces show what is around the object.
    #[must_use]
    pub fn is_shiny(&self) -> bool {
        self.model.is_shiny
    }

    /// Returns the distance along a ray at which the object is met, scene units; `None` if it is
    /// not. `direction` has unit length.
    #[must_use]
    pub fn distance(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        self.nearest(origin, direction).map(|hit| hit.distance)
    }

    pub(crate) fn raycaster(&self) -> &Raycaster {
        &self.model.raycaster
    }

    /// Turns a direction of the model into one of the scene.
    pub(crate) fn to_scene(&self, direction: Vec3) -> Vec3 {
        (self.rotation * direction.as_dvec3()).as_vec3()
    }

    /// Turns a direction of the scene into one of the model.
    pub(crate) fn to_model(&self, direction: Vec3) -> Vec3 {
        (self.rotation.conjugate() * direction.as_dvec3()).as_vec3()
    }

    /// Returns whether a ray passes the sphere around the object, and not only behind its origin.
    #[inline]
    pub(crate) fn is_near(&self, origin: DVec3, direction: DVec3, margin: f64) -> bool {
        let to_centre = self.centre - origin;
        let along = to_centre.dot(direction);
        let radius = self.radius + margin;
        let square = to_centre.length_squared();
        square - along * along <= radius * radius && (along > 0.0 || square <= radius * radius)
    }

    /// Returns the ray in the model's coordinates, and the distance along it at which it begins.
    fn ray(&self, origin: DVec3, direction: DVec3) -> Option<(Ray, f64)> {
        let back = self.rotation.conjugate();
        let origin = self.model.base + back * (origin - self.pose.at) / self.scale;
        self.model.raycaster.localize(origin, back * direction)
    }

    /// Returns the first point of the object along a ray.
    pub(crate) fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<ObjectHit> {
        if !self.is_near(origin, direction, 0.0) {
            return None;
        }
        let (ray, skipped) = self.ray(origin, direction)?;
        let hit = self.model.raycaster.nearest(&ray)?;
        let distance = (f64::from(hit.t) + skipped) * self.scale;
        Some(ObjectHit { distance, triangle: hit.triangle, u: hit.u, v: hit.v })
    }

    /// Returns the first point of the object along a ray that leaves its surface.
    pub(crate) fn nearest_from(&self, from: &ObjectSurface, direction: Vec3) -> Option<ObjectHit> {
        let ray = from.leaving(self.to_model(direction));
        let hit = self.model.raycaster.nearest_from(&ray, from.at.triangle)?;
        let distance = f64::from(hit.t) * self.scale;
        Some(ObjectHit { distance, triangle: hit.triangle, u: hit.u, v: hit.v })
    }

    /// Returns the surface that a ray meets. `width` is that of the ray there, scene units.
    pub(crate) fn surface(
        &self,
        origin: DVec3,
        direction: Vec3,
        hit: &ObjectHit,
        width: f32,
    ) -> ObjectSurface {
        let raycaster = &self.model.raycaster;
        let scene = raycaster.scene();
        let ObjectHit { triangle, u, v, distance } = *hit;
        let at = raycaster.surface(triangle, u, v);
        let footprint = width / self.scale as f32;
        let towards_eye = -self.to_model(direction);
        let faces =
            |normal: Vec3, side: Vec3| if normal.dot(side) < 0.0 { -normal } else { normal };
        let facing = faces(at.normal, towards_eye);
        let seen = |normal: Vec3| {
            let cosine = normal.dot(towards_eye);
            if cosine >= LEAST_COSINE {
                return normal;
            }
            let bent = normal + towards_eye * (LEAST_COSINE - cosine);
            bent.try_normalize().unwrap_or(facing)
        };
        let smooth = scene.smooth_normal(triangle, u, v).map(|smooth| faces(smooth, facing));
        let base = smooth.unwrap_or(facing);
        let side = if facing.dot(at.normal) < 0.0 { -1.0 } else { 1.0 };
        let mapped = scene.mapped_normal(triangle, [u, v], footprint, base * side);
        let normal = mapped.map(|mapped| mapped * side).or(smooth).map_or(facing, seen);
        ObjectSurface {
            place: origin + direction.as_dvec3() * distance,
            at,
            front: self.to_scene(at.normal),
            normal: self.to_scene(normal),
            u,
            v,
            footprint,
        }
    }

    /// Returns whether the object lies on a ray, before this distance.
    pub(crate) fn hides(&self, origin: DVec3, direction: DVec3, distance: f64) -> bool {
        if !self.is_near(origin, direction, 0.0) {
            return false;
        }
        let Some((ray, skipped)) = self.ray(origin, direction) else { return false };
        let t_max = (distance / self.scale - skipped) as f32;
        self.is_dark(Ray { t_max, ..ray }, NO_TRIANGLE)
    }

    /// Returns whether the object lies on a ray that leaves its surface, before this distance.
    pub(crate) fn hides_from(&self, from: &ObjectSurface, direction: Vec3, distance: f64) -> bool {
        let ray = from.leaving(self.to_model(direction));
        self.is_dark(Ray { t_max: (distance / self.scale) as f32, ..ray }, from.at.triangle)
    }

    /// Returns whether no light passes along a ray of the model. Light passes glass.
    fn is_dark(&self, ray: Ray, from: u32) -> bool {
        let raycaster = &self.model.raycaster;
        if !self.model.has_glass {
            return raycaster.occluded_from(&ray, from);
        }
        let (mut ray, mut from) = (ray, from);
        for _ in 0..MOST_PANES {
            let Some(hit) = raycaster.nearest_from(&ray, from) else { return false };
            if !raycaster.scene().passes_light(hit.triangle) {
                return true;
            }
            (ray.t_min, from) = (hit.t, hit.triangle);
        }
        false
    }
}

/// Returns the share of light that a model takes of what would pass the sphere around it, by rays
/// through the sphere from all sides. What it reflects is about half as bright as what it hides.
fn darkness(raycaster: &Raycaster, middle: DVec3, radius: f64) -> f32 {
    let scene = raycaster.scene();
    let taken = |number: u32| {
        let mut numbers = PassNumbers::new(1, number);
        let (height, turn) = numbers.two();
        let towards = in_cone(Vec3::Z, -1.0, (height, turn));
        let (right, ahead) = towards.any_orthonormal_pair();
        let (share, turn) = numbers.two();
        let (distance, turn) = (share.sqrt(), std::f32::consts::TAU * turn);
        let beside = right * (distance * turn.cos()) + ahead * (distance * turn.sin());
        let origin = middle + (beside - towards * 2.0).as_dvec3() * radius;
        let Some((ray, _)) = raycaster.localize(origin, towards.as_dvec3()) else { return 0.0 };
        let Some(hit) = raycaster.nearest(&ray) else { return 0.0 };
        if scene.passes_light(hit.triangle) {
            return 0.0;
        }
        1.0 - 0.5 * relative_luminance(scene.reflectance(hit.triangle, hit.u, hit.v, 0.0))
    };
    (0..RAYS).map(taken).sum::<f32>() / RAYS as f32
}
