//! Where sections lie in the picture and around the eye.

use glam::DVec3;
use holo_picture::View;
use holo_section::{SectionSpec, ViewClass};
use holo_stage::State;

/// Most lines of a grid along one axis.
const MOST_LINES: u32 = 64;

/// Nearest depth that is drawn, as a multiple of the first section's edge.
const NEAREST: f64 = 1e-3;

/// A section counts as ahead if the sine of its angle to the view direction is less than this.
const AHEAD: f64 = 0.2;

/// Size of the picture at distance 1, for an eye whose view cannot be shown.
const OTHER_EXTENT: (f64, f64) = (1.2, 0.7);

/// An eye with a perspective picture.
#[derive(Clone, Copy, Debug)]
pub struct OverlayCamera {
    /// The eye, scene units.
    pub eye: DVec3,
    right: DVec3,
    up: DVec3,
    direction: DVec3,
    /// Width and height of the picture at distance 1.
    extent: (f64, f64),
    /// Shifts of the picture, in its sides.
    shift: (f64, f64),
}

/// A line of a section's grid, in shares of the picture from its left and from its top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// One end.
    pub from: (f64, f64),
    /// The other.
    pub to: (f64, f64),
    /// True if it is an edge of the section.
    pub is_edge: bool,
}

impl OverlayCamera {
    /// Returns the camera of a perspective view; `None` for other views.
    pub fn of_view(view: &View) -> Option<OverlayCamera> {
        (view.kind.letter() == 'v').then(|| OverlayCamera {
            eye: view.eye(),
            right: view.right(),
            up: view.up(),
            direction: view.vd,
            extent: view.extent(),
            shift: (view.vs, view.vl),
        })
    }

    /// Returns the camera of an eye whose view cannot be shown.
    pub fn of_pose(pose: [[f64; 3]; 3]) -> OverlayCamera {
        let [eye, direction, up] = pose.map(DVec3::from_array);
        let right = direction.cross(up).normalize_or(DVec3::X);
        let up = right.cross(direction);
        OverlayCamera { eye, right, up, direction, extent: OTHER_EXTENT, shift: (0.0, 0.0) }
    }

    /// Returns the camera for the overlay. If the current view cannot be shown, this is the camera
    /// of the eye's current pose.
    pub fn now(state: &State, view: Option<&View>) -> Option<OverlayCamera> {
        if state.is_uncovered || state.trouble.is_some() {
            return Some(OverlayCamera::of_pose(state.pose));
        }
        view.and_then(OverlayCamera::of_view)
    }

    /// Returns the directions of the view's left and right borders on the plan.
    pub fn sides(&self) -> [DVec3; 2] {
        [-0.5, 0.5].map(|side| self.direction + self.right * (side * self.extent.0))
    }

    /// Returns a point's coordinates: right, up and depth.
    fn local(&self, point: DVec3) -> DVec3 {
        let way = point - self.eye;
        DVec3::new(way.dot(self.right), way.dot(self.up), way.dot(self.direction))
    }

    fn place(&self, local: DVec3) -> (f64, f64) {
        let (x, y) = (local.x / local.z / self.extent.0, local.y / local.z / self.extent.1);
        (0.5 - self.shift.0 + x, 0.5 + self.shift.1 - y)
    }

    /// Returns the lines of all sections' grids in front of the eye.
    pub fn grids(&self, sections: &[SectionSpec]) -> Vec<Line> {
        let first = sections.first().map_or(1.0, |first| axes(first)[0].length());
        let near = NEAREST * first;
        let mut lines = Vec::new();
        for section in sections {
            for (from, to, is_edge) in walls(section) {
                let (from, to) = (self.local(from), self.local(to));
                if from.z < near && to.z < near {
                    continue;
                }
                let cut = |point: DVec3, other: DVec3| match point.z >= near {
                    true => point,
                    false => point.lerp(other, (near - point.z) / (other.z - point.z)),
                };
                let (from, to) = (self.place(cut(from, to)), self.place(cut(to, from)));
                lines.push(Line { from, to, is_edge });
            }
        }
        lines
    }
}

/// The way back to the sections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lost {
    /// Clockwise angle of the arrow from straight up, radians; `None` if the section is ahead.
    pub turn: Option<f64>,
    /// True if the section is behind the eye.
    pub is_behind: bool,
    /// Its distance, scene units.
    pub distance: f64,
}

