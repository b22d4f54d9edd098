//! The beams that given views see, for `fill --views`.

use std::{fs, path::Path};

use anyhow::{Context, Result, ensure};
use glam::DVec3;
use holo_display::{SelectOptions, select_beams};
use holo_picture::View;
use holo_section::Section;
use holo_server::{BeamList, HolodeckDescription};

/// Picture size assumed for a view that does not state both angles, pixels.
const SIZE: (u32, u32) = (1280, 720);

/// Returns the beams that the rays of views belong to. Each line of the file has a view, as in
/// Radiance's view files. Empty lines and those that begin with `#` are skipped.
///
/// # Errors
/// If the file cannot be read, a line is no view, or no view sees a beam.
pub fn seen_beams(path: &Path, about: &HolodeckDescription) -> Result<BeamList> {
    let name = path.display();
    let text = fs::read_to_string(path).with_context(|| format!("reading {name}"))?;
    let sections: Vec<Section> =
        about.sections.iter().cloned().map(Section::new).collect::<Result<_, _>>()?;
    let mut beams = Vec::new();
    for (at, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let where_found = || format!("{name}:{}", at + 1);
        let mut spec = View::parse_vf(line).with_context(where_found)?;
        spec.vu = spec.vu.or(Some(DVec3::from(about.up)));
        let (view, size) = spec.resolve(SIZE).with_context(where_found)?;
        let selection = select_beams(&sections, &view, size, &SelectOptions::default());
        beams.extend(selection.beams.into_iter().map(|beam| beam.key));
    }
    ensure!(!beams.is_empty(), "no view in {name} looks into a section");
    Ok(beams.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use holo_proto::control::RenderSettings;
    use holo_section::{SectionSpec, ViewClass};

    use super::*;

    fn room() -> HolodeckDescription {
        let spec = SectionSpec {
            origin: [0.0; 3],
            axes: [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 3.0]],
            grid: [6, 6, 4],
            class: ViewClass::Interior,
            obstructions: true,
        };
        HolodeckDescription::new(vec![spec], RenderSettings::default(), b"", "a room".into())
    }

    fn seen(text: &str) -> Result<BeamList> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("tour.vf");
        fs::write(&file, text)?;
        seen_beams(&file, &room())
    }

    #[test]
    fn two_views_see_the_beams_of_each() {
        let east = "rview -vtv -vp 2 2 1.5 -vd 1 0 0 -vu 0 0 1 -vh 60";
        let west = "-vp 2 2 1.5 -vd -1 0 0 -vh 60";
        let (one, other) = (seen(east).unwrap(), seen(west).unwrap());
        let both = seen(&format!("# a tour\n{east}\n\n{west}\n")).unwrap();
        let beams = Section::new(room().sections[0].clone()).unwrap().beam_count();
        assert_eq!(both.len(), one.len() + other.len(), "opposite views share no beam");
        assert!(!one.is_empty() && (both.len() as u64) < beams / 4, "{} of {beams}", both.len());
    }

    #[test]
    fn a_line_that_is_no_view_is_named() {
        let error = format!("{:#}", seen("-vp 2 2 1 -vd 1 0 0\nhello\n").unwrap_err());
        assert!(error.contains("tour.vf:2"), "{error}");
        let away = seen("-vp 90 2 1 -vd 0 1 0 -vh 5\n").unwrap_err().to_string();
        assert!(away.contains("no view in"), "{away}");
    }
}
