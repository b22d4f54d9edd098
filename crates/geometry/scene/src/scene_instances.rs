//! A scene's meshes that occur several times, and their instances.

use glam::Vec3;

use crate::geometry::{Geometry, check_limit};
use crate::instances::{Instance, InstanceTable, MeshRange};
use crate::limits::{
    MAX_INSTANCES, MAX_MESHES, MAX_SHARED_LAMPS, MAX_THIN_TRIANGLES, MAX_TRIANGLES,
};
use crate::placement::Placement;
use crate::thin::{InstanceFault, Shapes};
use crate::{Scene, SceneError};

impl Scene {
    /// Adds instances of meshes that refer to this scene's materials. Instances are pairs of a
    /// mesh's index and a place. Without instances, the scene stays as it is.
    ///
    /// Normals and textures are added afterwards. They have a value for each stored triangle: those
    /// of the scene come first, and those of each mesh follow.
    ///
    /// # Errors
    /// As [`Scene::new`]. Also if the scene already has instances or [`Shading`](crate::Shading),
    /// or if a mesh does not exist or is empty. Also if there are more than
    /// [`limits`](crate::limits) allow.
    pub fn with_instances(
        mut self,
        meshes: &[Geometry],
        instances: &[(u32, Placement)],
    ) -> Result<Scene, SceneError> {
        if instances.is_empty() {
            return Ok(self);
        }
        let mut parts = Vec::with_capacity(meshes.len());
        let own =
            MeshRange { positions: 0..self.positions.len(), triangles: 0..self.triangles.len() };
        for mesh in meshes {
            let (position, triangle) = (self.positions.len(), self.triangles.len());
            self.positions.to_mut().extend_from_slice(mesh.positions);
            self.triangles.to_mut().extend_from_slice(mesh.triangles);
            self.material_ids.to_mut().extend_from_slice(mesh.material_ids);
            parts.push(MeshRange {
                positions: position..self.positions.len(),
                triangles: triangle..self.triangles.len(),
            });
        }
        self.share(own, parts, instances)
    }

    /// Makes the last parts of the scene's arrays shared meshes.
    pub(crate) fn share(
        mut self,
        own: MeshRange,
        meshes: Vec<MeshRange>,
        instances: &[(u32, Placement)],
    ) -> Result<Scene, SceneError> {
        let problem = |instance, problem| Err(SceneError::Instance { instance, problem });
        check_limit("meshes", meshes.len(), MAX_MESHES)?;
        check_limit("instances", instances.len(), MAX_INSTANCES)?;
        if self.shared.is_some() || self.shading.is_some() {
            return problem(0, "the scene already has instances, normals or textures");
        }
        let mut placed = Vec::with_capacity(instances.len());
        let mut is_used = vec![false; meshes.len()];
        let mut triangles = own.triangles.end;
        for (id, &(mesh, placement)) in instances.iter().enumerate() {
            let Some(part) = meshes.get(mesh as usize) else {
                return problem(id, "its mesh does not exist");
            };
            is_used[mesh as usize] = true;
            placed.push(Instance { mesh, first_triangle: triangles as u32, placement });
            // Both are at most 2²⁸.
            triangles += part.triangles.len();
            check_limit("triangles of instances", triangles, MAX_TRIANGLES)?;
        }
        let is_empty = |part: &MeshRange| part.triangles.is_empty() || part.positions.is_empty();
        if meshes.iter().any(is_empty) || is_used.contains(&false) {
            return problem(0, "a mesh is empty or has no instance");
        }
        let triangles = triangles as u32;
        self.shared = Some(Box::new(InstanceTable { own, meshes, instances: placed, triangles }));
        self.validated()
    }

    /// Checks the triangles of instances.
    pub(crate) fn validate_instances(&self) -> Result<(), SceneError> {
        let Some(shared) = &self.shared else { return Ok(()) };
        for mesh in self.meshes() {
            let mut is_used = vec![false; mesh.positions.len()];
            mesh.triangles.as_flattened().iter().for_each(|&c| is_used[c as usize] = true);
            if is_used.contains(&false) {
                let problem = "its mesh has a position that no triangle uses";
                return Err(SceneError::Instance { instance: 0, problem });
            }
        }
        let lamps = |mesh: &Geometry| {
            let emits = |&&id: &&u32| self.materials[id as usize].emits();
            mesh.material_ids.iter().filter(emits).count()
        };
        let meshes: Vec<Geometry> = self.meshes().collect();
        let lamps: Vec<usize> = meshes.iter().map(lamps).collect();
        // At most the limit of triangles.
        let lamps = shared.instances.iter().map(|one| lamps[one.mesh as usize]).sum();
        check_limit("triangles of instances that emit light", lamps, MAX_SHARED_LAMPS)?;
        let placements = shared.instances.iter().map(|one| (one.mesh, &one.placement));
        let shapes = Shapes::new(&meshes, placements.clone());
        // Bounded before any triangle is tested.
        let tests = placements.map(|(mesh, placement)| shapes.tests(mesh, placement)).sum();
        check_limit("triangles of instances nearly without area", tests, MAX_THIN_TRIANGLES)?;
        for (id, instance) in shared.instances.iter().enumerate() {
            match shapes.fault(instance.mesh, &instance.placement) {
                None => {}
                Some(InstanceFault::TooFar) => {
                    let problem = "a corner of its box is not finite or too far away";
                    return Err(SceneError::Instance { instance: id, problem });
                }
                Some(InstanceFault::NoArea(triangle)) => {
                    return Err(SceneError::NoArea(instance.first_triangle as usize + triangle));
                }
            }
        }
        Ok(())
    }

