//! A view in the form that projection uses: in f32, relative to the points' origin.
//!
//! Invariant: a point gets a depth above 0 only if the view sees it and all its numbers are finite.

use glam::{DVec3, Vec4};
use holo_picture::{Clip, View, ViewKind};

/// Distance that stands for infinity: no walk changes the direction of such a point, and products
/// fit in f32.
const FAR: f64 = 1e15;
/// The same in parallel views, in sizes of the picture. There a point belongs to a pixel, and at a
/// larger distance f32 could not distinguish pixels.
const FAR_SIZES: f64 = 1e3;
/// Least depth that a view sees: its reciprocal is finite.
const NEAREST: f32 = 1e-30;

/// Depth of black points beyond an aft clipping surface. Sums of nine do not overflow.
pub(crate) const BEYOND: f32 = 1e36;

/// Returns the position that stands for an infinitely far surface, relative to any origin.
pub(crate) fn far_away(direction: DVec3) -> DVec3 {
    direction.normalize_or_zero() * FAR
}

/// Returns the distance along a parallel view's rays that stands for infinity.
pub(crate) fn far_along(view: &View) -> f64 {
    FAR_SIZES * view.extent().0.max(view.extent().1)
}

/// Returns the least depth of infinitely far points in [`Frame::depth`](crate::CacheFrame::depth).
pub(crate) fn far_depth(view: &View) -> f64 {
    // The depth of a perspective is less than the distance: a tenth of it at 84° off the axis.
    if view.kind.has_eye() { 0.1 * FAR } else { 0.5 * far_along(view) }
}

/// Maps points to pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Map {
    Perspective(Perspective),
    /// Any other type of view, in double precision.
    Other(Curved),
}

impl Map {
    /// Returns the map of a view to a picture of `size` pixels, which need not be whole.
    pub fn new(view: &View, origin: DVec3, size: (f64, f64)) -> Self {
        match view.kind {
            ViewKind::Perspective => Self::Perspective(Perspective::new(view, origin, size)),
            _ => Self::Other(Curved::new(view, origin, size)),
        }
    }

    /// Returns column, row and depth of a point; depth 0 if the view does not see it. The point may
    /// lie beside the picture.
    pub fn project(&self, position: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Perspective(map) => map.project(position),
            Self::Other(map) => map.project(position),
        }
    }

    /// Projects points by their x, y and z. Writes columns, rows and depths to `seen`.
    #[inline(always)]
    pub fn project_all<const N: usize>(&self, [x, y, z]: [&[f32; N]; 3], seen: &mut [[f32; N]; 3]) {
        let [columns, rows, depths] = seen;
        // One loop for each type of view, because a choice inside the loop would be slow.
        match self {
            Self::Perspective(map) => {
                for i in 0..N {
                    [columns[i], rows[i], depths[i]] = map.project([x[i], y[i], z[i]]);
                }
            }
            Self::Other(map) => {
                for i in 0..N {
                    [columns[i], rows[i], depths[i]] = map.project([x[i], y[i], z[i]]);
                }
            }
        }
    }
}

/// A perspective. With p = (position, 1), the depth is z·p, the column x·p/z·p, the row y·p/z·p.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Perspective {
    x: [f32; 4],
    y: [f32; 4],
    z: [f32; 4],
    /// Least depth that is seen, and largest one that is not black.
    nearest: f32,
    farthest: f32,
}

impl Perspective {
    fn new(view: &View, origin: DVec3, (width, height): (f64, f64)) -> Self {
        let (across, along) = view.extent();
        let forward = view.vd;
        let eye = view.eye() - origin;
        let row = |axis: DVec3| axis.extend(-axis.dot(eye)).as_vec4().to_array();
        Self {
            x: row(view.right() * (width / across) + forward * ((0.5 - view.vs) * width)),
            y: row(view.up() * (-height / along) + forward * ((0.5 + view.vl) * height)),
            z: row(forward),
            nearest: (view.vo as f32).max(NEAREST),
            farthest: if view.clips_sky() { view.va as f32 } else { f32::INFINITY },
        }
    }

    #[inline(always)]
    fn project(&self, p: [f32; 3]) -> [f32; 3] {
        let dot = |row: &[f32; 4]| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
        let depth = dot(&self.z);
        let inverse = 1.0 / depth;
        let is_seen = (depth >= self.nearest) & (depth < f32::INFINITY);
        let shown = if depth > self.farthest { BEYOND } else { depth };
        [dot(&self.x) * inverse, dot(&self.y) * inverse, if is_seen { shown } else { 0.0 }]
    }
}

/// A view of another type. Depth is the distance from where a point's ray begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curved {
    view: View,
    right: Vec4,
    up: Vec4,
    forward: Vec4,
    size: (f64, f64),
}

impl Curved {
    fn new(view: &View, origin: DVec3, size: (f64, f64)) -> Self {
        let eye = view.eye() - origin;
        let row = |axis: DVec3| axis.extend(-axis.dot(eye)).as_vec4();
        let (right, up, forward) = (row(view.right()), row(view.up()), row(view.vd));
        Self { view: *view, right, up, forward, size }
    }

    fn project(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let dot = |row: Vec4| f64::from(row.x * x + row.y * y + row.z * z + row.w);
        let place = DVec3::new(dot(self.right), dot(self.up), dot(self.forward));
        let depth = match self.view.clip_local(place) {
            Clip::Shown if self.view.kind.has_eye() => place.length() as f32,
            Clip::Shown => place.z as f32,
            Clip::Beyond => BEYOND,
            Clip::Before => 0.0,
        };
        let is_seen = (NEAREST..f32::INFINITY).contains(&depth);
        match self.view.project_local(place) {
            Some((x, y)) if is_seen => {
                [(x * self.size.0) as f32, ((1.0 - y) * self.size.1) as f32, depth]
            }
            _ => [0.0; 3],
        }
    }
}
