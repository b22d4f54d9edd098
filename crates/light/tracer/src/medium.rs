//! The solid that fills each point of space, so that nested, overlapping and touching glass
//! refracts correctly.
//!
//! A point is inside the solids whose closed surfaces wind around it. Windings are counted by
//! material: +1 where a path enters through the counter-clockwise side, -1 where it leaves. These
//! counts alone determine what fills the point:
//! - If a point is inside several solids, the one of highest priority fills it (Schmidt and Budge
//!   2002, "Simple Nested Dielectrics in Ray Traced Images", JGT 7(2)). Later materials of the
//!   scene have higher priority, so contents come after their container. A material of index at
//!   most 1 (a bubble) precedes all others. Overlapping pieces of one material are one piece.
//! - A solid with reversed winding inside another solid is a hole. So bubbles may be drawn as
//!   surfaces of the glass that face inwards, or as solids of index 1 that face either way. A
//!   reversed solid that stands alone is treated as if it faced outwards.
//! - An index below 1 is relative to the surroundings: `Ni 0.667` in glass of 1.5 is air.
//!
//! A surface between a solid and itself has no effect: no bend, no reflection, no colour. Any other
//! one has the ratio of the two indices, and the roughness and colour (`Tf`, once per crossing) of
//! its own material. A path crosses surfaces that touch as one. An opaque surface that touches the
//! boundary of a solid hides it.
//!
//! Invariant: a boundary is the same from both sides, because what fills a point does not depend
//! on the path that leads there. At most [`DEPTH`] materials are counted at a point; further ones
//! are ignored. A surface that is not closed has no inside: an eye is never inside it, and a path
//! is inside from crossing it on.

mod boxes;

use std::sync::Arc;

use boxes::Boxes;
use glam::{DVec3, Vec3};
use holo_raycast::{Hit, NO_TRIANGLE, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, Material, Scene};

use crate::bsdf::{SAME_INDEX, Scatter};
use crate::interface::Interface;
use holo_optics::Ggx;

/// Most materials that a point may be inside of.
const DEPTH: usize = 8;
/// Most surfaces that touch at a point, beside the one that was met.
const TOUCHING: usize = 4;
/// Most surfaces crossed to find which solids contain an eye.
const MAX_PASSED: usize = 4096;
/// Most pairs of indices at rough surfaces that have tables. A table takes a few milliseconds to
/// compute.
const MAX_PAIRS: usize = 64;
/// Factor on the rounding error of one surface within which two surfaces count as touching. It
/// exceeds 1 because the corners of both were rounded.
pub(crate) const TOUCH: f32 = 4.0;
/// A direction along no axis or diagonal that scenes use.
const PROBE: Vec3 = Vec3::new(0.367_879, 0.577_216, 0.729_027);

/// The solids that contain a point: materials, and how often their surfaces wind around it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Inside {
    entries: [(u32, i32); DEPTH],
    count: usize,
}

impl Inside {
    fn entries(&self) -> &[(u32, i32)] {
        &self.entries[..self.count]
    }

    fn winding(&self, material: u32) -> i32 {
        self.entries().iter().find(|e| e.0 == material).map_or(0, |e| e.1)
    }

    /// Crosses a surface; `inwards`: the surface is met on its front.
    fn pass(&mut self, material: u32, inwards: bool) {
        let step = if inwards { 1 } else { -1 };
        if let Some(i) = self.entries().iter().position(|e| e.0 == material) {
            self.entries[i].1 += step;
            if self.entries[i].1 == 0 {
                self.count -= 1;
                self.entries[i] = self.entries[self.count];
            }
        } else if self.count < DEPTH {
            self.entries[self.count] = (material, step);
            self.count += 1;
        }
    }
}

/// The material of a solid.
#[derive(Clone, Copy, Debug)]
struct Solid {
    ior: f32,
    alpha: f32,
    transmittance: Vec3,
}

/// The solids of a scene.
#[derive(Debug)]
pub(crate) struct Nesting {
    /// Indexed by material; `None` for materials that are not solids.
    solids: Vec<Option<Solid>>,
    /// Contain all closed surfaces of solids, relative to the scene's origin.
    boxes: Boxes,
    /// Rough interfaces, sorted by key: the bits of the roughness, and of the index on the
    /// clockwise side over that on the other.
    rough: Vec<((u32, u32), Arc<Interface>)>,
}

/// The effect of the surface of a solid on a path.
#[derive(Debug)]
pub(crate) enum Crossing {
    /// It meets the boundary between two media. `beyond`: the solids behind the boundary.
    Boundary { scatter: Scatter, beyond: Inside },
    /// It meets an opaque surface that touches the boundary.
    Opaque(Hit),
}

