//! Makes and opens a holodeck file for a scene and options.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_net::Shutdown;
use holo_proto::{
    control::Engine,
    stand_ins::{StandInKind, StandInRecord},
};
use holo_scene::Scene;
use holo_section::{Section, SectionSpec, ViewClass};
use holo_server::{BakedObject, Holodeck, HolodeckDescription, RadianceLimits, SceneReading};
use holo_view::{MovedObject, ObjectFolder, SceneChange, StatedOptions};

use crate::light::{SkyChoice, StatedLight};
use crate::{
    brightness,
    config::{self, HolodeckConfig, Obstructions},
    differences,
    loading::load_file,
    objects::{OBJECT, SceneObjects},
    opening::{OpenedScene, OpeningRequest, open},
    settings::{scene_path, settings},
};

/// Memory for beams while a file is only made or read.
pub const SMALL_CACHE: u64 = 16 << 20;

/// Beginning of the choices that are about light.
const LIGHT: &str = "light: ";

/// What becomes of a file that was made of another scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherScene {
    /// It stays as it is: an error.
    Refuse,
    /// It goes on with the scene as it is now.
    Restart,
}

impl OtherScene {
    /// Returns what `--restart` asks for.
    pub fn of_option(restart: bool) -> OtherScene {
        if restart { OtherScene::Restart } else { OtherScene::Refuse }
    }
}

/// Makes a holodeck file. If it exists, only checks that it has these settings and, unless
/// `other_scene` says otherwise, this scene.
///
/// # Errors
/// If the scene cannot be loaded, the file cannot be written, or it has another scene.
pub fn make(
    path: &Path,
    config: &HolodeckConfig,
    other_scene: OtherScene,
    quiet: bool,
) -> Result<Holodeck> {
    let existing = path.exists().then(|| Holodeck::open(path, SMALL_CACHE)).transpose()?;
    existing.as_ref().map_or(Ok(()), |file| file.about.check_traced(path))?;
    let mut opened = match &existing {
        None => open(config, OpeningRequest::Sections, quiet)?,
        // The choices stored in the file stay.
        Some(file) => open(&chosen_before(config, file)?, OpeningRequest::Sections, true)?,
    };
    let packed = opened.scene.pack();
    let sections = sections(config, &opened)?;
    let source = scene_path(config)?.display().to_string();
    let engine = usual_engine(config.bounces);
    let mut about = HolodeckDescription::new(sections, settings(config, engine), &packed, source);
    about.up = opened.up;
    describe_sky(&mut about, &opened.scene);
    about.unit = opened.unit;
    about.limits = Some(RadianceLimits::of(&opened.scene));
    about.views.clone_from(&opened.views);
    about.reading = Some(reading(config, Vec::new())?);
    let is_other = existing.as_ref().is_some_and(|file| file.about.scene != about.scene);
    if is_other && other_scene == OtherScene::Restart {
        // It must not be open for writing twice.
        drop(existing);
        Edited::read(path, Some(config), &SceneChange::default())?.restart(path)?;
        return Holodeck::open(path, SMALL_CACHE);
    }
    match &existing {
        None => {
            about.exposure = brightness::of_first_view(&mut opened, about.settings.bounces)?;
            if let Some(factor) = about.exposure {
                let words = format!(
                    "brightness: radiance times {factor:.4} in pictures, as suits the first view \
                     (picture --exposure)"
                );
                opened.choices.push(words);
            }
            about.choices.clone_from(&opened.choices);
            opened.say(config)?;
        }
        Some(file) => {
            about.settings.engine = config.engine.unwrap_or(file.about.settings.engine);
            check_same(path, file, &about, &opened.scene)?;
        }
    }
    // If a stand-in is wrong, no file is made.
    let stand_ins = stand_ins(config, about.sections.len(), quiet)?;
    let mut holodeck = match existing {
        Some(holodeck) => holodeck,
        None => {
            if config.engine.is_none() {
                eprintln!("{}", engine_words(about.settings.engine));
            }
            Holodeck::create(path, about, &packed, SMALL_CACHE)?
        }
    };
    // Stand-ins do not affect samples, so new ones may replace those in the file.
    if !stand_ins.is_empty() {
        holodeck.set_stand_ins(&stand_ins)?;
    }
    Ok(holodeck)
}

