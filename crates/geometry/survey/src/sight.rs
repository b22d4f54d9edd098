//! Chooses where to stand in a room, and where to look.

use std::f64::consts::TAU;

use glam::DVec3;
use holo_raycast::{Ray, Raycaster};

use crate::grid::SceneGrid;
use crate::rectangle::CellRectangle;

/// A chosen view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChosenView {
    /// World coordinates of the eye.
    pub eye: DVec3,
    /// Unit direction of the view.
    pub direction: DVec3,
    /// Up.
    pub up: DVec3,
    /// Horizontal angle, degrees.
    pub angle: f64,
}

/// Horizontal angle of views in rooms, degrees.
const IN_ROOM: f64 = 75.0;

/// Distance of eyes from a room's ends, as a share of its sides. A wall right beside the eye fills
/// an edge of the picture, and hardly any stored ray hits it at such a grazing angle.
const INSET: f64 = 0.08;

/// Level directions that are tried from each place.
const AROUND: usize = 48;

/// Number of directions on each side of a view's middle that count, up to its edges.
const FAN: usize = 5;

/// Most places that are tried.
const MAX_PLACES: usize = 120;

/// Downward slope of a view in a room, because floors show more than ceilings.
const DOWN: f64 = 0.08;

/// Returns the view along the longest sight lines of a rectangle at eye height, relative to the
/// scene's origin. All lines within the view count, so that a single line through a gap between
/// chairs does not decide.
pub(crate) fn in_room(
    grid: &SceneGrid,
    raycaster: &Raycaster,
    room: CellRectangle,
    eye: usize,
) -> ChosenView {
    let inset = |axis: usize| (INSET * (room.high[axis] - room.low[axis]) as f64).round() as usize;
    let room = CellRectangle {
        low: [room.low[0] + inset(0), room.low[1] + inset(1)],
        high: [room.high[0] - inset(0), room.high[1] - inset(1)],
    };
    let stride = ((room.cells() as f64 / MAX_PLACES as f64).sqrt().ceil() as usize).max(1);
    let farthest = grid.cell * grid.size.map(|n| n as f64).into_iter().fold(0.0, f64::max);
    let mut best: Option<(f64, DVec3, DVec3)> = None;
    let on_stride = |[x, y]: [usize; 2]| {
        (x - room.low[0]).is_multiple_of(stride) && (y - room.low[1]).is_multiple_of(stride)
    };
    // From its corners, most of the room is visible.
    let corners = [room.low, [room.low[0], room.high[1]], [room.high[0], room.low[1]], room.high];
    for [x, y] in corners.into_iter().chain(room.places().filter(|&place| on_stride(place))) {
        let from = grid.middle([x, y, eye]);
        let origin = grid.frame.to_world(from).as_vec3();
        let level = |i: usize| {
            let (sin, cos) = (i as f64 / AROUND as f64 * TAU).sin_cos();
            DVec3::new(cos, sin, 0.0)
        };
        let lengths: Vec<f64> = (0..AROUND)
            .map(|i| {
                let ray = Ray::new(origin, grid.frame.to_world(level(i)).as_vec3());
                // A look out of a window counts a little, but it does not show the room.
                raycaster.nearest(&ray).map_or(0.3 * farthest, |hit| f64::from(hit.t).min(farthest))
            })
            .collect();
        for i in 0..AROUND {
            // The middle of the view counts most.
            let share = |by: usize| (FAN + 1 - by.abs_diff(FAN)) as f64;
            let length = |by: usize| lengths[(i + AROUND + by - FAN) % AROUND];
            let score: f64 = (0..=2 * FAN).map(|by| length(by) * share(by)).sum();
            if best.is_none_or(|(most, ..)| score > most * (1.0 + 1e-6)) {
                best = Some((score, from, level(i)));
            }
        }
    }
    let middle = grid.middle([room.low[0], room.low[1], eye]);
    let (_, eye, ahead) = best.unwrap_or((0.0, middle, DVec3::Y));
    let direction = (ahead - DVec3::Z * DOWN).normalize();
    ChosenView {
        eye: grid.frame.to_world(eye),
        direction: grid.frame.to_world(direction),
        up: grid.frame.up,
        angle: IN_ROOM,
    }
}
