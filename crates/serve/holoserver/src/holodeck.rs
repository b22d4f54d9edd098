//! A holodeck on disk: the beam file with its samples. The file also stores the description, the
//! scene, named views, unseen beams, cells of surface light, and makers.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc, OnceLock,
        atomic::{AtomicU32, Ordering},
    },
};

use anyhow::{Context, Result, bail, ensure};
use holo_beamfile::{BeamFile, Maker, Options};
use holo_proto::control::{MAX_VIEWS, Welcome};
use holo_scene::Scene;
use holo_section::Section;
use parking_lot::{Mutex, RwLock, RwLockReadGuard, RwLockWriteGuard};

use crate::{
    about::HolodeckDescription,
    baked::BakedObject,
    cells::{SavedCells, SharedCells},
    makers::MachineList,
    plausible::Plausible,
    unproven::UnprovenClaims,
    unseen::UnseenBeams,
};

/// Name of the blob that holds the packed scene, of the first generation.
const SCENE: &str = "scene";
/// Name of the blob that holds the beams that are proven to see nothing, in the scene of the first
/// generation.
const UNSEEN: &str = "unseen";
/// Name of the blob that holds claims of such beams that nobody has checked.
const UNPROVEN: &str = "unproven";
/// Name of the blob that holds the named views, as JSON, once one was kept.
const VIEWS: &str = "views";

/// Files that are being made.
static DRAFTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file while it is made, which is removed unless it has been renamed.
struct Draft(PathBuf);

impl Draft {
    /// Returns a draft in the folder of a file. Its name is short, because the file's own name may
    /// be as long as names can be.
    fn beside(path: &Path) -> Draft {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = path.with_file_name(format!(".holodeck-{}-{number}.tmp", std::process::id()));
        DRAFTS.lock().push(path.clone());
        Draft(path)
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // It has usually been renamed, or was never made.
        let _ = std::fs::remove_file(&self.0);
        DRAFTS.lock().retain(|path| *path != self.0);
    }
}

/// Removes the files that are being made, before a process ends in the middle of it.
pub fn remove_drafts() {
    remove_drafts_if(|_| true);
}

fn remove_drafts_if(goes: impl Fn(&Path) -> bool) {
    for path in DRAFTS.lock().iter().filter(|path| goes(path)) {
        // One that is not there yet cannot be removed.
        let _ = std::fs::remove_file(path);
    }
}

/// Writes a scene and then its description, which makes it the file's scene.
fn write_scene(file: &BeamFile, about: &HolodeckDescription, packed_scene: &[u8]) -> Result<()> {
    ensure!(
        Scene::content_hash(packed_scene) == about.scene.hash,
        "the description is of another scene"
    );
    // A file of captured rays has no scene.
    if !packed_scene.is_empty() {
        file.put_blob(&about.own_blob(SCENE), packed_scene)?;
    }
    // After a crash before this, the file has its former scene, and a blob that nothing uses.
    about.write(file)?;
    Ok(file.flush()?)
}

/// An open holodeck.
pub struct Holodeck {
    /// Its description.
    pub about: HolodeckDescription,
    /// Its sections, checked.
    pub sections: Arc<[Section]>,
    /// Its samples.
    pub file: Arc<BeamFile>,
    /// False if it was opened only to be shown.
    pub writable: bool,
    /// True if beams that see nothing are not traced.
    pub skip_unseen: bool,
    /// Limits that workers' results cannot exceed.
    pub(crate) plausible: Plausible,
    /// Damage that costs time but no samples, for people.
    pub warnings: Vec<String>,
    path: PathBuf,
    scene: OnceLock<Arc<[u8]>>,
    /// The named views. Locked while they are written.
    views: Mutex<Vec<(String, String)>>,
    /// All that are not traced, whether they are proven or not.
    unseen: RwLock<UnseenBeams>,
    /// Those that are not proven.
    unproven: RwLock<UnprovenClaims>,
    /// The values of [`UnseenBeams::changes`] and [`UnprovenClaims::changes`] for the lists in the
    /// file. Locked while they are written.
    unseen_saved: Mutex<(u64, u64)>,
    cells: RwLock<SharedCells>,
    /// What the file has of them.
    cells_saved: Mutex<SavedCells>,
    makers: RwLock<MachineList>,
    /// The list in the file. Locked while it is written.
    pub(crate) makers_saved: Mutex<MachineList>,
}