/// Makes a holodeck file as [`make`] does, and returns its description. If `shutdown` is triggered
/// meanwhile, no half of a file is left.
///
/// # Errors
/// As [`make`], and if `shutdown` was triggered.
pub async fn make_unless_ended(
    path: &Path,
    config: &HolodeckConfig,
    other_scene: OtherScene,
    quiet: bool,
    shutdown: &Shutdown,
) -> Result<HolodeckDescription> {
    let (file, config) = (path.to_owned(), config.clone());
    let making = tokio::task::spawn_blocking(move || {
        Ok(make(&file, &config, other_scene, quiet)?.about.clone())
    });
    tokio::select! {
        about = making => about?,
        () = shutdown.wait() => {
            // The process ends without waiting for that thread.
            holo_server::remove_drafts();
            bail!("ended before {} was ready", path.display())
        }
    }
}

/// An edited scene, with which a file can go on.
pub struct Edited {
    about: HolodeckDescription,
    packed: Vec<u8>,
    stand_ins: Vec<(StandInRecord, String)>,
    /// The configuration by which it was read, with its change of light.
    config: HolodeckConfig,
    /// The objects that are part of it.
    objects: SceneObjects,
    /// The names of those that were carried before.
    baked: Vec<String>,
    /// Those that were elsewhere, or are gone.
    moved: Vec<MovedObject>,
    /// What differs from the scene before, for people.
    differences: String,
    warnings: Vec<String>,
}

impl Edited {
    /// Reads a file's scene again: by `config`, or as the file says if there is none, with a
    /// change. The objects that are part of it stay so, whatever `config` says.
    ///
    /// # Errors
    /// If the scene cannot be used, is as before, or the file cannot go on with it.
    pub fn read(
        path: &Path,
        config: Option<&HolodeckConfig>,
        change: &SceneChange,
    ) -> Result<Edited> {
        let file = Holodeck::open_read_only(path, SMALL_CACHE)?;
        file.about.check_traced(path)?;
        let mut config = config.map_or_else(|| config_of(path, &file.about), |c| Ok(c.clone()))?;
        if !change.light.is_empty() {
            config.set_light(config.light().changed(change.light.options())?);
        }
        for name in &change.taken_out {
            // Its lamps go with it.
            config.lamp.retain(|(lamp, _)| !lamp.starts_with(&format!("{name}/")));
        }
        let mut chosen = chosen_before(&config, &file)?;
        let before = chosen.objects.clone();
        chosen.objects = chosen.objects.changed(change, DVec3::from_array(file.about.up))?;
        let mut opened = open(&chosen, OpeningRequest::Sections, true)?;
        let objects = chosen.objects;
        let packed = opened.scene.pack();
        let name = scene_path(&config)?.display().to_string();
        let usual = file.about.settings.engine;
        let settings = settings(&config, usual);
        let sections = sections(&config, &opened)?;
        let mut about = HolodeckDescription::new(sections, settings, &packed, name.clone());
        if about.scene == file.about.scene {
            ensure!(!change.is_empty(), "{name} is as it was: edit it, save it, and restart then");
            bail!("the light is as it was: nothing needs to be traced anew");
        }
        (about.up, about.unit) = (opened.up, opened.unit);
        describe_sky(&mut about, &opened.scene);
        about.limits = Some(RadianceLimits::of(&opened.scene));
        about.views.clone_from(&opened.views);
        about.reading = Some(reading(&config, objects.described())?);
        about.exposure = file.about.exposure;
        about.choices = choices_of_edit(&file.about.choices, &opened.choices);
        about.stand_ins.clone_from(&file.about.stand_ins);
        about
            .suits(&file.about)
            .with_context(|| format!("{} cannot go on with this scene", path.display()))?;
        let stand_ins = stand_ins(&config, file.sections.len(), true)?;
        let differences = differences_of(&file, &opened.scene);
        let warnings = std::mem::take(&mut opened.warnings);
        let baked = change.baked.iter().map(|object| object.name.clone()).collect();
        let moved = before.moved(&objects)?;
        Ok(Edited {
            about,
            packed,
            stand_ins,
            config,
            objects,
            baked,
            moved,
            differences,
            warnings,
        })
    }

