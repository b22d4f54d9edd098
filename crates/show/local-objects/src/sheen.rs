//! What glossy surfaces of a room show of objects: metals, coats and glass, not flat mirrors.
//!
//! A frame shows such a surface without the objects. The light around the nearest object says what
//! the surface reflects from behind it, and the object's own light takes its place.

use glam::{DVec3, Vec3};
use holo_optics::{Ggx, dielectric, pane, reflect};
use holo_raycast::{Hit, spawn};
use holo_scene::Bsdf;

use crate::numbers::PassNumbers;
use crate::object::LocalObject;
use crate::room::Room;
use crate::surface::{METAL, MIRROR};

/// Roughness from which a surface shows nothing of what is around it: half of what it reflects
/// comes from a quarter of all directions.
const MATT: f32 = 0.6;

/// Angle around the mirrored direction within which 95 % of the reflected light arrives, over the
/// surface's roughness, radians.
const WIDTH: f32 = 3.0;

/// Greatest such angle, radians.
const MOST_WIDTH: f32 = 1.2;

/// Least share of a surface's reflection in which an object is looked for.
const LEAST_SHARE: f32 = 0.01;

/// A direction in which a surface of many facets reflects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GlossRay {
    /// Away from the surface.
    pub towards: Vec3,
    /// Cosine between the facet's normal and the eye.
    pub cosine: f32,
    /// Share of the facets that the eye sees and that see the light.
    pub masked: f32,
}

impl GlossRay {
    /// Returns one that the eye sees, by two numbers; `None` if it goes below the surface.
    pub(crate) fn sampled(
        normal: Vec3,
        eye: Vec3,
        alpha: f32,
        numbers: (f32, f32),
    ) -> Option<GlossRay> {
        if alpha < MIRROR {
            let cosine = normal.dot(eye).clamp(0.0, 1.0);
            return Some(GlossRay { towards: reflect(eye, normal), cosine, masked: 1.0 });
        }
        let (right, ahead) = normal.any_orthonormal_pair();
        let view = Vec3::new(eye.dot(right), eye.dot(ahead), eye.dot(normal));
        let ggx = Ggx::new(alpha);
        let facet = ggx.sample(view, numbers.into());
        let towards = reflect(view, facet);
        (view.z > 0.0 && towards.z > 0.0).then(|| GlossRay {
            towards: right * towards.x + ahead * towards.y + normal * towards.z,
            cosine: view.dot(facet).clamp(0.0, 1.0),
            masked: ggx.shadowing(view, towards),
        })
    }
}

/// A glossy surface of a room.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoomSheen {
    /// Where rays leave it, in the scene.
    pub origin: DVec3,
    /// Unit normals on the side that is seen: of the triangle, and the one that mirrors.
    facing: Vec3,
    normal: Vec3,
    /// Unit direction to the eye.
    eye: Vec3,
    /// Colour of the reflection.
    ks: Vec3,
    law: ReflectionLaw,
    pub alpha: f32,
}

/// How much a surface reflects by the angle.
#[derive(Clone, Copy, Debug)]
enum ReflectionLaw {
    /// The same at all angles.
    Metal,
    /// By Fresnel's law for an index of refraction.
    Coat(f32),
    /// By both faces of a pane with an index of refraction.
    Pane(f32),
}