impl Holodeck {
    /// Makes a new file. It appears whole or not at all: it is written under another name in the
    /// same folder, and renamed.
    ///
    /// # Errors
    /// If the file exists or cannot be written, or a section is not valid.
    pub fn create(
        path: &Path,
        about: HolodeckDescription,
        packed_scene: &[u8],
        cache_bytes: u64,
    ) -> Result<Holodeck> {
        let sections = about.checked_sections()?;
        let layout = sections.iter().map(Section::beam_count).collect();
        ensure!(!path.exists(), "{} exists already", path.display());
        let draft = Draft::beside(path);
        let write = || {
            let file = BeamFile::create(&draft.0, Options { cache_bytes: 0, layout })?;
            write_scene(&file, &about, packed_scene)
        };
        let made = write().and_then(|()| Ok(std::fs::rename(&draft.0, path)?));
        drop(draft);
        made.with_context(|| format!("making {}", path.display()))?;
        let file = BeamFile::open(path, Options { cache_bytes, layout: Vec::new() })?;
        Self::new(path, about, sections, file, true).with_sky()
    }

    /// Replaces the scene of a file by an edited one, which `about` describes. The samples that are
    /// there belong to an earlier generation from now on: displays show them until new ones come.
    /// Unseen beams and cells of surface light are found anew. `objects` are those of `about`, with
    /// their packed models.
    ///
    /// # Errors
    /// If `about` does not [suit](HolodeckDescription::suits) the file, it is no holodeck, another
    /// process writes to it, or the disk fails. The file then has the scene that it had.
    pub fn restart(
        path: &Path,
        about: &HolodeckDescription,
        packed_scene: &[u8],
        objects: &[(BakedObject, Arc<[u8]>)],
    ) -> Result<()> {
        let old = Self::open(path, 0)?;
        about.suits(&old.about)?;
        // After a crash before the scene is written, these are blobs that nothing uses.
        for (object, packed) in objects {
            object.write_model(&old.file, packed)?;
        }
        write_scene(&old.file, &about.after(&old.about)?, packed_scene)
    }

    /// Replaces a file by one with the same description and scene, and without samples.
    ///
    /// # Errors
    /// If it is no holodeck, or the new one cannot be written. The file is then as before.
    pub fn start_over(path: &Path) -> Result<()> {
        let old = Self::open_read_only(path, 0)?;
        let fresh = beside(path)?;
        drop(old.without_samples(&fresh)?);
        drop(old);
        std::fs::rename(&fresh, path).with_context(|| format!("replacing {}", path.display()))
    }

    /// Makes a new file with the same description and scene, and without samples.
    ///
    /// # Errors
    /// If it exists or cannot be written, or this one cannot be read.
    pub fn without_samples(&self, path: &Path) -> Result<Holodeck> {
        let new = Self::create(path, self.about.clone(), &self.packed_scene()?, 0)?;
        self.copy_stand_ins(&new)?;
        self.copy_models(&new)?;
        new.file.flush()?;
        Ok(new)
    }

    fn new(
        path: &Path,
        about: HolodeckDescription,
        sections: Arc<[Section]>,
        file: BeamFile,
        writable: bool,
    ) -> Holodeck {
        let generation = about.generation;
        Holodeck {
            plausible: Plausible::new(&about, &sections),
            views: Mutex::new(about.views.clone()),
            about,
            sections,
            file: Arc::new(file),
            writable,
            skip_unseen: true,
            warnings: Vec::new(),
            path: path.to_owned(),
            scene: OnceLock::new(),
            unseen: RwLock::default(),
            unproven: RwLock::default(),
            unseen_saved: Mutex::default(),
            cells: RwLock::default(),
            cells_saved: Mutex::new(SavedCells::none(generation)),
            makers: RwLock::default(),
            makers_saved: Mutex::default(),
        }
    }

    /// Opens a file to add to it.
    ///
    /// # Errors
    /// If it does not exist, is not a holodeck, or another process writes to it.
    pub fn open(path: &Path, cache_bytes: u64) -> Result<Holodeck> {
        let file = BeamFile::open(path, Options { cache_bytes, layout: Vec::new() })?;
        Self::from_file(path, file, true)
    }

    /// Opens a file to show it; another process may go on writing to it.
    ///
    /// # Errors
    /// If it does not exist or is not a holodeck.
    pub fn open_read_only(path: &Path, cache_bytes: u64) -> Result<Holodeck> {
        Self::from_file(path, BeamFile::open_read_only(path, cache_bytes)?, false)
    }

