//! Scenes received, kept on disk by their content's hash and mapped at the next start.

use std::{
    fs::{self, File},
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};
use holo_proto::control::SceneInfo;
use holo_scene::Scene;

/// Scenes kept: a user works on a few; older ones are fetched again when needed.
const MAX_SCENES: usize = 8;

/// A folder of packed scenes.
#[derive(Debug)]
pub struct SceneCache {
    folder: Option<PathBuf>,
}

impl SceneCache {
    /// The folder given, or the user's cache folder; without either, nothing is kept.
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

    /// The scene, if it is here and whole.
    pub fn get(&self, info: &SceneInfo) -> Option<Scene> {
        let file = File::open(self.path(info)?).ok()?;
        if file.metadata().ok()?.len() != info.bytes {
            return None;
        }
        let map = map(&file)?;
        unpack(&map, info).ok()
    }

    /// Keeps a scene for the next time. A full or read-only disk only means that it is fetched again.
    pub fn put(&self, info: &SceneInfo, packed: &[u8]) {
        if let Some(path) = self.path(info) {
            let _ = self.write(&path, packed);
        }
    }

    fn write(&self, path: &Path, packed: &[u8]) -> std::io::Result<()> {
        let Some(folder) = path.parent() else { return Ok(()) };
        fs::create_dir_all(folder)?;
        // Another worker may be writing the same scene: each to a file of its own, then a rename, which is atomic.
        let temporary = path.with_extension(format!("{}.part", std::process::id()));
        let written = File::create(&temporary).and_then(|mut file| file.write_all(packed));
        if let Err(error) = written.and_then(|()| fs::rename(&temporary, path)) {
            let _ = fs::remove_file(&temporary);
            return Err(error);
        }
        prune(folder)
    }
}

/// Leaves the newest [`MAX_SCENES`].
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

/// The scene in these bytes, if they are the ones announced.
pub fn unpack(packed: &[u8], info: &SceneInfo) -> Result<Scene> {
    ensure!(
        Scene::content_hash(packed) == info.hash,
        "the scene's bytes do not have the announced hash"
    );
    Scene::unpack(packed).context("reading the server's scene")
}

#[allow(unsafe_code)]
fn map(file: &File) -> Option<memmap2::Mmap> {
    // SAFETY: scenes in the cache are written to a temporary file and renamed, never changed in place. If another
    // program truncates one while it is read here, this process ends by SIGBUS: the server gives its work to others.
    unsafe { memmap2::Mmap::map(file) }.ok()
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
