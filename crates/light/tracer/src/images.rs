//! Images of lamps in flat mirrors and panes: the light that these reflect onto other surfaces.
//!
//! From a given point, a lamp in a mirror looks like the lamp itself from the mirror image of that
//! point. This is the method of virtual light sources (Ward 1994, "The RADIANCE Lighting Simulation
//! and Rendering System", §2.2.2; Shirley et al. 1996). So one light tree serves all mirrors, and
//! no ray is needed to determine what a mirror can show. Records of the engine `cached` aim some of
//! their rays at images.
//!
//! Invariant: aimed rays account for exactly one reflection by a mirror or pane of a known plane.
//! Any number of panes may come before and after it. They are combined with hemisphere rays that
//! find the same light (Veach 1997, §9.2.2). A scene without such planes pays nothing.

use glam::Vec3;
use holo_raycast::{Hit, Raycaster, SurfacePoint};

use crate::lights::{Aim, Lights, Subtree};
use crate::luminance::luminance;
use crate::mirrors::Mirrors;
use crate::panes::Panes;
use crate::weighting::power_heuristic;

/// A plane that shows lamps to a point, and the mirror image of that point.
#[derive(Clone, Copy, Debug)]
struct MirroredPoint {
    /// Index of the plane.
    plane: u8,
    point: Vec3,
    normal: Vec3,
    /// Index of the plane's first subtree.
    first: usize,
}

/// The images of lamps that a point may see.
#[derive(Debug)]
pub(crate) struct Images<'a> {
    raycaster: &'a Raycaster,
    lights: &'a Lights,
    panes: &'a Panes,
    mirrors: &'a Mirrors,
    planes: Vec<MirroredPoint>,
    subtrees: Vec<Subtree>,
    /// Cumulative probabilities of the subtrees.
    sums: Vec<f64>,
}

/// A point on an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Image {
    pub plane: u8,
    /// The lamp's triangle.
    pub triangle: u32,
    /// Position on that triangle.
    pub barycentrics: [f32; 2],
    /// Vector from the observing point to the image.
    pub towards: Vec3,
    /// Normal of the image.
    pub normal: Vec3,
    /// Density, per solid angle, with which it was chosen.
    pub density: f32,
}

impl<'a> Images<'a> {
    /// Returns the images that `point`, lit on the side of `normal`, may see. `None` if it sees
    /// none.
    pub(crate) fn visible_from(
        raycaster: &'a Raycaster,
        lights: &'a Lights,
        panes: &'a Panes,
        mirrors: &'a Mirrors,
        [point, normal]: [Vec3; 2],
    ) -> Option<Self> {
        let (mut planes, mut subtrees, mut sums, mut sum) =
            (Vec::new(), Vec::new(), Vec::new(), 0.0);
        for (number, plane) in (0..).zip(&mirrors.planes) {
            let (point, normal) = (plane.reflect(point), plane.reflect_direction(normal));
            let shown =
                lights.subtrees(point, normal, |center, radius| plane.shows(point, center, radius));
            if shown.is_empty() {
                continue;
            }
            planes.push(MirroredPoint { plane: number, point, normal, first: subtrees.len() });
            for subtree in &shown {
                let reflectance = plane.face.reflectance(plane.cosine(subtree.center - point));
                sum += f64::from(subtree.importance * luminance(reflectance.to_array()));
                sums.push(sum);
            }
            subtrees.extend(shown);
        }
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        sums.iter_mut().for_each(|s| *s /= sum);
        Some(Self { raycaster, lights, panes, mirrors, planes, subtrees, sums })
    }

    /// Returns a point on an image by two uniform numbers. `None` if no light arrives from the one
    /// chosen.
    pub(crate) fn choose(&self, uniform: f64, second: f32) -> Option<Image> {
        let i = self.sums.partition_point(|&sum| sum <= uniform).min(self.subtrees.len() - 1);
        let MirroredPoint { plane, point, normal, .. } =
            self.planes[self.planes.partition_point(|p| p.first <= i) - 1];
        let rest = ((uniform - self.before(i)) / self.share(i)).clamp(0.0, 1.0 - f64::EPSILON);
        let (triangle, probability, rest) =
            self.lights.choose_in(&self.subtrees[i], point, normal, rest)?;
        let aim = Aim::new(point, self.raycaster.vertices(triangle));
        let (u, v) = aim.sample([rest, second]);
        let towards = self.raycaster.point(triangle, u, v) - point;
        let lamp = self.raycaster.geometric_normal(triangle);
        let distance2 = towards.length_squared();
        let cosine = -towards.dot(lamp) / distance2.sqrt();
        let surface = &self.raycaster.scene().materials
            [self.raycaster.scene().material_id(triangle) as usize];
        if !(cosine > 0.0 || surface.two_sided_emission && cosine < 0.0) {
            return None;
        }
        let mirror = &self.mirrors.planes[usize::from(plane)];
        Some(Image {
            plane,
            triangle,
            barycentrics: [u, v],
            towards: mirror.reflect_direction(towards),
            normal: mirror.reflect_direction(lamp),
            density: self.share(i) as f32 * probability * aim.density(distance2, cosine.abs()),
        })
    }

