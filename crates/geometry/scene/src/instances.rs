//! Where the meshes of a scene are that occur several times, and where their geometry is stored.
//!
//! The arrays of a [`Scene`](crate::Scene) begin with its own triangles, and those of shared meshes follow. The
//! number of a triangle hides this: own triangles have the first numbers, and then those of each
//! instance follow in its mesh's order. A scene and its [`flattened`](crate::Scene::flattened) form have
//! the same triangles with the same numbers.
//!
//! Invariants:
//! - Every triangle of every instance has an area, and its corners are within
//!   [`limits`](crate::limits).
//! - Every mesh has an instance, and triangles use all of its positions.

use std::ops::Range;

use crate::SceneError;
use crate::geometry::check_limit;
use crate::limits::MAX_TRIANGLES;
use crate::placement::Placement;

/// A mesh at a place in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The mesh, in the order of [`Scene::meshes`](crate::Scene::meshes).
    pub mesh: u32,
    /// The number of its first triangle.
    pub first_triangle: u32,
    /// The place.
    pub placement: Placement,
}

/// The part of a scene's arrays that belongs to a mesh. Triangles count their corners from the
/// mesh's first position.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MeshRange {
    pub positions: Range<usize>,
    pub triangles: Range<usize>,
}

/// All instances of a scene, at least one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct InstanceTable {
    pub own: MeshRange,
    pub meshes: Vec<MeshRange>,
    pub instances: Vec<Instance>,
    /// Number of triangles of the scene.
    pub triangles: u32,
}

impl InstanceTable {
    /// Returns where a triangle is stored, and its instance if it belongs to one.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub(crate) fn locate(&self, triangle: u32) -> (usize, Option<&Instance>) {
        assert!(triangle < self.triangles, "there is no triangle {triangle}");
        if (triangle as usize) < self.own.triangles.end {
            return (triangle as usize, None);
        }
        let after = self.instances.partition_point(|one| one.first_triangle <= triangle);
        let instance = &self.instances[after - 1];
        let first = self.meshes[instance.mesh as usize].triangles.start;
        (first + (triangle - instance.first_triangle) as usize, Some(instance))
    }

    /// Makes room for further triangles of the scene's own.
    pub(crate) fn shift(&mut self, positions: usize, triangles: usize) -> Result<(), SceneError> {
        let total = self.triangles as usize + triangles;
        check_limit("triangles of instances", total, MAX_TRIANGLES)?;
        self.triangles = total as u32;
        self.own.positions.end += positions;
        self.own.triangles.end += triangles;
        for part in &mut self.meshes {
            part.positions = part.positions.start + positions..part.positions.end + positions;
            part.triangles = part.triangles.start + triangles..part.triangles.end + triangles;
        }
        self.instances.iter_mut().for_each(|one| one.first_triangle += triangles as u32);
        Ok(())
    }
}