    fn from_file(path: &Path, file: BeamFile, writable: bool) -> Result<Holodeck> {
        let mut about = HolodeckDescription::read(&file, path)?;
        file.begin_generation(about.generation)?;
        let sections = about.checked_sections()?;
        if let Some(views) = file.blob(VIEWS)? {
            about.views = serde_json::from_slice(&views).with_context(|| {
                format!("{}: the list of named views is damaged", path.display())
            })?;
        }
        let mut holodeck = Self::new(path, about, sections, file, writable);
        if writable {
            holodeck = holodeck.with_sky()?;
        }
        if writable {
            holodeck.warnings.extend(holodeck.about.engine_warning());
        }
        // Workers find them again, so the file can be opened all the same.
        if let Err(error) = holodeck.load_unseen() {
            holodeck
                .warnings
                .push(format!("the list of beams that see nothing is lost: {error:#}"));
        }
        holodeck.load_cells();
        let (makers, result) = MachineList::load(&holodeck.file);
        holodeck.warnings.extend(result.err().map(|error| format!("{error:#}")));
        holodeck.makers_saved = Mutex::new(makers.clone());
        holodeck.makers = RwLock::new(makers);
        Ok(holodeck)
    }

    /// Reads the sky if the description does not say what it is, to check misses by.
    fn with_sky(mut self) -> Result<Holodeck> {
        if self.about.sky_varies {
            self.plausible.set_sky(Scene::unpack_sky(&self.packed_scene()?)?);
        }
        Ok(self)
    }

    fn load_cells(&mut self) {
        let (saved, cells, warnings) = SavedCells::load(&self.file, self.about.generation);
        self.cells_saved = Mutex::new(saved);
        self.cells = RwLock::new(cells);
        self.warnings.extend(warnings);
    }

    /// Forgets which beams see nothing: every beam is traced, for comparison.
    pub fn without_skipping(mut self) -> Holodeck {
        self.skip_unseen = false;
        *self.unseen_mut() = UnseenBeams::default();
        *self.unproven_mut() = UnprovenClaims::default();
        self
    }

    fn load_unseen(&self) -> Result<()> {
        if !self.skip_unseen {
            return Ok(());
        }
        let (mut unseen, mut unproven) = (UnseenBeams::default(), UnprovenClaims::default());
        if let Some(bytes) = self.file.blob(&self.about.own_blob(UNPROVEN))? {
            unproven = UnprovenClaims::decode(&bytes, &self.sections)?;
        }
        if let Some(bytes) = self.file.blob(&self.about.own_blob(UNSEEN))? {
            let (listed, is_checked) = UnseenBeams::decode(&bytes, &self.sections)?;
            if is_checked {
                unseen = listed;
                // After a crash between the two writes, a beam may be in both lists.
                let mut claimed = UnseenBeams::default();
                unproven.iter().for_each(|(_, claims)| claimed.add(claims));
                claimed.subtract(&unseen);
                unproven.retain(&claimed);
            } else {
                unproven = UnprovenClaims::of(Maker::UNKNOWN, listed);
            }
        }
        unproven.iter().for_each(|(_, claims)| unseen.add(claims));
        let saved = (unseen.changes(), unproven.changes());
        *self.unseen_saved.lock() = saved;
        *self.unseen_mut() = unseen;
        *self.unproven_mut() = unproven;
        Ok(())
    }

    /// Reads what another process has added, if the file is only shown.
    ///
    /// # Errors
    /// If the disk cannot be read.
    pub fn refresh(&self) -> Result<()> {
        if !self.writable && self.file.refresh()? > 0 {
            ensure!(
                self.file.generation() == self.about.generation,
                "{} has an edited scene by now: open it again",
                self.path.display()
            );
            // If the list is damaged, the one from before is still true.
            let _ = self.load_unseen();
        }
        Ok(())
    }

