//! A holodeck on disk: the beam file, and in it everything that a server, a worker and a display
//! need to know.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex, OnceLock, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard},
};

use anyhow::{Context, Result, bail, ensure};
use holo_beamfile::{BeamFile, Options};
use holo_proto::{
    control::{MAX_SECTIONS, MAX_VIEWS, RenderSettings, SceneInfo, Welcome},
    stand_ins::{self, StandIn, StandInKind},
};
use holo_scene::Scene;
use holo_section::{Section, SectionSpec};
use serde::{Deserialize, Serialize};

use crate::{
    forget::beside,
    light::{LightRecords, Saved},
    makers::Makers,
    plausible::{Limits, Plausible},
    unseen::UnseenBeams,
};

/// Name of the blob that holds [`About`], as JSON, so that people and other programs can read it.
const ABOUT: &str = "holodeck";
/// Name of the blob that holds the packed scene.
const SCENE: &str = "scene";
/// Name of the blob that holds the beams that see nothing.
const UNSEEN: &str = "unseen";
/// Name of the blob that holds the named views, as JSON, once one was kept.
const VIEWS: &str = "views";
/// Name of the blob that holds the stand-ins.
const STAND_INS: &str = "stand-ins";
/// Version of [`About`].
const FORMAT: u32 = 1;

/// The description of a holodeck: everything except its samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Version of this record, 1.
    pub format: u32,
    /// The sections, in the order of their numbers.
    pub sections: Vec<SectionSpec>,
    /// How samples are traced.
    pub settings: RenderSettings,
    /// The packed scene's hash and length.
    pub scene: SceneInfo,
    /// Where the scene came from, for people.
    pub source: String,
    /// The scene's up axis, in the scene's coordinates.
    pub up: [f64; 3],
    /// Radiance of rays that hit nothing, W·sr⁻¹·m⁻².
    pub sky: [f32; 3],
    /// Metres per scene unit.
    pub unit: f64,
    /// Named views, as Radiance view options; the first is where a display begins.
    pub views: Vec<(String, String)>,
    /// Factor from radiance to display light that pictures share, so that they can be compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure: Option<f32>,
    /// The choices that were made in place of missing options, and why, for people.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<String>,
    /// Simpler scenes that displays use in place of the scene, if some exist.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stand_ins: Option<AboutStandIns>,
    /// Limits that the scene sets; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<Limits>,
}

/// Simpler scenes that displays use, by section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AboutStandIns {
    /// Hash and length of the blob that holds them.
    pub blob: SceneInfo,
    /// For each: the section, `geometry` or `portals`, and where it came from, for people.
    pub sources: Vec<(u16, String, String)>,
}

impl About {
    /// Returns a record of the present format, with defaults where nothing is said.
    pub fn new(
        sections: Vec<SectionSpec>,
        settings: RenderSettings,
        packed_scene: &[u8],
        source: String,
    ) -> About {
        About {
            format: FORMAT,
            sections,
            settings,
            scene: SceneInfo {
                hash: Scene::content_hash(packed_scene),
                bytes: packed_scene.len() as u64,
            },
            source,
            up: [0.0, 0.0, 1.0],
            sky: [0.0; 3],
            unit: 1.0,
            views: Vec::new(),
            exposure: None,
            choices: Vec::new(),
            stand_ins: None,
            limits: None,
        }
    }
}

/// An open holodeck.
pub struct Holodeck {
    /// Its description.
    pub about: About,
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
    unseen: RwLock<UnseenBeams>,
    /// The value of [`UnseenBeams::changes`] for the list in the file. Locked while they are
    /// written.
    unseen_saved: Mutex<u64>,
    light: RwLock<LightRecords>,
    /// Locked while records are written.
    light_saved: Mutex<Saved>,
    makers: RwLock<Makers>,
    /// The list in the file. Locked while it is written.
    pub(crate) makers_saved: Mutex<Makers>,
}

impl Holodeck {
    /// Makes a new file.
    ///
    /// # Errors
    /// If the file exists or cannot be written, or a section is not valid.
    pub fn create(
        path: &Path,
        about: About,
        packed_scene: &[u8],
        cache_bytes: u64,
    ) -> Result<Holodeck> {
        let sections = sections(&about)?;
        let layout = sections.iter().map(Section::beam_count).collect();
        let file = BeamFile::create(path, Options { cache_bytes, layout })?;
        file.put_blob(SCENE, packed_scene)?;
        file.put_blob(ABOUT, serde_json::to_string_pretty(&about)?.as_bytes())?;
        file.flush()?;
        Ok(Self::new(path, about, sections, file, true))
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
        if let Some(stand_ins) = self.stand_ins()? {
            new.file.put_blob(STAND_INS, &stand_ins)?;
        }
        new.file.flush()?;
        Ok(new)
    }

