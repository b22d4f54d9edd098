//! Instances of shared meshes: a hierarchy over the instances, and one over each mesh in its own
//! coordinates.
//!
//! A ray is transformed to a mesh's coordinates for the boxes alone. The triangles of a leaf are
//! placed in the scene, and tested with the ray itself.
//!
//! Invariants: hits have the same bits as in the flattened scene, because placed corners do.
//! The boxes of a mesh are padded for the rounding of the transformed ray in each of its instances.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use holo_scene::{Geometry, Instance, Placement, Scene, coordinate, greatest};
use obvhs::aabb::Aabb;
use rayon::prelude::*;

use crate::build::{self, LEAST_PAD, PAD};
use crate::facet::{BuildError, facets};
use crate::kernel::Query;
use crate::node::{
    Hierarchy, LANES, LARGE_STACK, LEAF, SMALL_STACK, TriangleBlock, WIDTH, WideNode,
};
use crate::prepared::Prepared;
use crate::simd::{STRETCH, Simd, entry, unpack};
use crate::triangle::intersect;
use crate::{Hit, NO_TRIANGLE};

/// The hierarchies of a scene's instances.
#[derive(Debug)]
pub(crate) struct Instances {
    /// Over instances. A leaf is the index of one.
    pub top: Hierarchy,
    /// Over the triangles of meshes, which are numbered from 0. A mesh has several if its instances
    /// need very different padding. Otherwise the boxes of large instances would be as wide as
    /// those of tiny ones.
    pub meshes: Vec<Hierarchy>,
    /// The hierarchy of each instance, as an index into `meshes`.
    pub mesh_of: Vec<u32>,
}

/// Exponents of padding that share a hierarchy: padding is at most 16 times too wide.
const EXPONENTS: u32 = 4;

/// The boxes of a scene's instances, in its order.
pub(crate) fn boxes(scene: &Scene) -> Vec<Aabb> {
    let meshes: Vec<Geometry> = scene.meshes().collect();
    let bounds = |instance: &Instance| {
        let positions = meshes[instance.mesh as usize].positions.iter();
        let (low, high) =
            positions.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| {
                let place = instance.placement.point(p);
                (low.min(place), high.max(place))
            });
        Aabb::new(low.into(), high.into())
    };
    scene.instances().par_iter().map(bounds).collect()
}

impl Instances {
    /// Builds the hierarchies of a scene with these boxes of instances, whose coordinates are at
    /// most `reach`.
    pub(crate) fn build(scene: &Scene, boxes: &[Aabb], reach: f32) -> Result<Self, BuildError> {
        let top = build::over_boxes(boxes, (reach * PAD).max(LEAST_PAD));
        let meshes: Vec<Geometry> = scene.meshes().collect();
        let size = |mesh: &Geometry| {
            mesh.positions.as_flattened().iter().fold(0.0, |most: f32, c| most.max(c.abs()))
        };
        let sizes: Vec<f32> = meshes.iter().map(size).collect();
        // By mesh and exponent: the index of the hierarchy, and its padding.
        let mut groups: BTreeMap<(u32, u32), (u32, f32)> = BTreeMap::new();
        let group = |one: &Instance| {
            let pad = pad(&one.placement, sizes[one.mesh as usize], reach);
            let exponent = pad.to_bits() >> (f32::MANTISSA_DIGITS - 1);
            let next = groups.len() as u32;
            let group = groups.entry((one.mesh, exponent / EXPONENTS)).or_insert((next, LEAST_PAD));
            group.1 = group.1.max(pad);
            group.0
        };
        let mesh_of = scene.instances().iter().map(group).collect();
        let mut groups: Vec<_> = groups.into_iter().collect();
        groups.sort_unstable_by_key(|(_, (index, _))| *index);
        let build = |((mesh, _), (_, pad)): ((u32, u32), (u32, f32))| {
            Ok(build::padded(&facets(&meshes[mesh as usize])?, pad))
        };
        let meshes = groups.into_iter().map(build).collect::<Result<_, _>>()?;
        Ok(Self { top, meshes, mesh_of })
    }

    /// Returns the hierarchy of an instance's mesh.
    #[inline(always)]
    pub(crate) fn mesh(&self, instance: u32) -> &Hierarchy {
        &self.meshes[self.mesh_of[instance as usize] as usize]
    }
}

/// Returns the padding that the boxes of a mesh with coordinates up to `size` need for one
/// instance.
///
/// In the scene, a ray passes its triangle within [`PAD`] reaches, which the inverse enlarges. In
/// the mesh, the ray's origin is as far away as the inverse takes twice the scene's reach and the
/// placement's sum. Its rounding, and that of the test of boxes, is [`PAD`] of this distance and of
/// the mesh, as in a scene of that size.
fn pad(placement: &Placement, size: f32, reach: f32) -> f32 {
    let sum = placement.rows().iter().fold(0.0, |most: f64, row| most.max(row[3].abs()));
    let far = greatest(*placement.inverse()) * (4.0 * f64::from(reach) + sum);
    PAD * (far as f32 + size)
}

