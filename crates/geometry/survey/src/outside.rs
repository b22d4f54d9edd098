//! Chooses a view of a whole scene from outside.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use glam::DVec3;
use holo_raycast::{Hit, Ray, Raycaster};
use holo_scene::Scene;

use crate::frame::UprightAxes;
use crate::lit::Lamps;
use crate::sight::ChosenView;

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

/// Value of visible surfaces without direct light, relative to lit ones.
const UNLIT: f64 = 0.1;

/// Number of rays along each side of a parallel view.
const RAYS: usize = 32;

/// Distance of the rays' origins from the middle of the scene, relative to half of its depth.
const START: f64 = 1.1;

/// A hit is deep inside beyond this share of the scene's depth. A side is open if at least the
/// share `CLOSED` of the rays through it hit anything, and the share `OPEN` of them deep inside. A
/// slanted board has no open side, because only a quarter of it is that deep.
const DEEP: f64 = 0.75;
const CLOSED: f64 = 0.9;
const OPEN: f64 = 0.5;

/// Least depth behind an open side, as a share of the scene's diagonal.
const LEAST_DEPTH: f64 = 0.1;

/// Horizontal angle of views, degrees.
const ANGLE: f64 = 45.0;

/// Greatest share of the picture that a scene fills, and height over width of the widest pictures.
const FILLED: f64 = 0.9;
const WIDE: f64 = 9.0 / 16.0;

/// Least distance from the middle of a scene, in its diagonals, so that the eye is outside of a
/// section around it.
const LEAST_DISTANCE: f64 = 0.6;

/// Returns a view of the whole scene from outside. It looks through the scene's open side, if there
/// is one. Otherwise it has the usual direction, unless that shows surfaces edge-on or dark ones. A
/// board is edge-on from its side, and the back of a screen before a lamp is dark.
pub(crate) fn from_outside(
    frame: &UprightAxes,
    raycaster: &Raycaster,
    open: Option<&OutsideView>,
) -> ChosenView {
    let scene = raycaster.scene();
    if let Some(look) = open {
        return look.whole(frame, scene);
    }
    let features = scene.features();
    // A sky or a sun lights what lamps do not. A scene that is dark without one will get it.
    let lamps = (!features.sky && features.suns == 0).then(|| Lamps::new(raycaster));
    let lamps = lamps.filter(|lamps| lamps.suffice(raycaster));
    let looks = DIRECTIONS.map(|direction| OutsideView::new(frame, direction));
    let shown = looks.each_ref().map(|look| look.shown(raycaster, lamps.as_ref()));
    let most = shown.into_iter().fold(0.0, f64::max);
    let best = shown.iter().position(|&shown| shown == most).unwrap_or(0);
    looks[if shown[0] >= SHOWN * most { 0 } else { best }].whole(frame, scene)
}

/// Returns the look through the missing side of a scene, such as a doll's house or a stage. Level
/// rays through that side hit surfaces, most of them deep inside.
pub(crate) fn open_side(frame: &UprightAxes, raycaster: &Raycaster) -> Option<OutsideView> {
    let half = half_extent(raycaster.scene());
    let is_open = |look: &OutsideView| {
        if half.dot(look.direction.abs()) < LEAST_DEPTH * half.length() {
            return false;
        }
        let (mut hits, mut deep) = (0, 0);
        look.cast(raycaster, |depth, _| {
            hits += 1;
            deep += u32::from(depth > DEEP);
        });
        let all = (RAYS * RAYS) as f64;
        f64::from(hits) > CLOSED * all && f64::from(deep) > OPEN * all
    };
    let level = DIRECTIONS.into_iter().filter(|[.., up]| *up == 0.0);
    level.map(|direction| OutsideView::new(frame, direction)).find(is_open)
}

/// What views of a scene from outside show.
pub(crate) struct Facade {
    /// Share of their rays that hit front faces, among those that hit anything.
    fronts: f64,
    /// Number of triangles that they hit.
    pub triangles: usize,
}

/// Least share of front faces that makes sense of a view from outside. The walls of a room that is
/// modelled from within show their backs.
const LEAST_FRONTS: f64 = 0.6;

/// Number of directions from which a facade is looked at: those of the four sides.
const SIDES: usize = 4;

impl Facade {
    /// Looks at a scene from its four sides.
    pub(crate) fn new(frame: &UprightAxes, raycaster: &Raycaster) -> Facade {
        let (mut hits, mut fronts, mut triangles) = (0, 0, BTreeSet::new());
        for direction in DIRECTIONS.into_iter().take(SIDES) {
            let look = OutsideView::new(frame, direction);
            look.cast(raycaster, |_, hit| {
                let normal = raycaster.geometric_normal(hit.triangle).as_dvec3();
                hits += 1;
                fronts += u32::from(normal.dot(look.direction) < 0.0);
                triangles.insert(hit.triangle);
            });
        }
        let fronts = f64::from(fronts) / f64::from(hits.max(1));
        Facade { fronts, triangles: triangles.len() }
    }

