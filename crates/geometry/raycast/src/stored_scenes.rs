//! Large scenes stored on disk, prepared for casting rays. Their files are mapped, so they open at
//! once, and the processes of a machine share their memory.

use std::fmt;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

use holo_mapped::SealError;
use holo_scene::{KeptFiles, Scene};

use crate::coincident::Coincident;
use crate::facet::BuildError;
use crate::raycaster::Raycaster;
use crate::stored_geometry::{self, StoredGeometry};
use crate::stored_surfaces::{self, StoredSurfaces};

/// Number of triangles from which a scene is stored. Fewer are prepared within 50 ms. Scenes with
/// instances are prepared each time: what they share is small.
const MANY: usize = 100_000;

/// A folder of prepared scenes. Each geometry has a file, and so have the surfaces of each scene.
/// Scenes of another hour or with other lamps share their geometry.
#[derive(Clone, Debug)]
pub struct StoredScenes {
    geometries: KeptFiles,
    surfaces: KeptFiles,
    many: usize,
}

/// A stored file that cannot be used. It is made again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnusableFile {
    /// The file.
    pub path: PathBuf,
    /// The reason.
    pub reason: SealError,
}

impl fmt::Display for UnusableFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; it is made again", self.path.display(), self.reason)
    }
}

impl std::error::Error for UnusableFile {}

impl StoredScenes {
    /// Returns the scenes in `folder`, or else in the user's cache folder. Without either, nothing
    /// is stored.
    #[must_use]
    pub fn new(folder: Option<PathBuf>) -> StoredScenes {
        let geometries = KeptFiles::new(folder.clone(), "geometry");
        StoredScenes { geometries, surfaces: KeptFiles::new(folder, "surfaces"), many: MANY }
    }

    /// Returns whether scenes like this one are stored.
    #[must_use]
    pub fn keeps(&self, scene: &Scene) -> bool {
        scene.instances().is_empty() && scene.own().triangles.len() >= self.many
    }

    /// Opens a stored scene by the hash of its packed form. `None` if it is not stored.
    ///
    /// # Errors
    /// If a file of the scene is of another version or scene, or damaged.
    pub fn open(&self, scene: &[u8; 32]) -> Result<Option<Raycaster>, UnusableFile> {
        let surfaces = read(&self.surfaces, scene, stored_surfaces::read)?;
        let Some(surfaces) = surfaces else { return Ok(None) };
        let geometry = read(&self.geometries, &surfaces.geometry, stored_geometry::read)?;
        let Some(geometry) = geometry else { return Ok(None) };
        let unusable = |reason| unusable(&self.surfaces, scene, reason);
        surfaces.over(geometry).map(Some).map_err(unusable)
    }

    /// Prepares a scene for casting rays. If it is large, its geometry is read instead of made, and
    /// stored if it was not. With the hash of its packed form, its surfaces are stored too, and
    /// [`open`](Self::open) finds it the next time. The raycaster's scene equals `scene`, but may
    /// lie in files. The second value is a file that could not be used.
    ///
    /// # Errors
    /// As [`Raycaster::build`]. A file that cannot be read or written is no error.
    pub fn prepare(
        &self,
        mut scene: Arc<Scene>,
        hash: Option<[u8; 32]>,
    ) -> Result<(Raycaster, Option<UnusableFile>), BuildError> {
        if !self.keeps(&scene) {
            return Ok((Raycaster::build(scene)?, None));
        }
        let geometry = scene.geometry_hash();
        let (stored, mut unused) = self.geometry(&geometry);
        let raycaster = stored.as_ref().and_then(|stored| over(&mut scene, stored, None));
        let (raycaster, stored) = match raycaster {
            Some(raycaster) => (raycaster, stored),
            None => self.built(scene, geometry)?,
        };
        let Some(hash) = hash else { return Ok((raycaster, unused)) };
        let (mut surfaces, unusable) = self.surfaces(&hash);
        unused = unused.or(unusable);
        if surfaces.is_none()
            && let Some(frame) = raycaster.scene().pack_frame()
        {
            let write = |out: &mut dyn Write| {
                stored_surfaces::write(&raycaster, &frame, geometry, hash, out)
            };
            self.surfaces.put(&hash, write);
            surfaces = self.surfaces(&hash).0;
        }
        // The files take the place of the memory that the scene had.
        let surfaces = surfaces.filter(|surfaces| surfaces.geometry == geometry);
        let raycaster = match (surfaces, stored) {
            (Some(surfaces), Some(stored)) => surfaces.over(stored).unwrap_or(raycaster),
            _ => raycaster,
        };
        Ok((raycaster, unused))
    }