impl Lost {
    /// Returns the way back, if the eye has left all sections.
    pub fn new(camera: &OverlayCamera, state: &State) -> Option<Lost> {
        let sections = &state.sections;
        let is_in = |section: &SectionSpec| {
            shares(section, camera.eye)
                .is_some_and(|at| at.min_element() >= 0.0 && at.max_element() <= 1.0)
        };
        let only_interiors = sections.iter().all(|section| section.class == ViewClass::Interior);
        let is_lost = state.is_uncovered || only_interiors && !sections.iter().any(is_in);
        let middles = sections.iter().map(|section| point(section, DVec3::splat(0.5)));
        let nearest = middles.min_by(|a, b| {
            a.distance_squared(camera.eye).total_cmp(&b.distance_squared(camera.eye))
        })?;
        let local = camera.local(nearest);
        let aside = local.x.hypot(local.y);
        let is_ahead = local.z > 0.0 && aside < AHEAD * local.z;
        is_lost.then(|| Lost {
            turn: (!is_ahead).then(|| local.x.atan2(local.y)),
            is_behind: local.z < 0.0,
            distance: local.length(),
        })
    }
}

/// A plan: the scene from above.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Directions that point right and up on the plan.
    u: DVec3,
    v: DVec3,
    /// Outlines of the sections, and whether each is an interior.
    pub outlines: Vec<(Vec<(f64, f64)>, bool)>,
    least: (f64, f64),
    /// Length of its longer side, scene units.
    pub size: f64,
}

/// Width of the margin around the plan, as a share of the plan's size.
const MARGIN: f64 = 0.12;

impl Plan {
    /// Returns the plan of a holodeck; `None` without sections.
    pub fn new(state: &State) -> Option<Plan> {
        let up = DVec3::from_array(state.up).try_normalize()?;
        let along = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
        let u = (along - up * along.dot(up)).try_normalize()?;
        let v = up.cross(u);
        let flat = |at: DVec3| (at.dot(u), -at.dot(v));
        let outlines: Vec<_> = state
            .sections
            .iter()
            .map(|section| {
                let corners = (0..8).map(|corner| {
                    let side = |bit: u32| f64::from(corner >> bit & 1);
                    flat(point(section, DVec3::new(side(0), side(1), side(2))))
                });
                (hull(corners.collect()), section.class == ViewClass::Interior)
            })
            .collect();
        let all = outlines.iter().flat_map(|(outline, _)| outline);
        let (least, most) = all.fold(
            ((f64::INFINITY, f64::INFINITY), (f64::NEG_INFINITY, f64::NEG_INFINITY)),
            |(least, most), at| {
                ((at.0.min(least.0), at.1.min(least.1)), (at.0.max(most.0), at.1.max(most.1)))
            },
        );
        let (width, height) = (most.0 - least.0, most.1 - least.1);
        let size = width.max(height);
        let is_sound = size.is_finite() && size > 0.0;
        // The shorter side is centred.
        let least = (least.0 - (size - width) / 2.0, least.1 - (size - height) / 2.0);
        is_sound.then_some(Plan { u, v, outlines, least, size })
    }

    /// Returns a point's place on the plan, scene units.
    pub fn flat(&self, at: DVec3) -> (f64, f64) {
        (at.dot(self.u), -at.dot(self.v))
    }

    /// Converts a place on the plan into shares of the square that shows it.
    pub fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let share =
            |at: f64, least: f64| ((at - least) / self.size + MARGIN) / (1.0 + 2.0 * MARGIN);
        (share(x, self.least.0), share(y, self.least.1))
    }

    /// Returns the point for a place in that square, at the height of `eye`.
    pub fn point(&self, (x, y): (f64, f64), eye: DVec3) -> DVec3 {
        let at =
            |share: f64, least: f64| (share * (1.0 + 2.0 * MARGIN) - MARGIN) * self.size + least;
        let (from, to) = (self.flat(eye), (at(x, self.least.0), at(y, self.least.1)));
        eye + self.u * (to.0 - from.0) - self.v * (to.1 - from.1)
    }
}

fn axes(section: &SectionSpec) -> [DVec3; 3] {
    section.axes.map(DVec3::from_array)
}

/// Returns the point at shares of a section's axes.
fn point(section: &SectionSpec, shares: DVec3) -> DVec3 {
    let [a, b, c] = axes(section);
    DVec3::from_array(section.origin) + a * shares.x + b * shares.y + c * shares.z
}

/// Returns a point's place in shares of a section's axes.
fn shares(section: &SectionSpec, at: DVec3) -> Option<DVec3> {
    let ([a, b, c], way) = (axes(section), at - DVec3::from_array(section.origin));
    let shares = DVec3::new(way.dot(b.cross(c)), way.dot(c.cross(a)), way.dot(a.cross(b)))
        / a.dot(b.cross(c));
    shares.is_finite().then_some(shares)
}

