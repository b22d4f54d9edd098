//! Opens a scene, and chooses what is not stated: up axis, unit, light, sections and views.
//!
//! Invariant: each choice is reported once, with the option that overrides it.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use glam::DVec3;
use holo_progress::{HumanCount, Meter};
use holo_raycast::{Raycaster, StoredScenes};
use holo_scene::{Loaded, ModelCamera, ModelFacts, Scene};
use holo_survey::{ChosenView, Room, Survey, UprightAxes, unit_words};

use crate::config::{self, HolodeckConfig};
use crate::light::hang;
use crate::{
    limit, loading, places, preview,
    settings::{check_units, scene_path},
};

/// Share of the scene's size between its bounds and the section around it, on each side.
const MARGIN: f64 = 0.05;

/// Number of triangles from which their preparation takes seconds, and is reported.
const MANY: usize = 500_000;

/// A scene with everything that is needed to show it.
pub struct OpenedScene {
    /// The scene.
    pub scene: Arc<Scene>,
    /// The scene's up axis.
    pub up: [f64; 3],
    /// Length of the scene's unit, metres.
    pub unit: f64,
    /// Views by name. A session begins with the first.
    pub views: Vec<(String, String)>,
    /// Sections. Empty if only a picture is wanted.
    pub sections: Vec<config::SectionTable>,
    /// The choices and their reasons, for people.
    pub choices: Vec<String>,
    /// What of its file is left out or odd, for people.
    pub warnings: Vec<String>,
    raycaster: Option<Arc<Raycaster>>,
    is_quiet: bool,
    survey: Option<Survey>,
}

/// The parts of an opened scene that a command needs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum OpeningRequest {
    /// A view to begin with.
    View,
    /// Sections, too.
    Sections,
}

/// Opens the configuration's scene, and chooses what the configuration does not state. With
/// `quiet`, no progress is shown.
///
/// # Errors
/// If there is no scene, or it cannot be loaded.
pub fn open(config: &HolodeckConfig, wanted: OpeningRequest, quiet: bool) -> Result<OpenedScene> {
    check_units(config)?;
    let Loaded { scene, about, warnings, photometry, .. } = loading::load(config, quiet)?;
    let mut choices = Vec::new();
    let guess = config.up.is_none().then(|| holo_survey::guess_up(&scene, &about));
    let stated = config.up.map_or(DVec3::Z, |up| DVec3::from_array(up.0));
    let up = guess.as_ref().map_or(stated, |guess| guess.value);
    let light = config.light();
    let unit = stated_unit(config, &about);
    let (mut scene, said) = hang(&light.luminaires, &photometry, scene, up, unit)?;
    choices.extend(said);
    choices.extend(light.apply_sky(&mut scene, up)?);
    let features = scene.features();
    let has_no_sky = !features.sky && !light.states_sky();
    if has_no_sky && features.suns > 0 {
        let sky = preview::sky_beside(&scene.suns);
        scene.sky = sky.into();
        let sky = preview::words(sky);
        choices.push(format!(
            "light: a sky of radiance {sky}, a fifth of the suns' irradiance, because the file has \
             suns and no sky (--sky R,G,B)"
        ));
    }
    choices.extend(guess.map(|guess| format!("up: {} (--up y|z)", guess.reason)));
    let mut views = config.views();
    if views.is_empty() && !about.cameras.is_empty() {
        let names: Vec<_> = about.cameras.iter().map(|camera| camera.name.as_str()).collect();
        choices.push(format!("views: the file's cameras {}", names.join(", ")));
        views = about.cameras.iter().map(camera_view).collect();
    }
    let mut opened = OpenedScene {
        scene: Arc::new(scene),
        up: up.to_array(),
        unit: config.unit.map_or(1.0, |unit| unit.0),
        views,
        sections: config.section.clone(),
        choices,
        warnings: warnings.iter().map(ToString::to_string).collect(),
        raycaster: None,
        is_quiet: quiet,
        survey: None,
    };
    let has_lamps = holo_survey::has_lamps(&opened.scene);
    let may_be_dark = has_no_sky && features.suns == 0 && !opened.is_lit_by_lamps(has_lamps)?;
    let needs_sections = wanted == OpeningRequest::Sections && opened.sections.is_empty();
    // A dark scene is always surveyed, because its rooms may need lamps, which must be the same
    // each time.
    if needs_sections || opened.views.is_empty() || may_be_dark {
        let raycaster = opened.raycaster()?;
        let unit = config.unit.map(|unit| unit.0);
        let mut survey = Survey::new(&raycaster, UprightAxes::new(up), unit, &about);
        opened.unit = survey.unit.value;
        if unit.is_none() {
            opened.choices.push(format!("unit: {} (--unit mm|cm|m|in|ft)", survey.unit.reason));
        }
        // Lamps in rooms are intended, even if they light little.
        if may_be_dark && (!has_lamps || survey.rooms.is_empty()) {
            opened.light(raycaster, &survey)?;
        }
        // The rooms are limited after the light is chosen, because the light must not depend on the
        // limit.
        let found = survey.rooms.len();
        limit::apply(config, &mut survey);
        if needs_sections {
            opened.choose_sections(config, &survey, found)?;
        }
        if opened.views.is_empty() {
            opened.choose_views(config, &survey)?;
        }
        opened.survey = Some(survey);
    } else if let Some(said) = about.unit.filter(|_| config.unit.is_none()) {
        opened.unit = said.value;
        opened.choices.push(format!(
            "unit: {}, as the file says: `{}` (--unit mm|cm|m|in|ft)",
            unit_words(said.value),
            said.words
        ));
    }
    if !config.objects.names().is_empty() {
        // No choice depends on objects either, because they may be taken out again.
        opened.raycaster = None;
        let scene = Arc::unwrap_or_clone(opened.scene);
        let (scene, said) = config.objects.join(scene)?;
        opened.scene = Arc::new(scene);
        opened.choices.extend(said);
    }
    if !light.lamps.is_empty() {
        // No choice depends on factors: a scene whose lamps are off gets no preview light.
        opened.raycaster = None;
        let dimmed = light.dim_lamps(Arc::make_mut(&mut opened.scene))?;
        opened.choices.extend(dimmed);
    }
    Ok(opened)
}

