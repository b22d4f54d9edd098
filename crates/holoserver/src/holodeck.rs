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
/// Name of the blob that holds the packed scene, of the first generation.
const SCENE: &str = "scene";
/// Name of the blob that holds the beams that see nothing, in the scene of the first generation.
const UNSEEN: &str = "unseen";
/// Name of the blob that holds the named views, as JSON, once one was kept.
const VIEWS: &str = "views";
/// Name of the blob that holds the stand-ins.
const STAND_INS: &str = "stand-ins";
/// Version of [`About`] of a file with one generation.
const FORMAT: u32 = 1;
/// The same of a file with several. Programs that know one would take samples of an earlier scene
/// for those of the present one.
const FORMAT_OF_GENERATIONS: u32 = 2;

/// The description of a holodeck: everything except its samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Version of this record: 1, or 2 from the second generation on.
    pub format: u32,
    /// How often the scene was replaced by an edited one: samples of lower generations are of
    /// earlier scenes.
    #[serde(default, skip_serializing_if = "is_first")]
    pub generation: u32,
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
    /// How the scene can be read again; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reading: Option<Reading>,
}

/// How a scene was read from its file, so that it can be read again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// The file, from the root.
    pub path: PathBuf,
    /// The sky that was stated in place of the file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sky: Option<[f32; 3]>,
    /// Whether it was stated that lights shine from both sides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub two_sided_lights: Option<bool>,
    /// Whether what stands inside sections is seen, if that was stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstructions: Option<bool>,
}

/// Returns whether a generation is the first one, which descriptions do not state.
fn is_first(generation: &u32) -> bool {
    *generation == 0
}

/// Returns the name of a blob that each generation has for itself.
fn of_generation(name: &str, generation: u32) -> String {
    if generation == 0 { name.to_owned() } else { format!("{name}-{generation}") }
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
            generation: 0,
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
            reading: None,
        }
    }
}

impl About {
    /// Checks that a file with the description `old` can go on with the scene that this one
    /// describes. Whether what stands inside a section is seen may differ: rays pass through the
    /// same cells.
    ///
    /// # Errors
    /// What differs, and what to do.
    pub fn suits(&self, old: &About) -> Result<()> {
        let places = |about: &About| {
            let place = |spec: &SectionSpec| SectionSpec { obstructions: false, ..spec.clone() };
            about.sections.iter().map(place).collect::<Vec<_>>()
        };
        ensure!(
            places(self) == places(old),
            "the sections differ from those of the file, and its samples lie in these: name \
             another file, or delete it"
        );
        ensure!(
            self.settings == old.settings,
            "the file was traced with other settings: name another file, or delete it"
        );
        Ok(())
    }
}

/// Writes a scene and then its description, which makes it the file's scene.
fn write_scene(file: &BeamFile, about: &About, packed_scene: &[u8]) -> Result<()> {
    ensure!(
        Scene::content_hash(packed_scene) == about.scene.hash,
        "the description is of another scene"
    );
    file.put_blob(&of_generation(SCENE, about.generation), packed_scene)?;
    // A crash before this leaves the scene before, and an unused blob.
    file.put_blob(ABOUT, serde_json::to_string_pretty(about)?.as_bytes())?;
    Ok(file.flush()?)
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
        write_scene(&file, &about, packed_scene)?;
        Ok(Self::new(path, about, sections, file, true))
    }

    /// Replaces the scene of a file by an edited one, which `about` describes. The samples that are
    /// there belong to an earlier generation from now on: displays show them until new ones come.
    /// Unseen beams and records of indirect light are found anew.
    ///
    /// # Errors
    /// If `about` does not [suit](About::suits) the file, it is no holodeck, another process writes
    /// to it, or the disk fails. The file then has the scene that it had.
    pub fn restart(path: &Path, about: &About, packed_scene: &[u8]) -> Result<()> {
        let old = Self::open(path, 0)?;
        about.suits(&old.about)?;
        let generation =
            old.about.generation.checked_add(1).context("there is no generation left")?;
        let about = About { format: FORMAT_OF_GENERATIONS, generation, ..about.clone() };
        write_scene(&old.file, &about, packed_scene)
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
            unseen_saved: Mutex::default(),
            light: RwLock::default(),
            light_saved: Mutex::new(Saved::none(generation)),
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
            [FORMAT, FORMAT_OF_GENERATIONS].contains(&about.format),
            "{}: this program does not know format {}",
            path.display(),
            about.format
        );
        ensure!(
            file.generation() <= about.generation,
            "{}: the description of its present scene is lost",
            path.display()
        );
        file.begin_generation(about.generation)?;
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
        let (saved, light, warnings) = Saved::load(&self.file, self.about.generation);
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
        let name = of_generation(UNSEEN, self.about.generation);
        if let Some(bytes) = self.file.blob(&name)?.filter(|_| self.skip_unseen) {
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
        self.file.put_blob_once(&of_generation(UNSEEN, self.about.generation), &bytes)?;
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
        let blob = of_generation(SCENE, self.about.generation);
        let packed = self.file.blob(&blob)?.with_context(|| format!("{name} holds no scene"))?;
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
