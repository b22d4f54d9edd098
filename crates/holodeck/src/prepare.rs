//! From a scene and options to an open holodeck file.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_proto::{
    control::Engine,
    stand_ins::{StandIn, StandInKind},
};
use holo_scene::{Bsdf, LoadOptions, Scene};
use holo_section::{Section, SectionSpec, ViewClass};
use holo_server::{About, Holodeck};

use crate::{
    config::{self, Config},
    scene_args::{Obstructions, check_units, scene_path, settings},
};

/// Memory for beams while a file is only made or looked into.
pub const SMALL_CACHE: u64 = 16 << 20;

/// Share of the scene's bounds that a default section leaves free on each side: 10 % of the whole.
const SHRINK: f64 = 0.05;

/// Share of a scene's surface that scatters diffusely from which records of indirect light are worth making.
const DIFFUSE: f64 = 0.1;

/// Loads the configuration's scene; warnings go to standard error.
///
/// # Errors
/// If there is no scene or it cannot be loaded.
pub fn load(config: &Config) -> Result<Scene> {
    load_file(scene_path(config)?, config)
}

fn load_file(path: &Path, config: &Config) -> Result<Scene> {
    let options = LoadOptions {
        sky: config.sky.unwrap_or([0.0; 3]),
        two_sided_lights: config.two_sided_lights.unwrap_or(false),
    };
    let loaded = holo_scene::load_obj(path, &options)?;
    for warning in &loaded.warnings {
        eprintln!("{warning}");
    }
    Ok(loaded.scene)
}

/// Makes a holodeck file, or checks that the one that is there is of this scene and these settings, so that it goes on.
///
/// # Errors
/// If the scene cannot be loaded, the file be written, or it is of something else.
pub fn make(path: &Path, config: &Config) -> Result<Holodeck> {
    check_units(config)?;
    let scene = load(config)?;
    let packed = scene.pack();
    let sections = sections(config, &scene)?;
    let source = scene_path(config)?.display().to_string();
    let mut about =
        About::new(sections, settings(config, engine_for(&scene, config.bounces)), &packed, source);
    about.up = config.up.unwrap_or(about.up);
    about.sky = scene.sky;
    about.unit = config.unit.unwrap_or(about.unit);
    about.views = config.view.iter().map(|view| (view.name.clone(), view.to_options())).collect();
    if !path.exists() {
        if config.engine.is_none() {
            eprintln!("{}", engine_said(about.settings.engine));
        }
        let stand_ins = stand_ins(config, about.sections.len())?;
        let mut holodeck = Holodeck::create(path, about, &packed, SMALL_CACHE)?;
        if !stand_ins.is_empty() {
            holodeck.set_stand_ins(&stand_ins)?;
        }
        return Ok(holodeck);
    }
    let mut holodeck = Holodeck::open(path, SMALL_CACHE)?;
    let there = &holodeck.about;
    about.settings.engine = config.engine.unwrap_or(there.settings.engine);
    let name = path.display();
    ensure!(
        there.scene == about.scene,
        "{name} was made of another scene; name another file, or delete it"
    );
    ensure!(
        there.settings == about.settings,
        "{name} was traced with other settings ({:?}, now {:?}); name another file, or delete it",
        there.settings,
        about.settings
    );
    ensure!(
        there.sections == about.sections,
        "{name} has other sections; name another file, or delete it"
    );
    // They decide no sample: those named now replace those before.
    let stand_ins = stand_ins(config, about.sections.len())?;
    if !stand_ins.is_empty() {
        holodeck.set_stand_ins(&stand_ins)?;
    }
    Ok(holodeck)
}

/// What stands in for the scene, loaded, and where each came from: of the command line, else of the configuration's sections.
fn stand_ins(config: &Config, sections: usize) -> Result<Vec<(StandIn, String)>> {
    let of = |kind: StandInKind| {
        let (name, given) = match kind {
            StandInKind::Geometry => ("geometry", &config.geometry),
            StandInKind::Portals => ("portals", &config.portals),
        };
        let from_section = |section: &config::Section| match kind {
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
                "--{name}: there is no section {section}, only {sections} from 0 on"
            );
            let scene =
                load_file(&file, config).with_context(|| format!("{name} of section {section}"))?;
            let section = u16::try_from(section)?;
            Ok((StandIn { section, kind, packed: scene.pack() }, file.display().to_string()))
        };
        files.into_iter().map(load)
    };
    of(StandInKind::Geometry).chain(of(StandInKind::Portals)).collect()
}

/// The engine that makes clean samples soonest: with records of indirect light where there is such light and surfaces that records
/// are for.
fn engine_for(scene: &Scene, bounces: Option<u32>) -> Engine {
    let (mut diffuse, mut all) = (0.0, 0.0);
    for triangle in 0..scene.triangles.len() as u32 {
        let area = scene.area(triangle);
        all += area;
        if matches!(scene.material(triangle).bsdf, Bsdf::Diffuse { kd } if kd != [0.0; 3]) {
            diffuse += area;
        }
    }
    if bounces != Some(0) && diffuse > DIFFUSE * all { Engine::Cached } else { Engine::Path }
}

fn engine_said(engine: Engine) -> &'static str {
    match engine {
        Engine::Path => {
            "engine path: there is no indirect light on diffuse surfaces to keep records of"
        }
        Engine::Cached => {
            "engine cached: clean samples, indirect light aimed at --accuracy (--engine path for unbiased, noisy ones)"
        }
    }
}

fn sections(config: &Config, scene: &Scene) -> Result<Vec<SectionSpec>> {
    let given = match config.section.is_empty() {
        true => vec![default_section(scene)?],
        false => config.section.clone(),
    };
    given
        .iter()
        .enumerate()
        .map(|(index, section)| {
            spec(config, scene, section, index).with_context(|| format!("section {index}"))
        })
        .collect()
}

fn spec(
    config: &Config,
    scene: &Scene,
    section: &config::Section,
    index: usize,
) -> Result<SectionSpec> {
    let inside = scene
        .geometry_inside(DVec3::from_array(section.origin), section.axes.map(DVec3::from_array));
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
    let seen = if obstructions { "what stands inside is seen" } else { "nothing stands inside" };
    eprintln!("section {name}: grid {w}x{d}x{h}, {beams} beams, {seen}");
    Ok(spec)
}

fn default_section(scene: &Scene) -> Result<config::Section> {
    let (low, high) = scene.bounds();
    let size = high - low;
    if size.min_element() <= 0.0 {
        bail!("the scene is flat: name a section with --section");
    }
    let origin = low + size * SHRINK;
    let size = size * (1.0 - 2.0 * SHRINK);
    eprintln!(
        "no section given: taking the scene's bounds shrunk by 10 %, from {origin} to {}",
        origin + size
    );
    let axes = [[size.x, 0.0, 0.0], [0.0, size.y, 0.0], [0.0, 0.0, size.z]];
    Ok(config::Section {
        name: None,
        origin: origin.to_array(),
        axes,
        grid: None,
        exterior: false,
        geometry: None,
        portals: None,
    })
}