/// Returns the unit that the configuration or the model states, metres.
pub(crate) fn stated_unit(config: &HolodeckConfig, about: &ModelFacts) -> Option<f64> {
    let of_file = about.unit.as_ref().or(about.usual_unit.as_ref()).map(|said| said.value);
    config.unit.map(|unit| unit.0).or(of_file)
}

impl OpenedScene {
    /// Returns the scene's raycaster, which is built once.
    ///
    /// # Errors
    /// If the scene cannot be traced.
    pub fn raycaster(&mut self) -> Result<Arc<Raycaster>> {
        if let Some(raycaster) = &self.raycaster {
            return Ok(raycaster.clone());
        }
        let triangles = self.scene.triangles().len();
        if triangles >= MANY {
            let text = format!("preparing {} triangles for tracing", HumanCount(triangles as u64));
            Meter::new(self.is_quiet).say(&text);
        }
        let prepared = StoredScenes::new(None).prepare(self.scene.clone(), None);
        let (raycaster, unusable) = prepared.context("the scene cannot be traced")?;
        if let Some(unusable) = unusable {
            eprintln!("{unusable}");
        }
        // The same scene, but its geometry may lie in a file.
        self.scene = raycaster.scene().clone();
        Ok(self.raycaster.insert(Arc::new(raycaster)).clone())
    }

    fn is_lit_by_lamps(&mut self, has_lamps: bool) -> Result<bool> {
        if !has_lamps {
            return Ok(false);
        }
        let raycaster = self.raycaster()?;
        Ok(holo_survey::is_lit_by_lamps(&raycaster))
    }

    /// Gives a dark scene a sky, and a sun or lamps.
    fn light(&mut self, raycaster: Arc<Raycaster>, survey: &Survey) -> Result<()> {
        let (sky, glows) = preview::sky(&self.scene);
        let words = preview::words(sky);
        self.choices.push(match glows {
            false => format!(
                "light: a preview sky of radiance {words}, because nothing in the scene gives light; its \
                 luminances mean nothing (--sky R,G,B)"
            ),
            true => format!(
                "light: a preview sky of radiance {words}, as bright as what glows, because that lights \
                 hardly any of the scene (--sky R,G,B; --sky 0,0,0 is none)"
            ),
        });
        let suns = match survey.rooms.is_empty() || survey.is_thing {
            true => vec![preview::sun(&survey.outside(&raycaster), sky)],
            false => Vec::new(),
        };
        if !suns.is_empty() {
            let words =
                "light: a preview sun over the viewer's shoulder, because it is seen from outside";
            self.choices.push(format!("{words} (--sky R,G,B)"));
        }
        self.raycaster = None;
        // Building the hierarchy again would take seconds for millions of triangles.
        let only = Arc::into_inner(raycaster).context("the scene is still being surveyed")?;
        let lit = Arc::new(only.with_sky(sky.into(), suns)?);
        (self.scene, self.raycaster) = (lit.scene().clone(), Some(lit.clone()));
        if let Some((scene, count)) = preview::with_lamps(&lit, &survey.rooms)? {
            let words = format!("light: preview lamps in {count} rooms that no sky reaches");
            self.choices.push(words);
            (self.scene, self.raycaster) = (Arc::new(scene), None);
        }
        Ok(())
    }

