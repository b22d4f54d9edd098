//! The surfaces of a scene in a sealed file: all that is not geometry.
//!
//! The arrays of the file (`holo_mapped::SealedFile`), which belongs to the hash of the packed
//! scene:
//!
//! ```text
//! geometry     32     hash of the geometry, which has a file of its own
//! materials    4·T    the material of each triangle
//! uvs          24·T   as in the scene; these and the next three may have no bytes
//! normals      12·T
//! colours      9·T
//! opacities    3·T
//! places       T/8    one bit for each triangle: another one lies at its place. No bytes without
//! frame               all else of the scene, packed
//! ```

use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;

use bytemuck::cast_slice;
use holo_mapped::{Array, FileKind, SealError, SealedFile, write_sealed};
use holo_scene::{Scene, SceneArrays, Shading};

use crate::coincident::Coincident;
use crate::raycaster::Raycaster;
use crate::stored_geometry::StoredGeometry;

/// Increase the version when an array changes, or the packing of scenes.
pub(crate) const KIND: FileKind = FileKind { magic: *b"holosrf\n", version: 1, arrays: 8 };

/// What the file of a scene's surfaces has.
pub(crate) struct StoredSurfaces {
    /// Hash of the geometry.
    pub geometry: [u8; 32],
    /// Without positions and triangles.
    arrays: SceneArrays,
    places: Array<u64>,
    frame: Array<u8>,
}

/// Writes the surfaces of a scene without instances. `geometry` is the hash of its geometry, and
/// `hash` that of the packed scene.
pub(crate) fn write(
    raycaster: &Raycaster,
    frame: &[u8],
    geometry: [u8; 32],
    hash: [u8; 32],
    out: &mut dyn Write,
) -> io::Result<()> {
    let scene = raycaster.scene();
    let none = Shading::default();
    let shading = scene.shading.as_deref().unwrap_or(&none);
    let arrays: [&[u8]; 8] = [
        &geometry,
        cast_slice(scene.own().material_ids),
        cast_slice(&shading.uvs),
        cast_slice(&shading.normals),
        cast_slice(&shading.colours),
        cast_slice(&shading.opacities),
        raycaster.faces_at_one_place().map_or(&[], |places| cast_slice(places.bits())),
        frame,
    ];
    write_sealed(KIND, hash, &arrays, out)
}

/// Maps the surfaces of the scene with this hash.
pub(crate) fn read(file: &File, hash: &[u8; 32]) -> Result<StoredSurfaces, SealError> {
    let file = SealedFile::open(file, KIND, hash)?;
    let geometry = file.array::<u8>(0)?[..].try_into().map_err(|_| SealError::Damaged)?;
    let arrays = SceneArrays {
        material_ids: file.array(1)?,
        uvs: file.array(2)?,
        normals: file.array(3)?,
        colours: file.array(4)?,
        opacities: file.array(5)?,
        ..SceneArrays::default()
    };
    Ok(StoredSurfaces { geometry, arrays, places: file.array(6)?, frame: file.array(7)? })
}

impl StoredSurfaces {
    /// Casts rays at the scene that has these surfaces and this geometry.
    pub(crate) fn over(self, geometry: StoredGeometry) -> Result<Raycaster, SealError> {
        let StoredGeometry { positions, triangles, cast } = geometry;
        let words = triangles.len().div_ceil(u64::BITS as usize);
        if !(self.places.is_empty() || self.places.len() == words) {
            return Err(SealError::Damaged);
        }
        let arrays = SceneArrays { positions, triangles, ..self.arrays };
        let scene = Scene::from_frame(&self.frame, arrays).map_err(|_| SealError::Damaged)?;
        let places = Coincident::of_bits(&self.places, cast.reach);
        Ok(Raycaster::over(Arc::new(scene), cast, places))
    }
}
