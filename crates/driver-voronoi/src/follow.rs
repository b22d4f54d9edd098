//! Following rays through thin panes and off mirrors to the first surface that is neither.
//!
//! Invariant: a ray's end is a function of the ray and the scene, whichever are followed together.

use super::surfaces::{Caster, Image, NO_IMAGE, SMOOTH_METAL, Seen};
use glam::Vec3;
use holo_raycast::{Hit, MAX_TOGETHER, NO_TRIANGLE, Ray};
use holo_scene::{Bsdf, Rgb};

/// Mirrors and panes that are followed at the most.
const MAX_CHAIN: usize = 8;

/// A ray on its way through panes and off mirrors.
#[derive(Clone, Copy)]
struct Way {
    /// Which of those followed together.
    number: usize,
    ray: Ray,
    hit: Hit,
    /// Whether a pane to come off is still to be met.
    off_pane: bool,
}

impl Way {
    /// Fills arrays.
    const NONE: Way = Way {
        number: 0,
        ray: Ray { origin: Vec3::ZERO, direction: Vec3::ZERO, t_min: 0.0, t_max: 0.0 },
        hit: Hit { t: 0.0, triangle: NO_TRIANGLE, u: 0.0, v: 0.0 },
        off_pane: false,
    };
}

impl Caster<'_> {
    /// Follows a ray from a mirror or pane to the first surface that is neither, and what of its light comes back: through
    /// all panes, or off the first one and then through the others if `off_pane`.
    ///
    /// `None` if there are too many of them, or no pane to come off.
    pub fn follow(&self, ray: Ray, hit: Hit, off_pane: bool) -> Option<End> {
        let mut end = None;
        self.follow_together(std::iter::once((ray, hit)), off_pane, std::slice::from_mut(&mut end));
        end
    }

    /// The same for at most [`MAX_TOGETHER`] rays, which are traced together from one mirror or pane to the next.
    pub fn follow_together(
        &self,
        from: impl Iterator<Item = (Ray, Hit)>,
        off_pane: bool,
        ends: &mut [Option<End>],
    ) {
        let mut ways = [Way::NONE; MAX_TOGETHER];
        let mut count = 0;
        for ((way, (ray, hit)), number) in ways.iter_mut().zip(from).zip(0..) {
            *way = Way { number, ray, hit, off_pane };
            count = number + 1;
        }
        ends.fill(Some(End::NOWHERE));
        for _ in 0..MAX_CHAIN {
            let mut rays = [Way::NONE.ray; MAX_TOGETHER];
            let mut left = [NO_TRIANGLE; MAX_TOGETHER];
            let mut hits = [None; MAX_TOGETHER];
            let mut onward = 0;
            for i in 0..count {
                let mut way = ways[i];
                let Some(end) = &mut ends[way.number] else { continue };
                if self.turn(&mut way, end) {
                    (rays[onward], left[onward], ways[onward]) = (way.ray, way.hit.triangle, way);
                    onward += 1;
                } else if way.off_pane {
                    ends[way.number] = None;
                }
            }
            self.raycaster().nearest_many_from(
                &rays[..onward],
                &left[..onward],
                &mut hits[..onward],
            );
            count = 0;
            for i in 0..onward {
                let way = ways[i];
                if let Some(hit) = hits[i] {
                    ways[count] = Way { hit, ..way };
                    count += 1;
                } else if way.off_pane {
                    ends[way.number] = None;
                }
            }
            if count == 0 {
                break;
            }
        }
        // There are too many mirrors on these ways.
        ways[..count].iter().for_each(|way| ends[way.number] = None);
    }

    /// Turns a ray at the mirror or pane that it meets; whether it goes on, or else has met a surface that is neither.
    fn turn(&self, way: &mut Way, end: &mut End) -> bool {
        let Way { ray, hit, off_pane, .. } = way;
        let normal = self.raycaster().geometric_normal(hit.triangle);
        let (at, error) = self.raycaster().surface_point(hit);
        let mirrored = ray.direction - 2.0 * ray.direction.dot(normal) * normal;
        let (colour, onward) = match self.scene().material(hit.triangle).bsdf {
            Bsdf::Mirror { ks } => {
                end.image = end.image.mirrored(self.point(at), self.vector(normal));
                end.mirrors[end.count] = hit.triangle;
                end.count += 1;
                (ks, mirrored)
            }
            Bsdf::ThinGlass { ior, .. } if *off_pane => {
                *off_pane = false;
                end.image = end.image.mirrored(self.point(at), self.vector(normal));
                ([pane_reflectance(ray.direction.dot(normal).abs(), ior); 3], mirrored)
            }
            Bsdf::ThinGlass { ior, transmittance } => {
                let passes = 1.0 - pane_reflectance(ray.direction.dot(normal).abs(), ior);
                (transmittance.map(|t| t * passes), ray.direction)
            }
            _ => {
                end.seen = self.first(ray, hit);
                return false;
            }
        };
        end.share = [0, 1, 2].map(|channel| end.share[channel] * colour[channel]);
        *ray = Ray::new(holo_raycast::spawn(at, error, normal, onward), onward);
        true
    }

    /// What a smooth metal that a ray meets shows, followed through mirrors, panes and other such metals, and how much of it.
    /// Its place is where it is.
    pub fn glance(&self, mut ray: Ray, mut hit: Hit) -> Option<(Seen, Rgb)> {
        let mut share = [1.0_f32; 3];
        for _ in 0..MAX_CHAIN {
            let normal = self.raycaster().geometric_normal(hit.triangle);
            let mirrored = ray.direction - 2.0 * ray.direction.dot(normal) * normal;
            let (colour, onward) = match self.scene().material(hit.triangle).bsdf {
                Bsdf::Mirror { ks } => (ks, mirrored),
                Bsdf::Conductor { ks, alpha } if alpha <= SMOOTH_METAL => (ks, mirrored),
                Bsdf::ThinGlass { ior, transmittance } => {
                    let passes = 1.0 - pane_reflectance(ray.direction.dot(normal).abs(), ior);
                    (transmittance.map(|t| t * passes), ray.direction)
                }
                _ => {
                    return Some((
                        Seen { image: NO_IMAGE, through: true, ..self.first(&ray, &hit) },
                        share,
                    ));
                }
            };
            share = [0, 1, 2].map(|channel| share[channel] * colour[channel]);
            let (at, error) = self.raycaster().surface_point(&hit);
            ray = Ray::new(holo_raycast::spawn(at, error, normal, onward), onward);
            match self.raycaster().nearest_from(&ray, hit.triangle) {
                Some(next) => hit = next,
                None => return Some((Seen { through: true, ..Seen::NOTHING }, share)),
            }
        }
        None
    }
}

