//! The scene: arrays of positions, triangles and materials, and queries about them.
//!
//! A [`Scene`] is valid: [`Scene::new`] and [`Scene::from_world`] check what they make one of, and
//! [`Scene::from_frame`] joins the parts of one that was.

use crate::geometry::{Geometry, check_limit, doubled_area_normal, world_bounds};
use crate::inside::OpenBox;
use crate::instances::InstanceTable;
use crate::limits::{MAX_COORDINATE, MAX_MATERIALS, MAX_POSITIONS, MAX_TRIANGLES};
use crate::luminaire::LuminaireTable;
use crate::{Bsdf, Material, PunctualLight, SceneError, Shading, Sky, Sun};
use glam::{DVec3, Vec3};
use holo_mapped::Array;
use serde::Serialize;
use std::ops::Range;

/// Triangles with materials, around an origin. Triangles are numbered from 0.
///
/// A scene whose public fields were changed is checked again when it is packed and unpacked.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Scene {
    /// World coordinates of the zero of `positions`. For a scene from a file, the centre of the
    /// bounds.
    pub origin: DVec3,
    /// Corners of triangles, relative to `origin`, in scene units.
    pub(crate) positions: Array<[f32; 3]>,
    /// Three indices into `positions` for each triangle, counter-clockwise seen from the front.
    pub(crate) triangles: Array<[u32; 3]>,
    /// An index into `materials` for each triangle.
    pub(crate) material_ids: Array<u32>,
    /// The materials of surfaces.
    pub materials: Vec<Material>,
    /// The sky, with its sun if it has one.
    pub sky: Sky,
    /// Suns of the model, if there are any. They are not seen.
    pub suns: Vec<Sun>,
    /// Point and spot lights, if there are any.
    pub punctual_lights: Vec<PunctualLight>,
    /// Luminaires, if there are any.
    pub(crate) luminaires: Option<Box<LuminaireTable>>,
    /// Normals, textures and colours of corners, if the scene has some.
    pub shading: Option<Box<Shading>>,
    /// Instances of meshes, if the scene has some.
    pub(crate) shared: Option<Box<InstanceTable>>,
}

/// The features that a scene uses. Materials that no triangle has do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Features {
    /// Some surface is [`Bsdf::Diffuse`].
    pub diffuse: bool,
    /// Some surface is [`Bsdf::Mirror`].
    pub mirror: bool,
    /// Some surface is [`Bsdf::Conductor`].
    pub conductor: bool,
    /// Some surface is [`Bsdf::ThinGlass`].
    pub thin_glass: bool,
    /// Some surface is [`Bsdf::Dielectric`] with `alpha` 0.
    pub dielectric: bool,
    /// Some surface is [`Bsdf::Dielectric`] with `alpha` above 0.
    pub rough_dielectric: bool,
    /// Some surface is [`Bsdf::Coated`].
    pub coated: bool,
    /// Number of triangles that emit light.
    pub emitters: usize,
    /// Some triangle emits on both sides.
    pub two_sided_emission: bool,
    /// The sky is not black.
    pub sky: bool,
    /// Number of suns.
    pub suns: usize,
    /// Number of point and spot lights.
    pub punctual_lights: usize,
    /// Number of luminaires.
    pub luminaires: usize,
    /// Some surface is smoothly curved.
    pub smooth: bool,
    /// Some surface has a texture, or colours of its corners.
    pub textures: bool,
}

impl Scene {
    /// Makes a scene. `positions` are relative to `origin`. There may be no triangles.
    ///
    /// # Errors
    /// Anything that is out of range, not finite or not plausible, a triangle without area, or more
    /// than [`crate::limits`] allow.
    pub fn new(
        origin: DVec3,
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        material_ids: Vec<u32>,
        materials: Vec<Material>,
        sky: impl Into<Sky>,
    ) -> Result<Scene, SceneError> {
        let sky = sky.into();
        Scene::unchecked(origin, positions, triangles, material_ids, materials, sky).validated()
    }

