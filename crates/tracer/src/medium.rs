//! Which solid fills the place where a path is, so that nested, overlapping and touching glass refracts as it should.
//!
//! A place is inside the solids whose closed surfaces wind around it (counted by material: +1 where a path comes in
//! through the counter-clockwise side, -1 where it goes out). What fills it follows from these numbers alone:
//! - Of several solids, the one of highest priority (Schmidt and Budge 2002, "Simple Nested Dielectrics in Ray Traced
//!   Images", JGT 7(2)): the later material of the scene, so that contents come after their container; but a material of
//!   index at most 1, a bubble, comes before all others. Overlapping pieces of one material are one piece.
//! - A solid wound around the wrong way, within another one, is a hole: bubbles may be drawn as surfaces of the glass that
//!   look inwards, or as solids of index 1 that look either way. Alone, it is taken as if it looked outwards.
//! - An index below 1 is relative to what surrounds it: `Ni 0.667` in glass of 1.5 is air.
//!
//! A surface between a solid and itself is not there: no bend, no reflection, no colour. Any other one has the ratio of
//! the two indices and the roughness and colour (`Tf`, once per crossing) of its own material. Surfaces that touch are
//! crossed as one; what touches an opaque surface is that opaque surface.
//!
//! Always true: a boundary is the same from both sides, since what fills a place depends on the place and not on the way
//! there; at most [`DEPTH`] materials are counted at a place, and further ones are not there. A surface that is not closed
//! has no inside: eyes are taken as outside of it, and a path is inside from crossing it on.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::{Hit, NO_TRIANGLE, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, Scene};

use crate::bsdf::{SAME_INDEX, Scatter};
use crate::interface::Interface;
use crate::microfacet::Ggx;

/// Materials that a place may be inside of.
const DEPTH: usize = 8;
/// Surfaces that touch at a point, beside the one that was met.
const TOUCHING: usize = 4;
/// Surfaces passed in looking for what an eye is inside of.
const MAX_PASSED: usize = 4096;
/// Most pairs of indices at rough surfaces that tables are made for, each some milliseconds' work.
const MAX_PAIRS: usize = 64;
/// How much farther than its rounding a surface is from one that touches it: corners of both were rounded.
pub(crate) const TOUCH: f32 = 4.0;
/// Along no axis or diagonal that builders use.
const PROBE: Vec3 = Vec3::new(0.367_879, 0.577_216, 0.729_027);

/// What a place is inside of: materials and how often their surfaces wind around it.
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

    /// Goes through a surface, inwards if it is met on its front.
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

/// A solid's material.
#[derive(Clone, Copy, Debug)]
struct Solid {
    ior: f32,
    alpha: f32,
    transmittance: Vec3,
}

/// The solids of a scene.
#[derive(Debug)]
pub(crate) struct Nesting {
    /// By material; `None` for what is not a solid.
    solids: Vec<Option<Solid>>,
    /// Bounds of all their surfaces, relative to the scene's origin.
    low: DVec3,
    high: DVec3,
    /// Rough interfaces by the bits of roughness and of the index of the clockwise over the other side, sorted.
    rough: Vec<((u32, u32), Arc<Interface>)>,
}

/// What happens where a path meets the surface of a solid.
#[derive(Debug)]
pub(crate) enum Crossing {
    /// The boundary, and what a path that goes through it is inside of.
    Boundary { scatter: Scatter, beyond: Inside },
    /// An opaque surface touches it.
    Opaque(Hit),
}

impl Nesting {
    /// `None` if the scene has no solids: then nothing here costs anything.
    pub(crate) fn new(scene: &Scene) -> Option<Self> {
        let mut solids = vec![None; scene.materials.len()];
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (triangle, &material) in (0_u32..).zip(&scene.material_ids) {
            let Bsdf::Dielectric { ior, transmittance, alpha } =
                scene.materials[material as usize].bsdf
            else {
                continue;
            };
            solids[material as usize] =
                Some(Solid { ior, alpha, transmittance: transmittance.into() });
            for corner in scene.corners(triangle) {
                (low, high) = (low.min(corner), high.max(corner));
            }
        }
        if low.x > high.x {
            return None;
        }
        let rough = rough_interfaces(&solids);
        Some(Self { solids, low: low.as_dvec3(), high: high.as_dvec3(), rough })
    }