    /// Builds the hierarchy of a scene, and stores its geometry. Returns the stored geometry, too,
    /// if there is one now.
    fn built(
        &self,
        scene: Arc<Scene>,
        hash: [u8; 32],
    ) -> Result<(Raycaster, Option<StoredGeometry>), BuildError> {
        let built = Raycaster::build(scene)?;
        let (own, cast) = (built.scene().own(), built.geometry());
        self.geometries.put(&hash, |out| stored_geometry::write(&own, &cast, hash, out));
        let Some(stored) = self.geometry(&hash).0 else { return Ok((built, None)) };
        // The file takes the place of the memory in which it was made.
        let (mut scene, places) = (Arc::clone(built.scene()), built.faces_at_one_place().cloned());
        drop(built);
        match over(&mut scene, &stored, Some(places)) {
            Some(raycaster) => Ok((raycaster, Some(stored))),
            None => Ok((Raycaster::build(scene)?, None)),
        }
    }

    fn geometry(&self, hash: &[u8; 32]) -> (Option<StoredGeometry>, Option<UnusableFile>) {
        apart(read(&self.geometries, hash, stored_geometry::read))
    }

    fn surfaces(&self, hash: &[u8; 32]) -> (Option<StoredSurfaces>, Option<UnusableFile>) {
        apart(read(&self.surfaces, hash, stored_surfaces::read))
    }
}

/// Reads a file. `None` if it is not there.
fn read<T>(
    files: &KeptFiles,
    hash: &[u8; 32],
    read: impl FnOnce(&File, &[u8; 32]) -> Result<T, SealError>,
) -> Result<Option<T>, UnusableFile> {
    let Some((file, _)) = files.open(hash) else { return Ok(None) };
    read(&file, hash).map(Some).map_err(|reason| unusable(files, hash, reason))
}

fn unusable(files: &KeptFiles, hash: &[u8; 32], reason: SealError) -> UnusableFile {
    UnusableFile { path: files.path(hash).unwrap_or_default(), reason }
}

fn apart<T>(read: Result<Option<T>, UnusableFile>) -> (Option<T>, Option<UnusableFile>) {
    match read {
        Ok(found) => (found, None),
        Err(unusable) => (None, Some(unusable)),
    }
}

