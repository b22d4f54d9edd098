//! A scene taken apart: the arrays that grow with its triangles, and its frame, which is the rest.
//!
//! Files that are mapped into memory store both apart: arrays as they are in memory, and the frame
//! packed.

use holo_mapped::Array;

use crate::{Octahedral, Scene, SceneError, Shading};

/// The arrays of a scene without instances. Those that the scene does not have are empty.
#[derive(Clone, Debug, Default)]
pub struct SceneArrays {
    /// Corners of triangles, relative to the origin.
    pub positions: Array<[f32; 3]>,
    /// Three indices into `positions` for each triangle.
    pub triangles: Array<[u32; 3]>,
    /// An index into the scene's materials for each triangle.
    pub material_ids: Array<u32>,
    /// See [`Shading::uvs`].
    pub uvs: Array<[[f32; 2]; 3]>,
    /// See [`Shading::normals`].
    pub normals: Array<[Octahedral; 3]>,
    /// See [`Shading::colours`].
    pub colours: Array<[[u8; 3]; 3]>,
    /// See [`Shading::opacities`].
    pub opacities: Array<[u8; 3]>,
}

impl Scene {
    /// Returns the frame of a scene: its materials, textures and lights, as the packing of a scene
    /// without triangles. `None` if it has instances.
    #[must_use]
    pub fn pack_frame(&self) -> Option<Vec<u8>> {
        if self.shared.is_some() {
            return None;
        }
        let of_materials = |shading: &Shading| Shading {
            textures: shading.textures.clone(),
            maps: shading.maps.clone(),
            covers: shading.covers.clone(),
            ..Shading::default()
        };
        let shading = self.shading.as_deref().map(of_materials);
        let none = (Vec::new(), Vec::new(), Vec::new());
        let (materials, sky) = (self.materials.clone(), self.sky.clone());
        let frame = Scene {
            suns: self.suns.clone(),
            punctual_lights: self.punctual_lights.clone(),
            luminaires: self.luminaires.clone(),
            shading: shading.filter(|shading| !shading.is_empty()).map(Box::new),
            ..Scene::unchecked(self.origin, none.0, none.1, none.2, materials, sky)
        };
        Some(frame.pack())
    }

    /// Joins a frame with the arrays of the same scene. Lengths and indices are checked. All other
    /// numbers of the arrays must be those of a valid scene. A caller knows that by the hash of
    /// their file.
    ///
    /// # Errors
    /// As [`Scene::unpack`] for the frame. Also if an index is out of range, or if an array has
    /// another length than there are triangles.
    pub fn from_frame(frame: &[u8], arrays: SceneArrays) -> Result<Scene, SceneError> {
        let mut scene = Scene::unpack(frame)?;
        let luminaires = scene.luminaires.take();
        let SceneArrays { positions, triangles, material_ids, uvs, normals, colours, opacities } =
            arrays;
        if triangles.len() != material_ids.len() {
            let (triangles, material_ids) = (triangles.len(), material_ids.len());
            return Err(SceneError::MaterialIdCount { triangles, material_ids });
        }
        let lengths = [uvs.len(), normals.len(), colours.len(), opacities.len()];
        let is_textured = scene.shading.as_ref().is_some_and(|shading| shading.has_textures());
        let fits = |&length: &usize| length == 0 || length == triangles.len();
        if !lengths.iter().all(fits) || is_textured && lengths[0] != triangles.len() {
            let problem = "their number differs from the triangles'";
            return Err(SceneError::Shading { problem });
        }
        // Instances would count triangles that the frame has not.
        if scene.shared.take().is_some() {
            return Err(SceneError::Shading { problem: "a frame has instances" });
        }
        (scene.positions, scene.triangles, scene.material_ids) =
            (positions, triangles, material_ids);
        scene.check_indices(scene.own())?;
        if lengths.iter().any(|&length| length > 0) {
            let shading = scene.shading.take().map(|shading| *shading).unwrap_or_default();
            let shading = Shading { uvs, normals, colours, opacities, ..shading };
            scene.shading = Some(Box::new(shading));
        }
        match luminaires {
            Some(table) => scene.with_luminaires(table.all),
            None => Ok(scene),
        }
    }

    /// Uses these positions and triangles in place of its own, if they are the same bits. So a
    /// scene in memory can release what a mapped file has. Returns whether they are the same.
    pub fn share_geometry(
        &mut self,
        positions: &Array<[f32; 3]>,
        triangles: &Array<[u32; 3]>,
    ) -> bool {
        let bits = bytemuck::cast_slice::<[f32; 3], u8>;
        let is_same = bits(&self.positions) == bits(positions) && self.triangles == *triangles;
        if is_same {
            (self.positions, self.triangles) = (positions.clone(), triangles.clone());
        }
        is_same
    }
}