    /// Returns the configuration by which it was read, with its change of light.
    pub fn config(&self) -> &HolodeckConfig {
        &self.config
    }

    /// Returns what is stated for it.
    pub fn stated(&self) -> StatedOptions {
        stated_options(&self.about)
    }

    /// Returns the names of objects that were carried before and are part of it.
    pub fn baked(&self) -> &[String] {
        &self.baked
    }

    /// Returns the objects that were part of the scene before, and were elsewhere or are gone.
    pub fn moved(&self) -> &[MovedObject] {
        &self.moved
    }

    /// Goes on with it in a file that nobody else writes, and says so. Returns what of the scene is
    /// odd, for people who do not look at the terminal.
    ///
    /// # Errors
    /// If the file cannot be written; it then has the scene before.
    pub fn restart(&self, path: &Path) -> Result<Option<String>> {
        Holodeck::restart(path, &self.about, &self.packed, self.objects.packed())
            .with_context(|| format!("restarting {}", path.display()))?;
        // A crash before this leaves objects both in the scene and carried, which a person can
        // remove; the other order could lose them.
        if let Err(error) = ObjectFolder::beside(path, true).forget(&self.baked) {
            eprintln!("objects are part of the scene, and still carried: {error:#}");
        }
        if !self.stand_ins.is_empty() {
            Holodeck::open(path, SMALL_CACHE)?.set_stand_ins(&self.stand_ins)?;
        }
        eprintln!(
            "{} goes on with the edited scene{}. Samples of the scene before are shown until new \
             ones come",
            path.display(),
            self.differences
        );
        let more = match self.warnings.len() {
            0 | 1 => String::new(),
            many => format!("; the terminal has all {many} warnings"),
        };
        Ok(self
            .warnings
            .first()
            .map(|first| format!("the edited scene is in use, but {first}{more}")))
    }
}

/// Checks that rays can be traced for a file.
///
/// # Errors
/// If its rays were captured, or it cannot be read.
pub fn check_traced(path: &Path) -> Result<()> {
    Holodeck::open_read_only(path, SMALL_CACHE)?.about.check_traced(path)
}

/// Returns what is stated for the scene of a file.
///
/// # Errors
/// If the file cannot be read.
pub fn stated_for(path: &Path) -> Result<StatedOptions> {
    Ok(stated_options(&Holodeck::open_read_only(path, SMALL_CACHE)?.about))
}

fn stated_options(about: &HolodeckDescription) -> StatedOptions {
    let mut options = about.reading.as_ref().map_or_else(Vec::new, |r| r.light.clone());
    let radiance = about.reading.as_ref().and_then(|reading| reading.sky);
    if let Some(radiance) = radiance {
        options.push(("sky".to_owned(), SkyChoice::Radiance(radiance).to_string()));
    }
    let words = about.choices.iter().filter_map(|choice| choice.strip_prefix(LIGHT));
    let objects = about.reading.iter().flat_map(|reading| &reading.objects);
    StatedOptions {
        options,
        words: words.map(str::to_owned).collect(),
        objects: objects.map(|object| object.name.clone()).collect(),
    }
}

/// Describes a scene's sky, as far as the description does.
fn describe_sky(about: &mut HolodeckDescription, scene: &Scene) {
    (about.sky, about.sky_varies) = (scene.sky.mean(), !scene.sky.is_plain());
}

/// Returns the choices of a file, with those of light and objects as they are for the edited scene.
fn choices_of_edit(before: &[String], now: &[String]) -> Vec<String> {
    let changes = |choice: &&String| choice.starts_with(LIGHT) || choice.starts_with(OBJECT);
    let changed = now.iter().filter(changes);
    before.iter().filter(|choice| !changes(choice)).chain(changed).cloned().collect()
}

