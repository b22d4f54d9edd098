//! The view of a display at the start if no view is given (Larson & Simmons 1999, §2.4.1). Its eye
//! is in the middle of the first section, or outside if the section is exterior.

use glam::DVec3;
use holo_picture::ViewSpec;
use holo_section::{Section, ViewClass};

/// Horizontal angle of the default view, degrees.
const ANGLE: f64 = 60.0;

/// Returns the default view for a section: level, along the section's longest level axis.
pub fn default_view(section: &Section, up: DVec3) -> ViewSpec {
    let up = up.try_normalize().unwrap_or(DVec3::Z);
    let axes = section.spec().axes.map(DVec3::from_array);
    let level = |axis: DVec3| axis - up * axis.dot(up);
    let longest = axes.into_iter().map(level).max_by(|a, b| a.length().total_cmp(&b.length()));
    let fallback = up.any_orthonormal_vector();
    let vd = longest.and_then(DVec3::try_normalize).unwrap_or(fallback);
    let middle = section.local_to_world(DVec3::splat(0.5));
    let vp = match section.spec().class {
        ViewClass::Interior => middle,
        ViewClass::Exterior => middle - vd * 1.5 * section.diagonal(),
    };
    ViewSpec { vp: Some(vp), vd: Some(vd), vu: Some(up), vh: Some(ANGLE), ..ViewSpec::default() }
}

#[cfg(test)]
mod tests {
    use holo_section::SectionSpec;

    use super::*;

    #[test]
    fn it_begins_inside_a_room_and_outside_an_object() {
        let mut spec = SectionSpec {
            origin: [1.0, 2.0, 3.0],
            axes: [[2.0, 0.0, 0.0], [0.0, 8.0, 0.0], [0.0, 0.0, 20.0]],
            grid: [4, 4, 4],
            class: ViewClass::Interior,
            obstructions: true,
        };
        let inside = default_view(&Section::new(spec.clone()).unwrap(), DVec3::Z);
        assert_eq!(inside.vp, Some(DVec3::new(2.0, 6.0, 13.0)));
        assert_eq!(inside.vd, Some(DVec3::Y), "along the longest level axis");
        spec.class = ViewClass::Exterior;
        let section = Section::new(spec).unwrap();
        let outside = default_view(&section, DVec3::Z);
        assert!(!section.contains(outside.vp.unwrap()));
    }
}