    fn new(
        path: &Path,
        about: About,
        sections: Arc<[Section]>,
        file: BeamFile,
        writable: bool,
    ) -> Holodeck {
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
            unseen_saved: Mutex::default(),
            light: RwLock::default(),
            light_saved: Mutex::default(),
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
        let about = file.blob(ABOUT)?;
        let about = about
            .with_context(|| format!("{} holds no description of its sections", path.display()))?;
        let about: About = serde_json::from_slice(&about).with_context(|| {
            format!("{}: the description of its sections is damaged", path.display())
        })?;
        ensure!(
            about.format == FORMAT,
            "{}: this program does not know format {}",
            path.display(),
            about.format
        );
        let sections = sections(&about)?;
        let mut about = about;
        if let Some(views) = file.blob(VIEWS)? {
            about.views = serde_json::from_slice(&views).with_context(|| {
                format!("{}: the list of named views is damaged", path.display())
            })?;
        }
        let mut holodeck = Self::new(path, about, sections, file, writable);
        // Workers find them again, so the file can be opened all the same.
        if let Err(error) = holodeck.load_unseen() {
            holodeck
                .warnings
                .push(format!("the list of beams that see nothing is lost: {error:#}"));
        }
        holodeck.load_light();
        let (makers, result) = Makers::load(&holodeck.file);
        holodeck.warnings.extend(result.err().map(|error| format!("{error:#}")));
        holodeck.makers_saved = Mutex::new(makers.clone());
        holodeck.makers = RwLock::new(makers);
        Ok(holodeck)
    }

    fn load_light(&mut self) {
        let (saved, light, warnings) = Saved::load(&self.file);
        self.light_saved = Mutex::new(saved);
        self.light = RwLock::new(light);
        self.warnings.extend(warnings);
    }

    /// Forgets which beams see nothing: every beam is traced, for comparison.
    pub fn without_skipping(mut self) -> Holodeck {
        self.skip_unseen = false;
        *self.unseen_mut() = UnseenBeams::default();
        self
    }

    fn load_unseen(&self) -> Result<()> {
        if let Some(bytes) = self.file.blob(UNSEEN)?.filter(|_| self.skip_unseen) {
            let unseen = UnseenBeams::decode(&bytes, &self.sections)?;
            *self.unseen_saved.lock().unwrap_or_else(PoisonError::into_inner) = unseen.changes();
            *self.unseen_mut() = unseen;
        }
        Ok(())
    }

    /// Reads what another process has added, if the file is only shown.
    ///
    /// # Errors
    /// If the disk cannot be read.
    pub fn refresh(&self) -> Result<()> {
        if !self.writable && self.file.refresh()? > 0 {
            // If the list is damaged, the one from before is still true.
            let _ = self.load_unseen();
        }
        Ok(())
    }

    /// Returns the beams that are known to see nothing.
    pub fn unseen(&self) -> RwLockReadGuard<'_, UnseenBeams> {
        self.unseen.read().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn unseen_mut(&self) -> RwLockWriteGuard<'_, UnseenBeams> {
        self.unseen.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes the beams that see nothing, if the file has others. Waits for the disk.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn save_unseen(&self) -> Result<()> {
        let mut saved = self.unseen_saved.lock().unwrap_or_else(PoisonError::into_inner);
        let (changes, bytes) = {
            let unseen = self.unseen();
            if !self.writable || unseen.changes() == *saved {
                return Ok(());
            }
            (unseen.changes(), unseen.encode())
        };
        self.file.put_blob_once(UNSEEN, &bytes)?;
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
        ensure!(self.writable, "this holodeck is only shown: no view can be kept in it");
        let mut kept = self.views.lock().unwrap_or_else(PoisonError::into_inner);
        let mut views = kept.clone();
        let at = views.iter().position(|(other, _)| other == name);
        match (at, options) {
            (None, "") => bail!("the holodeck has no view named `{name}`"),
            (Some(at), "") => _ = views.remove(at),
            (Some(at), options) => options.clone_into(&mut views[at].1),
            (None, options) => views.push((name.to_owned(), options.to_owned())),
        }
        ensure!(views.len() <= MAX_VIEWS, "a holodeck has at most {MAX_VIEWS} named views");
        self.file.put_blob(VIEWS, serde_json::to_string_pretty(&views)?.as_bytes())?;
        kept.clone_from(&views);
        Ok(views)
    }

