//! Faces at one place: triangles that lie in one plane and overlap, however they are cut.
//!
//! Of these, a ray meets the one that faces it, then the one that emits light, then the earlier in
//! the file.
//!
//! Invariants:
//! - A scene without such triangles has no [`Coincident`], and pays nothing after it was prepared.
//! - Which of them a ray meets does not depend on the rounding of their distances.
//! - Boundaries of solid glass take no part: where solids touch, light passes between them.

use std::cell::RefCell;

use glam::{DVec3, Vec3};
use holo_scene::{Bsdf, Scene};
use rayon::prelude::*;

use crate::facet::Facet;
use crate::node::Hierarchy;
use crate::search::{find, triangles};

/// Greatest distance between two faces at one place, over the largest coordinate: a few roundings
/// of f32.
const APART: f64 = 4.0 * f32::EPSILON as f64;
/// Greatest sine between their normals. Long triangles may lean less, because their corners are
/// within [`APART`].
const LEANS: f64 = 1e-3;
/// Triangles in planes at the same distance from the origin that are looked at before a triangle
/// counts as one with others in its plane.
const MATES: usize = 64;
/// Least depth of an overlap, over the largest side of the smaller triangle. Neighbours that share
/// an edge do not overlap.
const OVERLAP: f64 = 1e-4;

/// The faces at one place of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Coincident {
    /// One bit for each triangle: set if another one lies at its place, in part.
    shares: Vec<u64>,
    /// Greatest distance between faces at one place.
    apart: f64,
}

impl Coincident {
    /// Finds the faces at one place among the triangles that belong to no instance. `None` if there
    /// are none. `reach` is the largest coordinate.
    pub(crate) fn find(
        scene: &Scene,
        facets: &[Facet],
        hierarchy: &Hierarchy,
        reach: f32,
    ) -> Option<Self> {
        let apart = APART * f64::from(reach);
        let is_shared = |triangle: &u32| shares_place(scene, facets, hierarchy, *triangle, apart);
        let found = with_mates(scene, facets, apart).into_par_iter().filter(is_shared);
        let found: Vec<u32> = found.collect();
        if found.is_empty() {
            return None;
        }
        let mut shares = vec![0; facets.len().div_ceil(64)];
        found.iter().for_each(|&triangle| shares[triangle as usize / 64] |= 1 << (triangle % 64));
        Some(Self { shares, apart })
    }

    /// Returns the faces at one place whose bits were stored. `None` if there are no bits.
    pub(crate) fn of_bits(bits: &[u64], reach: f32) -> Option<Self> {
        let apart = APART * f64::from(reach);
        (!bits.is_empty()).then(|| Self { shares: bits.to_vec(), apart })
    }

    /// Returns the bits to store.
    pub(crate) fn bits(&self) -> &[u64] {
        &self.shares
    }

    /// Returns whether another triangle lies at the place of a triangle, in part.
    #[inline]
    pub(crate) fn shares(&self, triangle: u32) -> bool {
        self.shares.get(triangle as usize / 64).is_some_and(|bits| bits >> (triangle % 64) & 1 != 0)
    }

    /// Returns all triangles that have others at their place, in rising order.
    pub(crate) fn triangles(&self) -> Vec<u32> {
        let all = 0..64 * self.shares.len() as u32;
        all.filter(|&triangle| self.shares(triangle)).collect()
    }

    /// Returns whether a triangle lies in the plane of another one. Both share their places.
    pub(crate) fn lies_in_plane(&self, facets: &[Facet], triangle: u32, other: u32) -> bool {
        self.shares(other)
            && are_coplanar(corners(facets, triangle), corners(facets, other), self.apart)
    }

    /// Returns the other triangles at a point of a triangle, with the point's barycentric weights,
    /// in rising order.
    pub(crate) fn at(
        &self,
        facets: &[Facet],
        hierarchy: &Hierarchy,
        triangle: u32,
        point: Vec3,
    ) -> Vec<(u32, [f32; 2])> {
        let at = point.as_dvec3();
        let enters = |least: DVec3, most: DVec3| {
            least.cmple(at + self.apart).all() && most.cmpge(at - self.apart).all()
        };
        let found = RefCell::new(Vec::new());
        find(hierarchy, enters, |leaf| {
            for other in triangles(hierarchy, leaf).filter(|&other| other != triangle) {
                if let Some(weights) = within(&facets[other as usize], point)
                    && self.lies_in_plane(facets, triangle, other)
                {
                    found.borrow_mut().push((other, weights));
                }
            }
            false
        });
        let mut found = found.into_inner();
        found.sort_unstable_by_key(|(other, _)| *other);
        // A hierarchy may refer to a triangle several times.
        found.dedup_by_key(|(other, _)| *other);
        found
    }
}

fn corners(facets: &[Facet], triangle: u32) -> [DVec3; 3] {
    facets[triangle as usize].vertices.map(|vertex| vertex.as_dvec3())
}

/// Returns the order in which a ray meets a triangle among those at its place: the least first.
#[inline]
pub(crate) fn rank(
    scene: &Scene,
    facets: &[Facet],
    triangle: u32,
    direction: Vec3,
) -> (bool, bool, u32) {
    let faces_away = facets.get(triangle as usize).is_some_and(|f| f.normal.dot(direction) > 0.0);
    let material = scene.material(triangle);
    let glows = material.emits() && (!faces_away || material.two_sided_emission);
    (faces_away, !glows, triangle)
}

