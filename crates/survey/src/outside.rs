//! Chooses a view of a whole scene from outside.

use glam::{DVec3, Vec3};
use holo_raycast::{Hit, Raycaster};
use holo_scene::Scene;

use crate::frame::Frame;
use crate::lit::Lamps;
use crate::sight::Sight;

/// Directions of views, in the frame's axes. The usual one comes first: from the front, the right
/// and above. Then come other sides, one from high above, and those straight into boxes that are
/// open on one side.
const DIRECTIONS: [[f64; 3]; 10] = [
    [-0.5, 0.85, -0.38],
    [0.5, 0.85, -0.38],
    [-0.5, -0.85, -0.38],
    [0.85, -0.5, -0.38],
    [-0.3, 0.5, -0.9],
    [-0.95, 0.2, -0.2],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
];

/// The first direction is used if it shows at least this share of the most surface that any
/// direction shows.
const SHOWN: f64 = 0.5;

/// Value of surfaces that are in view but that no lamp lights directly, relative to lit ones.
const UNLIT: f64 = 0.1;

/// Number of rays along each side of a parallel view.
const RAYS: usize = 32;

/// Horizontal angle of views, degrees.
const ANGLE: f64 = 45.0;

/// Greatest share of the picture that a scene fills, and height over width of the widest pictures.
const FILLED: f64 = 0.9;
const WIDE: f64 = 9.0 / 16.0;

/// Least distance from the middle of a scene, in its diagonals, so that the eye is outside of a
/// section around it.
const LEAST_DISTANCE: f64 = 0.6;

/// Returns a view of the whole scene from outside. It has the usual direction, unless that shows
/// surfaces edge-on, such as a board from its side, or dark ones, such as the back of a box whose
/// lamp shines inside.
pub(crate) fn from_outside(frame: &Frame, raycaster: &Raycaster) -> Sight {
    let features = raycaster.scene().features();
    // A sky or a sun lights what lamps do not.
    let lamps = (!features.sky && features.suns == 0).then(|| Lamps::new(raycaster));
    let looks = DIRECTIONS.map(|direction| Look::new(frame, DVec3::from_array(direction)));
    let shown = looks.each_ref().map(|look| look.shown(raycaster, lamps.as_ref()));
    let most = shown.into_iter().fold(0.0, f64::max);
    let best = shown.iter().position(|&shown| shown == most).unwrap_or(0);
    looks[if shown[0] >= SHOWN * most { 0 } else { best }].whole(frame, raycaster.scene())
}

/// A direction of view, and the directions to the right and upwards in the picture.
struct Look {
    direction: DVec3,
    right: DVec3,
    above: DVec3,
}

impl Look {
    fn new(frame: &Frame, towards: DVec3) -> Look {
        let direction = frame.to_world(towards.normalize());
        let right = direction.cross(frame.up).normalize_or(frame.up.any_orthonormal_vector());
        Look { direction, right, above: right.cross(direction) }
    }

    /// Returns the area that surfaces cover in a parallel view. Those that no lamp lights count
    /// less if `lamps` are given.
    fn shown(&self, raycaster: &Raycaster, lamps: Option<&Lamps>) -> f64 {
        let (low, high) = raycaster.scene().bounds();
        let half = (high - low) * 0.5;
        let extent = |axis: DVec3| half.dot(axis.abs());
        let (across, up) = (self.right * extent(self.right), self.above * extent(self.above));
        let start = (low + high) * 0.5 - self.direction * (1.01 * half.length());
        let place = |i: usize| (i as f64 + 0.5) / RAYS as f64 * 2.0 - 1.0;
        let value = |x: f64, y: f64| {
            let local = raycaster.localize(start + across * x + up * y, self.direction);
            let hit = local.and_then(|(ray, _)| raycaster.nearest(&ray));
            let is_lit = |lamps: &Lamps, hit: &Hit| {
                lamps.light(raycaster, (hit.triangle, hit.u, hit.v), Some(self.direction.as_vec3()))
            };
            hit.map_or(0.0, |hit| match lamps {
                Some(lamps) if !is_lit(lamps, &hit) => UNLIT,
                _ => 1.0,
            })
        };
        let row = |y: usize| (0..RAYS).map(|x| value(place(x), place(y))).sum::<f64>();
        let values: f64 = (0..RAYS).map(row).sum();
        values * across.length() * up.length()
    }

    /// Returns the view in this direction from as far as the whole scene needs.
    fn whole(&self, frame: &Frame, scene: &Scene) -> Sight {
        let (low, high) = scene.bounds();
        let middle = (low + high) * 0.5;
        let slope = (0.5 * ANGLE.to_radians()).tan() * FILLED;
        let distance = scene.triangles.as_flattened().iter().map(|&corner| {
            let corner = Vec3::from(scene.positions[corner as usize]).as_dvec3();
            let from_middle = scene.origin + corner - middle;
            let across = from_middle.dot(self.right).abs() / slope;
            let up = from_middle.dot(self.above).abs() / (slope * WIDE);
            across.max(up) - from_middle.dot(self.direction)
        });
        let distance = distance.fold(LEAST_DISTANCE * low.distance(high), f64::max);
        let eye = middle - self.direction * distance;
        Sight { eye, direction: self.direction, up: frame.up, angle: ANGLE }
    }
}