    /// Returns the beams that are known to see nothing.
    pub fn unseen(&self) -> RwLockReadGuard<'_, UnseenBeams> {
        self.unseen.read()
    }

    pub(crate) fn unseen_mut(&self) -> RwLockWriteGuard<'_, UnseenBeams> {
        self.unseen.write()
    }

    /// Returns those that nobody has checked.
    pub fn unproven(&self) -> RwLockReadGuard<'_, UnprovenClaims> {
        self.unproven.read()
    }

    pub(crate) fn unproven_mut(&self) -> RwLockWriteGuard<'_, UnprovenClaims> {
        self.unproven.write()
    }

    /// Writes the beams that see nothing, if the file has others. Waits for the disk.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn save_unseen(&self) -> Result<()> {
        let mut saved = self.unseen_saved.lock();
        let (changes, proven, claims) = {
            let (unseen, unproven) = (self.unseen(), self.unproven());
            let changes = (unseen.changes(), unproven.changes());
            if !self.writable || changes == *saved {
                return Ok(());
            }
            // Without claims there is nothing to write, unless the file lists some.
            let claims = (changes.1 != saved.1).then(|| unproven.encode());
            (changes, unproven.proven(&unseen).encode(), claims)
        };
        // Proven ones go first: a crash in between may leave them in both lists, and loses none.
        self.file.put_blob_once(&self.about.own_blob(UNSEEN), &proven)?;
        if let Some(claims) = claims {
            self.file.put_blob_once(&self.about.own_blob(UNPROVEN), &claims)?;
        }
        *saved = changes;
        Ok(())
    }

    /// Keeps a view by name, in place of one of the same name; removes it if `options` is empty.
    /// Returns all views. Waits for the disk.
    ///
    /// # Errors
    /// If the file is only shown or cannot be written, there are too many views, or none has the
    /// name of one to be removed.
    pub fn keep_view(&self, name: &str, options: &str) -> Result<Vec<(String, String)>> {
        let (views, results) = self.keep_views(&[(name.to_owned(), options.to_owned())]);
        results.into_iter().collect::<Result<()>>()?;
        Ok(views)
    }

    /// Changes several views as [`keep_view`](Self::keep_view) does, and writes their list once.
    /// Returns all views, and the result of each change.
    pub fn keep_views(
        &self,
        changes: &[(String, String)],
    ) -> (Vec<(String, String)>, Vec<Result<()>>) {
        let mut kept = self.views.lock();
        let mut views = kept.clone();
        let results: Vec<_> =
            changes.iter().map(|change| self.change_view(&mut views, change)).collect();
        if views == *kept {
            return (views, results);
        }
        match self.write_views(&views) {
            Ok(()) => {
                kept.clone_from(&views);
                (views, results)
            }
            Err(error) => {
                let text = format!("{error:#}");
                let failed = |result: Result<()>| result.and_then(|()| bail!("{text}"));
                (kept.clone(), results.into_iter().map(failed).collect())
            }
        }
    }

    fn change_view(
        &self,
        views: &mut Vec<(String, String)>,
        (name, options): &(String, String),
    ) -> Result<()> {
        ensure!(self.writable, "this holodeck is only shown: no view can be kept in it");
        let at = views.iter().position(|(other, _)| other == name);
        match (at, options.as_str()) {
            (None, "") => bail!("the holodeck has no view named `{name}`"),
            (Some(at), "") => _ = views.remove(at),
            (Some(at), options) => options.clone_into(&mut views[at].1),
            (None, _) => {
                let has_room = views.len() < MAX_VIEWS;
                ensure!(has_room, "a holodeck has at most {MAX_VIEWS} named views");
                views.push((name.clone(), options.clone()));
            }
        }
        Ok(())
    }

    fn write_views(&self, views: &[(String, String)]) -> Result<()> {
        Ok(self.file.put_blob(VIEWS, serde_json::to_string_pretty(views)?.as_bytes())?)
    }

    /// Returns about how many bytes the list of views takes in the file.
    pub(crate) fn view_bytes(&self) -> usize {
        let views = self.views.lock();
        views.iter().map(|(name, options)| name.len() + options.len() + 24).sum()
    }

    /// Returns the cells of surface light of the file and of all workers.
    pub fn cells(&self) -> RwLockReadGuard<'_, SharedCells> {
        self.cells.read()
    }

    pub(crate) fn cells_mut(&self) -> RwLockWriteGuard<'_, SharedCells> {
        self.cells.write()
    }

    /// Returns who made samples.
    pub fn makers(&self) -> RwLockReadGuard<'_, MachineList> {
        self.makers.read()
    }

    /// Writes who made samples, if the file says otherwise. Waits for the disk.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save_makers(&self) -> Result<()> {
        let mut saved = self.makers_saved.lock();
        let makers = self.makers().clone();
        if self.writable && makers != *saved {
            makers.store(&self.file)?;
            *saved = makers;
        }
        Ok(())
    }

    pub(crate) fn makers_mut(&self) -> RwLockWriteGuard<'_, MachineList> {
        self.makers.write()
    }

    /// Writes the cells of surface light if the file lacks many or, at the end, any. Waits for the
    /// disk.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn save_cells(&self, is_end: bool) -> Result<()> {
        let mut saved = self.cells_saved.lock();
        let missing = saved.missing(&self.cells(), is_end);
        match missing.filter(|_| self.writable) {
            Some(missing) => saved.write(&self.file, missing),
            None => Ok(()),
        }
    }

    /// Returns where the file is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the packed scene. It is read once.
    ///
    /// # Errors
    /// If it is damaged on disk.
    pub fn packed_scene(&self) -> Result<Arc<[u8]>> {
        if let Some(scene) = self.scene.get() {
            return Ok(Arc::clone(scene));
        }
        if self.about.scene.bytes == 0 {
            return Ok(Arc::default());
        }
        let name = self.path.display();
        let blob = self.about.own_blob(SCENE);
        let packed = self.file.blob(&blob)?.with_context(|| format!("{name} holds no scene"))?;
        let packed: Arc<[u8]> = packed.into();
        ensure!(
            Scene::content_hash(&packed) == self.about.scene.hash,
            "{name}: the scene is damaged, or not the one that the samples were traced in"
        );
        Ok(Arc::clone(self.scene.get_or_init(|| packed)))
    }

    /// Returns the welcome that the server sends to a new connection.
    pub fn welcome(&self) -> Welcome {
        Welcome {
            software: format!("holoserver {}", env!("CARGO_PKG_VERSION")),
            sections: self.about.sections.clone(),
            settings: self.about.settings,
            scene: self.about.scene,
            up: self.about.up,
            views: self.views.lock().clone(),
            samples: self.file.stats().samples,
            tracing: self.writable,
            sky: self.about.sky,
            sky_varies: self.about.sky_varies,
            skip_unseen: self.skip_unseen,
            unit: self.about.unit,
        }
    }
}