    /// Returns the records of indirect light of the file and of all workers.
    pub fn light(&self) -> RwLockReadGuard<'_, LightRecords> {
        self.light.read().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn light_mut(&self) -> RwLockWriteGuard<'_, LightRecords> {
        self.light.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns who made samples.
    pub fn makers(&self) -> RwLockReadGuard<'_, Makers> {
        self.makers.read().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn makers_mut(&self) -> RwLockWriteGuard<'_, Makers> {
        self.makers.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes the records of indirect light that the file does not have. Waits for the disk.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn save_light(&self) -> Result<()> {
        let mut saved = self.light_saved.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.writable || self.light().len() == saved.records() {
            return Ok(());
        }
        let missing = saved.missing(&self.light());
        saved.write(&self.file, missing)
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
        let name = self.path.display();
        let packed = self.file.blob(SCENE)?.with_context(|| format!("{name} holds no scene"))?;
        let packed: Arc<[u8]> = packed.into();
        ensure!(
            Scene::content_hash(&packed) == self.about.scene.hash,
            "{name}: the scene is damaged, or not the one that the samples were traced in"
        );
        Ok(Arc::clone(self.scene.get_or_init(|| packed)))
    }

    /// Replaces the stand-ins for the scene. Each comes with a text that says where it is from.
    ///
    /// # Errors
    /// If one is for a section that does not exist, or they cannot be written.
    pub fn set_stand_ins(&mut self, parts: &[(StandIn, String)]) -> Result<()> {
        let known = |section: u16| usize::from(section) < self.sections.len();
        if let Some((part, source)) = parts.iter().find(|(part, _)| !known(part.section)) {
            bail!(
                "{source} is for section {}, but there are only {} (the first is 0)",
                part.section,
                self.sections.len()
            );
        }
        let source = |(part, source): &(StandIn, String)| {
            let kind = match part.kind {
                StandInKind::Geometry => "geometry",
                StandInKind::Portals => "portals",
            };
            (part.section, kind.to_owned(), source.clone())
        };
        let sources = parts.iter().map(source).collect();
        let bytes =
            stand_ins::encode(&parts.iter().map(|(part, _)| part.clone()).collect::<Vec<_>>());
        let blob = SceneInfo { hash: Scene::content_hash(&bytes), bytes: bytes.len() as u64 };
        let about = Some(AboutStandIns { blob, sources });
        if self.about.stand_ins != about {
            self.file.put_blob(STAND_INS, &bytes)?;
            self.about.stand_ins = about;
            self.file.put_blob(ABOUT, serde_json::to_string_pretty(&self.about)?.as_bytes())?;
        }
        Ok(())
    }

    /// Returns the blob of the stand-ins, if some exist.
    ///
    /// # Errors
    /// If it is damaged on disk.
    pub fn stand_ins(&self) -> Result<Option<Arc<[u8]>>> {
        let Some(about) = &self.about.stand_ins else { return Ok(None) };
        let name = self.path.display();
        let bytes = self
            .file
            .blob(STAND_INS)?
            .with_context(|| format!("{name}: the stand-ins for the scene are missing"))?;
        ensure!(
            Scene::content_hash(&bytes) == about.blob.hash,
            "{name}: the stand-ins for the scene are damaged"
        );
        Ok(Some(bytes.into()))
    }

    /// Returns the welcome that the server sends to a new connection.
    pub fn welcome(&self) -> Welcome {
        Welcome {
            software: format!("holoserver {}", env!("CARGO_PKG_VERSION")),
            sections: self.about.sections.clone(),
            settings: self.about.settings,
            scene: self.about.scene,
            up: self.about.up,
            views: self.views.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            samples: self.file.stats().samples,
            tracing: self.writable,
            sky: self.about.sky,
            skip_unseen: self.skip_unseen,
            unit: self.about.unit,
        }
    }
}

fn sections(about: &About) -> Result<Arc<[Section]>> {
    ensure!(!about.sections.is_empty(), "a holodeck needs at least one section");
    ensure!(
        about.sections.len() <= MAX_SECTIONS,
        "{} sections are more than the {MAX_SECTIONS} that a holodeck may have",
        about.sections.len()
    );
    about
        .sections
        .iter()
        .enumerate()
        .map(|(index, spec)| Section::new(spec.clone()).with_context(|| format!("section {index}")))
        .collect()
}
