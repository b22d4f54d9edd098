//! Hierarchies stored on disk, so that a large scene opens sooner the next time.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

use holo_scene::{KeptFiles, Scene};

use crate::facet::BuildError;
use crate::raycaster::Raycaster;
use crate::stored;

/// Number of triangles, without those of instances, from which a hierarchy is stored. Fewer are
/// built within 50 ms. The hierarchies of shared meshes are built each time.
const MANY: usize = 100_000;

/// A folder of hierarchies, each under the hash of its scene's geometry.
#[derive(Clone, Debug)]
pub struct Hierarchies {
    files: KeptFiles,
    many: usize,
}

impl Hierarchies {
    /// Returns the hierarchies in `folder`, or else in the user's cache folder. Without either,
    /// nothing is stored.
    #[must_use]
    pub fn new(folder: Option<PathBuf>) -> Hierarchies {
        Hierarchies { files: KeptFiles::new(folder, "hierarchy"), many: MANY }
    }

    /// Prepares a scene for casting rays. Reads the stored hierarchy, or builds it and stores it if
    /// the scene is large. If a stored hierarchy cannot be used, the second value is the reason,
    /// for people.
    ///
    /// # Errors
    /// As [`Raycaster::build`]. A hierarchy that cannot be read or written is no error.
    pub fn prepare(&self, scene: Arc<Scene>) -> Result<(Raycaster, Option<String>), BuildError> {
        let triangles = scene.own().triangles.len();
        if triangles < self.many {
            return Ok((Raycaster::build(scene)?, None));
        }
        let geometry = scene.geometry_hash();
        let read = || {
            let (mut file, bytes) = self.files.open(&geometry)?;
            Some(stored::read(&mut file, bytes, triangles, geometry))
        };
        let (mut is_read, mut unused) = (false, None);
        let raycaster = thread::scope(|scope| {
            // The file is read while the facets are made.
            let reading = scope.spawn(read);
            Raycaster::build_unless(scene, |facets| {
                let read = reading.join().ok()??.and_then(|stored| stored.over(facets));
                is_read = read.is_ok();
                read.map_err(|error| unused = Some(error)).ok()
            })
        })?;
        if !is_read {
            let (hierarchy, _) = raycaster.hierarchy();
            self.files.put(&geometry, |out| stored::write(hierarchy, triangles, geometry, out));
        }
        let words = |error| {
            let path = self.files.path(&geometry).unwrap_or_default();
            format!("{}: {error}; the hierarchy is built again", path.display())
        };
        Ok((raycaster, unused.map(words)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stored::tests::scene;
    use std::fs;

    fn hierarchies(folder: &tempfile::TempDir) -> Hierarchies {
        Hierarchies { many: 1, ..Hierarchies::new(Some(folder.path().to_owned())) }
    }

    #[test]
    fn the_second_time_the_hierarchy_is_read_and_not_built() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Arc::new(scene(500));
        let first = hierarchies(&folder).prepare(scene.clone()).unwrap();
        let path = hierarchies(&folder).files.path(&scene.geometry_hash()).unwrap();
        let written = fs::metadata(&path).unwrap().modified().unwrap();
        let second = hierarchies(&folder).prepare(scene).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().modified().unwrap(), written);
        assert_eq!((first.1, second.1), (None, None));
        let nodes = |raycaster: &Raycaster| {
            bytemuck::cast_slice::<_, u8>(&raycaster.hierarchy().0.nodes).to_vec()
        };
        assert!(nodes(&first.0) == nodes(&second.0));
    }

    #[test]
    fn a_damaged_hierarchy_is_built_again_with_a_message_and_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Arc::new(scene(500));
        hierarchies(&folder).prepare(scene.clone()).unwrap();
        let path = hierarchies(&folder).files.path(&scene.geometry_hash()).unwrap();
        let whole = fs::read(&path).unwrap();
        let mut damaged = whole.clone();
        damaged[1000] ^= 4;
        fs::write(&path, &damaged).unwrap();
        let said = hierarchies(&folder).prepare(scene.clone()).unwrap().1.unwrap();
        assert!(said.contains("damaged") && said.contains(path.to_str().unwrap()), "{said}");
        assert!(fs::read(&path).unwrap() == whole);
        assert_eq!(hierarchies(&folder).prepare(scene).unwrap().1, None);
    }

    #[test]
    fn scenes_that_are_built_at_once_are_not_kept() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Hierarchies::new(Some(folder.path().to_owned()));
        kept.prepare(Arc::new(scene(500))).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