    /// Returns the survey, if one was made.
    pub fn survey(&self) -> Option<&Survey> {
        self.survey.as_ref()
    }

    /// Prints the choices to standard error.
    ///
    /// # Errors
    /// If the configuration has no scene.
    pub fn say(&self, config: &HolodeckConfig) -> Result<()> {
        let name = scene_path(config)?.display();
        self.choices.iter().for_each(|choice| eprintln!("{name}: {choice}"));
        Ok(())
    }

    /// Chooses sections for the rooms of a survey. `found` is the number of rooms before they were
    /// limited.
    fn choose_sections(
        &mut self,
        config: &HolodeckConfig,
        survey: &Survey,
        found: usize,
    ) -> Result<()> {
        let rooms: &[Room] = if config.exterior { &[] } else { &survey.rooms };
        if rooms.is_empty() {
            let how = if config.exterior { "as stated" } else { "because it has no closed rooms" };
            self.choices.push(format!("section: around the scene, {how} (--section)"));
            self.sections = vec![around(&self.scene)?];
            return Ok(());
        }
        let sections = rooms.iter().enumerate().map(|(n, room)| config::SectionTable {
            name: Some(format!("room {}", n + 1)),
            ..section(room.origin, room.axes, false)
        });
        let doors = survey.doors.iter().enumerate().map(|(n, door)| config::SectionTable {
            name: Some(format!("door {}", n + 1)),
            grid: Some(limit::door_grid(door)),
            ..section(door.origin, door.axes, false)
        });
        let outside = survey.is_thing.then(|| around(&self.scene)).transpose()?;
        self.sections = outside.into_iter().chain(sections).chain(doors).collect();
        let sizes: Vec<String> = rooms
            .iter()
            .map(|room| format!("{:.3} by {:.3}", room.axes[0].length(), room.axes[1].length()))
            .collect();
        let around = if survey.is_thing { "around the scene, and " } else { "" };
        let mut words = format!(
            "sections: {around}free boxes at eye height in {}: {} units",
            counted(rooms.len(), "room", "rooms"),
            sizes.join(", ")
        );
        if !survey.doors.is_empty() {
            let boxes = counted(survey.doors.len(), "box", "boxes");
            words.push_str(&format!("; joined by {boxes} in doors"));
        }
        if found > rooms.len() {
            let more = counted(found - rooms.len(), "smaller box", "smaller boxes");
            words.push_str(&format!("; {more} left out (--max-rooms, --max-beams)"));
        }
        self.choices.push(format!("{words} (--section, --exterior)"));
        Ok(())
    }

    fn choose_views(&mut self, config: &HolodeckConfig, survey: &Survey) -> Result<()> {
        let raycaster = self.raycaster()?;
        let views = match config.exterior {
            true => vec![("outside".to_owned(), survey.outside(&raycaster))],
            false => survey.views(&raycaster),
        };
        let (low, high) = self.scene.bounds();
        let step = places::step(low.distance(high), self.unit);
        let options = |sight: ChosenView| sight_options(&sight, step);
        self.views = views.into_iter().map(|(name, sight)| (name, options(sight))).collect();
        if let Some((name, options)) = self.views.first() {
            let reason = match survey.is_thing && !config.exterior {
                true => "; it is a thing with rooms inside",
                false => "",
            };
            let more = match self.views.iter().filter(|(name, _)| name != "outside").count() {
                0 => String::new(),
                1 if survey.is_thing => format!("{reason}: --view \"room 1\""),
                1 => String::new(),
                n => format!("{reason}; --view takes room 1 to {n}"),
            };
            self.choices.push(format!("view: {name}, {options}{more} (--vp, --vd)"));
        }
        Ok(())
    }
}

fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Returns a section with default options.
fn section(origin: DVec3, axes: [DVec3; 3], exterior: bool) -> config::SectionTable {
    config::SectionTable {
        name: None,
        origin: origin.to_array(),
        axes: axes.map(|axis| axis.to_array()),
        grid: None,
        exterior,
        geometry: None,
        portals: None,
    }
}