    /// Returns the direction in which a ray reaches the lamp of an image.
    pub(crate) fn arrives_along(&self, image: &Image) -> Vec3 {
        self.mirrors.planes[usize::from(image.plane)].reflect_direction(image.towards)
    }

    /// Returns the share of an image's light that arrives at the point.
    pub(crate) fn arriving(&self, at: &SurfacePoint, image: &Image) -> Vec3 {
        let Image { plane, triangle, barycentrics: [u, v], towards, .. } = *image;
        let mirror = &self.mirrors.planes[usize::from(plane)];
        let lamp = self.raycaster.point(triangle, u, v);
        if !mirror.shows(mirror.reflect(at.point), lamp, 0.0) {
            return Vec3::ZERO;
        }
        let Some(direction) = towards.try_normalize() else { return Vec3::ZERO };
        let face = |triangle: u32| self.mirrors.faces.get(&triangle).filter(|face| face.0 == plane);
        let ends = |triangle: u32| face(triangle).is_some();
        let Some((met, share)) = self.panes.to_face(self.raycaster, at, direction, ends) else {
            return Vec3::ZERO;
        };
        let Some((_, face)) = face(met.triangle) else { return Vec3::ZERO };
        let lamp = self.raycaster.surface(triangle, u, v);
        share
            * face.reflectance(direction.dot(met.normal))
            * self.panes.between(self.raycaster, &met, &lamp)
    }

    /// Returns the density, per solid angle, with which [`choose`](Self::choose) gives a point of a
    /// lamp as seen in a plane.
    pub(crate) fn density(&self, plane: u8, met: &Hit, cosine: f32) -> f32 {
        let Some(at) = self.planes.iter().position(|p| p.plane == plane) else { return 0.0 };
        let MirroredPoint { point, normal, first, .. } = self.planes[at];
        let end = self.planes.get(at + 1).map_or(self.subtrees.len(), |next| next.first);
        let Some((i, probability)) =
            self.lights.find_in(&self.subtrees[first..end], point, normal, met.triangle)
        else {
            return 0.0;
        };
        let aim = Aim::new(point, self.raycaster.vertices(met.triangle));
        let distance2 = self.raycaster.point(met.triangle, met.u, met.v).distance_squared(point);
        self.share(first + i) as f32 * probability * aim.density(distance2, cosine)
    }

    fn before(&self, i: usize) -> f64 {
        if i == 0 { 0.0 } else { self.sums[i - 1] }
    }

    /// Returns the probability of a subtree.
    fn share(&self, i: usize) -> f64 {
        self.sums[i] - self.before(i)
    }
}

/// A ray from a point at which images were sampled. It determines the weight of emission that the
/// ray hits after a mirror.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageSampling<'a> {
    pub images: &'a Images<'a>,
    /// Number of rays that were aimed at images.
    pub count: u32,
    /// Expected number of other rays per solid angle in the ray's direction.
    pub others: f32,
}

/// A mirror or pane that a ray met and that shows sampled images.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageMirror<'a> {
    sampling: ImageSampling<'a>,
    plane: u8,
}

impl<'a> ImageSampling<'a> {
    /// Returns the mirror or pane that reflects a ray; `None` if it shows no images.
    pub(crate) fn mirror_at(self, mirror: u32) -> Option<ImageMirror<'a>> {
        let &(plane, _) = self.images.mirrors.faces.get(&mirror)?;
        Some(ImageMirror { sampling: self, plane })
    }
}

impl ImageMirror<'_> {
    /// Returns the weight of a lamp that a ray hit after the mirror, at a cosine.
    pub(crate) fn weight(&self, met: &Hit, cosine: f32) -> f32 {
        let ImageSampling { images, count, others } = self.sampling;
        let density = count as f32 * images.density(self.plane, met, cosine);
        if density > 0.0 { power_heuristic(others, density) } else { 1.0 }
    }
}
