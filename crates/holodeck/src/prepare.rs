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
use holo_scene::{Bsdf, Scene};
use holo_section::{Section, SectionSpec, ViewClass};
use holo_server::{About, Holodeck};

use crate::{
    config::{self, Config, Obstructions},
    differences,
    loading::{load, load_file},
    scene_args::{check_units, scene_path, settings},
};

/// Memory for beams while a file is only made or looked into.
pub const SMALL_CACHE: u64 = 16 << 20;

/// Share of the scene's size between its bounds and a default section, on each side. An interior
/// section is smaller by that, an exterior one larger.
const MARGIN: f64 = 0.05;

/// Records of indirect light are worth making if this share of a scene's surface is diffuse.
const DIFFUSE: f64 = 0.1;

/// Makes a holodeck file. If it exists, only checks that it has this scene and these settings.
///
/// # Errors
/// If the scene cannot be loaded, the file cannot be written, or it has another scene.
pub fn make(path: &Path, config: &Config, quiet: bool) -> Result<Holodeck> {
    check_units(config)?;
    let scene = load(config, quiet)?;
    let packed = scene.pack();
    let sections = sections(config, &scene)?;
    let source = scene_path(config)?.display().to_string();
    let mut about =
        About::new(sections, settings(config, engine_for(&scene, config.bounces)), &packed, source);
    about.up = config.up.unwrap_or(about.up);
    about.sky = scene.sky;
    about.unit = config.unit.unwrap_or(about.unit);
    about.views = config.view.iter().map(|view| (view.name.clone(), view.to_options())).collect();
    let existing = path.exists().then(|| Holodeck::open(path, SMALL_CACHE)).transpose()?;
    if let Some(file) = &existing {
        about.settings.engine = config.engine.unwrap_or(file.about.settings.engine);
        check_same(path, file, &about, &scene)?;
    }
    // If one of them is wrong, no file is made.
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
    // Stand-ins decide no sample, so those named now may replace those in the file.
    if !stand_ins.is_empty() {
        holodeck.set_stand_ins(&stand_ins)?;
    }
    Ok(holodeck)
}

/// Checks that a file holds samples of this scene, by these settings and sections.
fn check_same(path: &Path, file: &Holodeck, now: &About, scene: &Scene) -> Result<()> {
    let name = path.display();
    if file.about.scene != now.scene {
        // A damaged scene, or one of an earlier format, has nothing to compare.
        let before = file.packed_scene().ok().and_then(|packed| Scene::unpack(&packed).ok());
        let found = before.map(|before| differences::of_scenes(&before, scene)).unwrap_or_default();
        let found =
            if found.is_empty() { String::new() } else { format!(": {}", found.join("; ")) };
        bail!("{name} was made of another scene{found}. Name another file, or delete it");
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

/// Loads the stand-ins for the scene, and says where each is from. The command line's come before
/// those of the configuration's sections.
fn stand_ins(config: &Config, sections: usize, quiet: bool) -> Result<Vec<(StandIn, String)>> {
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
                "--{name}: there is no section {section}; there are {sections}, the first is 0"
            );
            let scene = load_file(&file, config, quiet)
                .with_context(|| format!("{name} of section {section}"))?;
            let section = u16::try_from(section)?;
            Ok((StandIn { section, kind, packed: scene.pack() }, file.display().to_string()))
        };
        files.into_iter().map(load)
    };
    of(StandInKind::Geometry).chain(of(StandInKind::Portals)).collect()
}

/// Returns the engine that makes clean samples soonest. Records of indirect light help if there is
/// such light, and if enough surfaces are diffuse.
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

fn engine_words(engine: Engine) -> &'static str {
    match engine {
        Engine::Path => "engine path: no indirect light on diffuse surfaces needs records",
        Engine::Cached => {
            "engine cached: clean samples, with indirect light within --accuracy \
             (--engine path gives unbiased, noisy samples)"
        }
    }
}

fn sections(config: &Config, scene: &Scene) -> Result<Vec<SectionSpec>> {
    let given = match config.section.is_empty() {
        true => vec![default_section(scene, config.exterior)?],
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
    let seen = match (section.exterior, obstructions) {
        (true, _) => "looked into from outside",
        (false, true) => "what stands inside is seen",
        (false, false) => "nothing stands inside",
    };
    eprintln!("section {name}: grid {w}x{d}x{h}, {beams} beams, {seen}");
    Ok(spec)
}

/// Returns the section for users who name none: within the scene's bounds, or around them.
fn default_section(scene: &Scene, exterior: bool) -> Result<config::Section> {
    let (low, high) = scene.bounds();
    let size = high - low;
    let (low, high) = if exterior {
        // A flat scene, too, gets a section that has a volume.
        let margin = DVec3::splat(MARGIN * size.max_element());
        (low - margin, high + margin)
    } else {
        if size.min_element() <= 0.0 {
            bail!(
                "the scene is flat: name a section with --section, or look at it with --exterior"
            );
        }
        (low + size * MARGIN, high - size * MARGIN)
    };
    let how = if exterior { "around the scene" } else { "the scene's bounds shrunk by 10 %" };
    eprintln!("no section given: it is {how}, from {low} to {high}");
    let size = high - low;
    Ok(config::Section {
        name: None,
        origin: low.to_array(),
        axes: [[size.x, 0.0, 0.0], [0.0, size.y, 0.0], [0.0, 0.0, size.z]],
        grid: None,
        exterior,
        geometry: None,
        portals: None,
    })
}

#[cfg(test)]
mod tests {
    use holo_scene::Material;

    use super::*;

    fn triangle(corner: DVec3) -> Scene {
        let corners = [DVec3::ZERO, DVec3::X * 2.0, corner];
        Scene::from_world(&corners, &[[0, 1, 2]], &[0], vec![Material::grey("a")], [1.0; 3])
            .unwrap()
            .0
    }

    #[test]
    fn an_exterior_section_of_its_own_is_around_the_scene_even_if_that_is_flat() {
        for corner in [DVec3::new(0.0, 1.0, 4.0), DVec3::Y] {
            let scene = triangle(corner);
            let section = default_section(&scene, true).unwrap();
            assert!(section.exterior);
            let (low, high) = scene.bounds();
            for axis in 0..3 {
                let (from, size) = (section.origin[axis], section.axes[axis][axis]);
                assert!(from < low[axis] && from + size > high[axis], "{section:?}");
            }
        }
        let flat = default_section(&triangle(DVec3::Y), false).unwrap_err().to_string();
        assert!(flat.contains("--section") && flat.contains("--exterior"), "{flat}");
    }
}