/// Returns the barycentric weights of the point of a triangle next to `point`, if it lies within
/// the triangle.
fn within(facet: &Facet, point: Vec3) -> Option<[f32; 2]> {
    let [a, b, c] = facet.vertices.map(|vertex| vertex.as_dvec3());
    let (ab, ac, ap) = (b - a, c - a, point.as_dvec3() - a);
    let (d00, d01, d11) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
    let (d20, d21) = (ap.dot(ab), ap.dot(ac));
    let area = d00 * d11 - d01 * d01;
    let u = (d11 * d20 - d01 * d21) / area;
    let v = (d00 * d21 - d01 * d20) / area;
    // Rounding must not let a point on an edge fall between two triangles.
    let margin = f64::from(facet.margin);
    let is_within = u >= -margin && v >= -margin && u + v <= 1.0 + margin;
    is_within.then(|| [u, v].map(|c| c.clamp(0.0, 1.0) as f32))
}

/// Returns the triangles for which another one may lie in the same plane.
fn with_mates(scene: &Scene, facets: &[Facet], apart: f64) -> Vec<u32> {
    let own = scene.own().material_ids;
    let takes_part = |triangle: &u32| {
        let material = &scene.materials[own[*triangle as usize] as usize];
        !matches!(material.bsdf, Bsdf::Dielectric { .. })
    };
    // Planes at different distances from the origin are different planes.
    let distance = |triangle: u32| {
        let Facet { vertices, normal, .. } = facets[triangle as usize];
        vertices[0].as_dvec3().dot(normal.as_dvec3()).abs()
    };
    let mut sorted: Vec<(f64, u32)> = (0..facets.len() as u32)
        .into_par_iter()
        .filter(takes_part)
        .map(|triangle| (distance(triangle), triangle))
        .collect();
    sorted.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // The normal's own rounding turns a plane by half a unit of the largest coordinate.
    let window = 4.0 * apart;
    let has_mate = |&place: &usize| {
        let (distance, triangle) = sorted[place];
        let normal = facets[triangle as usize].normal;
        let mut seen = 0;
        let mut is_mate = |&(other, number): &(f64, u32)| {
            seen += 1;
            seen > MATES
                || (other - distance).abs() <= window
                    && facets[number as usize].normal.cross(normal).length() < LEANS as f32
        };
        let near = |other: &&(f64, u32)| (other.0 - distance).abs() <= window;
        sorted[place + 1..].iter().take_while(near).any(&mut is_mate)
            || sorted[..place].iter().rev().take_while(near).any(&mut is_mate)
    };
    let places = (0..sorted.len()).into_par_iter();
    places.filter(has_mate).map(|place| sorted[place].1).collect()
}

/// Returns whether another triangle overlaps a triangle in its plane.
fn shares_place(
    scene: &Scene,
    facets: &[Facet],
    hierarchy: &Hierarchy,
    triangle: u32,
    apart: f64,
) -> bool {
    let own = corners(facets, triangle);
    let low = own.into_iter().fold(DVec3::INFINITY, DVec3::min) - apart;
    let high = own.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max) + apart;
    let enters = |least: DVec3, most: DVec3| least.cmple(high).all() && most.cmpge(low).all();
    find(hierarchy, enters, |leaf| {
        triangles(hierarchy, leaf).any(|other| {
            other != triangle
                && overlap(own, corners(facets, other), apart)
                && !matches!(scene.material(other).bsdf, Bsdf::Dielectric { .. })
        })
    })
}

/// Returns whether two triangles lie in one plane and have an area in common.
fn overlap(one: [DVec3; 3], other: [DVec3; 3], apart: f64) -> bool {
    if !are_coplanar(one, other, apart) {
        return false;
    }
    let normals = [one, other].map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero());
    let longest =
        |[a, b, c]: [DVec3; 3]| (b - a).length().max((c - b).length()).max((a - c).length());
    let least = OVERLAP * longest(one).min(longest(other)) + 2.0 * apart;
    // Two convex shapes are disjoint if an edge of one separates them.
    let separates = |corners: &[DVec3; 3], normal: DVec3, others: &[DVec3; 3]| {
        (0..3).any(|k| {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let Some(outwards) = (to - from).cross(normal).try_normalize() else { return false };
            others.iter().all(|corner| outwards.dot(*corner - from) > -least)
        })
    };
    !separates(&one, normals[0], &other) && !separates(&other, normals[1], &one)
}

/// Returns whether two triangles lie in one plane.
fn are_coplanar(one: [DVec3; 3], other: [DVec3; 3], apart: f64) -> bool {
    let normals = [one, other].map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero());
    let lies_in = |plane: DVec3, at: DVec3, corners: &[DVec3; 3]| {
        corners.iter().all(|corner| plane.dot(*corner - at).abs() <= apart)
    };
    // A large triangle's plane is the better known.
    normals[0].cross(normals[1]).length() <= LEANS
        && (lies_in(normals[0], one[0], &other) || lies_in(normals[1], other[0], &one))
}
