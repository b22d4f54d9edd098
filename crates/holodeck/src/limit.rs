//! Limits the number of rooms with a section, and the number of beams of all sections.

use holo_section::{Section, SectionSpec, ViewClass};
use holo_survey::{Door, Survey};

use crate::config::HolodeckConfig;

/// Most rooms by default.
const ROOMS: usize = 8;

/// Most beams of all sections by default. Enough rays for them take a few hours.
const BEAMS: u64 = 2_000_000;

/// Beams of a box in a door. A person only passes through it, and rooms store everything visible
/// from it except the door itself.
const DOOR_BEAMS: f64 = 20_000.0;

/// Limits a survey to the rooms that the configuration allows, at least one, and to the doors for
/// which beams are left.
pub fn apply(config: &HolodeckConfig, survey: &mut Survey) {
    let mut left = config.max_beams.unwrap_or(BEAMS);
    let mut fits = |axes: [[f64; 3]; 3], grid: [u32; 3]| {
        let beams = beams(axes, grid);
        let fits = beams <= left;
        left = left.saturating_sub(beams);
        fits
    };
    let axes = |axes: [glam::DVec3; 3]| axes.map(|axis| axis.to_array());
    let most = config.max_rooms.unwrap_or(ROOMS);
    let rooms = survey.rooms.iter().take(most).map(|room| axes(room.axes));
    let rooms = rooms.take_while(|&axes| fits(axes, Section::default_grid(axes))).count();
    survey.limit(rooms.max(1));
    let doors = survey.doors.iter();
    let doors = doors.take_while(|door| fits(axes(door.axes), door_grid(door))).count();
    survey.doors.truncate(doors);
}

/// Returns the grid of a box in a door.
pub fn door_grid(door: &Door) -> [u32; 3] {
    Section::grid_near(door.axes.map(|axis| axis.to_array()), DOOR_BEAMS)
}

/// Returns the number of beams of a section; 0 if the section is invalid.
fn beams(axes: [[f64; 3]; 3], grid: [u32; 3]) -> u64 {
    let (origin, class) = ([0.0; 3], ViewClass::Interior);
    let section = Section::new(SectionSpec { origin, axes, grid, class, obstructions: false });
    section.map_or(0, |section| section.beam_count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::opening::{OpeningRequest, open};

    /// Returns the number of beams of each section of a flat with two rooms under a limit, and the
    /// sections' names.
    fn sections(max_beams: Option<u64>) -> (Vec<u64>, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let scene = holo_scenes::write_model("sketchup-flat", folder.path()).unwrap();
        let config = HolodeckConfig { scene, max_beams, ..HolodeckConfig::default() };
        let sections = open(&config, OpeningRequest::Sections, true).unwrap().sections;
        let of = |section: &crate::config::SectionTable| {
            beams(section.axes, section.grid.unwrap_or_else(|| Section::default_grid(section.axes)))
        };
        let names = sections.iter().map(|section| section.name.clone().unwrap_or_default());
        (sections.iter().map(of).collect(), names.collect())
    }

    #[test]
    fn a_limit_of_beams_leaves_out_doors_first_and_then_small_rooms_but_never_the_largest() {
        let (beams, names) = sections(None);
        assert_eq!(names, ["room 1", "room 2", "door 1"]);
        assert!(beams.iter().all(|&beams| beams > 0));
        let total: u64 = beams.iter().sum();
        for (limit, left) in [
            (total, 3),
            (total - 1, 2),
            (beams[0] + beams[1], 2),
            (beams[0] + beams[1] - 1, 1),
            (beams[0], 1),
            (1, 1),
        ] {
            assert_eq!(sections(Some(limit)), (beams[..left].to_vec(), names[..left].to_vec()));
        }
    }
}
