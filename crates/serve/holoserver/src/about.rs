//! The description of a holodeck: what a server, a worker and a display need to know about its
//! samples.
//!
//! It is a blob of the file. With each edit of the scene, a new one takes its place.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use anyhow::{Context, Result, ensure};
use holo_beamfile::BeamFile;
use holo_proto::control::{Engine, MAX_SECTIONS, RenderSettings, SceneInfo};
use holo_scene::Scene;
use holo_section::{Section, SectionSpec};
use serde::{Deserialize, Serialize};

use crate::{baked::BakedObject, radiance_limits::RadianceLimits};

/// Name of the blob that holds [`HolodeckDescription`], as JSON, so that people and other programs
/// can read it.
const ABOUT: &str = "holodeck";
/// Version of [`HolodeckDescription`] of a file with one generation.
const FORMAT: u32 = 1;
/// Version of [`HolodeckDescription`] of a file with several generations. A program that knows only
/// the other version must refuse the file, because it would count samples of an earlier scene.
const FORMAT_OF_GENERATIONS: u32 = 2;

/// An engine of earlier versions. It kept indirect light in records, which are not read any more.
const EARLIER_ENGINE: &str = "cached";

/// The description of a holodeck: everything except its samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HolodeckDescription {
    /// Version of this record: 1, or 2 from the second generation on.
    pub format: u32,
    /// The number of times that an edited scene has replaced the scene. Samples with lower numbers
    /// show earlier scenes.
    #[serde(default, skip_serializing_if = "is_first")]
    pub generation: u32,
    /// The sections, in the order of their numbers.
    pub sections: Vec<SectionSpec>,
    /// How samples are traced.
    pub settings: RenderSettings,
    /// The engine of the file's first samples, if this program no longer has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub earlier_engine: Option<String>,
    /// The packed scene's hash and length.
    pub scene: SceneInfo,
    /// Where the scene came from, for people.
    pub source: String,
    /// The scene's up axis, in the scene's coordinates.
    pub up: [f64; 3],
    /// Radiance of rays that hit nothing, W·sr⁻¹·m⁻²; its mean if it varies.
    pub sky: [f32; 3],
    /// True if the sky has a sun that is seen, or differs by direction. The scene describes it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sky_varies: bool,
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
    pub limits: Option<RadianceLimits>,
    /// How the scene can be read again; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reading: Option<SceneReading>,
}

/// How a scene was read from its file, so that it can be read again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneReading {
    /// The file, from the root. A name that is not UTF-8 is stored as its bytes.
    #[serde(with = "stored_path")]
    pub path: PathBuf,
    /// The sky that was stated in place of the file's, if it is the same in every direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sky: Option<[f32; 3]>,
    /// Options of light that were stated, by their names on the command line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light: Vec<(String, String)>,
    /// Whether it was stated that lights shine from both sides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub two_sided_lights: Option<bool>,
    /// Whether what stands inside sections is seen, if that was stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstructions: Option<bool>,
    /// Objects that were carried in and are part of the scene.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<BakedObject>,
}

/// A path as text, or as bytes if it is not UTF-8.
mod stored_path {
    use std::{
        ffi::OsString,
        os::unix::ffi::{OsStrExt, OsStringExt},
        path::{Path, PathBuf},
    };

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum StoredDescription {
        Text(String),
        Bytes(Vec<u8>),
    }

    pub fn serialize<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
        match path.to_str() {
            Some(text) => text.serialize(serializer),
            None => path.as_os_str().as_bytes().serialize(serializer),
        }
    }

    pub fn deserialize<'a, D: Deserializer<'a>>(deserializer: D) -> Result<PathBuf, D::Error> {
        Ok(match StoredDescription::deserialize(deserializer)? {
            StoredDescription::Text(text) => text.into(),
            StoredDescription::Bytes(bytes) => OsString::from_vec(bytes).into(),
        })
    }
}

/// Simpler scenes that displays use, by section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AboutStandIns {
    /// Hash and length of the blob that holds them.
    pub blob: SceneInfo,
    /// For each: the section, `geometry` or `portals`, and where it came from, for people.
    pub sources: Vec<(u16, String, String)>,
}