impl Nesting {
    /// Finds the solids of a scene. `None` if the scene has none; then this module costs nothing.
    pub(crate) fn new(scene: &Scene) -> Option<Self> {
        let solid = |material: &Material| match material.bsdf {
            Bsdf::Dielectric { ior, transmittance, alpha } => {
                Some(Solid { ior, alpha, transmittance: transmittance.into() })
            }
            _ => None,
        };
        let solids: Vec<Option<Solid>> = scene.materials.iter().map(solid).collect();
        let triangles = (0..).zip(scene.material_ids());
        let of_solids = triangles.filter(|&(_, material)| solids[material as usize].is_some());
        let boxes = Boxes::new(of_solids.map(|(triangle, _)| scene.corners(triangle)));
        if boxes.is_empty() {
            return None;
        }
        let rough = rough_interfaces(&solids);
        Some(Self { solids, boxes, rough })
    }

    /// Returns the material that fills a point; `None` for air.
    fn filling(&self, inside: &Inside) -> Option<u32> {
        let best = |positive: bool| {
            inside
                .entries()
                .iter()
                .filter(|e| (e.1 > 0) == positive)
                .map(|e| e.0)
                .max_by_key(|&m| self.priority(m))
        };
        match (best(true), best(false)) {
            (Some(solid), None) | (None, Some(solid)) => Some(solid),
            // A hole in a solid, or no solid at all.
            (Some(_), Some(_)) | (None, None) => None,
        }
    }

    fn priority(&self, material: u32) -> (bool, u32) {
        (self.solids[material as usize].is_some_and(|s| s.ior <= 1.0 + SAME_INDEX), material)
    }

    /// Returns the material that fills a point and its index of refraction.
    fn index(&self, inside: &Inside) -> (Option<u32>, f32) {
        let mut remaining = *inside;
        let filling = self.filling(inside);
        let (mut material, mut index) = (filling, 1.0);
        while let Some(m) = material {
            let ior = self.solids[m as usize].map_or(1.0, |s| s.ior);
            index *= ior;
            if ior >= 1.0 {
                break;
            }
            // The index is relative to what would be here without this material.
            let inwards = remaining.winding(m) < 0;
            while remaining.winding(m) != 0 {
                remaining.pass(m, inwards);
            }
            material = self.filling(&remaining);
        }
        (filling, index)
    }

    /// Returns the solids that contain an eye (world coordinates).
    ///
    /// They are counted along one ray and along the opposite one. For closed surfaces the counts
    /// agree; other surfaces are ignored.
    pub(crate) fn at(&self, raycaster: &Raycaster, eye: DVec3) -> Inside {
        let local = (eye - raycaster.scene().origin).as_vec3();
        let mut inside = Inside::default();
        if !self.boxes.contain(local) {
            return inside;
        }
        let [Some(ahead), Some(behind)] = [PROBE, -PROBE].map(|d| self.around(raycaster, local, d))
        else {
            return inside;
        };
        for &(material, winding) in ahead.entries() {
            if behind.winding(material) == winding {
                inside.entries[inside.count] = (material, winding);
                inside.count += 1;
            }
        }
        inside
    }

    /// Returns the windings around a point from the surfaces that a ray meets on its way to
    /// infinity. `None` if it meets too many.
    fn around(&self, raycaster: &Raycaster, origin: Vec3, direction: Vec3) -> Option<Inside> {
        let direction = direction.normalize();
        let mut inside = Inside::default();
        let mut ray = Ray::new(origin, direction);
        let mut from = NO_TRIANGLE;
        for _ in 0..MAX_PASSED {
            let Some(hit) = raycaster.nearest_from(&ray, from) else { return Some(inside) };
            let point = raycaster.surface(hit.triangle, hit.u, hit.v);
            let material = raycaster.scene().material_id(hit.triangle);
            let mut pass = |material: u32, normal: Vec3| {
                if self.solids[material as usize].is_some() {
                    // The ray leaves what a path towards the point would enter.
                    inside.pass(material, direction.dot(normal) > 0.0);
                }
            };
            pass(material, point.normal);
            touching(raycaster, &point, direction, |_, material, normal| pass(material, normal));
            ray = Ray::new(
                spawn(point.point, point.error * TOUCH, point.normal, direction),
                direction,
            );
            from = hit.triangle;
        }
        None
    }

