//! Scenes that servers have sent, kept on disk under the hash of their content.

use std::{
    fs::{self, File},
    io::{Read, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};
use holo_proto::control::SceneInfo;
use holo_scene::Scene;

/// Scenes that are kept: a user works on a few. Older ones are fetched again when needed.
const MAX_SCENES: usize = 8;

/// A folder of packed scenes.
#[derive(Debug)]
pub struct SceneCache {
    folder: Option<PathBuf>,
}

impl SceneCache {
    /// Returns the cache in the folder given, or in the user's cache folder. Without either, it
    /// keeps nothing.
    pub fn new(folder: Option<PathBuf>) -> SceneCache {
        let absolute = |name: &str| {
            std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute())
        };
        let users =
            || absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")));
        SceneCache { folder: folder.or_else(|| Some(users()?.join("holodeck/scenes"))) }
    }

    fn path(&self, info: &SceneInfo) -> Option<PathBuf> {
        let name: String = info.hash.iter().map(|byte| format!("{byte:02x}")).collect();
        Some(self.folder.as_ref()?.join(name).with_extension("scene"))
    }

    /// Returns the scene, if it is here and whole.
    ///
    /// The file is read and not mapped: a mapped file that shrinks under its reader ends the
    /// process.
    pub fn get(&self, info: &SceneInfo) -> Option<Scene> {
        let file = File::open(self.path(info)?).ok()?;
        if file.metadata().ok()?.len() != info.bytes {
            return None;
        }
        let mut packed = Vec::with_capacity(usize::try_from(info.bytes).ok()?);
        file.take(info.bytes).read_to_end(&mut packed).ok()?;
        unpack(&packed, info).ok()
    }

    /// Keeps a scene for the next time. If the disk is full or read-only, it will be fetched again.
    pub fn put(&self, info: &SceneInfo, packed: &[u8]) {
        if let Some(path) = self.path(info) {
            let _ = self.write(&path, packed);
        }
    }

    fn write(&self, path: &Path, packed: &[u8]) -> std::io::Result<()> {
        let Some(folder) = path.parent() else { return Ok(()) };
        fs::create_dir_all(folder)?;
        // Another worker may write the same scene. Each writes a file of its own and renames it,
        // which is atomic.
        let temporary = path.with_extension(format!("{}.part", std::process::id()));
        let written = File::create(&temporary).and_then(|mut file| file.write_all(packed));
        if let Err(error) = written.and_then(|()| fs::rename(&temporary, path)) {
            let _ = fs::remove_file(&temporary);
            return Err(error);
        }
        prune(folder)
    }
}

/// Deletes all but the newest [`MAX_SCENES`] scenes.
fn prune(folder: &Path) -> std::io::Result<()> {
    let mut scenes: Vec<_> = fs::read_dir(folder)?
        .filter_map(|entry| entry.ok())
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "scene"))
        .filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path())))
        .collect();
    scenes.sort();
    for (_, path) in scenes.iter().rev().skip(MAX_SCENES) {
        fs::remove_file(path)?;
    }
    Ok(())
}

/// Returns the scene in these bytes.
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

    #[test]
    fn a_damaged_or_foreign_scene_is_not_taken_from_the_cache() {
        let folder = tempfile::tempdir().unwrap();
        let cache = SceneCache::new(Some(folder.path().to_owned()));
        let packed = b"not a scene, but eighteen bytes".to_vec();
        let info = SceneInfo { hash: Scene::content_hash(&packed), bytes: packed.len() as u64 };
        assert!(cache.get(&info).is_none(), "nothing is there yet");
        cache.put(&info, &packed);
        assert!(cache.path(&info).unwrap().exists());
        assert!(cache.get(&info).is_none(), "the right bytes, but no scene");
        let other = SceneInfo { hash: [7; 32], ..info };
        fs::write(cache.path(&other).unwrap(), &packed).unwrap();
        assert!(unpack(&packed, &other).unwrap_err().to_string().contains("hash"));
    }

    #[test]
    fn only_the_newest_scenes_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let cache = SceneCache::new(Some(folder.path().to_owned()));
        for index in 0..MAX_SCENES as u8 + 3 {
            cache.put(&SceneInfo { hash: [index; 32], bytes: 1 }, &[index]);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), MAX_SCENES);
    }
}
