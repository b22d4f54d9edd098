//! Flat mirrors and panes, grouped by the planes that they lie in.
//!
//! Invariant: a triangle belongs to at most one plane. Mirrors that are too small, too narrow or
//! curved belong to none. A scene without flat mirrors and panes has no planes.

use std::collections::HashMap;

use glam::Vec3;
use holo_scene::Scene;

use crate::bsdf::Scatter;
use crate::fresnel::pane;
use crate::luminance::luminance;
use crate::surface::Surface;

/// Most planes that are distinguished. A curved mirror has one for each triangle.
const PLANES: usize = 64;
/// Least area of a plane over the square of the scene's longest side.
const LEAST_AREA: f64 = 1e-4;
/// Least mean width over that side. Narrow mirrors, such as the facets of a pole, reflect streaks
/// that few rays hit.
const LEAST_WIDTH: f64 = 5e-3;
/// Greatest distance of a mirror's corner from its plane, over that side.
const FLAT: f32 = 1e-5;
/// Sine of the greatest angle between a mirror's normal and its plane's.
const BENT: f32 = 1e-4;
/// Margin around a plane's bounds over their longest side.
const SLACK: f32 = 1e-3;

/// The reflection of a mirror or pane.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Face {
    Mirror(Vec3),
    /// Index of refraction.
    Pane(f32),
}

impl Face {
    fn of(scatter: &Scatter) -> Option<Self> {
        match *scatter {
            Scatter::Mirror(ks) => Some(Self::Mirror(ks)),
            Scatter::Pane { ior, .. } => Some(Self::Pane(ior)),
            _ => None,
        }
    }

    pub(crate) fn reflectance(self, cosine: f32) -> Vec3 {
        match self {
            Self::Mirror(ks) => ks,
            Self::Pane(ior) => Vec3::splat(pane(cosine.abs(), ior)),
        }
    }

    /// Returns the luminance that it reflects of light at normal incidence.
    fn strength(self) -> f32 {
        luminance(self.reflectance(1.0).to_array())
    }
}

/// A plane that contains mirrors or panes: the points x with x · normal = offset.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    normal: Vec3,
    offset: f32,
    /// Bounds of the mirrors and panes.
    low: Vec3,
    high: Vec3,
    /// The face that reflects most.
    pub face: Face,
    area: f64,
}

impl Plane {
    fn new(corners: [Vec3; 3], normal: Vec3, face: Face) -> Self {
        Self {
            normal,
            offset: corners[0].dot(normal),
            low: corners[0],
            high: corners[0],
            face,
            area: 0.0,
        }
    }

    /// Returns whether a triangle lies in the plane, within `slack`.
    fn holds(&self, corners: [Vec3; 3], normal: Vec3, slack: f32) -> bool {
        self.normal.cross(normal).length() <= BENT
            && corners.iter().all(|&c| self.height(c).abs() <= slack)
    }

    fn add(&mut self, corners: [Vec3; 3], face: Face, area: f64) {
        for corner in corners {
            (self.low, self.high) = (self.low.min(corner), self.high.max(corner));
        }
        if face.strength() > self.face.strength() {
            self.face = face;
        }
        self.area += area;
    }

    fn is_large(&self, size: f64) -> bool {
        let length = f64::from((self.high - self.low).length());
        self.area >= LEAST_AREA * size * size && self.area >= LEAST_WIDTH * size * length
    }

    /// Returns the distance of a point, positive on the side of the normal.
    pub(crate) fn height(&self, point: Vec3) -> f32 {
        point.dot(self.normal) - self.offset
    }

    pub(crate) fn reflect(&self, point: Vec3) -> Vec3 {
        point - self.normal * (2.0 * self.height(point))
    }

    pub(crate) fn reflect_direction(&self, direction: Vec3) -> Vec3 {
        direction - self.normal * (2.0 * direction.dot(self.normal))
    }

    /// Returns the cosine of the angle of incidence of a direction of any length.
    pub(crate) fn cosine(&self, direction: Vec3) -> f32 {
        direction.normalize_or_zero().dot(self.normal).abs()
    }

    /// Returns whether a line from `behind` the plane to some point of a sphere before it may cross
    /// the plane's mirrors. The bounds of the mirrors decide. Exact up to rounding for points,
    /// approximate for spheres.
    pub(crate) fn shows(&self, behind: Vec3, center: Vec3, radius: f32) -> bool {
        let below = self.height(behind);
        let above = -self.height(center) * below.signum();
        if below == 0.0 || above <= -radius {
            return false;
        }
        if above <= radius && radius > 0.0 {
            return true;
        }
        let line = center - behind;
        let height = below.abs() + above;
        let share = below.abs() / height;
        let met = behind + line * share;
        // Oblique lines widen the cross-section through which the sphere is seen.
        let spread =
            radius * share * line.length() / height + SLACK * (self.high - self.low).max_element();
        met.cmpge(self.low - spread).all() && met.cmple(self.high + spread).all()
    }
}

/// The mirror planes of a scene.
#[derive(Debug)]
pub(crate) struct Mirrors {
    pub planes: Vec<Plane>,
    /// By triangle of a mirror or pane: the index of its plane, and how it reflects.
    pub faces: HashMap<u32, (u8, Face)>,
}

impl Mirrors {
    /// Finds the planes of mirrors and panes.
    pub(crate) fn find(scene: &Scene, surfaces: &[Surface]) -> Self {
        Self::find_with(scene, |t| Face::of(&surfaces[scene.material_id(t) as usize].scatter))
    }

    /// Finds the planes of the triangles for which `face` returns a reflection.
    pub(crate) fn find_with(scene: &Scene, face: impl Fn(u32) -> Option<Face>) -> Self {
        let (low, high) = scene.bounds();
        let size = (high - low).max_element();
        // A curved mirror has no plane, and a textured one no single reflectance.
        let face = |t: u32| face(t).filter(|_| scene.is_plain(t));
        // The largest first, so that the many small triangles of a curved mirror do not displace a
        // flat mirror.
        let mut shining: Vec<(f64, u32, Face)> = scene
            .triangles()
            .filter_map(|t| face(t).map(|face| (scene.area(t), t, face)))
            .collect();
        shining.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut found: Vec<(Plane, Vec<(u32, Face)>)> = Vec::new();
        for (area, triangle, face) in shining {
            let (corners, normal) = (scene.corners(triangle), scene.normal(triangle));
            let slack = FLAT * size as f32;
            if let Some((plane, faces)) =
                found.iter_mut().find(|(plane, _)| plane.holds(corners, normal, slack))
            {
                plane.add(corners, face, area);
                faces.push((triangle, face));
            } else if found.len() < PLANES && normal != Vec3::ZERO {
                let mut plane = Plane::new(corners, normal, face);
                plane.add(corners, face, area);
                found.push((plane, vec![(triangle, face)]));
            }
        }
        found.retain(|(plane, _)| plane.is_large(size));
        let faces = (0_u8..)
            .zip(&found)
            .flat_map(|(number, (_, faces))| {
                faces.iter().map(move |&(triangle, face)| (triangle, (number, face)))
            })
            .collect();
        Self { planes: found.into_iter().map(|(plane, _)| plane).collect(), faces }
    }
}
