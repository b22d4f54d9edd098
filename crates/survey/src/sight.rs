//! Chooses where to stand, and where to look.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use holo_raycast::{Ray, Raycaster};
use holo_scene::Scene;

use crate::frame::Frame;
use crate::grid::Grid;
use crate::rectangle::Rectangle;

/// A chosen view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// World coordinates of the eye.
    pub eye: DVec3,
    /// Unit direction of the view.
    pub direction: DVec3,
    /// Up.
    pub up: DVec3,
    /// Horizontal angle, degrees.
    pub angle: f64,
}

/// Horizontal angles of views in rooms and of objects, degrees.
const IN_ROOM: f64 = 75.0;
const OF_OBJECT: f64 = 45.0;

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
pub(crate) fn in_room(grid: &Grid, raycaster: &Raycaster, room: Rectangle, eye: usize) -> Sight {
    let inset = |axis: usize| (INSET * (room.high[axis] - room.low[axis]) as f64).round() as usize;
    let room = Rectangle {
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
    Sight {
        eye: grid.frame.to_world(eye),
        direction: grid.frame.to_world(direction),
        up: grid.frame.up,
        angle: IN_ROOM,
    }
}

/// Directions of views from outside, in the frame's axes. The usual one comes first: from the
/// front, the right and above. Then come other sides, and one from high above.
const OUTSIDE: [[f64; 3]; 6] = [
    [-0.5, 0.85, -0.38],
    [0.5, 0.85, -0.38],
    [-0.5, -0.85, -0.38],
    [0.85, -0.5, -0.38],
    [-0.3, 0.5, -0.9],
    [-0.95, 0.2, -0.2],
];

/// The first direction is used if it shows at least this share of the most surface that any
/// direction shows.
const SHOWN: f64 = 0.4;

/// Most triangles that are examined.
const MAX_SAMPLED: usize = 100_000;

/// Greatest share of the picture that an object fills, and height over width of the widest
/// pictures.
const FILLED: f64 = 0.9;
const WIDE: f64 = 9.0 / 16.0;

/// Least distance from the middle of a scene, in its diagonals, so that the eye is outside of a
/// section around it.
const LEAST_DISTANCE: f64 = 0.6;

/// Returns a view of the whole scene from outside. It is the usual one, unless that shows surfaces
/// edge-on, such as a board from its side.
pub(crate) fn from_outside(frame: &Frame, scene: &Scene) -> Sight {
    let towards = OUTSIDE.map(|towards| frame.to_world(DVec3::from_array(towards).normalize()));
    let shown = towards.map(|towards| shown(scene, towards));
    let most = shown.into_iter().fold(0.0, f64::max);
    let enough = |&number: &usize| shown[number] >= SHOWN * most;
    let direction = towards[(0..towards.len()).find(enough).unwrap_or(0)];
    let right = direction.cross(frame.up).normalize_or(frame.up.any_orthonormal_vector());
    let above = right.cross(direction);
    let (low, high) = scene.bounds();
    let middle = (low + high) * 0.5;
    let slope = (0.5 * OF_OBJECT.to_radians()).tan() * FILLED;
    let distance = scene.triangles.as_flattened().iter().map(|&corner| {
        let corner = Vec3::from(scene.positions[corner as usize]).as_dvec3();
        let from_middle = scene.origin + corner - middle;
        let across = from_middle.dot(right).abs() / slope;
        let up = from_middle.dot(above).abs() / (slope * WIDE);
        across.max(up) - from_middle.dot(direction)
    });
    let distance = distance.fold(LEAST_DISTANCE * low.distance(high), f64::max);
    Sight { eye: middle - direction * distance, direction, up: frame.up, angle: OF_OBJECT }
}

/// Returns the area that surfaces cover in a parallel view, without occlusion.
fn shown(scene: &Scene, direction: DVec3) -> f64 {
    let stride = scene.triangles.len().div_ceil(MAX_SAMPLED).max(1);
    let area = |triangle: usize| {
        let [a, b, c] = scene.corners(triangle as u32).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).dot(direction).abs()
    };
    (0..scene.triangles.len()).step_by(stride).map(area).sum()
}
