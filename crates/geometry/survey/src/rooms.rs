//! Rooms: free boxes at eye height, at a distance from walls and furniture.

use std::cell::OnceCell;

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_scene::{ModelFacts, StatedValue};

use crate::Guess;
use crate::columns::{runs, storey};
use crate::doors::joints;
use crate::frame::UprightAxes;
use crate::grid::SceneGrid;
use crate::level::{Heights, Storey, levels};
use crate::outside::{Facade, OutsideView, from_outside, open_side};
use crate::rectangle::{CellRectangle, largest, opened};
use crate::sight::{self, ChosenView};
use crate::unit::{Unit, by_extent, by_storey, unit_words};

/// Height of eyes above floors, metres.
const EYE: f64 = 1.6;

/// Height of eyes as a share of the storey's height, if storeys are too low for a person, as in
/// doll's houses.
const EYE_SHARE: f64 = 0.55;

/// Least height of a storey, metres, if the unit is known. Doll's houses are 1:12; lower spaces are
/// the insides of things.
const LEAST_STOREY: f64 = 0.18;

/// Least height of a storey in which a person can stand, metres.
const STANDING: f64 = 1.75;

/// Longest side of vehicles and other things that people enter, metres.
const LONGEST_THING: f64 = 20.0;

/// A scene of this size is a thing if its outside shows so many times as many triangles as its
/// largest room.
const DETAIL: usize = 4;

/// Greatest difference between floors of one storey, as a share of the eye's height, for steps and
/// thresholds.
const STEPS: f64 = 0.25;

/// Distance of boxes from walls and furniture, as a share of the eye's height.
const OFF_WALLS: f64 = 0.1;

/// Extents of boxes below and above the eye, as shares of the eye's height.
const BELOW: f64 = 0.35;
const ABOVE: f64 = 0.25;

/// Least side of a room's box, as a share of the eye's height, and least area, as a share of the
/// largest room's.
const LEAST_SIDE: f64 = 0.35;
const LEAST_AREA: f64 = 0.03;

/// Least area of the largest room, in squares of the eye's height. Bathrooms are larger. Without
/// such a room the scene is an object, whose free places are, for example, below wings or between
/// legs.
const LEAST_LARGEST: f64 = 1.0;

/// Least width of places that are not doors, as a share of the eye's height. Boxes keep off the
/// jambs, so a door of 1.1 m is narrower than this.
const DOOR: f64 = 0.5;

/// Most rooms that are searched for. [`Survey::limit`] reduces their number.
const MAX_ROOMS: usize = 64;

/// A free box at eye height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// World coordinates of one corner.
    pub origin: DVec3,
    /// The three edges from that corner.
    pub axes: [DVec3; 3],
    /// The view along the box's longest sight line.
    pub sight: ChosenView,
    /// Index of its storey, from below.
    pub level: usize,
    pub(crate) rectangle: CellRectangle,
}

impl Room {
    fn area(&self) -> f64 {
        self.axes[0].length() * self.axes[1].length()
    }
}

/// A free box at eye height that joins rooms, through a door or past furniture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Door {
    /// World coordinates of one corner.
    pub origin: DVec3,
    /// The three edges from that corner.
    pub axes: [DVec3; 3],
    /// Index of its storey, from below.
    pub level: usize,
    pub(crate) rectangle: CellRectangle,
}

/// The rooms of a scene and where to stand.
pub struct Survey {
    /// Free boxes, the largest first. Empty for an object on its own, and for a scene that is open
    /// on one side.
    pub rooms: Vec<Room>,
    /// Boxes that join the rooms; none before [`Survey::limit`]. Those of short ways come first.
    pub doors: Vec<Door>,
    /// The length of the scene's unit, stated or guessed.
    pub unit: Guess<Unit>,
    /// True if the scene is a thing to be seen from outside, although it has rooms, such as a car
    /// or a doll's house.
    pub is_thing: bool,
    frame: UprightAxes,
    open_side: Option<OutsideView>,
    outside: OnceCell<ChosenView>,
    pub(crate) levels: Vec<Storey>,
    pub(crate) grid: Option<SceneGrid>,
    /// Height of eyes above floors, in scene units.
    eye: f64,
    /// The scene's origin in world coordinates.
    pub(crate) origin: DVec3,
}

