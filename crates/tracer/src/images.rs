//! Images of lamps in flat mirrors: light samples for what mirrors throw on surfaces, where paths would find it by chance alone
//! (virtual light sources: Ward 1994, "The RADIANCE Lighting Simulation and Rendering System", §2.2.2; Shirley et al. 1996).
//!
//! Each lamp stands behind each mirror once more; a tree of its own chooses among all images, by what parts of the scene really
//! get from them. The engine `cached` samples them at diffuse surfaces, and its records leave out what comes that way.
//!
//! Always true: what is sampled here is what [`Images::shows`] lets paths from there leave out: one reflection by a mirror of a plane that is
//! known, with any number of panes gone through before and after. A scene without such planes has no images, and pays nothing.
//! Where none of a cell's 16 probes sees an image, none is sampled, and records leave them out all the same: a spot of light that is smaller is
//! lost. (One sample for each vertex there would find it, a few thousand times as bright as its surroundings.)

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;
use holo_raycast::SurfacePoint;
use holo_scene::Scene;

use crate::bsdf::Scatter;
use crate::lights::{Emitter, Lights, luminance};
use crate::path::Surface;
use crate::stage::{Lamps, Stage};

/// Images at most; planes that would bring more are mirrors like any other.
const MOST: usize = 1 << 16;
/// Planes that are told apart, at most: a curved mirror has one for each triangle.
const PLANES: usize = 64;
/// Least area of a plane, as a share of the square of the scene's greatest side.
const LEAST_AREA: f64 = 1e-4;
/// How far off its plane a mirror's corner may be, as a share of that side.
const FLAT: f32 = 1e-5;
/// Sine of the angle by which its normal may differ.
const BENT: f32 = 1e-4;
/// By how much bounds of mirrors are wider than they, as a share of their greatest side.
const SLACK: f32 = 1e-3;

/// A plane that holds mirrors: the points x with x · normal = offset.
#[derive(Clone, Copy, Debug)]
struct Plane {
    normal: Vec3,
    offset: f32,
    /// Bounds of the mirrors.
    low: Vec3,
    high: Vec3,
}

impl Plane {
    /// Includes a mirror's corners in the bounds.
    fn hold(&mut self, corners: [Vec3; 3]) {
        for corner in corners {
            (self.low, self.high) = (self.low.min(corner), self.high.max(corner));
        }
    }

    /// Whether the line to an image may meet a mirror.
    fn is_crossed(&self, at: Vec3, image: Vec3) -> bool {
        let [here, there] = [at, image].map(|point| self.height(point));
        // The image must be on the other side.
        if here * there >= 0.0 {
            return false;
        }
        let met = at + (image - at) * (here / (here - there));
        let slack = SLACK * (self.high - self.low).max_element();
        met.cmpge(self.low - slack).all() && met.cmple(self.high + slack).all()
    }

    fn height(&self, point: Vec3) -> f32 {
        point.dot(self.normal) - self.offset
    }

    fn reflect(&self, point: Vec3) -> Vec3 {
        point - self.normal * (2.0 * self.height(point))
    }

    fn reflect_direction(&self, direction: Vec3) -> Vec3 {
        direction - self.normal * (2.0 * direction.dot(self.normal))
    }
}

/// Lamps as flat mirrors show them.
#[derive(Debug)]
pub(crate) struct Mirrors {
    lamps: Arc<Lamps>,
    planes: Vec<Plane>,
    /// By triangle of a mirror, its plane and what it reflects.
    faces: HashMap<u32, (u8, Vec3)>,
    /// The lamp's triangle and the plane of each.
    images: Vec<(u32, u8)>,
}

/// All images in a scene, and the tree that chooses among them.
#[derive(Debug)]
pub(crate) struct Images {
    pub mirrors: Arc<Mirrors>,
    pub lights: Lights,
}

impl Images {
    /// `None` if there are no lamps or no flat mirrors.
    pub(crate) fn find(lamps: &Arc<Lamps>, surfaces: &[Surface], lights: &Lights) -> Option<Self> {
        let scene = lamps.raycaster.scene();
        let mut mirrors = flat(scene, surfaces);
        mirrors.truncate(MOST / lights.triangles().len().max(1));
        let strength = |t: u32| f64::from(luminance(scene.material(t).emission));
        let unit = lights.triangles().iter().map(|&t| strength(t) * scene.area(t)).fold(0.0, f64::max);
        let (mut faces, mut images, mut emitters) = (HashMap::new(), Vec::new(), Vec::new());
        for (number, Flat { plane, faces: shown, .. }) in (0_u8..).zip(&mirrors) {
            faces.extend(shown.iter().map(|&(triangle, ks)| (triangle, (number, ks))));
            let reflectance = shown.iter().map(|(_, ks)| f64::from(luminance(ks.to_array()))).fold(0.0, f64::max);
            for &triangle in lights.triangles() {
                let power = strength(triangle) * scene.area(triangle) * reflectance / unit;
                let normal = plane.reflect_direction(scene.normal(triangle));
                let two_sided = scene.material(triangle).two_sided_emission;
                emitters.push(Emitter::new(corners(plane, scene.corners(triangle)), normal, power, two_sided));
                images.push((triangle, number));
            }
        }
        if images.is_empty() {
            return None;
        }
        let planes = mirrors.into_iter().map(|mirror| mirror.plane).collect();
        let mirrors = Arc::new(Mirrors { lamps: lamps.clone(), planes, faces, images });
        let lights = Lights::over((0..mirrors.images.len() as u32).collect(), emitters);
        let lights = lights.with_cells(&lamps.raycaster, mirrors.clone());
        Some(Self { mirrors, lights })
    }

