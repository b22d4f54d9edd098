//! Scenes of servers, stored on disk under the hash of their content. Large scenes are stored
//! prepared instead (`holo_raycast::StoredScenes`).

use std::{io::Read, path::PathBuf};

use anyhow::{Context, Result, ensure};
use holo_proto::control::SceneInfo;
use holo_scene::{KeptFiles, Scene};

/// A folder of packed scenes.
#[derive(Debug)]
pub struct SceneCache(KeptFiles);

impl SceneCache {
    /// Returns the cache in `folder`, or else in the user's cache folder. Without either, nothing
    /// is stored.
    pub fn new(folder: Option<PathBuf>) -> SceneCache {
        SceneCache(KeptFiles::new(folder, "scene"))
    }

    /// Returns the scene, if it is stored and undamaged.
    pub fn get(&self, info: &SceneInfo) -> Option<Scene> {
        let (file, _) = self.0.open(&info.hash).filter(|(_, bytes)| *bytes == info.bytes)?;
        let mut packed = Vec::with_capacity(usize::try_from(info.bytes).ok()?);
        file.take(info.bytes).read_to_end(&mut packed).ok()?;
        unpack(&packed, info).ok()
    }

    /// Stores a scene for the next time. If the disk is full or read-only, the scene will be
    /// fetched again.
    pub fn put(&self, info: &SceneInfo, packed: &[u8]) {
        self.0.put(&info.hash, |file| file.write_all(packed));
    }
}

/// Decodes a scene.
///
/// # Errors
/// If they are not the bytes announced, or not a scene.
pub fn unpack(packed: &[u8], info: &SceneInfo) -> Result<Scene> {
    ensure!(
        Scene::content_hash(packed) == info.hash,
        "the scene's bytes do not have the hash that the server announced"
    );
    Scene::unpack(packed).context("reading the server's scene")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_damaged_or_foreign_scene_is_not_taken_from_the_cache() {
        let folder = tempfile::tempdir().unwrap();
        let cache = SceneCache::new(Some(folder.path().to_owned()));
        let packed = b"not a scene, but eighteen bytes".to_vec();
        let info = SceneInfo { hash: Scene::content_hash(&packed), bytes: packed.len() as u64 };
        assert!(cache.get(&info).is_none(), "nothing is there yet");
        cache.put(&info, &packed);
        assert!(cache.0.path(&info.hash).unwrap().exists());
        assert!(cache.get(&info).is_none(), "the right bytes, but no scene");
        let other = SceneInfo { hash: [7; 32], ..info };
        fs::write(cache.0.path(&other.hash).unwrap(), &packed).unwrap();
        assert!(unpack(&packed, &other).unwrap_err().to_string().contains("hash"));
    }
}