/// Returns the lines on a section's walls, and whether each is an edge.
fn walls(section: &SectionSpec) -> Vec<(DVec3, DVec3, bool)> {
    let mut lines = Vec::new();
    for axis in 0..3 {
        let (p, q) = ((axis + 1) % 3, (axis + 2) % 3);
        for (across, along) in [(p, q), (q, p)] {
            let count = section.grid[across].clamp(1, MOST_LINES);
            for (cell, side) in (0..=count).flat_map(|cell| [(cell, 0.0), (cell, 1.0)]) {
                let mut from = DVec3::ZERO;
                (from[axis], from[across]) = (side, f64::from(cell) / f64::from(count));
                let mut to = from;
                to[along] = 1.0;
                let is_edge = cell == 0 || cell == count;
                lines.push((point(section, from), point(section, to), is_edge));
            }
        }
    }
    lines
}

/// Returns the corners of the convex hull (Andrew 1979).
fn hull(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let half = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut kept: Vec<(f64, f64)> = Vec::new();
        for at in points {
            while let [.., o, a] = kept[..]
                && (a.0 - o.0) * (at.1 - o.1) - (a.1 - o.1) * (at.0 - o.0) <= 0.0
            {
                kept.pop();
            }
            kept.push(at);
        }
        kept.pop();
        kept
    };
    let mut corners = half(&mut points.iter().copied());
    corners.extend(half(&mut points.iter().rev().copied()));
    corners
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn cube(class: ViewClass) -> SectionSpec {
        let axes = [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
        SectionSpec { origin: [0.0; 3], axes, grid: [2, 2, 2], class, obstructions: true }
    }

    fn state(class: ViewClass) -> State {
        let sections = Arc::new(vec![cube(class)]);
        State { sections, up: [0.0, 0.0, 1.0], ..State::default() }
    }

    /// Returns a camera that looks along y.
    fn camera(x: f64, y: f64) -> OverlayCamera {
        OverlayCamera::of_pose([[x, y, 2.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    }

    #[test]
    fn a_grid_lies_where_its_corners_are_projected() {
        let lines = camera(2.0, -6.0).grids(&[cube(ViewClass::Exterior)]);
        // 6 walls with 3 lines in each direction.
        assert_eq!(lines.len(), 36);
        assert_eq!(lines.iter().filter(|line| line.is_edge).count(), 24);
        let near = 0.5 - 2.0 / 6.0 / OTHER_EXTENT.0;
        let left = lines.iter().map(|line| line.from.0.min(line.to.0)).fold(1.0, f64::min);
        assert!((left - near).abs() < 1e-12, "{left} {near}");
    }

    #[test]
    fn lines_behind_the_eye_are_cut() {
        let lines = camera(2.0, 2.0).grids(&[cube(ViewClass::Interior)]);
        assert!(!lines.is_empty() && lines.len() < 36);
        let finite = |at: (f64, f64)| at.0.is_finite() && at.1.is_finite();
        assert!(lines.iter().all(|line| finite(line.from) && finite(line.to)));
        assert_eq!(camera(2.0, 5.0).grids(&[cube(ViewClass::Interior)]), []);
    }

    #[test]
    fn an_eye_outside_all_sections_is_shown_the_way_back() {
        let interior = state(ViewClass::Interior);
        assert_eq!(Lost::new(&camera(2.0, 2.0), &interior), None);
        let ahead = Lost::new(&camera(2.0, -8.0), &interior).unwrap();
        assert_eq!((ahead.turn, ahead.is_behind, ahead.distance), (None, false, 10.0));
        let behind = Lost::new(&camera(-1.0, 9.0), &interior).unwrap();
        assert!(behind.is_behind && behind.turn.unwrap() > 1.5, "{behind:?}");
        let exterior = state(ViewClass::Exterior);
        assert_eq!(Lost::new(&camera(2.0, -8.0), &exterior), None, "that is where one looks from");
        let uncovered = State { is_uncovered: true, ..exterior };
        assert!(Lost::new(&camera(2.0, -8.0), &uncovered).is_some());
    }

    #[test]
    fn a_place_on_the_plan_is_the_point_above_which_the_eye_goes() {
        let plan = Plan::new(&state(ViewClass::Interior)).unwrap();
        assert_eq!(plan.outlines[0].0.len(), 4);
        let eye = DVec3::new(1.0, 3.0, 2.5);
        let place = plan.place(plan.flat(eye));
        assert!(place.0 < 0.5 && place.1 < 0.5, "left, and at the top: {place:?}");
        assert!(plan.point(place, DVec3::new(0.0, 0.0, 2.5)).distance(eye) < 1e-12);
        assert_eq!(Plan::new(&State::default()), None);
    }
}