    /// What fills a place: a material, or none for air.
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
            // A hole in a solid, or nothing at all.
            (Some(_), Some(_)) | (None, None) => None,
        }
    }

    fn priority(&self, material: u32) -> (bool, u32) {
        (self.solids[material as usize].is_some_and(|s| s.ior <= 1.0 + SAME_INDEX), material)
    }

    /// The filling and its index of refraction.
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
            // Relative to what would be here without it.
            let inwards = remaining.winding(m) < 0;
            while remaining.winding(m) != 0 {
                remaining.pass(m, inwards);
            }
            material = self.filling(&remaining);
        }
        (filling, index)
    }

    /// What an eye is inside of (world coordinates).
    ///
    /// Counted along a ray and along the opposite one: for closed surfaces both agree, and others do not count.
    pub(crate) fn at(&self, raycaster: &Raycaster, eye: DVec3) -> Inside {
        let local = eye - raycaster.scene().origin;
        let mut inside = Inside::default();
        if !(local.cmpge(self.low).all() && local.cmple(self.high).all()) {
            return inside;
        }
        let [Some(ahead), Some(behind)] =
            [PROBE, -PROBE].map(|d| self.around(raycaster, local.as_vec3(), d))
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

    /// Windings around a place by what a ray from there meets on its way to infinity. `None` if that is too much.
    fn around(&self, raycaster: &Raycaster, origin: Vec3, direction: Vec3) -> Option<Inside> {
        let direction = direction.normalize();
        let mut inside = Inside::default();
        let mut ray = Ray::new(origin, direction);
        let mut from = NO_TRIANGLE;
        for _ in 0..MAX_PASSED {
            let Some(hit) = raycaster.nearest_from(&ray, from) else { return Some(inside) };
            let point = raycaster.surface(hit.triangle, hit.u, hit.v);
            let material = raycaster.scene().material_ids[hit.triangle as usize];
            let mut pass = |material: u32, normal: Vec3| {
                if self.solids[material as usize].is_some() {
                    // Backwards: what is left there is entered here.
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

    /// What happens to a path from `inside` that meets the surface of a solid at `point`; `None` if it is not a solid's.
    ///
    /// Not inlined: scenes without solids keep a short loop.
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

/// Tables for every pair of indices that may meet at a rough surface, those with air first.
fn rough_interfaces(solids: &[Option<Solid>]) -> Vec<((u32, u32), Arc<Interface>)> {
    let mut indices = vec![1.0_f32];
    for solid in solids.iter().flatten() {
        if !indices.contains(&solid.ior) {
            indices.push(solid.ior);
        }
    }
    // Those below 1 are relative to the others.
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

/// Calls `found` (hit, material, normal) for the surfaces that touch `point` beside its own.
///
/// Triangles of one surface that meet in an edge, and surfaces that are there twice, count once: the same material on the
/// same side.
fn touching(
    raycaster: &Raycaster,
    point: &SurfacePoint,
    direction: Vec3,
    mut found: impl FnMut(Hit, u32, Vec3),
) {
    let error = point.error * TOUCH;
    let near = spawn(point.point, error, point.normal, -direction);
    let far = spawn(point.point, error, point.normal, direction);
    let material_ids = &raycaster.scene().material_ids;
    let side = |normal: Vec3| direction.dot(normal) < 0.0;
    let mut seen = [(material_ids[point.triangle as usize], side(point.normal)); TOUCHING + 1];
    let mut count = 1;
    let mut segment = Ray { origin: near, direction: far - near, t_min: 0.0, t_max: 1.0 };
    let mut from = point.triangle;
    for _ in 0..2 * TOUCHING {
        let Some(hit) = raycaster.nearest_from(&segment, from) else { return };
        let (material, normal) =
            (material_ids[hit.triangle as usize], raycaster.geometric_normal(hit.triangle));
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
