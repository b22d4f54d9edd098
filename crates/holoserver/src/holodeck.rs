//! A holodeck on disk: the beam file, and in it everything that a server, a worker and a display need to know.

use std::{
    path::Path,
    sync::{Arc, OnceLock},
};

use anyhow::{Context, Result, ensure};
use holo_beamfile::{BeamFile, Options};
use holo_proto::control::{MAX_SECTIONS, RenderSettings, SceneInfo, Welcome};
use holo_section::{Section, SectionSpec};
use serde::{Deserialize, Serialize};

/// Name of the blob that holds [`About`], as JSON for people and other programs to read.
const ABOUT: &str = "holodeck";
/// Name of the blob that holds the packed scene.
const SCENE: &str = "scene";
/// Version of [`About`].
const FORMAT: u32 = 1;

/// What a holodeck is, besides its samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Version of this record, 1.
    pub format: u32,
    /// The sections, in the order of their numbers.
    pub sections: Vec<SectionSpec>,
    /// What samples hold.
    pub settings: RenderSettings,
    /// The packed scene's hash and length.
    pub scene: SceneInfo,
    /// Where the scene came from, for people.
    pub source: String,
    /// The scene's up axis.
    pub up: [f64; 3],
    /// Radiance of rays that meet nothing.
    pub sky: [f32; 3],
    /// Metres per scene unit.
    pub unit: f64,
    /// Named views, as Radiance view options; the first is where a display begins.
    pub views: Vec<(String, String)>,
}

impl About {
    /// A record of the present format.
    pub fn new(sections: Vec<SectionSpec>, settings: RenderSettings, packed_scene: &[u8], source: String) -> About {
        About {
            format: FORMAT,
            sections,
            settings,
            scene: SceneInfo { hash: holo_scene::Scene::content_hash(packed_scene), bytes: packed_scene.len() as u64 },
            source,
            up: [0.0, 0.0, 1.0],
            sky: [0.0; 3],
            unit: 1.0,
            views: Vec::new(),
        }
    }
}

/// An open holodeck.
pub struct Holodeck {
    /// What it is.
    pub about: About,
    /// Its sections, valid.
    pub sections: Arc<[Section]>,
    /// Its samples.
    pub file: Arc<BeamFile>,
    /// False if it was opened to be shown only.
    pub writable: bool,
    scene: OnceLock<Arc<[u8]>>,
}

impl Holodeck {
    /// Makes a new file.
    ///
    /// # Errors
    /// If the file exists, cannot be written, or a section is not valid.
    pub fn create(path: &Path, about: About, packed_scene: &[u8], cache_bytes: u64) -> Result<Holodeck> {
        let sections = sections(&about)?;
        let layout = sections.iter().map(Section::beam_count).collect();
        let file = BeamFile::create(path, Options { cache_bytes, layout })
            .with_context(|| format!("making {}", path.display()))?;
        file.put_blob(SCENE, packed_scene)?;
        file.put_blob(ABOUT, serde_json::to_string_pretty(&about)?.as_bytes())?;
        file.flush()?;
        let file = Arc::new(file);
        Ok(Holodeck { about, sections, file, writable: true, scene: OnceLock::new() })
    }

    /// Opens a file to add to it.
    ///
    /// # Errors
    /// If it does not exist, is not a holodeck, or another process writes to it.
    pub fn open(path: &Path, cache_bytes: u64) -> Result<Holodeck> {
        let file = BeamFile::open(path, Options { cache_bytes, layout: Vec::new() });
        Self::from_file(path, file.with_context(|| format!("opening {}", path.display()))?, true)
    }

    /// Opens a file to show it; another process may go on writing to it.
    ///
    /// # Errors
    /// If it does not exist or is not a holodeck.
    pub fn open_read_only(path: &Path, cache_bytes: u64) -> Result<Holodeck> {
        let file = BeamFile::open_read_only(path, cache_bytes);
        Self::from_file(path, file.with_context(|| format!("opening {}", path.display()))?, false)
    }

    fn from_file(path: &Path, file: BeamFile, writable: bool) -> Result<Holodeck> {
        let about = file.blob(ABOUT)?;
        let about = about.with_context(|| format!("{} says nothing about its sections", path.display()))?;
        let about: About = serde_json::from_slice(&about)
            .with_context(|| format!("{}: the description of its sections is damaged", path.display()))?;
        ensure!(about.format == FORMAT, "{}: format {} is not known here", path.display(), about.format);
        let sections = sections(&about)?;
        Ok(Holodeck { about, sections, file: Arc::new(file), writable, scene: OnceLock::new() })
    }

    /// The packed scene, read once.
    ///
    /// # Errors
    /// If it is damaged on disk.
    pub fn packed_scene(&self) -> Result<Arc<[u8]>> {
        if let Some(scene) = self.scene.get() {
            return Ok(Arc::clone(scene));
        }
        let packed: Arc<[u8]> = self.file.blob(SCENE)?.context("the file holds no scene")?.into();
        ensure!(
            holo_scene::Scene::content_hash(&packed) == self.about.scene.hash,
            "the scene in the file is not the one that its samples were traced in"
        );
        Ok(Arc::clone(self.scene.get_or_init(|| packed)))
    }

    /// What whoever connects is told.
    pub fn welcome(&self) -> Welcome {
        Welcome {
            software: format!("holoserver {}", env!("CARGO_PKG_VERSION")),
            sections: self.about.sections.clone(),
            settings: self.about.settings,
            scene: self.about.scene,
            up: self.about.up,
            views: self.about.views.clone(),
            samples: self.file.stats().samples,
            tracing: self.writable,
            sky: self.about.sky,
            skip_unseen: false,
        }
    }
}

fn sections(about: &About) -> Result<Arc<[Section]>> {
    ensure!(!about.sections.is_empty(), "a holodeck needs at least one section");
    ensure!(about.sections.len() <= MAX_SECTIONS, "{} sections, at most {MAX_SECTIONS}", about.sections.len());
    about
        .sections
        .iter()
        .enumerate()
        .map(|(index, spec)| Section::new(spec.clone()).with_context(|| format!("section {index}")))
        .collect()
}