impl Survey {
    /// Surveys a scene. `unit` is the unit that a person has stated, in metres. Without one, it
    /// follows from the scene's file, the height of its rooms, the usual unit of the program that
    /// wrote it, or the scene's size.
    #[must_use]
    pub fn new(
        raycaster: &Raycaster,
        frame: UprightAxes,
        unit: Option<Unit>,
        about: &ModelFacts,
    ) -> Survey {
        let scene = raycaster.scene();
        let (unit, usual) = known_unit(unit, about);
        let (low, high) = scene.bounds();
        let (open_side, outside) = (open_side(&frame, raycaster), OnceCell::new());
        let extent = (high - low).max_element();
        let Some(grid) = SceneGrid::new(raycaster, frame) else {
            let unit = unit.or(usual).unwrap_or_else(|| by_extent(extent));
            return Survey {
                rooms: Vec::new(),
                doors: Vec::new(),
                unit,
                is_thing: false,
                frame,
                open_side,
                outside,
                levels: Vec::new(),
                grid: None,
                eye: 0.0,
                origin: scene.origin,
            };
        };
        let runs = runs(&grid);
        let height = storey(&runs).map(|cells| cells * grid.cell);
        let guessed = || {
            let by_storey = height.and_then(by_storey);
            by_storey.or_else(|| usual.clone()).unwrap_or_else(|| by_extent(extent))
        };
        let metres = unit.as_ref().map_or_else(|| guessed().value, |unit| unit.value);
        let facade = Facade::new(&frame, raycaster);
        let is_lower = |least: f64| height.is_some_and(|height| height * metres < least);
        // Without a unit and a storey of a usual height, nobody knows whether a person fits.
        let is_unknown = unit.is_none() && usual.is_none() && height.and_then(by_storey).is_none();
        let is_low = is_lower(STANDING) || is_unknown;
        let eye = eye_height(metres, height);
        let cells = |length: f64| (length / grid.cell).round().max(1.0) as u32;
        let (below, slack) = (cells(BELOW * eye), cells(STEPS * eye));
        let heights = Heights { eye: cells(eye), below, slack, is_low };
        // The unit of a room that is modelled from within may be anything.
        let is_too_low = is_lower(LEAST_STOREY) && (unit.is_some() || facade.makes_sense());
        let levels = match is_too_low {
            true => Vec::new(),
            false => levels(&grid, raycaster, &runs, heights),
        };
        let mut rooms = rooms(&grid, raycaster, &levels, eye);
        let is_too_small = |room: &Room| room.area() < LEAST_LARGEST * eye * eye;
        if rooms.first().is_some_and(is_too_small) || open_side.is_some() {
            rooms.clear();
        }
        let is_small = extent * metres < LONGEST_THING;
        let shows_more = |room: &Room| {
            let inside = Facade::triangles_around(raycaster, room.sight.eye - scene.origin);
            facade.triangles > DETAIL * inside
        };
        let is_thing = facade.makes_sense()
            && rooms.first().is_some_and(|room| is_low || is_small && shows_more(room));
        let unit = unit.unwrap_or_else(|| {
            let by_storey = height.and_then(by_storey).filter(|_| !rooms.is_empty());
            by_storey.or(usual).unwrap_or_else(|| by_extent(extent))
        });
        let (doors, grid, origin) = (Vec::new(), Some(grid), scene.origin);
        Survey {
            rooms,
            doors,
            unit,
            is_thing,
            frame,
            open_side,
            outside,
            levels,
            grid,
            eye,
            origin,
        }
    }