/// Casts rays at a scene with the arrays of its stored geometry. `None` if the scene has another
/// geometry. Looks for faces at one place if they are not given.
fn over(
    scene: &mut Arc<Scene>,
    stored: &StoredGeometry,
    places: Option<Option<Coincident>>,
) -> Option<Raycaster> {
    let StoredGeometry { positions, triangles, cast } = stored;
    if !Arc::make_mut(scene).share_geometry(positions, triangles) {
        return None;
    }
    let places = places
        .unwrap_or_else(|| Coincident::find(scene, &cast.facets, &cast.hierarchy, cast.reach));
    Some(Raycaster::over(Arc::clone(scene), cast.clone(), places))
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::stored_geometry::tests::{scene, shaded};
    use crate::{Hit, Ray};

    const HASH: [u8; 32] = [5; 32];

    fn stored(folder: &tempfile::TempDir) -> StoredScenes {
        StoredScenes { many: 1, ..StoredScenes::new(Some(folder.path().to_owned())) }
    }

    fn hits(raycaster: &Raycaster) -> Vec<Option<Hit>> {
        let ray = |k: u32| {
            let (sin, cos) = (k as f32 * 2.4).sin_cos();
            let towards = Vec3::new(cos, sin, (k as f32 * 0.1).sin());
            Ray::new(-3.0 * towards, towards.normalize())
        };
        (0..2000).map(|k| raycaster.nearest(&ray(k))).collect()
    }

    /// The file with this ending in a folder.
    fn file(folder: &Path, ending: &str) -> PathBuf {
        let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut files = files.filter(|path| path.extension().is_some_and(|end| end == ending));
        files.next().unwrap()
    }

    fn is_in_files(raycaster: &Raycaster) -> bool {
        let cast = raycaster.geometry();
        cast.facets.is_mapped()
            && cast.hierarchy.nodes.is_mapped()
            && cast.hierarchy.blocks.is_mapped()
    }

    #[test]
    fn a_stored_scene_is_equal_and_its_hits_are_the_same_bits() {
        for scene in [scene(500), shaded(500)] {
            let folder = tempfile::tempdir().unwrap();
            let scene = Arc::new(scene);
            let built = Raycaster::build(scene.clone()).unwrap();
            assert!(stored(&folder).open(&HASH).unwrap().is_none());
            let (first, unused) = stored(&folder).prepare(scene.clone(), Some(HASH)).unwrap();
            let opened = stored(&folder).open(&HASH).unwrap().unwrap();
            assert_eq!(unused, None);
            for raycaster in [first, opened] {
                assert!(is_in_files(&raycaster));
                assert!(**raycaster.scene() == *scene);
                assert!(raycaster.scene().pack() == scene.pack());
                assert_eq!(hits(&raycaster), hits(&built));
                assert_eq!(raycaster.coincident(), built.coincident());
            }
        }
    }

    #[test]
    fn scenes_with_other_light_share_the_geometry_of_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let (day, mut night) = (scene(500), scene(500));
        night.sky = [0.0; 3].into();
        stored(&folder).prepare(Arc::new(day), Some([1; 32])).unwrap();
        let path = file(folder.path(), "geometry");
        let written = fs::metadata(&path).unwrap().modified().unwrap();
        let night = Arc::new(night);
        let (raycaster, _) = stored(&folder).prepare(night.clone(), Some([2; 32])).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().modified().unwrap(), written);
        assert!(is_in_files(&raycaster) && **raycaster.scene() == *night);
        let (surveyed, _) = stored(&folder).prepare(night, None).unwrap();
        assert!(is_in_files(&surveyed));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn a_damaged_file_is_made_again_with_a_message() {
        let scene = Arc::new(scene(500));
        for ending in ["geometry", "surfaces"] {
            let folder = tempfile::tempdir().unwrap();
            stored(&folder).prepare(scene.clone(), Some(HASH)).unwrap();
            let path = file(folder.path(), ending);
            let whole = fs::read(&path).unwrap();
            let mut damaged = whole.clone();
            damaged[1000] ^= 4;
            for bytes in [&damaged[..], &whole[..whole.len() - 1], b""] {
                // A file that is mapped is replaced and not written to.
                fs::remove_file(&path).unwrap();
                fs::write(&path, bytes).unwrap();
                let unusable = stored(&folder).open(&HASH).unwrap_err();
                let unusable = unusable.to_string();
                assert!(unusable.contains("damaged") && unusable.contains(ending), "{unusable}");
                let (made, unused) = stored(&folder).prepare(scene.clone(), Some(HASH)).unwrap();
                assert_eq!(unused.unwrap().path, path);
                assert!(is_in_files(&made) && fs::read(&path).unwrap() == whole);
                assert!(stored(&folder).open(&HASH).unwrap().is_some());
            }
        }
    }

    #[test]
    fn a_file_of_another_scene_or_version_is_not_used() {
        let folder = tempfile::tempdir().unwrap();
        stored(&folder).prepare(Arc::new(scene(500)), Some(HASH)).unwrap();
        let path = file(folder.path(), "surfaces");
        let mut bytes = fs::read(&path).unwrap();
        let foreign = stored(&folder).surfaces.path(&[6; 32]).unwrap();
        fs::write(foreign, &bytes).unwrap();
        let unusable = stored(&folder).open(&[6; 32]).unwrap_err();
        assert_eq!(unusable.reason, SealError::Owner);
        bytes[8] += 1;
        fs::remove_file(&path).unwrap();
        fs::write(&path, bytes).unwrap();
        assert_eq!(stored(&folder).open(&HASH).unwrap_err().reason, SealError::Version);
    }

    #[test]
    fn a_scene_stays_usable_while_its_files_are_deleted() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Arc::new(scene(500));
        let (raycaster, _) = stored(&folder).prepare(scene.clone(), Some(HASH)).unwrap();
        drop(folder);
        assert_eq!(hits(&raycaster), hits(&Raycaster::build(scene).unwrap()));
    }

    #[test]
    fn what_is_prepared_at_once_is_not_stored() {
        let folder = tempfile::tempdir().unwrap();
        let all = StoredScenes::new(Some(folder.path().to_owned()));
        all.prepare(Arc::new(scene(500)), Some(HASH)).unwrap();
        let scene = scene(500);
        let place = holo_scene::Placement::new([
            [1.0, 0.0, 0.0, 9.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ]);
        let mesh = scene.own();
        let instanced = scene.clone().with_instances(&[mesh], &[(0, place.unwrap())]).unwrap();
        stored(&folder).prepare(Arc::new(instanced), Some(HASH)).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