/// Where a ray ends that goes through panes and off mirrors.
#[derive(Clone, Copy)]
pub(crate) struct End {
    /// Where it is.
    pub seen: Seen,
    /// What of its light comes back.
    pub share: Rgb,
    /// Where it is seen.
    pub image: Image,
    mirrors: [u32; MAX_CHAIN],
    count: usize,
}

impl End {
    const NOWHERE: End = End {
        seen: Seen::NOTHING,
        share: [1.0; 3],
        image: Image::ITSELF,
        mirrors: [0; MAX_CHAIN],
        count: 0,
    };

    /// The triangles of the mirrors on the way.
    pub fn mirrors(&self) -> &[u32] {
        &self.mirrors[..self.count]
    }

    /// What is seen there, in the image of this number if it has one.
    pub fn placed(&self, number: Option<usize>) -> Seen {
        let seen = Seen { through: true, ..self.seen };
        match number {
            _ if seen.is_sky() => seen,
            None => Seen { image: NO_IMAGE, ..seen },
            Some(number) => Seen {
                position: self.image.point(seen.position),
                normal: self.image.direction(seen.normal),
                image: number as u8,
                ..seen
            },
        }
    }
}

/// The number of an image, if it is among these.
pub(crate) fn number_of(images: &[Image], image: &Image, reach: f32) -> Option<usize> {
    images.iter().position(|known| known.is_like(image, reach))
}

/// What a thin pane reflects of unpolarised light at this cosine, all passes between its faces together.
fn pane_reflectance(cosine: f32, ior: f32) -> f32 {
    let inside = (1.0 - (1.0 - cosine * cosine) / (ior * ior)).max(0.0).sqrt();
    let parallel = (ior * cosine - inside) / (ior * cosine + inside);
    let across = (cosine - ior * inside) / (cosine + ior * inside);
    let once = 0.5 * (parallel * parallel + across * across);
    2.0 * once / (1.0 + once)
}