/// Returns the path of the file that is to take the place of another. A file that an earlier try
/// left there is removed.
pub(crate) fn beside(path: &Path) -> Result<PathBuf> {
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    let fresh = PathBuf::from(name);
    if fresh.exists() {
        std::fs::remove_file(&fresh).with_context(|| format!("removing {}", fresh.display()))?;
    }
    Ok(fresh)
}

#[cfg(test)]
mod tests {
    use std::{ffi::OsStr, os::unix::ffi::OsStrExt};

    use holo_proto::control::RenderSettings;
    use holo_section::{SectionSpec, ViewClass};

    use super::*;
    use crate::about::SceneReading;

    fn about(scene: &[u8]) -> HolodeckDescription {
        let spec = SectionSpec {
            origin: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            grid: [2; 3],
            class: ViewClass::Interior,
            obstructions: true,
        };
        HolodeckDescription::new(vec![spec], RenderSettings::default(), scene, "a test".into())
    }

    fn names(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn a_file_that_could_not_be_made_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.holo");
        // The scene is not the one that is described.
        let failed = Holodeck::create(&path, about(b"a scene"), b"another", 0);
        let error = format!("{:#}", failed.err().unwrap());
        assert!(error.contains("x.holo") && error.contains("another scene"), "{error}");
        assert_eq!(names(folder.path()), 0);
        drop(Holodeck::create(&path, about(b"a scene"), b"a scene", 0).unwrap());
        assert_eq!(names(folder.path()), 1);
        let again = Holodeck::create(&path, about(b"a scene"), b"a scene", 0).err().unwrap();
        assert!(again.to_string().contains("exists already"), "{again}");
        drop(Holodeck::open(&path, 0).unwrap());
        // One that is being made when the process ends.
        let draft = Draft::beside(&path);
        std::fs::write(&draft.0, "half of it").unwrap();
        // Other tests of this process make files, too.
        remove_drafts_if(|path| path.starts_with(folder.path()));
        assert_eq!(names(folder.path()), 1);
    }

    #[test]
    fn names_may_be_long_or_not_utf_8() {
        let folder = tempfile::tempdir().unwrap();
        let long = folder.path().join(format!("{}.holo", "x".repeat(250)));
        let latin = folder.path().join(OsStr::from_bytes(b"k\xfcche.holo"));
        for path in [long, latin] {
            let mut about = about(b"a scene");
            let model = path.with_extension("obj");
            about.reading = Some(SceneReading { path: model.clone(), ..SceneReading::default() });
            drop(Holodeck::create(&path, about, b"a scene", 0).unwrap());
            let opened = Holodeck::open_read_only(&path, 0).unwrap();
            assert_eq!(opened.about.reading.as_ref().unwrap().path, model);
        }
    }
}
