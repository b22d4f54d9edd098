//! A plan of the scene: its walls at a height above each storey's floor, seen from above.

use glam::{DVec2, DVec3};
use holo_section::SectionSpec;
use holo_session::Session;

/// Where a section is cut, as a share of its height from below. Sections begin above most furniture
/// and end below the ceiling.
const CUT: f64 = 0.25;

/// Sections whose cuts differ by less are of one storey, metres.
const SAME_STOREY: f64 = 1.0;

/// Most storeys of a plan, the lowest ones.
const MOST_STOREYS: usize = 8;

/// Most lines of a storey, the longest ones.
const MOST_LINES: usize = 4000;

/// The storeys of a scene, from below.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WallPlan {
    /// The directions to the right and up on the plan, as unit vectors.
    pub axes: [DVec3; 2],
    /// The point at (0, 0): a corner of the first section.
    pub base: DVec3,
    /// The storeys. Empty if the scene is unknown.
    pub storeys: Vec<StoreyWalls>,
}

/// The walls of a storey.
#[derive(Clone, Debug, PartialEq)]
pub struct StoreyWalls {
    /// Height of the cut along the up axis, scene units.
    pub height: f64,
    /// The ends of each line, right and up from the plan's base, scene units.
    pub lines: Vec<[DVec2; 2]>,
}

impl WallPlan {
    /// Returns the plan of a session's scene.
    pub fn new(session: &Session) -> WallPlan {
        let up = session.up();
        let sections: Vec<&SectionSpec> = session.sections().iter().map(|s| s.spec()).collect();
        let axes = axes(up);
        let base = sections.first().map_or(DVec3::ZERO, |first| DVec3::from_array(first.origin));
        let heights = heights(&sections, up, SAME_STOREY / session.unit());
        let flat =
            |point: DVec3| DVec2::new((point - base).dot(axes[0]), (point - base).dot(axes[1]));
        let storeys = match session.scene() {
            Some(raycaster) => raycaster
                .cuts(up, &heights, MOST_LINES)
                .into_iter()
                .zip(heights)
                .map(|(lines, height)| {
                    let lines = lines.into_iter().map(|line| line.map(flat)).collect();
                    StoreyWalls { height, lines }
                })
                .collect(),
            None => Vec::new(),
        };
        WallPlan { axes, base, storeys }
    }
}

/// Returns the directions to the right and up on a plan. If `up` is z, they are x and y.
fn axes(up: DVec3) -> [DVec3; 2] {
    let away = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let right = (away - away.dot(up) * up).normalize();
    [right, up.cross(right)]
}

/// Returns the heights at which sections are cut, from below. Heights that differ by less than
/// `apart` are of one storey.
fn heights(sections: &[&SectionSpec], up: DVec3, apart: f64) -> Vec<f64> {
    let cut = |spec: &&SectionSpec| {
        let rises = spec.axes.map(|axis| DVec3::from_array(axis).dot(up));
        let bottom = DVec3::from_array(spec.origin).dot(up)
            + rises.iter().map(|rise| rise.min(0.0)).sum::<f64>();
        bottom + CUT * rises.iter().map(|rise| rise.abs()).sum::<f64>()
    };
    let mut heights: Vec<f64> = sections.iter().map(cut).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|next, first| *next - *first < apart);
    heights.truncate(MOST_STOREYS);
    heights
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_section::ViewClass;

    fn section(bottom: f64, height: f64) -> SectionSpec {
        SectionSpec {
            origin: [0.0, 0.0, bottom],
            axes: [[4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, height]],
            grid: [3; 3],
            class: ViewClass::Interior,
            obstructions: false,
        }
    }

    #[test]
    fn rooms_of_a_storey_are_cut_once_and_upper_storeys_again() {
        let rooms = [section(3.9, 1.2), section(1.0, 1.2), section(1.1, 1.6), section(-1.8, 1.2)];
        let found = heights(&rooms.each_ref(), DVec3::Z, 1.0);
        let expected = [-1.5, 1.3, 4.2];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        assert_eq!(found.len(), 3);
        let tower: Vec<SectionSpec> = (0..100).map(|n| section(3.0 * f64::from(n), 1.0)).collect();
        assert_eq!(heights(&tower.iter().collect::<Vec<_>>(), DVec3::Z, 1.0).len(), MOST_STOREYS);
    }

    #[test]
    fn a_plan_has_x_to_the_right_unless_x_is_up() {
        assert_eq!(axes(DVec3::Z), [DVec3::X, DVec3::Y]);
        assert_eq!(axes(DVec3::Y), [DVec3::X, DVec3::NEG_Z]);
        let [right, ahead] = axes(DVec3::X);
        assert!(right.dot(DVec3::X).abs() < 1e-12 && ahead.dot(right).abs() < 1e-12);
    }
}
