//! Virtual distances: the distance at which something seen in flat mirrors or through flat glass
//! appears to be (Larson & Simmons 1999, §2.3, `VDISTANCE`).
//!
//! A ray is followed from one flat smooth surface to the next. At each it takes reflection or
//! transmission, whichever carries more light, and the lengths are summed as if it went straight.
//! It ends at the first diffuse, glossy, emitting or curved surface. A point that far along the
//! first ray is the image of that surface, except that refraction by glass is ignored.
//!
//! Invariant: there is no randomness, so all samples of a surface agree. The distance is never
//! less than the first surface's. A scene without flat smooth surfaces has no [`VirtualDistance`]
//! and pays nothing.

use std::collections::HashMap;

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, spawn};
use holo_scene::{Bsdf, Scene};

use crate::bsdf::Scatter;
use crate::engine::PathEngine;
use crate::geometry::ShadingFrame;
use crate::luminance::luminance;
use crate::medium::{Crossing, TOUCH};
use crate::path::Start;
use holo_optics::{dielectric, mirrored, pane, refract};

/// Most surfaces on the way. Between two mirrors that face each other, a ray would never end.
const MAX_PASSED: u32 = 64;

/// Sine of the least angle between two triangles of a curved surface, 0.1°. Polygons whose corners
/// were rounded are flat.
const BENT: f32 = 1.7e-3;

/// Cosine of the greatest angle between two triangles of a curved surface, 45°. A greater angle is
/// an edge between flat surfaces.
const SMOOTH: f32 = 0.707;

/// The triangles that show images at a distance of their own.
#[derive(Debug)]
pub(crate) struct VirtualDistance {
    /// By triangle: whether it is smooth and not part of a curved surface.
    flat: Vec<bool>,
}

impl VirtualDistance {
    /// Finds the flat smooth triangles of a scene. `None` if there are none.
    pub(crate) fn new(scene: &Scene) -> Option<Self> {
        let smooth: Vec<bool> = scene
            .materials
            .iter()
            .map(|material| match material.bsdf {
                Bsdf::Mirror { .. } | Bsdf::ThinGlass { .. } => true,
                Bsdf::Dielectric { alpha, .. } => alpha == 0.0,
                Bsdf::Diffuse { .. } | Bsdf::Conductor { .. } | Bsdf::Coated { .. } => false,
            })
            .collect();
        let is_even = |m: u32| scene.has_even_finish(m as usize);
        let mut flat: Vec<bool> =
            scene.material_ids().map(|m| smooth[m as usize] && is_even(m)).collect();
        // Triangles by edge and material. Edges are compared by position, because files repeat
        // vertices.
        let mut sides: HashMap<(u32, [[u32; 3]; 2]), Vec<u32>> = HashMap::new();
        for triangle in (0..flat.len() as u32).filter(|&t| smooth[scene.material_id(t) as usize]) {
            let corners =
                scene.corners(triangle).map(|c| (c + Vec3::ZERO).to_array().map(f32::to_bits));
            for k in 0..3 {
                let mut edge = [corners[k], corners[(k + 1) % 3]];
                edge.sort_unstable();
                sides.entry((scene.material_id(triangle), edge)).or_default().push(triangle);
            }
        }
        for triangles in sides.values() {
            let normals = || triangles.iter().map(|&t| scene.normal(t));
            for (&triangle, normal) in triangles.iter().zip(normals()) {
                if normals()
                    .any(|n| n.cross(normal).length() > BENT && n.dot(normal).abs() > SMOOTH)
                {
                    flat[triangle as usize] = false;
                }
            }
        }
        flat.contains(&true).then_some(Self { flat })
    }

    /// Returns the virtual distance of what a ray shows whose first surface is `first` away.
    /// Infinity if that is the sky.
    pub(crate) fn along(
        &self,
        engine: &PathEngine,
        raycaster: &Raycaster,
        start: Start,
        first: f64,
    ) -> f64 {
        let scene = raycaster.scene();
        let Start { mut hit, mut direction, mut inside, .. } = start;
        let mut distance = first;
        let mut left: Option<Vec3> = None;
        for _ in 0..MAX_PASSED {
            let Some(found) = hit else { return f64::INFINITY };
            let point = raycaster.surface(found.triangle, found.u, found.v);
            let material = scene.material_id(found.triangle);
            let surface = &engine.surfaces[material as usize];
            let crossing = engine
                .nesting
                .as_ref()
                .and_then(|n| n.cross(raycaster, &point, material, direction, &inside));
            let (scatter, beyond) = match &crossing {
                None => (&surface.scatter, None),
                Some(Crossing::Boundary { scatter, beyond }) => (scatter, Some(beyond)),
                Some(Crossing::Opaque(touching)) => {
                    hit = Some(Hit { t: found.t, ..*touching });
                    continue;
                }
            };
            if let Some(left) = left {
                distance +=
                    f64::from(left.distance(raycaster.point(found.triangle, found.u, found.v)));
            }
            let front = direction.dot(point.normal) < 0.0;
            let frame = ShadingFrame::new(if front { point.normal } else { -point.normal });
            let wo = frame.to_local(-direction);
            let there = matches!(scatter, Scatter::Clear { .. });
            let emits = surface.emits && (front || surface.two_sided);
            let next = (there || self.flat[found.triangle as usize]) && !emits && wo.z > 0.0;
            let Some(wi) = next.then(|| onwards(scatter, wo, front)).flatten() else {
                return distance;
            };
            if let Some(beyond) = beyond.filter(|_| wi.z < 0.0) {
                inside = *beyond;
            }
            left = Some(raycaster.point(found.triangle, found.u, found.v));
            direction = frame.to_world(wi).normalize();
            let error = if crossing.is_some() { point.error * TOUCH } else { point.error };
            let ray = Ray::new(spawn(point.point, error, point.normal, direction), direction);
            hit = raycaster.nearest_from(&ray, found.triangle);
        }
        distance
    }
}

/// Returns the direction of the largest share of the light that a smooth surface sends to `wo`.
/// `None` if the surface is not smooth.
fn onwards(scatter: &Scatter, wo: Vec3, front: bool) -> Option<Vec3> {
    let goes_through = |reflected: f32, transmittance: Vec3| {
        (1.0 - reflected) * luminance(transmittance.to_array()) >= reflected
    };
    match scatter {
        Scatter::Mirror(_) => Some(mirrored(wo)),
        Scatter::Clear { .. } => Some(-wo),
        Scatter::Pane { ior, transmittance } => {
            Some(if goes_through(pane(wo.z, *ior), *transmittance) { -wo } else { mirrored(wo) })
        }
        Scatter::Smooth { eta, transmittance } => {
            let eta = if front { *eta } else { 1.0 / eta };
            let (reflected, beyond) = dielectric(wo.z, eta);
            let through = goes_through(reflected, *transmittance);
            Some(if through { refract(wo, Vec3::Z, beyond, eta) } else { mirrored(wo) })
        }
        Scatter::Black
        | Scatter::Diffuse(_)
        | Scatter::Conductor(_)
        | Scatter::Rough { .. }
        | Scatter::Coated(_) => None,
    }
}