impl Room {
    /// Returns the glossy surface at a hit; `None` for others, for mirrors, and for the inner side
    /// of solid glass.
    pub(crate) fn sheen(&self, hit: &Hit, direction: Vec3) -> Option<RoomSheen> {
        let scene = self.raycaster().scene();
        let Hit { triangle, u, v, .. } = *hit;
        let reflectance = || Vec3::from(scene.reflectance(triangle, u, v, 0.0));
        let varied = scene.finish(triangle, u, v, 0.0);
        let rough = |alpha: f32| varied.map_or(alpha, |[roughness, _]| roughness * roughness);
        let at = self.raycaster().surface(triangle, u, v);
        let (ks, law, alpha) = match (scene.material(triangle).bsdf, varied) {
            (Bsdf::Coated { alpha, .. }, Some([_, metalness])) if metalness >= METAL => {
                (reflectance(), ReflectionLaw::Metal, rough(alpha))
            }
            (Bsdf::Coated { ks, ior, alpha, .. }, _) => {
                (ks.into(), ReflectionLaw::Coat(ior), rough(alpha))
            }
            (Bsdf::Conductor { alpha, .. }, _) => {
                (reflectance(), ReflectionLaw::Metal, rough(alpha))
            }
            (Bsdf::ThinGlass { ior, .. }, _) => (Vec3::ONE, ReflectionLaw::Pane(ior), 0.0),
            (Bsdf::Dielectric { ior, alpha, .. }, _) if at.normal.dot(direction) < 0.0 => {
                (Vec3::ONE, ReflectionLaw::Coat(ior), alpha)
            }
            _ => return None,
        };
        let faces = |normal: Vec3| if normal.dot(direction) > 0.0 { -normal } else { normal };
        let (eye, facing) = (-direction, faces(at.normal));
        let smooth = scene.smooth_normal(triangle, u, v).unwrap_or(facing);
        let smooth = if smooth.dot(facing) < 0.0 { -smooth } else { smooth };
        let normal = if smooth.dot(eye) > 0.0 { smooth } else { facing };
        let sheen = RoomSheen {
            origin: scene.origin + spawn(at.point, at.error, at.normal, facing).as_dvec3(),
            facing,
            normal,
            eye,
            ks,
            law,
            alpha,
        };
        let is_seen = alpha < MATT && sheen.share(normal.dot(eye)).max_element() > LEAST_SHARE;
        is_seen.then_some(sheen)
    }

    /// Calls `found` with each glossy surface along a ray, up to a distance. Its second argument is
    /// the share of the surface's light that the panes before it leave. Returns the share that all
    /// the panes leave, and the first surface that is no pane.
    pub(crate) fn sheens(
        &self,
        (origin, direction): (DVec3, DVec3),
        far: f64,
        mut found: impl FnMut(RoomSheen, Vec3),
    ) -> (Vec3, Option<(Hit, f64)>) {
        let mut left = Vec3::ONE;
        let towards = direction.as_vec3();
        let mut find = |hit: &Hit, left: Vec3| {
            if let Some(sheen) = self.sheen(hit, towards) {
                found(sheen, left);
            }
        };
        let last = self.through_panes(origin, direction, far, |hit| {
            find(hit, left);
            left *= self.left_by_pane(hit, towards);
        });
        if let Some((hit, _)) = last {
            find(&hit, left);
        }
        (left, last)
    }
}

impl RoomSheen {
    /// Returns the share of light that a facet reflects.
    fn share(&self, cosine: f32) -> Vec3 {
        let cosine = cosine.clamp(0.0, 1.0);
        let share = match self.law {
            ReflectionLaw::Metal => 1.0,
            ReflectionLaw::Coat(ior) => dielectric(cosine, ior).0,
            ReflectionLaw::Pane(ior) => pane(cosine, ior),
        };
        self.ks * share
    }

    /// Returns whether it may show an object, or one that is `margin` larger.
    pub(crate) fn may_show(&self, object: &LocalObject, margin: f64) -> bool {
        let to_centre = object.centre() - self.origin;
        let (distance, radius) = (to_centre.length(), object.radius() + margin);
        if distance <= radius {
            return true;
        }
        let width = (WIDTH * self.alpha).min(MOST_WIDTH);
        let angle = (radius / distance).asin() as f32 + width;
        let cosine = reflect(self.eye, self.normal).dot((to_centre / distance).as_vec3());
        cosine >= angle.min(std::f32::consts::PI).cos()
    }

    /// Returns a ray that it reflects and the share of light along it, by the next numbers. `None`
    /// if the ray goes below the surface.
    pub(crate) fn reflected(&self, numbers: &mut PassNumbers) -> Option<(Vec3, Vec3)> {
        let ray = GlossRay::sampled(self.normal, self.eye, self.alpha, numbers.two())?;
        let leaves = ray.towards.dot(self.facing) > 0.0;
        leaves.then(|| (ray.towards, self.share(ray.cosine) * ray.masked))
    }
}