/// Finds the nearest hit on an instance that is nearer than `best`, or with `ANY` some hit.
#[inline(always)]
pub(crate) fn traverse_instances<S: Simd, const ANY: bool>(
    simd: S,
    hierarchies: &Instances,
    instances: &[Instance],
    query: &Query,
    best: &mut Hit,
) {
    let mut walk = Walk::<LARGE_STACK>::new(&hierarchies.top, &query.ray, query.t_min, 1.0);
    while let Some(index) = walk.next(simd, best.t) {
        let instance = &instances[index as usize];
        let mesh = hierarchies.mesh(index);
        if mesh.stack_need <= SMALL_STACK {
            visit::<S, SMALL_STACK, ANY>(simd, mesh, instance, query, best);
        } else {
            visit::<S, LARGE_STACK, ANY>(simd, mesh, instance, query, best);
        }
        if ANY && best.triangle != NO_TRIANGLE {
            return;
        }
    }
}

/// Does the same for one instance.
#[inline(always)]
fn visit<S: Simd, const STACK: usize, const ANY: bool>(
    simd: S,
    mesh: &Hierarchy,
    instance: &Instance,
    query: &Query,
    best: &mut Hit,
) {
    let Some((ray, scale)) = local(&instance.placement, &query.ray) else { return };
    let mut walk = Walk::<STACK>::new(mesh, &ray, query.t_min, scale);
    let blocks = mesh.slices().blocks;
    while let Some(block) = walk.next(simd, best.t) {
        let block = placed(&blocks[block as usize], instance);
        intersect(simd, &block, &query.ray, query.t_min, query.skip, best);
        if ANY && best.triangle != NO_TRIANGLE {
            return;
        }
    }
}

/// The leaves of a hierarchy that a ray enters, nearest first.
struct Walk<'a, const STACK: usize> {
    nodes: &'a [WideNode],
    ray: &'a Prepared,
    /// Where the ray begins, in units of its direction.
    begin: f32,
    /// The factor from a query's `t` to these units.
    scale: f32,
    stack: [u64; STACK],
    top: usize,
}

impl<'a, const STACK: usize> Walk<'a, STACK> {
    #[inline(always)]
    fn new(hierarchy: &'a Hierarchy, ray: &'a Prepared, t_min: f32, scale: f32) -> Self {
        let mut stack = [0; STACK];
        // The root is node 0.
        stack[0] = entry(0, 0.0);
        Self { nodes: &hierarchy.nodes, ray, begin: t_min * scale, scale, stack, top: 1 }
    }

    /// Returns the next leaf, if the ray enters one before `t_max`.
    #[inline(always)]
    fn next<S: Simd>(&mut self, simd: S, t_max: f32) -> Option<u32> {
        let end = t_max * self.scale;
        while self.top > 0 {
            self.top -= 1;
            let (child, near) = unpack(self.stack[self.top]);
            // Stretched, because a hit at the same distance must be found in whatever order boxes
            // are visited.
            if near > end * STRETCH {
                continue;
            }
            if child & LEAF != 0 {
                return Some(child & !LEAF);
            }
            let node = &self.nodes[child as usize];
            let (near, mask) = simd.enter(node, self.ray, self.begin, end);
            let free = self.stack.get_mut(self.top..).and_then(|s| s.first_chunk_mut::<WIDTH>());
            if let Some(free) = free {
                simd.stack::<true>(&node.children, &near, mask, free);
            }
            self.top += mask.count_ones() as usize;
        }
        None
    }
}

/// Returns a ray in a mesh's coordinates, and the factor from the ray's `t` to its distances.
///
/// The factor is a power of two that keeps the direction's length near 1, so it adds no rounding.
#[inline(always)]
fn local(placement: &Placement, ray: &Prepared) -> Option<(Prepared, f32)> {
    let rows = placement.rows();
    let inverse = placement.inverse().map(DVec3::from_array);
    let sum = DVec3::new(rows[0][3], rows[1][3], rows[2][3]);
    let origin = Vec3::from_array(ray.origin).as_dvec3() - sum;
    let direction = Vec3::from_array(ray.direction).as_dvec3();
    let turned = |v: DVec3| DVec3::from_array(inverse.map(|row| row.dot(v)));
    let direction = turned(direction);
    /// The exponent of an f64.
    const EXPONENT: u64 = 0x7ff << 52;
    let scale = f64::from_bits(direction.abs().max_element().to_bits() & EXPONENT);
    let ray = Prepared::new(turned(origin).as_vec3(), (direction / scale).as_vec3())?;
    Some((ray, scale as f32))
}

/// Returns a leaf's triangles at their places in the scene.
#[inline(always)]
fn placed(block: &TriangleBlock, instance: &Instance) -> TriangleBlock {
    let rows = instance.placement.rows();
    let order = if instance.placement.is_mirrored() { [0, 2, 1] } else { [0, 1, 2] };
    let mut placed = TriangleBlock::EMPTY;
    let [x, y, z] = &block.vertices;
    for (axis, row) in rows.iter().enumerate() {
        for (vertex, from) in order.into_iter().enumerate() {
            for lane in 0..LANES {
                placed.vertices[axis][vertex][lane] =
                    coordinate(row, [x[from][lane], y[from][lane], z[from][lane]]);
            }
        }
    }
    for lane in 0..LANES {
        // Unused lanes have no number.
        let id = block.id(lane).wrapping_add(instance.first_triangle);
        placed.vertices[0][3][lane] = f32::from_bits(id);
    }
    placed
}