    /// Whether this triangle is a mirror that shows images.
    pub(crate) fn shows(&self, triangle: u32) -> bool {
        self.mirrors.faces.contains_key(&triangle)
    }
}

/// All of a plane that mirrors.
struct Flat {
    plane: Plane,
    area: f64,
    faces: Vec<(u32, Vec3)>,
}

/// The planes that mirror, the largest first.
fn flat(scene: &Scene, surfaces: &[Surface]) -> Vec<Flat> {
    let (low, high) = scene.bounds();
    let size = (high - low).max_element();
    let shine = |t: u32| match surfaces[scene.material_ids[t as usize] as usize].scatter {
        Scatter::Mirror(ks) => Some(ks),
        _ => None,
    };
    // The largest first: a curved mirror of many small ones takes no place from a flat one.
    let mut shining: Vec<(f64, u32, Vec3)> =
        (0..scene.triangles.len() as u32).filter_map(|t| Some((scene.area(t), t, shine(t)?))).collect();
    shining.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut found: Vec<Flat> = Vec::new();
    for (area, triangle, ks) in shining {
        let (corners, normal) = (scene.corners(triangle), scene.normal(triangle));
        let lies = |flat: &&mut Flat| {
            flat.plane.normal.cross(normal).length() <= BENT
                && corners.iter().all(|&corner| flat.plane.height(corner).abs() <= FLAT * size as f32)
        };
        if let Some(flat) = found.iter_mut().find(lies) {
            flat.area += area;
            flat.faces.push((triangle, ks));
            flat.plane.hold(corners);
        } else if found.len() < PLANES && normal != Vec3::ZERO {
            let mut plane = Plane { normal, offset: corners[0].dot(normal), low: corners[0], high: corners[0] };
            plane.hold(corners);
            found.push(Flat { plane, area, faces: vec![(triangle, ks)] });
        }
    }
    found.retain(|flat| flat.area >= LEAST_AREA * size * size);
    found.sort_by(|a, b| b.area.total_cmp(&a.area));
    found
}

/// A triangle behind a plane, with its front where it is seen.
fn corners(plane: &Plane, [a, b, c]: [Vec3; 3]) -> [Vec3; 3] {
    [a, c, b].map(|corner| plane.reflect(corner))
}

impl Stage for Mirrors {
    /// Where none sees any, none is sampled.
    fn probes(&self) -> usize {
        16
    }

    fn triangle(&self, light: u32) -> u32 {
        self.images[light as usize].0
    }

    fn vertices(&self, light: u32) -> [Vec3; 3] {
        let (triangle, plane) = self.images[light as usize];
        corners(&self.planes[plane as usize], self.lamps.raycaster.vertices(triangle))
    }

    fn point(&self, light: u32, [u, v]: [f32; 2]) -> (Vec3, Vec3) {
        let (triangle, plane) = self.images[light as usize];
        let plane = &self.planes[plane as usize];
        let (point, normal) = self.lamps.point(triangle, [v, u]);
        (plane.reflect(point), plane.reflect_direction(normal))
    }

    fn may_show(&self, at: Vec3, light: u32, barycentrics: [f32; 2]) -> bool {
        let plane = &self.planes[self.images[light as usize].1 as usize];
        plane.is_crossed(at, self.point(light, barycentrics).0)
    }

    fn arriving(&self, at: &SurfacePoint, light: u32, [u, v]: [f32; 2]) -> Vec3 {
        let (triangle, plane) = self.images[light as usize];
        let image = self.point(light, [u, v]).0;
        if !self.planes[plane as usize].is_crossed(at.point, image) {
            return Vec3::ZERO;
        }
        let Some(direction) = (image - at.point).try_normalize() else { return Vec3::ZERO };
        let Some((mirror, share)) = self.lamps.panes.to_face(&self.lamps.raycaster, at, direction) else {
            return Vec3::ZERO;
        };
        match self.faces.get(&mirror.triangle) {
            Some(&(shown_by, ks)) if shown_by == plane => share * ks * self.lamps.arriving(&mirror, triangle, [v, u]),
            _ => Vec3::ZERO,
        }
    }
}