/// Returns how a configuration's scene is read, with objects that are part of it.
fn reading(config: &HolodeckConfig, objects: Vec<BakedObject>) -> Result<SceneReading> {
    let path = scene_path(config)?;
    Ok(SceneReading {
        path: std::path::absolute(path)
            .with_context(|| format!("looking for {}", path.display()))?,
        sky: config.light().radiance(),
        light: config.light().to_options()?,
        two_sided_lights: config.two_sided_lights,
        obstructions: config.obstructions.and_then(|obstructions| match obstructions {
            Obstructions::Auto => None,
            Obstructions::On => Some(true),
            Obstructions::Off => Some(false),
        }),
        objects,
    })
}

/// Returns the configuration by which a file was made.
fn config_of(path: &Path, about: &HolodeckDescription) -> Result<HolodeckConfig> {
    let name = path.display();
    let reading = about.reading.as_ref().with_context(|| {
        format!(
            "{name} does not say how its scene was read. Open the scene itself: holodeck view {} \
             --keep {name} --restart, with the options that it was opened with",
            about.source
        )
    })?;
    let SceneReading { path, sky, light, two_sided_lights, obstructions, .. } = reading.clone();
    let settings = &about.settings;
    let mut light = StatedLight::from_options(&light).with_context(|| name.to_string())?;
    light.sky = light.sky.or(sky.map(SkyChoice::Radiance));
    let mut config = HolodeckConfig {
        scene: Some(path),
        two_sided_lights,
        obstructions: obstructions.map(|on| if on { Obstructions::On } else { Obstructions::Off }),
        engine: Some(settings.engine),
        bounces: settings.bounces,
        paths_per_sample: Some(settings.paths_per_sample),
        seed: Some(settings.seed),
        virtual_distance: Some(settings.virtual_distance),
        ..HolodeckConfig::default()
    };
    config.set_light(light);
    Ok(config)
}

/// Returns what differs between a file's scene and another one: nothing, or `: ` and what it is.
fn differences_of(file: &Holodeck, scene: &Scene) -> String {
    // A damaged scene, or one of an earlier format, has nothing to compare.
    let before = file.packed_scene().ok().and_then(|packed| Scene::unpack(&packed).ok());
    let found = before.map(|before| differences::of_scenes(&before, scene)).unwrap_or_default();
    if found.is_empty() { String::new() } else { format!(": {}", found.join("; ")) }
}

/// Returns the configuration, completed by the choices that were made when the file was created,
/// and by the objects that became part of its scene.
///
/// # Errors
/// If the model of an object is damaged.
fn chosen_before(config: &HolodeckConfig, file: &Holodeck) -> Result<HolodeckConfig> {
    let about = &file.about;
    let mut config = HolodeckConfig { objects: SceneObjects::of(file)?, ..config.clone() };
    config.up = config.up.or(Some(config::Up(about.up)));
    config.unit = config.unit.or(Some(config::Unit(about.unit)));
    if config.section.is_empty() && !config.exterior {
        let section = |spec: &SectionSpec| config::SectionTable {
            name: None,
            origin: spec.origin,
            axes: spec.axes,
            grid: Some(spec.grid),
            exterior: spec.class == ViewClass::Exterior,
            geometry: None,
            portals: None,
        };
        config.section = about.sections.iter().map(section).collect();
    }
    if config.view.is_empty() {
        config.named_views.clone_from(&about.views);
    }
    Ok(config)
}

/// Checks that a file has samples of this scene, with these settings and sections.
fn check_same(
    path: &Path,
    file: &Holodeck,
    now: &HolodeckDescription,
    scene: &Scene,
) -> Result<()> {
    let name = path.display();
    if file.about.scene != now.scene {
        let found = differences_of(file, scene);
        bail!(
            "{name} was made of another scene{found}. Say --restart to go on with the scene as it \
             is now, name another file, or delete it"
        );
    }
    let found = differences::of_settings(&file.about.settings, &now.settings);
    ensure!(
        found.is_empty(),
        "{name} was traced with other settings: {}. Name another file, or delete it",
        found.join("; ")
    );
    ensure!(
        file.about.sections == now.sections,
        "{name} has other sections. Name another file, or delete it"
    );
    Ok(())
}