    /// Removes all rooms except the `most` largest, and joins these through doors.
    pub fn limit(&mut self, most: usize) {
        self.rooms.truncate(most);
        self.doors.clear();
        let Some(grid) = &self.grid else { return };
        for (number, level) in self.levels.iter().enumerate() {
            let here = self.rooms.iter().filter(|room| room.level == number);
            let rectangles: Vec<CellRectangle> = here.map(|room| room.rectangle).collect();
            for rectangle in joints(grid, level, &rectangles, self.eye / grid.cell) {
                let heights = heights(grid, level, rectangle, reach(grid, self.eye));
                let (origin, axes) = cuboid(grid, self.origin, rectangle, heights);
                self.doors.push(Door { origin, axes, level: number, rectangle });
            }
        }
    }

    /// Returns the views of the survey by name: one for each room, the largest first. Without
    /// rooms, and before those of a thing, comes the view from outside.
    #[must_use]
    pub fn views(&self, raycaster: &Raycaster) -> Vec<(String, ChosenView)> {
        let rooms = self.rooms.iter().enumerate();
        let rooms = rooms.map(|(n, room)| (format!("room {}", n + 1), room.sight));
        let is_seen_from_outside = self.is_thing || self.rooms.is_empty();
        let outside = is_seen_from_outside.then(|| ("outside".to_owned(), self.outside(raycaster)));
        outside.into_iter().chain(rooms).collect()
    }

    /// Returns a view of the whole scene from outside. Later calls return the same, even if the
    /// scene has got light since.
    #[must_use]
    pub fn outside(&self, raycaster: &Raycaster) -> ChosenView {
        let find = || from_outside(&self.frame, raycaster, self.open_side.as_ref());
        *self.outside.get_or_init(find)
    }
}

/// Returns the unit that a person or else the file has stated, and the usual one for the program
/// that wrote the file.
fn known_unit(
    unit: Option<Unit>,
    about: &ModelFacts,
) -> (Option<Guess<Unit>>, Option<Guess<Unit>>) {
    let said = |said: &StatedValue<Unit>, how: &str| {
        Guess::new(said.value, format!("{}, {how} `{}`", unit_words(said.value), said.words))
    };
    let by_person = unit.map(|unit| Guess::new(unit, format!("{}, as stated", unit_words(unit))));
    let by_file = about.unit.as_ref().map(|unit| said(unit, "as the file says:"));
    let usual = about.usual_unit.as_ref().map(|unit| said(unit, "as usual in files of"));
    (by_person.or(by_file), usual)
}

/// Returns the height of eyes above floors, in scene units.
fn eye_height(metres: Unit, storey: Option<f64>) -> f64 {
    let person = EYE / metres;
    match storey {
        Some(height) if height < 1.2 * person => EYE_SHARE * height,
        _ => person,
    }
}

fn rooms(grid: &SceneGrid, raycaster: &Raycaster, levels: &[Storey], eye: f64) -> Vec<Room> {
    let margin = (OFF_WALLS * eye / grid.cell).ceil().max(1.0) as usize;
    let reach = reach(grid, eye);
    let least = (LEAST_SIDE * eye / grid.cell).max(2.0);
    let mut left: Vec<Vec<bool>> =
        levels.iter().map(|level| level.away_from_walls(grid, margin)).collect();
    let mut found: Vec<(usize, CellRectangle)> = Vec::new();
    // Wide places come first. Otherwise, a box through several doors in a row might be the largest.
    let width = (DOOR * eye / grid.cell).ceil() as usize;
    let mut wide: Vec<Vec<bool>> =
        left.iter().map(|mask| opened(mask, grid.size[1], width)).collect();
    take_largest(&mut wide, grid.size[1], [least, least], &mut found);
    for &(level, rectangle) in &found {
        rectangle.places().for_each(|[x, y]| left[level][x * grid.size[1] + y] = false);
    }
    take_largest(&mut left, grid.size[1], [least, eye / grid.cell], &mut found);
    found.sort_by_key(|(_, rectangle)| std::cmp::Reverse(rectangle.cells()));
    let made = found.into_iter().map(|(level, rectangle)| {
        let heights = heights(grid, &levels[level], rectangle, reach);
        room(grid, raycaster, level, levels[level].eye, rectangle, heights)
    });
    made.collect()
}

