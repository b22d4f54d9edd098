//! Objects that a person carried into the scene, and that are part of it, as the description of a
//! file has them.

use anyhow::{Result, ensure};
use holo_beamfile::BeamFile;
use holo_proto::control::SceneInfo;
use holo_scene::Scene;
use serde::{Deserialize, Serialize};

/// An object that is part of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakedObject {
    /// Its name.
    pub name: String,
    /// Hash and length of its packed model.
    pub model: SceneInfo,
    /// The rows of the map from the model's world coordinates to the scene's.
    pub place: [[f64; 4]; 3],
    /// The same as a person states it. `None` in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<BakedPose>,
}

/// Where an object is, as a person states it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakedPose {
    /// The middle of its base.
    pub at: [f64; 3],
    /// Degrees around the scene's up axis.
    pub turn: f64,
    /// Factor to the model's size.
    pub scale: f64,
}

impl BakedObject {
    /// Returns an object whose packed model is known.
    pub fn new(
        name: String,
        packed_model: &[u8],
        place: [[f64; 4]; 3],
        pose: BakedPose,
    ) -> BakedObject {
        let (hash, bytes) = (Scene::content_hash(packed_model), packed_model.len() as u64);
        BakedObject { name, model: SceneInfo { hash, bytes }, place, pose: Some(pose) }
    }

    /// Returns the name of the blob that holds its model.
    pub(crate) fn blob(&self) -> String {
        let hash: String = self.model.hash.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("object-{hash}")
    }

    /// Writes its model into a file, unless it is there.
    pub(crate) fn write_model(&self, file: &BeamFile, packed: &[u8]) -> Result<()> {
        let has_hash = Scene::content_hash(packed) == self.model.hash;
        ensure!(has_hash, "the model of object `{}` is another one", self.name);
        let blob = self.blob();
        if !file.blob_names().contains(&blob) {
            file.put_blob(&blob, packed)?;
        }
        Ok(())
    }
}
