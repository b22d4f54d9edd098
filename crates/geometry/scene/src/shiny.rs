//! Shiny objects: connected triangles of one curved material that mirrors or refracts. What such an
//! object shows depends on the direction, and hardly on the place.
//!
//! Flat mirrors and panes are no shiny objects: a ray follows them exactly to what they show.
//!
//! Invariant: the objects are a function of the scene. They are in the order of their first
//! triangles.

use std::collections::HashMap;

use glam::Vec3;

use crate::{Bsdf, Scene};

/// Most triangles of shiny materials. A scene with more has no shiny objects, because their edges
/// would take too much memory and time to compare: 70 bytes and 0.5 µs a triangle.
const MOST_TRIANGLES: usize = 1_000_000;

/// Sine of the least angle between two triangles of a curved surface, 0.1°. Polygons whose corners
/// were rounded are flat.
const BENT: f32 = 1.7e-3;

/// Cosine of the greatest angle between two triangles of a curved surface, 45°. A greater angle is
/// an edge between flat surfaces.
const SMOOTH: f32 = 0.707;

/// Stands for no object.
const NO_OBJECT: u32 = u32::MAX;

/// The shiny objects of a scene, at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct ShinyObjects {
    centres: Vec<Vec3>,
    of_triangles: Vec<u32>,
    /// Objects and their triangles, in order.
    members: Vec<(u32, u32)>,
}

/// The corners of an edge as bits, in rising order, with the material of its triangle.
type Edge = (u32, [[u32; 3]; 2]);

/// Triangles that hang together, by union and find.
struct Groups(Vec<u32>);

impl Groups {
    /// Returns the first triangle of a triangle's group.
    fn first(&mut self, mut one: u32) -> u32 {
        while self.0[one as usize] != one {
            let above = self.0[self.0[one as usize] as usize];
            self.0[one as usize] = above;
            one = above;
        }
        one
    }

    fn join(&mut self, one: u32, other: u32) {
        let (one, other) = (self.first(one), self.first(other));
        self.0[one.max(other) as usize] = one.min(other);
    }
}

/// Returns whether a material mirrors or refracts sharply enough for a direction to matter.
fn is_shiny(bsdf: &Bsdf) -> bool {
    match bsdf {
        Bsdf::Mirror { .. } | Bsdf::Conductor { .. } | Bsdf::Dielectric { .. } => true,
        Bsdf::Diffuse { .. } | Bsdf::ThinGlass { .. } | Bsdf::Coated { .. } => false,
    }
}

impl ShinyObjects {
    /// Finds the shiny objects of a scene. `None` if it has none.
    #[must_use]
    pub fn find(scene: &Scene) -> Option<ShinyObjects> {
        let is_shiny: Vec<bool> = scene.materials.iter().map(|one| is_shiny(&one.bsdf)).collect();
        if !is_shiny.contains(&true) {
            return None;
        }
        let shiny: Vec<u32> = scene
            .triangles()
            .filter(|&triangle| is_shiny[scene.material_id(triangle) as usize])
            .take(MOST_TRIANGLES + 1)
            .collect();
        if shiny.len() > MOST_TRIANGLES {
            return None;
        }
        let (mut groups, is_curved) = connected(scene, &shiny);
        let mut bounds: Vec<(Vec3, Vec3)> = Vec::new();
        let mut of_first: HashMap<u32, u32> = HashMap::new();
        let mut curved_groups = vec![false; shiny.len()];
        for number in 0..shiny.len() as u32 {
            curved_groups[groups.first(number) as usize] |= is_curved[number as usize];
        }
        let mut of_triangles = vec![NO_OBJECT; scene.triangles().len()];
        let mut members = Vec::new();
        for (number, &triangle) in (0..).zip(&shiny) {
            let first = groups.first(number);
            if !curved_groups[first as usize] {
                continue;
            }
            let object = *of_first.entry(first).or_insert_with(|| {
                bounds.push((Vec3::INFINITY, Vec3::NEG_INFINITY));
                bounds.len() as u32 - 1
            });
            of_triangles[triangle as usize] = object;
            members.push((object, triangle));
            let (low, high) = &mut bounds[object as usize];
            for corner in scene.corners(triangle) {
                (*low, *high) = (low.min(corner), high.max(corner));
            }
        }
        if bounds.is_empty() {
            return None;
        }
        members.sort_unstable();
        let centres = bounds.into_iter().map(|(low, high)| low.midpoint(high)).collect();
        Some(ShinyObjects { centres, of_triangles, members })
    }

    /// Returns the middles of all objects' bounds, relative to the scene's origin.
    #[must_use]
    pub fn centres(&self) -> &[Vec3] {
        &self.centres
    }

    /// Returns the number of the object that a triangle belongs to.
    #[must_use]
    #[inline]
    pub fn of(&self, triangle: u32) -> Option<u32> {
        self.of_triangles.get(triangle as usize).copied().filter(|&object| object != NO_OBJECT)
    }

    /// Returns the triangles of an object, in order: pairs of the object and a triangle.
    #[must_use]
    pub fn triangles_of(&self, object: u32) -> &[(u32, u32)] {
        let at = |number: u32| self.members.partition_point(|&(object, _)| object < number);
        &self.members[at(object)..at(object.saturating_add(1))]
    }
}

/// Joins triangles of the same material that share an edge. Returns the groups of their indices,
/// and for each triangle whether a neighbour is slightly bent against it. Edges are compared by
/// position, because files repeat vertices.
fn connected(scene: &Scene, triangles: &[u32]) -> (Groups, Vec<bool>) {
    let mut groups = Groups((0..triangles.len() as u32).collect());
    let mut is_curved = vec![false; triangles.len()];
    // The last triangle at each edge. Where several meet, each is compared with the one before.
    let mut sides: HashMap<Edge, u32> = HashMap::with_capacity(triangles.len() * 3 / 2);
    for (number, &triangle) in (0..).zip(triangles) {
        // Adding zero turns -0 into 0.
        let corners = scene
            .corners(triangle)
            .map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
        let normal = scene.normal(triangle);
        for k in 0..3 {
            let mut edge = [corners[k], corners[(k + 1) % 3]];
            edge.sort_unstable();
            if let Some(other) = sides.insert((scene.material_id(triangle), edge), number) {
                groups.join(number, other);
                let beside = scene.normal(triangles[other as usize]);
                let is_bent =
                    normal.cross(beside).length() > BENT && normal.dot(beside).abs() > SMOOTH;
                is_curved[number as usize] |= is_bent;
            }
        }
    }
    (groups, is_curved)
}