/// Takes the largest rectangles out of the masks of levels, in rows of `width`. Adds those with at
/// least `short` by `long` cells.
fn take_largest(
    masks: &mut [Vec<bool>],
    width: usize,
    [short, long]: [f64; 2],
    rooms: &mut Vec<(usize, CellRectangle)>,
) {
    let mut first = rooms.first().map_or(0, |(_, rectangle)| rectangle.cells());
    while rooms.len() < MAX_ROOMS {
        let found = masks
            .iter()
            .enumerate()
            .filter_map(|(level, mask)| Some((level, largest(mask, width)?)));
        let Some((level, rectangle)) = found.max_by_key(|(_, rectangle)| rectangle.cells()) else {
            break;
        };
        first = first.max(rectangle.cells());
        if (rectangle.cells() as f64) < LEAST_AREA * first as f64 {
            break;
        }
        rectangle.places().for_each(|[x, y]| masks[level][x * width + y] = false);
        let side = |axis: usize| (rectangle.high[axis] + 1 - rectangle.low[axis]) as f64;
        if side(0).min(side(1)) >= short && side(0).max(side(1)) >= long {
            rooms.push((level, rectangle));
        }
    }
}

/// Returns the extents of boxes below and above the eye, in cells.
fn reach(grid: &SceneGrid, eye: f64) -> (u32, u32) {
    ((BELOW * eye / grid.cell) as u32, (ABOVE * eye / grid.cell) as u32)
}

/// Returns the cells around the eye that are free everywhere in a rectangle: the lowest, and the
/// one above the highest.
fn heights(
    grid: &SceneGrid,
    level: &Storey,
    rectangle: CellRectangle,
    reach: (u32, u32),
) -> (u32, u32) {
    let eye = level.eye as u32;
    let (mut low, mut high) = (eye.saturating_sub(reach.0), eye + reach.1 + 1);
    for [x, y] in rectangle.places() {
        if let Some((from, to)) = level.runs[x * grid.size[1] + y] {
            // Keep a cell of distance from floors and ceilings, too.
            (low, high) =
                (low.max((from + 1).min(eye)), high.min(to.saturating_sub(1).max(eye + 1)));
        }
    }
    (low, high)
}

fn room(
    grid: &SceneGrid,
    raycaster: &Raycaster,
    level: usize,
    eye: usize,
    rectangle: CellRectangle,
    heights: (u32, u32),
) -> Room {
    let scene_origin = raycaster.scene().origin;
    let (origin, axes) = cuboid(grid, scene_origin, rectangle, heights);
    let sight = sight::in_room(grid, raycaster, rectangle, eye);
    let sight = ChosenView { eye: scene_origin + sight.eye, ..sight };
    Room { origin, axes, sight, level, rectangle }
}

/// Returns a corner of a box in world coordinates, and the edges from there.
fn cuboid(
    grid: &SceneGrid,
    scene_origin: DVec3,
    rectangle: CellRectangle,
    (low, high): (u32, u32),
) -> (DVec3, [DVec3; 3]) {
    let [x, y] = rectangle.low.map(|c| c as f64);
    let corner = grid.low + DVec3::new(x, y, f64::from(low)) * grid.cell;
    let side = |axis: usize| (rectangle.high[axis] + 1 - rectangle.low[axis]) as f64 * grid.cell;
    let edges = [
        DVec3::new(side(0), 0.0, 0.0),
        DVec3::new(0.0, side(1), 0.0),
        DVec3::new(0.0, 0.0, f64::from(high - low) * grid.cell),
    ];
    let origin = scene_origin + grid.frame.to_world(corner);
    (origin, edges.map(|edge| grid.frame.to_world(edge)))
}