    /// Makes a scene that is still to be validated.
    pub(crate) fn unchecked(
        origin: DVec3,
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        material_ids: Vec<u32>,
        materials: Vec<Material>,
        sky: Sky,
    ) -> Scene {
        Scene {
            origin,
            positions: positions.into(),
            triangles: triangles.into(),
            material_ids: material_ids.into(),
            materials,
            sky,
            suns: Vec::new(),
            punctual_lights: Vec::new(),
            luminaires: None,
            shading: None,
            shared: None,
        }
    }

    /// Makes a scene from positions in world coordinates. They are recentred on their bounds.
    /// Positions that no triangle uses and triangles without area are left out. Returns the scene
    /// and the triangles that were left out, in order.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn from_world(
        positions: &[DVec3],
        triangles: &[[u32; 3]],
        material_ids: &[u32],
        materials: Vec<Material>,
        sky: impl Into<Sky>,
    ) -> Result<(Scene, Vec<usize>), SceneError> {
        let (low, high) = world_bounds(positions, triangles)?;
        let origin = if triangles.is_empty() { DVec3::ZERO } else { low + (high - low) * 0.5 };
        Scene::around(origin, positions, triangles, material_ids, materials, sky)
    }

    /// Makes a scene as [`from_world`](Self::from_world), around this origin. The triangles'
    /// corners exist.
    pub(crate) fn around(
        origin: DVec3,
        positions: &[DVec3],
        triangles: &[[u32; 3]],
        material_ids: &[u32],
        materials: Vec<Material>,
        sky: impl Into<Sky>,
    ) -> Result<(Scene, Vec<usize>), SceneError> {
        if triangles.len() != material_ids.len() {
            return Err(SceneError::MaterialIdCount {
                triangles: triangles.len(),
                material_ids: material_ids.len(),
            });
        }
        const UNUSED: u32 = u32::MAX;
        let mut renumbered = vec![UNUSED; positions.len()];
        let mut kept_positions: Vec<[f32; 3]> = Vec::new();
        let mut kept_triangles = Vec::with_capacity(triangles.len());
        let mut kept_ids = Vec::with_capacity(triangles.len());
        let mut left_out = Vec::new();
        for (id, (triangle, &material)) in triangles.iter().zip(material_ids).enumerate() {
            let relative = triangle.map(|corner| (positions[corner as usize] - origin).as_vec3());
            if doubled_area_normal(relative).is_none() {
                left_out.push(id);
                continue;
            }
            let mut corners = [0; 3];
            for k in 0..3 {
                let number = &mut renumbered[triangle[k] as usize];
                if *number == UNUSED {
                    *number = kept_positions.len() as u32;
                    kept_positions.push(relative[k].to_array());
                }
                corners[k] = *number;
            }
            kept_triangles.push(corners);
            kept_ids.push(material);
        }
        let scene = Scene::new(origin, kept_positions, kept_triangles, kept_ids, materials, sky)?;
        Ok((scene, left_out))
    }

    pub(crate) fn validated(self) -> Result<Scene, SceneError> {
        self.validate()?;
        Ok(self)
    }

    fn validate(&self) -> Result<(), SceneError> {
        check_limit("positions", self.positions.len(), MAX_POSITIONS)?;
        check_limit("triangles", self.triangles.len(), MAX_TRIANGLES)?;
        check_limit("materials", self.materials.len(), MAX_MATERIALS)?;
        if !self.origin.to_array().iter().all(|c| c.abs() <= MAX_COORDINATE) {
            return Err(SceneError::Origin);
        }
        let within = |c: &f32| f64::from(c.abs()) <= MAX_COORDINATE;
        if let Some(bad) = self.positions.iter().position(|p| !p.iter().all(within)) {
            return Err(SceneError::Position(bad));
        }
        let (triangles, material_ids) = (self.triangles.len(), self.material_ids.len());
        if triangles != material_ids {
            return Err(SceneError::MaterialIdCount { triangles, material_ids });
        }
        let own = self.own();
        self.check_indices(own)?;
        self.meshes().try_for_each(|mesh| self.check_indices(mesh))?;
        if let Some(bad) = (0..own.triangles.len()).find(|&id| {
            let corners =
                own.triangles[id].map(|corner| Vec3::from(own.positions[corner as usize]));
            doubled_area_normal(corners).is_none()
        }) {
            return Err(SceneError::NoArea(bad));
        }
        self.validate_instances()?;
        self.materials.iter().try_for_each(Material::validate)?;
        self.sky.validate()
    }

    /// Checks that positions and materials of triangles exist.
    pub(crate) fn check_indices(&self, geometry: Geometry) -> Result<(), SceneError> {
        let Geometry { positions, triangles, material_ids } = geometry;
        for (triangle, (corners, &material)) in triangles.iter().zip(material_ids).enumerate() {
            let count = positions.len();
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= count) {
                return Err(SceneError::PositionIndex { triangle, index, count });
            }
            let count = self.materials.len();
            if material as usize >= count {
                return Err(SceneError::MaterialIndex { triangle, index: material, count });
            }
        }
        Ok(())
    }

    /// Returns the numbers of all triangles, those of instances included.
    #[must_use]
    pub fn triangles(&self) -> Range<u32> {
        0..self.shared.as_ref().map_or(self.triangles.len() as u32, |shared| shared.triangles)
    }

    /// Returns the triangles that belong to no instance, relative to the origin. They have the
    /// first numbers.
    #[must_use]
    pub fn own(&self) -> Geometry<'_> {
        match &self.shared {
            None => Geometry {
                positions: &self.positions,
                triangles: &self.triangles,
                material_ids: &self.material_ids,
            },
            Some(shared) => self.part(&shared.own),
        }
    }

    /// Returns the corners of all triangles, relative to the origin. A corner that several
    /// triangles share comes once.
    pub fn points(&self) -> impl Iterator<Item = Vec3> {
        let own = self.own().positions.iter().map(|&position| position.into());
        own.chain(self.shared_points())
    }

    /// Returns the memory of positions, triangles and material ids in bytes.
    #[must_use]
    pub fn geometry_bytes(&self) -> usize {
        size_of_val(&self.positions[..])
            + size_of_val(&self.triangles[..])
            + size_of_val(&self.material_ids[..])
            + size_of_val(self.instances())
    }

    /// Returns whether all triangles of two scenes are at the same places.
    #[must_use]
    pub fn has_same_geometry(&self, other: &Scene) -> bool {
        (self.origin, &self.positions, &self.triangles, &self.shared)
            == (other.origin, &other.positions, &other.triangles, &other.shared)
    }

    /// Returns the corners of a triangle, relative to the origin.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        match &self.shared {
            None => self.triangles[triangle as usize]
                .map(|corner| Vec3::from_array(self.positions[corner as usize])),
            Some(shared) => self.placed_corners(shared, triangle),
        }
    }

    /// Returns the index of a triangle in the scene's arrays.
    #[inline]
    pub(crate) fn stored(&self, triangle: u32) -> usize {
        match &self.shared {
            None => triangle as usize,
            Some(shared) => self.located(shared, triangle).0,
        }
    }

    /// Returns the unit normal of a triangle, on the side from which its corners appear
    /// counter-clockwise.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn normal(&self, triangle: u32) -> Vec3 {
        // Zero only for triangles that a valid scene does not have.
        doubled_area_normal(self.corners(triangle))
            .map_or(Vec3::ZERO, |n| n.normalize_or_zero().as_vec3())
    }

    /// Returns the area of a triangle in square scene units; always above zero.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn area(&self, triangle: u32) -> f64 {
        doubled_area_normal(self.corners(triangle)).map_or(0.0, |n| 0.5 * n.length())
    }

    /// Returns the material of a triangle.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[inline]
    pub fn material(&self, triangle: u32) -> &Material {
        &self.materials[self.material_id(triangle) as usize]
    }

    /// Returns the index of a triangle's material.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn material_id(&self, triangle: u32) -> u32 {
        self.material_ids[self.stored(triangle)]
    }

    /// Returns the index of each triangle's material.
    pub fn material_ids(&self) -> impl Iterator<Item = u32> {
        self.own().material_ids.iter().copied().chain(self.shared_material_ids())
    }

    /// Returns the lowest and highest world coordinates of the triangles; the origin twice if the
    /// scene is empty.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        if self.triangles().is_empty() {
            return (self.origin, self.origin);
        }
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let own = self.own();
        let corners = own.triangles.as_flattened().iter();
        let corners = corners.map(|&corner| Vec3::from_array(own.positions[corner as usize]));
        for corner in corners.chain(self.shared_points()) {
            low = low.min(corner);
            high = high.max(corner);
        }
        (self.origin + low.as_dvec3(), self.origin + high.as_dvec3())
    }

    /// Returns the triangles that emit light, in ascending order.
    pub fn emitters(&self) -> impl Iterator<Item = u32> + '_ {
        let lamps = |ids: &[u32]| -> Vec<u32> {
            let emits = |id: u32| self.materials[id as usize].emits();
            (0..).zip(ids).filter(|&(_, &id)| emits(id)).map(|(triangle, _)| triangle).collect()
        };
        let meshes: Vec<_> = self.meshes().map(|mesh| lamps(mesh.material_ids)).collect();
        let shared = self.instances().iter().flat_map(move |instance| {
            let (first, mesh) = (instance.first_triangle, instance.mesh as usize);
            meshes[mesh].iter().map(|triangle| first + triangle).collect::<Vec<_>>()
        });
        lamps(self.own().material_ids).into_iter().chain(shared)
    }

    /// Returns the kinds of surfaces and lights in the scene.
    pub fn features(&self) -> Features {
        let mut triangles_of = vec![0usize; self.materials.len()];
        self.own().material_ids.iter().for_each(|&id| triangles_of[id as usize] += 1);
        // A look at all triangles of all instances could take seconds.
        let mut uses = vec![0; self.meshes().len()];
        self.instances().iter().for_each(|instance| uses[instance.mesh as usize] += 1);
        for (mesh, uses) in self.meshes().zip(uses) {
            mesh.material_ids.iter().for_each(|&id| triangles_of[id as usize] += uses);
        }
        let mut features = Features {
            sky: self.sky.shines(),
            suns: self.all_suns().count(),
            punctual_lights: self.punctual_lights.len(),
            luminaires: self.luminaires().len(),
            ..Features::default()
        };
        if let Some(shading) = &self.shading {
            features.smooth = !shading.normals.is_empty();
            features.textures = !(shading.textures.is_empty() && shading.colours.is_empty());
        }
        for (material, &count) in
            self.materials.iter().zip(&triangles_of).filter(|(_, count)| **count > 0)
        {
            match material.bsdf {
                Bsdf::Diffuse { .. } => features.diffuse = true,
                Bsdf::Mirror { .. } => features.mirror = true,
                Bsdf::Conductor { .. } => features.conductor = true,
                Bsdf::ThinGlass { .. } => features.thin_glass = true,
                Bsdf::Dielectric { alpha, .. } if alpha > 0.0 => features.rough_dielectric = true,
                Bsdf::Dielectric { .. } => features.dielectric = true,
                Bsdf::Coated { .. } => features.coated = true,
            }
            if material.emits() {
                features.emitters += count;
                features.two_sided_emission |= material.two_sided_emission;
            }
        }
        features
    }

    /// Returns whether any triangle meets the interior of a parallelepiped (world `origin` and
    /// three edges `axes`).
    ///
    /// Triangles that only touch its faces do not count. Neither do triangles that enter it by no
    /// more than the rounding of stored positions (2⁻²⁴ of the largest coordinate). So a section
    /// that fits a room exactly is empty. A parallelepiped without volume has no interior.
    pub fn geometry_inside(&self, origin: DVec3, axes: [DVec3; 3]) -> bool {
        let extent = self.points().fold(0.0f32, |most, p| most.max(p.abs().max_element()));
        // Half a unit in the last place: the most that rounding to f32 moves a coordinate.
        let rounding = f64::from(extent) * f64::from(f32::EPSILON) * 0.5;
        let Some(open_box) = OpenBox::new(origin - self.origin, axes, rounding) else {
            return false;
        };
        self.triangles().any(|t| open_box.meets(self.corners(t).map(Vec3::as_dvec3)))
    }
}