    /// Returns what happens to a path inside `inside` that meets a surface at `point`. `None` if
    /// the surface is not that of a solid.
    ///
    /// Not inlined, so that the loop of scenes without solids stays short.
    #[inline(never)]
    pub(crate) fn cross(
        &self,
        raycaster: &Raycaster,
        point: &SurfacePoint,
        material: u32,
        direction: Vec3,
        inside: &Inside,
    ) -> Option<Crossing> {
        let solid = self.solids[material as usize]?;
        let front = direction.dot(point.normal) < 0.0;
        let mut beyond = *inside;
        beyond.pass(material, front);
        let mut transmittance = solid.transmittance;
        let mut opaque = None;
        touching(raycaster, point, direction, |hit, material, normal| {
            match self.solids[material as usize] {
                Some(other) => {
                    beyond.pass(material, direction.dot(normal) < 0.0);
                    transmittance *= other.transmittance;
                }
                None => opaque = opaque.or(Some(hit)),
            }
        });
        if let Some(hit) = opaque {
            return Some(Crossing::Opaque(hit));
        }
        let ((here, index_here), (there, index_there)) = (self.index(inside), self.index(&beyond));
        let scatter = if here == there {
            Scatter::Clear { transmittance: Vec3::ONE }
        } else {
            let eta = if front { index_there / index_here } else { index_here / index_there };
            Scatter::dielectric(eta, transmittance, solid.alpha, |ggx| {
                self.interface(ggx, solid.alpha, eta)
            })
        };
        Some(Crossing::Boundary { scatter, beyond })
    }

    fn interface(&self, ggx: Ggx, alpha: f32, eta: f32) -> Arc<Interface> {
        let key = (alpha.to_bits(), eta.to_bits());
        match self.rough.binary_search_by_key(&key, |entry| entry.0) {
            Ok(i) => self.rough[i].1.clone(),
            Err(_) => Arc::new(Interface::without_compensation(ggx, eta)),
        }
    }
}

/// Makes tables for the pairs of indices that may meet at a rough surface; pairs with air come
/// first.
fn rough_interfaces(solids: &[Option<Solid>]) -> Vec<((u32, u32), Arc<Interface>)> {
    let mut indices = vec![1.0_f32];
    for solid in solids.iter().flatten() {
        if !indices.contains(&solid.ior) {
            indices.push(solid.ior);
        }
    }
    // Indices below 1 are relative to the others.
    let relative: Vec<f32> = indices.iter().copied().filter(|&n| n < 1.0).collect();
    let mut all = indices.clone();
    all.extend(
        relative.iter().flat_map(|r| indices.iter().filter(|&&n| n > 1.0).map(move |n| r * n)),
    );
    let mut alphas: Vec<f32> =
        solids.iter().flatten().map(|s| s.alpha).filter(|&a| a > 0.0).collect();
    alphas.sort_unstable_by(f32::total_cmp);
    alphas.dedup();
    let mut made: Vec<((u32, u32), Arc<Interface>)> = Vec::new();
    for (i, &low) in all.iter().enumerate() {
        for &high in &all[i + 1..] {
            for eta in [high / low, low / high] {
                for &alpha in &alphas {
                    let key = (alpha.to_bits(), eta.to_bits());
                    if (eta - 1.0).abs() < SAME_INDEX || made.iter().any(|entry| entry.0 == key) {
                        continue;
                    }
                    if made.len() == MAX_PAIRS {
                        made.sort_unstable_by_key(|entry| entry.0);
                        return made;
                    }
                    made.push((key, Arc::new(Interface::new(Ggx::new(alpha), eta))));
                }
            }
        }
    }
    made.sort_unstable_by_key(|entry| entry.0);
    made
}

/// Calls `found` (hit, material, normal) for each surface that touches `point`, except its own.
///
/// Duplicate surfaces count once, and so do the triangles of one surface that meet at an edge. Two
/// surfaces are the same if their material and side are the same.
fn touching(
    raycaster: &Raycaster,
    point: &SurfacePoint,
    direction: Vec3,
    mut found: impl FnMut(Hit, u32, Vec3),
) {
    let error = point.error * TOUCH;
    let near = spawn(point.point, error, point.normal, -direction);
    let far = spawn(point.point, error, point.normal, direction);
    let material = |triangle: u32| raycaster.scene().material_id(triangle);
    let side = |normal: Vec3| direction.dot(normal) < 0.0;
    let mut seen = [(material(point.triangle), side(point.normal)); TOUCHING + 1];
    let mut count = 1;
    let mut segment = Ray { origin: near, direction: far - near, t_min: 0.0, t_max: 1.0 };
    let mut from = point.triangle;
    for _ in 0..2 * TOUCHING {
        let Some(hit) = raycaster.nearest_from(&segment, from) else { return };
        let (material, normal) = (material(hit.triangle), raycaster.geometric_normal(hit.triangle));
        let this = (material, side(normal));
        if hit.triangle != point.triangle && !seen[..count].contains(&this) {
            if count > TOUCHING {
                return;
            }
            seen[count] = this;
            count += 1;
            found(hit, material, normal);
        }
        segment.t_min = hit.t;
        from = hit.triangle;
    }
}