/// Returns the section around a scene, for views into it. Even a flat scene gets a section with a
/// volume.
fn around(scene: &Scene) -> Result<config::SectionTable> {
    let (low, high) = scene.bounds();
    let margin = DVec3::splat(MARGIN * (high - low).max_element());
    let size = high - low + margin * 2.0;
    if size.min_element() <= 0.0 {
        bail!("the scene is a point: name a section with --section");
    }
    let axes = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    Ok(section(low - margin, axes, true))
}

/// Step to which the components of chosen directions are rounded.
const DIRECTION_STEP: f64 = 1e-4;

/// Returns a view as Radiance options. Its eye is rounded to multiples of `step`.
fn sight_options(sight: &ChosenView, step: f64) -> String {
    let triple = |name: &str, v: DVec3, step: f64| {
        let [x, y, z] = v.to_array().map(|c| places::rounded(c, step));
        format!("-{name} {x} {y} {z}")
    };
    [
        "-vtv".to_owned(),
        triple("vp", sight.eye, step),
        triple("vd", sight.direction, DIRECTION_STEP),
        triple("vu", sight.up, DIRECTION_STEP),
        format!("-vh {}", sight.angle),
    ]
    .join(" ")
}

fn camera_view(camera: &ModelCamera) -> (String, String) {
    let triple = |name: &str, [x, y, z]: [f64; 3]| format!("-{name} {x} {y} {z}");
    let kind = if camera.is_parallel { "-vtl" } else { "-vtv" };
    let options = [
        kind.to_owned(),
        triple("vp", camera.eye),
        triple("vd", camera.direction),
        triple("vu", camera.up),
        format!("-vv {}", camera.height),
    ];
    (camera.name.clone(), options.join(" "))
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;
    use holo_scene::Material;

    #[test]
    fn a_section_around_a_scene_has_a_volume_even_if_the_scene_is_flat() {
        for corner in [DVec3::new(0.0, 1.0, 4.0), DVec3::Y] {
            let corners = [DVec3::ZERO, DVec3::X * 2.0, corner];
            let materials = vec![Material::grey("a")];
            let scene =
                Scene::from_world(&corners, &[[0, 1, 2]], &[0], materials, [1.0; 3]).unwrap().0;
            let section = around(&scene).unwrap();
            assert!(section.exterior);
            let (low, high) = scene.bounds();
            for axis in 0..3 {
                let (from, size) = (section.origin[axis], section.axes[axis][axis]);
                assert!(from < low[axis] && from + size > high[axis], "{section:?}");
            }
        }
    }

    #[test]
    fn models_of_other_programs_open_as_their_authors_meant() {
        let folder = tempfile::tempdir().unwrap();
        let (y, z) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        for (name, up, unit, rooms, lit) in [
            ("blender-room", y, 1.0, 1, false),
            ("sketchup-flat", z, 0.0254, 2, false),
            ("rhino-vase", y, 0.001, 0, false),
            ("max-lounge", y, 0.01, 1, true),
            ("revit-flat", z, 0.3048, 2, false),
            ("blender-kitchen", y, 1.0, 1, true),
        ] {
            let scene = holo_scenes::write_model(name, folder.path()).unwrap();
            let config = HolodeckConfig { scene, ..HolodeckConfig::default() };
            let opened = open(&config, OpeningRequest::Sections, true).unwrap();
            let said = opened.choices.join("\n");
            assert_eq!((opened.up, opened.unit), (up, unit), "{name}: {said}");
            let is_room = |section: &&config::SectionTable| {
                section.name.as_ref().is_some_and(|name| name.starts_with("room"))
            };
            let interior = opened.sections.iter().filter(is_room).count();
            let has_doors = rooms > 1 && opened.sections.len() > interior;
            assert_eq!(said.contains("joined by"), has_doors, "{name}: {said}");
            assert_eq!(has_doors, rooms > 1, "{name}: {said}");
            assert!(interior == rooms || rooms > 1 && interior > rooms, "{name}: {said}");
            assert_eq!(said.contains("preview sky"), !lit, "{name}: {said}");
            // Without its MTL file, the panes of this scene are walls.
            let is_closed = name == "revit-flat";
            assert_eq!(said.contains("preview lamps"), is_closed, "{name}: {said}");
            assert_eq!(said.contains("preview sun"), rooms == 0, "{name}: {said}");
            let has_suns = rooms == 0 || name == "blender-kitchen";
            assert_eq!(opened.scene.suns.len(), usize::from(has_suns), "{name}: {said}");
            let emitters = opened.scene.features().emitters;
            assert!(!is_closed || emitters == 2 * interior, "{name}: {said}");
            // From the first view, something is visible, and the eye stands in the open.
            let mut view = holo_picture::ViewSpec::default();
            view.apply_line(&opened.views[0].1).unwrap();
            let mut opened = opened;
            let raycaster = opened.raycaster().unwrap();
            assert!(Arc::ptr_eq(raycaster.scene(), &opened.scene), "{name}");
            let (ray, _) =
                raycaster.localize(view.vp.unwrap(), view.vd.unwrap().normalize()).unwrap();
            let ahead = f64::from(raycaster.nearest(&ray).unwrap().t) * unit;
            // A vase is viewed from at least its own height away.
            let least = if rooms == 0 { 0.1 } else { 0.3 };
            assert!(ahead > least, "{name}: {ahead} m to what is seen");
        }
    }

    /// A room of 4 by 5 by 2.6 units with a lamp, moved by `offset` and multiplied by `scale`.
    fn room(folder: &Path, offset: [f64; 3], scale: f64) -> PathBuf {
        let corners = [
            "0 0 0",
            "4 0 0",
            "0 5 0",
            "4 5 0",
            "0 0 2.6",
            "4 0 2.6",
            "0 5 2.6",
            "4 5 2.6",
            "1.5 2 2.59",
            "1.5 3 2.59",
            "2.5 3 2.59",
            "2.5 2 2.59",
        ];
        let mut text = String::from("mtllib room.mtl\n");
        for corner in corners {
            let place = corner.split(' ').zip(offset).map(|(part, from)| {
                let part: f64 = part.parse().unwrap();
                format!(" {}", part * scale + from)
            });
            text += &format!("v{}\n", place.collect::<String>());
        }
        text += "usemtl wall\nf 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\n\
                 f 6 8 4 2\nusemtl lamp\nf 9 10 11 12\n";
        std::fs::write(
            folder.join("room.mtl"),
            "newmtl wall\nKd .5 .5 .5\nnewmtl lamp\nKe 9 9 9\n",
        )
        .unwrap();
        let path = folder.join("room.obj");
        std::fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn a_room_whose_lamp_hardly_glows_gets_light() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Some(room(folder.path(), [0.0; 3], 1.0));
        for (emission, is_lit) in [("9 9 9", true), ("0 0.01 0", true), ("1e-6 0 1e-4", false)] {
            let materials = format!("newmtl wall\nKd .5 .5 .5\nnewmtl lamp\nKe {emission}\n");
            std::fs::write(folder.path().join("room.mtl"), materials).unwrap();
            let config = HolodeckConfig { scene: scene.clone(), ..HolodeckConfig::default() };
            let opened = open(&config, OpeningRequest::View, true).unwrap();
            let said = opened.choices.join("\n");
            assert_eq!(said.contains("preview lamps in 1 rooms"), !is_lit, "{emission}: {said}");
            assert_eq!(said.contains("preview sky of radiance 1,"), !is_lit, "{emission}: {said}");
        }
    }

    #[test]
    fn the_chosen_eye_stands_in_the_same_place_of_a_scene_however_far_from_the_origin_it_lies() {
        let folder = tempfile::tempdir().unwrap();
        let eye = |offset: [f64; 3], scale: f64, unit: &str| {
            let scene = Some(room(folder.path(), offset, scale));
            let unit = Some(unit.parse().unwrap());
            let config = HolodeckConfig { scene, unit, ..HolodeckConfig::default() };
            let opened = open(&config, OpeningRequest::View, true).unwrap();
            let mut view = holo_picture::ViewSpec::default();
            view.apply_line(&opened.views[0].1).unwrap();
            view.vp.unwrap() - DVec3::from_array(offset)
        };
        // Metres, millimetres and kilometres.
        for (scale, unit, metres) in [(1.0, "m", 1.0), (1e3, "mm", 1e-3), (1e-3, "1000", 1e3)] {
            let here = eye([0.0; 3], scale, unit);
            assert!(here.min_element() > 0.2 * scale, "{here}");
            for offset in [
                [500_000.0, 5_400_000.0, 300.0],
                [4_075_538.125, 931_735.25, 4_801_629.5],
                [-99_999_999.0, 100_000_000.0, 0.5],
            ] {
                let offset = offset.map(|part| part / metres);
                let there = eye(offset, scale, unit);
                let millimetres = here.distance(there) * metres * 1e3;
                assert!(millimetres < 1.0, "{unit} {offset:?}: {here} {there}");
            }
        }
    }
}