/// Loads the stand-ins for the scene, and returns the origin of each. The command line's come
/// before those of the configuration's sections.
fn stand_ins(
    config: &HolodeckConfig,
    sections: usize,
    quiet: bool,
) -> Result<Vec<(StandInRecord, String)>> {
    let of = |kind: StandInKind| {
        let (name, given) = match kind {
            StandInKind::Geometry => ("geometry", &config.geometry),
            StandInKind::Portals => ("portals", &config.portals),
        };
        let from_section = |section: &config::SectionTable| match kind {
            StandInKind::Geometry => section.geometry.clone(),
            StandInKind::Portals => section.portals.clone(),
        };
        let mut files: BTreeMap<usize, PathBuf> = config
            .section
            .iter()
            .map(from_section)
            .enumerate()
            .filter_map(|(n, file)| Some((n, file?)))
            .collect();
        files.extend(given.iter().cloned());
        let load = move |(section, file): (usize, PathBuf)| {
            ensure!(
                section < sections,
                "--{name}: there is no section {section}; there are {sections}, the first is 0"
            );
            let loaded = load_file(&file, config, quiet)
                .with_context(|| format!("{name} of section {section}"))?;
            let section = u16::try_from(section)?;
            let packed = loaded.scene.pack();
            Ok((StandInRecord { section, kind, packed }, file.display().to_string()))
        };
        files.into_iter().map(load)
    };
    of(StandInKind::Geometry).chain(of(StandInKind::Portals)).collect()
}

/// Returns the engine that reaches clean samples soonest. Direct light needs no cells.
fn usual_engine(bounces: Option<u32>) -> Engine {
    if bounces == Some(0) { Engine::Path } else { Engine::Gather }
}

fn engine_words(engine: Engine) -> &'static str {
    match engine {
        Engine::Path => "engine path: direct light needs no cells of surface light",
        Engine::Gather => {
            "engine gather: paths end in shared cells of surface light \
             (--engine path gives unbiased, noisier samples)"
        }
        Engine::Captured => "engine captured: nothing is traced",
    }
}

fn sections(config: &HolodeckConfig, opened: &OpenedScene) -> Result<Vec<SectionSpec>> {
    let specs = opened.sections.iter().enumerate().map(|(index, section)| {
        spec(config, Some(&opened.scene), section, index)
            .with_context(|| format!("section {index}"))
    });
    specs.collect()
}

/// Returns the specification of a section that was stated or found, and prints it.
pub(crate) fn spec(
    config: &HolodeckConfig,
    scene: Option<&Scene>,
    section: &config::SectionTable,
    index: usize,
) -> Result<SectionSpec> {
    let (origin, axes) = (DVec3::from_array(section.origin), section.axes.map(DVec3::from_array));
    // Without a scene, anything may be inside.
    let inside = scene.is_none_or(|scene| scene.geometry_inside(origin, axes));
    let obstructions = match config.obstructions.unwrap_or_default() {
        Obstructions::Auto => inside,
        Obstructions::On => true,
        Obstructions::Off => false,
    };
    let spec = SectionSpec {
        origin: section.origin,
        axes: section.axes,
        grid: section.grid.unwrap_or_else(|| Section::default_grid(section.axes)),
        class: if section.exterior { ViewClass::Exterior } else { ViewClass::Interior },
        obstructions,
    };
    let beams = Section::new(spec.clone())?.beam_count();
    let name =
        section.name.as_ref().map_or_else(|| index.to_string(), |name| format!("{index} ({name})"));
    let [w, d, h] = spec.grid;
    let seen = match (section.exterior, obstructions) {
        (true, _) => "looked into from outside",
        (false, true) => "what stands inside is seen",
        (false, false) => "nothing stands inside",
    };
    eprintln!("section {name}: grid {w}x{d}x{h}, {beams} beams, {seen}");
    Ok(spec)
}
