//! Images of lamps in flat mirrors and panes: what these throw on surfaces, where rays over the hemisphere find it by chance alone
//! (virtual light sources: Ward 1994, "The RADIANCE Lighting Simulation and Rendering System", §2.2.2; Shirley et al. 1996).
//!
//! A lamp behind a mirror is seen from a place as the lamp itself is from the place's image; so the tree of the lamps serves all
//! mirrors, and what a mirror can show is known without rays. Records of the engine `cached` aim some of their rays.
//!
//! Always true: what is aimed at is one reflection by a mirror or pane of a plane that is known, with any number of panes gone through
//! before and after. What rays over the hemisphere find that way is weighed with it (Veach 1997, §9.2.2), so that neither is brighter than
//! those rays alone would make it where little is known. A scene without such planes has no images, and pays nothing.

use glam::Vec3;
use holo_raycast::{Hit, Raycaster, SurfacePoint};

use crate::direct::power_heuristic;
use crate::lights::{Aim, Lights, Part, luminance};
use crate::mirrors::Mirrors;
use crate::panes::Panes;

/// A plane that shows lamps to a place, and the place's image behind it.
#[derive(Clone, Copy, Debug)]
struct Behind {
    plane: u8,
    point: Vec3,
    normal: Vec3,
    /// Its parts are those from here.
    first: usize,
}

/// The images of lamps that a place may see.
#[derive(Debug)]
pub(crate) struct Images<'a> {
    raycaster: &'a Raycaster,
    lights: &'a Lights,
    panes: &'a Panes,
    mirrors: &'a Mirrors,
    planes: Vec<Behind>,
    parts: Vec<Part>,
    /// Probability of all parts up to and with each.
    sums: Vec<f64>,
}

/// A point on an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Image {
    pub plane: u8,
    /// The lamp's triangle, and where on it.
    pub triangle: u32,
    pub barycentrics: [f32; 2],
    /// From the place.
    pub towards: Vec3,
    /// Of the image.
    pub normal: Vec3,
    /// With which it was chosen, per solid angle.
    pub density: f32,
}

impl<'a> Images<'a> {
    /// As `point` may see them that is lit on the side of `normal`; `None` if it sees none.
    pub(crate) fn seen(
        raycaster: &'a Raycaster,
        lights: &'a Lights,
        panes: &'a Panes,
        mirrors: &'a Mirrors,
        [point, normal]: [Vec3; 2],
    ) -> Option<Self> {
        let (mut planes, mut parts, mut sums, mut sum) = (Vec::new(), Vec::new(), Vec::new(), 0.0);
        for (number, plane) in (0..).zip(&mirrors.planes) {
            let (point, normal) = (plane.reflect(point), plane.reflect_direction(normal));
            let shown =
                lights.parts(point, normal, |center, radius| plane.shows(point, center, radius));
            if shown.is_empty() {
                continue;
            }
            planes.push(Behind { plane: number, point, normal, first: parts.len() });
            for part in &shown {
                let reflectance = plane.face.reflectance(plane.cosine(part.center - point));
                sum += f64::from(part.importance * luminance(reflectance.to_array()));
                sums.push(sum);
            }
            parts.extend(shown);
        }
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        sums.iter_mut().for_each(|s| *s /= sum);
        Some(Self { raycaster, lights, panes, mirrors, planes, parts, sums })
    }

    /// A point on an image by two uniform numbers. `None` if there is none to be seen there.
    pub(crate) fn choose(&self, uniform: f64, second: f32) -> Option<Image> {
        let i = self.sums.partition_point(|&sum| sum <= uniform).min(self.parts.len() - 1);
        let Behind { plane, point, normal, .. } =
            self.planes[self.planes.partition_point(|p| p.first <= i) - 1];
        let rest = ((uniform - self.before(i)) / self.share(i)).clamp(0.0, 1.0 - f64::EPSILON);
        let (triangle, probability, rest) =
            self.lights.choose_in(&self.parts[i], point, normal, rest)?;
        let aim = Aim::new(point, self.raycaster.vertices(triangle));
        let (u, v) = aim.sample([rest, second]);
        let towards = self.raycaster.point(triangle, u, v) - point;
        let lamp = self.raycaster.geometric_normal(triangle);
        let distance2 = towards.length_squared();
        let cosine = -towards.dot(lamp) / distance2.sqrt();
        let surface = &self.raycaster.scene().materials
            [self.raycaster.scene().material_ids[triangle as usize] as usize];
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

    /// The share of an image's light that arrives at the place.
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

    /// Density with which [`choose`](Self::choose) gives a point on a lamp as a plane shows it, per solid angle.
    pub(crate) fn density(&self, plane: u8, met: &Hit, cosine: f32) -> f32 {
        let Some(at) = self.planes.iter().position(|p| p.plane == plane) else { return 0.0 };
        let Behind { point, normal, first, .. } = self.planes[at];
        let end = self.planes.get(at + 1).map_or(self.parts.len(), |next| next.first);
        let Some((i, probability)) =
            self.lights.find_in(&self.parts[first..end], point, normal, met.triangle)
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

    /// Probability of a part.
    fn share(&self, i: usize) -> f64 {
        self.sums[i] - self.before(i)
    }
}

/// How a ray left a place from which images were aimed at, for weighing what it finds by mirrors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aims<'a> {
    pub images: &'a Images<'a>,
    /// How many times.
    pub count: u32,
    /// Expected number of other rays per solid angle, in the direction that was taken.
    pub others: f32,
}

/// A mirror or pane that shows images of its own plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shown<'a> {
    aims: Aims<'a>,
    plane: u8,
}

impl<'a> Aims<'a> {
    /// What a ray has met, and is reflected by; `None` if it shows no images.
    pub(crate) fn shown_by(self, mirror: u32) -> Option<Shown<'a>> {
        let &(plane, _) = self.images.mirrors.faces.get(&mirror)?;
        Some(Shown { aims: self, plane })
    }
}

impl Shown<'_> {
    /// Weight of a lamp that a ray has met by way of the mirror, at a cosine.
    pub(crate) fn weight(&self, met: &Hit, cosine: f32) -> f32 {
        let Aims { images, count, others } = self.aims;
        let density = count as f32 * images.density(self.plane, met, cosine);
        if density > 0.0 { power_heuristic(others, density) } else { 1.0 }
    }
}