impl HolodeckDescription {
    /// Returns a record of the present format, with defaults where nothing is said.
    pub fn new(
        sections: Vec<SectionSpec>,
        settings: RenderSettings,
        packed_scene: &[u8],
        source: String,
    ) -> HolodeckDescription {
        HolodeckDescription {
            format: FORMAT,
            generation: 0,
            sections,
            settings,
            earlier_engine: None,
            scene: SceneInfo {
                hash: Scene::content_hash(packed_scene),
                bytes: packed_scene.len() as u64,
            },
            source,
            up: [0.0, 0.0, 1.0],
            sky: [0.0; 3],
            sky_varies: false,
            unit: 1.0,
            views: Vec::new(),
            exposure: None,
            choices: Vec::new(),
            stand_ins: None,
            limits: None,
            reading: None,
        }
    }

    /// Reads the description of a file that is at `path`.
    ///
    /// # Errors
    /// If the file has no description, or if the description is damaged, has a later format, or
    /// belongs to an earlier generation.
    pub(crate) fn read(file: &BeamFile, path: &Path) -> Result<HolodeckDescription> {
        let path = path.display();
        let about = file.blob(ABOUT)?;
        let about =
            about.with_context(|| format!("{path} holds no description of its sections"))?;
        let about = HolodeckDescription::parse(&about)
            .with_context(|| format!("{path}: the description of its sections is damaged"))?;
        ensure!(
            [FORMAT, FORMAT_OF_GENERATIONS].contains(&about.format),
            "{path}: this program does not know format {}",
            about.format
        );
        ensure!(
            file.generation() <= about.generation,
            "{path}: the description of its present scene is lost"
        );
        Ok(about)
    }

    /// Parses a description. Files of an engine that this program no longer has go on with another.
    fn parse(json: &[u8]) -> Result<HolodeckDescription> {
        let mut json: serde_json::Value = serde_json::from_slice(json)?;
        if let Some(engine) = json.pointer_mut("/settings/engine")
            && engine == EARLIER_ENGINE
        {
            *engine = Engine::Gather.name().into();
            json["earlier_engine"] = EARLIER_ENGINE.into();
        }
        Ok(serde_json::from_value(json)?)
    }

    /// Returns the warning for people who add to a file whose samples are of another engine.
    pub(crate) fn engine_warning(&self) -> Option<String> {
        let (earlier, engine) = (self.earlier_engine.as_ref()?, self.settings.engine.name());
        Some(format!(
            "its first samples are of the engine `{earlier}`, which is no more; new ones are of \
             `{engine}`"
        ))
    }

    /// Writes the description into a file, in place of the one that is there.
    ///
    /// # Errors
    /// If the disk fails.
    pub(crate) fn write(&self, file: &BeamFile) -> Result<()> {
        Ok(file.put_blob(ABOUT, serde_json::to_string_pretty(self)?.as_bytes())?)
    }

    /// Returns this description for the generation that follows the one of `old`.
    ///
    /// # Errors
    /// If `old` has the last generation.
    pub(crate) fn after(&self, old: &HolodeckDescription) -> Result<HolodeckDescription> {
        let generation = old.generation.checked_add(1).context("there is no generation left")?;
        Ok(HolodeckDescription { format: FORMAT_OF_GENERATIONS, generation, ..self.clone() })
    }

    /// Returns the name of a blob that each generation has for itself.
    pub(crate) fn own_blob(&self, name: &str) -> String {
        match self.generation {
            0 => name.to_owned(),
            generation => format!("{name}-{generation}"),
        }
    }

    /// Returns the sections, checked.
    ///
    /// # Errors
    /// If there is none, there are too many, or one is not valid.
    pub(crate) fn checked_sections(&self) -> Result<Arc<[Section]>> {
        let count = self.sections.len();
        ensure!(count > 0, "a holodeck needs at least one section");
        ensure!(
            count <= MAX_SECTIONS,
            "{count} sections are more than the {MAX_SECTIONS} that a holodeck may have"
        );
        let section = |(index, spec): (usize, &SectionSpec)| {
            Section::new(spec.clone()).with_context(|| format!("section {index}"))
        };
        self.sections.iter().enumerate().map(section).collect()
    }

    /// Checks that a file with the description `old` can go on with the scene that this one
    /// describes. The two may differ in whether rays hit what stands inside sections, because the
    /// rays are the same.
    ///
    /// # Errors
    /// If it cannot go on. The error says what differs, and what the user can do.
    pub fn suits(&self, old: &HolodeckDescription) -> Result<()> {
        let places = |about: &HolodeckDescription| {
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

/// Returns whether a generation is the first one, which descriptions do not state.
fn is_first(generation: &u32) -> bool {
    *generation == 0
}