    /// Returns whether a view from outside makes sense.
    pub(crate) fn makes_sense(&self) -> bool {
        self.fronts >= LEAST_FRONTS
    }

    /// Returns the number of triangles that as many rays hit from a point, relative to the scene's
    /// origin.
    pub(crate) fn triangles_around(raycaster: &Raycaster, point: DVec3) -> usize {
        let rays = SIDES * RAYS * RAYS;
        let golden = PI * (3.0 - 5f64.sqrt());
        let directions = (0..rays).map(|i| {
            let z = -1.0 + 2.0 * (i as f64 + 0.5) / rays as f64;
            let (sin, cos) = (golden * i as f64).sin_cos();
            let level = (1.0 - z * z).max(0.0).sqrt();
            DVec3::new(level * cos, level * sin, z)
        });
        let hit =
            |direction: DVec3| raycaster.nearest(&Ray::new(point.as_vec3(), direction.as_vec3()));
        directions.filter_map(hit).map(|hit| hit.triangle).collect::<BTreeSet<_>>().len()
    }
}

/// A direction of view, and the directions to the right and upwards in the picture.
pub(crate) struct OutsideView {
    direction: DVec3,
    right: DVec3,
    above: DVec3,
}

impl OutsideView {
    fn new(frame: &UprightAxes, towards: [f64; 3]) -> OutsideView {
        let direction = frame.to_world(DVec3::from_array(towards).normalize());
        let right = direction.cross(frame.up).normalize_or(frame.up.any_orthonormal_vector());
        OutsideView { direction, right, above: right.cross(direction) }
    }

    /// Returns the area that surfaces cover in a parallel view. Those that no lamp lights count
    /// less if `lamps` are given.
    fn shown(&self, raycaster: &Raycaster, lamps: Option<&Lamps>) -> f64 {
        let seen = Some(self.direction.as_vec3());
        let mut values = 0.0;
        self.cast(raycaster, |_, hit| {
            let is_lit = |lamps: &Lamps| lamps.light(raycaster, (hit.triangle, hit.u, hit.v), seen);
            values += if lamps.is_none_or(is_lit) { 1.0 } else { UNLIT };
        });
        let half = half_extent(raycaster.scene());
        values * half.dot(self.right.abs()) * half.dot(self.above.abs())
    }

    /// Casts a square of parallel rays that covers the scene's bounds. Reports each hit, and its
    /// depth behind the foremost point of the bounds as a share of their depth.
    fn cast(&self, raycaster: &Raycaster, mut report: impl FnMut(f64, Hit)) {
        let (low, high) = raycaster.scene().bounds();
        let half = half_extent(raycaster.scene());
        let [across, up, depth] = [self.right, self.above, self.direction]
            .map(|axis| axis * half.dot(axis.abs()).max(f64::MIN_POSITIVE));
        let start = (low + high) * 0.5 - depth * START;
        let place = |i: usize| (i as f64 + 0.5) / RAYS as f64 * 2.0 - 1.0;
        for (x, y) in (0..RAYS).flat_map(|y| (0..RAYS).map(move |x| (place(x), place(y)))) {
            let local = raycaster.localize(start + across * x + up * y, self.direction);
            let hit = local.and_then(|(ray, skipped)| Some((raycaster.nearest(&ray)?, skipped)));
            if let Some((hit, skipped)) = hit {
                let distance = (f64::from(hit.t) + skipped) / depth.length();
                report((distance - (START - 1.0)) * 0.5, hit);
            }
        }
    }

    /// Returns the view in this direction from as far as the whole scene needs.
    fn whole(&self, frame: &UprightAxes, scene: &Scene) -> ChosenView {
        let (low, high) = scene.bounds();
        let middle = (low + high) * 0.5;
        let slope = (0.5 * ANGLE.to_radians()).tan() * FILLED;
        let distance = scene.points().map(|corner| {
            let from_middle = scene.origin + corner.as_dvec3() - middle;
            let across = from_middle.dot(self.right).abs() / slope;
            let up = from_middle.dot(self.above).abs() / (slope * WIDE);
            across.max(up) - from_middle.dot(self.direction)
        });
        let distance = distance.fold(LEAST_DISTANCE * low.distance(high), f64::max);
        let eye = middle - self.direction * distance;
        ChosenView { eye, direction: self.direction, up: frame.up, angle: ANGLE }
    }
}

/// Half of the scene's extent along each axis.
fn half_extent(scene: &Scene) -> DVec3 {
    let (low, high) = scene.bounds();
    (high - low) * 0.5
}
