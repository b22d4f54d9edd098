//! The surface of an object where a ray meets it.

use glam::{DVec3, Vec3};
use holo_raycast::{Ray, SurfacePoint, spawn};
use holo_scene::{Bsdf, Scene};

/// Roughness below which a surface is a mirror.
pub(crate) const MIRROR: f32 = 1e-3;

/// Least metalness of a texture that makes a surface a metal, as in the tracer.
pub(crate) const METAL: f32 = 0.5;

/// A point of an object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObjectSurface {
    /// In the scene.
    pub place: DVec3,
    /// In the model.
    pub at: SurfacePoint,
    /// Normal of the triangle on the side of its counter-clockwise corners, in the scene.
    pub front: Vec3,
    /// The normal that scatters light, on the side that is seen, in the scene.
    pub normal: Vec3,
    pub u: f32,
    pub v: f32,
    /// Width of the observed area, in units of the model.
    pub footprint: f32,
}

/// What a surface does with light, at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finish {
    /// Reflected diffusely.
    pub diffuse: Vec3,
    /// What is reflected as by a mirror.
    pub gloss: Gloss,
    /// Radiance that it emits towards the eye.
    pub emission: Vec3,
}

/// The reflection or refraction of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Gloss {
    /// None.
    Matt,
    /// By a metal.
    Metal { ks: Vec3, alpha: f32 },
    /// By a coat over the diffuse base.
    Coat { ks: Vec3, ior: f32, alpha: f32 },
    /// By a pane that light passes straight.
    Pane { ior: f32, colour: Vec3 },
    /// By the boundary of a solid that light passes.
    Solid { ior: f32, colour: Vec3 },
}

impl ObjectSurface {
    /// Returns the half line from here in a direction of the model.
    pub(crate) fn leaving(&self, direction: Vec3) -> Ray {
        let origin = spawn(self.at.point, self.at.error, self.at.normal, direction);
        Ray::new(origin, direction)
    }

    /// Returns what the surface does with light.
    pub(crate) fn finish(&self, scene: &Scene, towards_eye: Vec3) -> Finish {
        let (triangle, u, v) = (self.at.triangle, self.u, self.v);
        let material = scene.material(triangle);
        let reflectance = || Vec3::from(scene.reflectance(triangle, u, v, self.footprint));
        let mut finish = Finish { diffuse: Vec3::ZERO, gloss: Gloss::Matt, emission: Vec3::ZERO };
        let varied = scene.finish(triangle, u, v, self.footprint);
        match (material.bsdf, varied) {
            (Bsdf::ThinGlass { ior, transmittance }, _) => {
                finish.gloss = Gloss::Pane { ior, colour: transmittance.into() };
            }
            (Bsdf::Dielectric { ior, transmittance, .. }, _) => {
                finish.gloss = Gloss::Solid { ior, colour: transmittance.into() };
            }
            (_, Some([roughness, metalness])) if metalness >= METAL => {
                finish.gloss = Gloss::Metal { ks: reflectance(), alpha: roughness * roughness };
            }
            (Bsdf::Coated { ks, ior, alpha, .. }, varied) => {
                let alpha = varied.map_or(alpha, |[roughness, _]| roughness * roughness);
                finish.diffuse = reflectance();
                finish.gloss = Gloss::Coat { ks: ks.into(), ior, alpha };
            }
            (Bsdf::Diffuse { .. }, _) => finish.diffuse = reflectance(),
            (Bsdf::Mirror { .. }, _) => {
                finish.gloss = Gloss::Metal { ks: reflectance(), alpha: 0.0 };
            }
            (Bsdf::Conductor { alpha, .. }, varied) => {
                let alpha = varied.map_or(alpha, |[roughness, _]| roughness * roughness);
                finish.gloss = Gloss::Metal { ks: reflectance(), alpha };
            }
        }
        let is_front = self.front.dot(towards_eye) >= 0.0;
        if material.emits() && (is_front || material.two_sided_emission) {
            let texture = scene.emission_texture(triangle, u, v, self.footprint);
            finish.emission =
                Vec3::from(material.emission) * Vec3::from(texture.unwrap_or([1.0; 3]));
        }
        finish
    }
}
