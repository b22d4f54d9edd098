//! Glints: directions in which flat mirrors may show a lamp.
//!
//! A lamp seen in a flat mirror is where its mirror image is (as in [`images`](crate::images)).
//! Diffuse surfaces aim some of their samples at these images. Without that, paths find the patch
//! of light that a mirror throws only by chance.
//!
//! Always true: the images are a function of the scene alone, and only decide where samples go. A
//! density counts only towards these mirrors ([`Glints::may_show`]), and there it is that of
//! [`GlintVertex::choose`]. A scene without flat mirrors, or with more than [`MOST_IMAGES`], has no
//! glints and pays nothing. Metal and glass were tried too (docs/notes/path-tracing.md).

use glam::Vec3;
use holo_raycast::Hit;
use holo_scene::{Bsdf, Scene};

use crate::lights::{Aim, Lights};
use crate::luminance::luminance;
use crate::mirrors::{Face, Mirrors, Plane};

/// Most images of emitting triangles. All of them are weighed where a sample is aimed.
const MOST_IMAGES: usize = 64;

/// The glints of a scene.
#[derive(Debug)]
pub(crate) struct Glints {
    images: Vec<Image>,
    /// One bit per triangle of the scene.
    shows: Vec<u64>,
}

/// The image of an emitting triangle.
#[derive(Clone, Copy, Debug)]
struct Image {
    corners: [Vec3; 3],
    center: Vec3,
    radius2: f32,
    normal: Vec3,
    is_two_sided: bool,
    power: f32,
    /// The mirror that shows it.
    mirror: Plane,
}

/// A vertex that sees glints.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GlintVertex<'a> {
    pub glints: &'a Glints,
    point: Vec3,
    normal: Vec3,
}

impl Glints {
    /// Finds the glints of a scene. `None` if there are none.
    pub(crate) fn find(scene: &Scene, lights: &Lights) -> Option<Self> {
        let emitters = lights.triangles();
        if emitters.is_empty() || emitters.len() > MOST_IMAGES {
            return None;
        }
        let mirrors = Mirrors::find_with(scene, |t| match scene.material(t).bsdf {
            Bsdf::Mirror { ks } if !scene.material(t).emits() => Some(Face::Mirror(ks.into())),
            _ => None,
        });
        let images: Vec<Image> = mirrors
            .planes
            .iter()
            .flat_map(|plane| emitters.iter().map(|&t| Image::new(scene, t, *plane)))
            .collect();
        if images.is_empty() || images.len() > MOST_IMAGES {
            return None;
        }
        let mut shows = vec![0; scene.triangles.len().div_ceil(64)];
        mirrors.faces.keys().for_each(|&t| shows[t as usize / 64] |= 1 << (t % 64));
        Some(Self { images, shows })
    }

    /// Returns whether a triangle may show a lamp.
    #[inline]
    pub(crate) fn may_show(&self, triangle: u32) -> bool {
        self.shows[triangle as usize / 64] >> (triangle % 64) & 1 != 0
    }

    /// Returns the glints as a surface sees them that is lit on the side of `normal`.
    #[inline]
    pub(crate) fn seen_from(&self, point: Vec3, normal: Vec3) -> GlintVertex<'_> {
        GlintVertex { glints: self, point, normal }
    }
}

impl Image {
    /// Makes the image of an emitting triangle.
    fn new(scene: &Scene, t: u32, mirror: Plane) -> Self {
        let material = scene.material(t);
        let corners = scene.corners(t).map(|corner| mirror.reflect(corner));
        let center = (corners[0] + corners[1] + corners[2]) / 3.0;
        let reflected = luminance(mirror.face.reflectance(1.0).to_array());
        Self {
            corners,
            center,
            radius2: corners.iter().fold(0.0_f32, |m, v| m.max(v.distance_squared(center))),
            normal: mirror.reflect_direction(scene.normal(t)),
            is_two_sided: material.two_sided_emission,
            power: luminance(material.emission) * scene.area(t) as f32 * reflected,
            mirror,
        }
    }
}

impl GlintVertex<'_> {
    /// Returns approximately what an image may bring to the vertex.
    fn importance(&self, image: &Image) -> f32 {
        let towards = image.center - self.point;
        let distance2 = towards.length_squared().max(image.radius2).max(f32::MIN_POSITIVE);
        let (distance, radius) = (distance2.sqrt(), image.radius2.sqrt());
        let height = ((towards.dot(self.normal) + radius) / distance).clamp(0.0, 1.0);
        let facing = -towards.dot(image.normal);
        let facing = if image.is_two_sided { facing.abs() } else { facing };
        let facing = ((facing + radius) / distance).clamp(0.0, 1.0);
        let importance = image.power * height * facing / distance2;
        let is_shown = importance > 0.0
            && importance.is_finite()
            && image.mirror.shows(self.point, image.center, radius);
        if is_shown { importance } else { 0.0 }
    }

    /// Returns what each image may bring, and their sum.
    fn importances(&self) -> ([f32; MOST_IMAGES], f32) {
        let mut all = [0.0; MOST_IMAGES];
        let mut sum = 0.0;
        for (importance, image) in all.iter_mut().zip(&self.glints.images) {
            *importance = self.importance(image);
            sum += *importance;
        }
        (all, sum)
    }

    /// Returns a direction towards an image by two uniform numbers. `None` if no image can bring
    /// anything.
    pub(crate) fn choose(&self, first: f64, second: f32) -> Option<Vec3> {
        let (importances, sum) = self.importances();
        let mut rest = first as f32 * sum;
        for (image, &importance) in self.glints.images.iter().zip(&importances) {
            if rest < importance {
                let share = (rest / importance).min(1.0 - f32::EPSILON / 2.0);
                let (u, v) = Aim::new(self.point, image.corners).sample([share, second]);
                let [a, b, c] = image.corners;
                return (a + (b - a) * u + (c - a) * v - self.point).try_normalize();
            }
            rest -= importance;
        }
        None
    }

    /// Returns the density, per solid angle, with which [`choose`](Self::choose) gives a direction
    /// in which a ray meets `met`; 0 if that surface shows no lamps.
    pub(crate) fn density(&self, direction: Vec3, met: &Hit) -> f32 {
        if !self.glints.may_show(met.triangle) {
            return 0.0;
        }
        let (importances, sum) = self.importances();
        let mut density = 0.0;
        for (image, &importance) in self.glints.images.iter().zip(&importances) {
            if importance > 0.0
                && let Some((distance, cosine)) = meets(self.point, direction, image.corners)
            {
                let aim = Aim::new(self.point, image.corners);
                density += importance * aim.density(distance * distance, cosine);
            }
        }
        if density > 0.0 { density / sum } else { 0.0 }
    }
}

/// Returns the distance at which a line meets a triangle, and the absolute cosine there.
fn meets(point: Vec3, direction: Vec3, [a, b, c]: [Vec3; 3]) -> Option<(f32, f32)> {
    let (e1, e2, s) = (b - a, c - a, point - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let q = s.cross(e1);
    let u = s.dot(p) / determinant;
    let v = direction.dot(q) / determinant;
    let distance = e2.dot(q) / determinant;
    let is_met = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0;
    is_met.then(|| (distance, determinant.abs() / e1.cross(e2).length()))
}