    /// Returns the meshes that instances share, in their own coordinates.
    pub fn meshes(&self) -> impl ExactSizeIterator<Item = Geometry<'_>> {
        let meshes = self.shared.as_ref().map_or(&[][..], |shared| &shared.meshes);
        meshes.iter().map(|part| self.part(part))
    }

    /// Returns the instances of shared meshes, in the order of their triangles.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        self.shared.as_ref().map_or(&[], |shared| &shared.instances)
    }

    pub(crate) fn part(&self, part: &MeshRange) -> Geometry<'_> {
        Geometry {
            positions: &self.positions[part.positions.clone()],
            triangles: &self.triangles[part.triangles.clone()],
            material_ids: &self.material_ids[part.triangles.clone()],
        }
    }

    fn mesh_of(&self, shared: &InstanceTable, instance: &Instance) -> Geometry<'_> {
        self.part(&shared.meshes[instance.mesh as usize])
    }

    /// Returns the corners of all instances, each once.
    pub(crate) fn shared_points(&self) -> impl Iterator<Item = Vec3> {
        self.shared.iter().flat_map(|shared| &shared.instances).flat_map(|instance| {
            let positions = self.shared.iter().flat_map(|s| self.mesh_of(s, instance).positions);
            positions.map(|&position| instance.placement.point(position))
        })
    }

    /// Returns the materials of all triangles of instances.
    pub(crate) fn shared_material_ids(&self) -> impl Iterator<Item = u32> {
        self.shared.iter().flat_map(|shared| {
            let ids = |instance| self.mesh_of(shared, instance).material_ids.iter().copied();
            shared.instances.iter().flat_map(ids)
        })
    }

    /// Returns where a triangle is stored, and its instance if it belongs to one.
    #[cold]
    #[inline(never)]
    pub(crate) fn located<'a>(
        &self,
        shared: &'a InstanceTable,
        triangle: u32,
    ) -> (usize, Option<&'a Instance>) {
        shared.locate(triangle)
    }

    /// Returns the corners of a triangle of a scene with instances.
    #[cold]
    #[inline(never)]
    pub(crate) fn placed_corners(&self, shared: &InstanceTable, triangle: u32) -> [Vec3; 3] {
        let (stored, instance) = shared.locate(triangle);
        let corners = self.triangles[stored];
        match instance {
            None => corners.map(|corner| Vec3::from(self.positions[corner as usize])),
            Some(instance) => {
                let mesh = self.mesh_of(shared, instance);
                let place = |corner: u32| instance.placement.point(mesh.positions[corner as usize]);
                instance.placement.ordered(corners.map(place))
            }
        }
    }

    /// Returns a triangle's corners in its mesh.
    pub(crate) fn mesh_corners(
        &self,
        shared: &InstanceTable,
        instance: &Instance,
        stored: usize,
    ) -> [[f32; 3]; 3] {
        let mesh = self.mesh_of(shared, instance);
        self.triangles[stored].map(|corner| mesh.positions[corner as usize])
    }

    /// Returns the same scene with a copy of the mesh for each instance. Its triangles have the
    /// same numbers, places, materials and attributes.
    #[must_use]
    pub fn flattened(&self) -> Scene {
        let Some(shared) = &self.shared else { return self.clone() };
        let own = self.own();
        let (mut positions, mut triangles) = (own.positions.to_vec(), own.triangles.to_vec());
        for instance in &shared.instances {
            let (mesh, first) = (self.mesh_of(shared, instance), positions.len() as u32);
            let placement = &instance.placement;
            positions.extend(mesh.positions.iter().map(|&p| placement.point(p).to_array()));
            let moved = mesh.triangles.iter().map(|t| placement.ordered(t.map(|c| first + c)));
            triangles.extend(moved);
        }
        let shading = self.shading.as_ref().map(|shading| {
            let mut flat = shading.clone();
            flat.uvs = self.triangles().filter_map(|t| self.uvs(shading, t)).collect();
            flat.normals = self.triangles().filter_map(|t| self.normals(shading, t)).collect();
            flat.colours = self.triangles().filter_map(|t| self.colours_of(shading, t)).collect();
            let opacities = self.triangles().filter_map(|t| self.opacities_of(shading, t));
            flat.opacities = opacities.collect();
            flat
        });
        Scene {
            origin: self.origin,
            positions: positions.into(),
            triangles: triangles.into(),
            material_ids: self.material_ids().collect(),
            materials: self.materials.clone(),
            sky: self.sky.clone(),
            suns: self.suns.clone(),
            punctual_lights: self.punctual_lights.clone(),
            luminaires: self.luminaires.clone(),
            shading,
            shared: None,
        }
    }
}
