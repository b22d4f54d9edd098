//! A view as projection takes it, in f32, relative to the points' origin: three dot products for a perspective, [`Curved`] for others.
//!
//! Always true: a point is mapped to a pixel only if the view sees it (what is beyond an aft clipping surface it sees black) and all its numbers are finite.

use glam::{DVec3, Vec4};
use holo_picture::{Clip, View, ViewKind};

/// Distance at which things infinitely far away are kept: far enough that no walk moves them, with room for products in f32.
const FAR: f64 = 1e15;
/// The same in parallel views, where it depends on the pixel: so many sizes of the picture. More would not tell pixels apart.
const FAR_SIZES: f64 = 1e3;
/// Smallest depth that is in front of the eye: its reciprocal is finite.
pub(super) const NEAREST: f32 = 1e-30;

/// Depth of what is beyond an aft clipping surface: no picture's sums of nine overflow.
pub(super) const BEYOND: f32 = 1e36;

/// Position for something infinitely far away, relative to any origin.
pub(super) fn far_away(direction: DVec3) -> DVec3 {
    direction.normalize_or_zero() * FAR
}

/// How far along a parallel view's rays things are kept that are infinitely far away.
pub(super) fn far_along(view: &View) -> f64 {
    FAR_SIZES * view.extent().0.max(view.extent().1)
}

/// Depth from which what [`Frame::depth`](super::Frame::depth) has is infinitely far away.
pub fn far_depth(view: &View) -> f64 {
    // By perspective depth is less than distance; a tenth is seen at 84° off the axis.
    if view.kind.has_eye() { 0.1 * FAR } else { 0.5 * far_along(view) }
}

/// Says where points are seen.
pub(super) trait Lens: Copy + Sync {
    /// Whether anything may be clipped: asked for each point, it made projection take half as long again.
    const CLIPS: bool;

    /// Column, row and depth; meaningless unless the depth is at least [`nearest`](Self::nearest).
    fn project(&self, p: [f32; 3]) -> (f32, f32, f32);

    /// Least depth that is seen.
    #[inline(always)]
    fn nearest(&self) -> f32 {
        NEAREST
    }

    /// Largest depth that is not black.
    #[inline(always)]
    fn farthest(&self) -> f32 {
        f32::INFINITY
    }
}

/// Any view. Loops are compiled for each of the three: what follows from the match must be outside of them.
#[derive(Clone, Copy, Debug)]
pub(super) enum Map {
    Flat(Flat),
    Cut(Cut),
    Curved(Curved),
}

impl Map {
    /// `width` and `height` are the picture's in pixels, perhaps a fraction of the view's.
    pub fn new(view: &View, origin: DVec3, width: f64, height: f64) -> Self {
        match view.kind {
            ViewKind::Perspective => {
                let flat = Flat::new(view, origin, width, height);
                if view.is_clipped() { Map::Cut(Cut::new(view, flat)) } else { Map::Flat(flat) }
            }
            _ => Map::Curved(Curved::new(view, origin, width, height)),
        }
    }

    /// As [`Lens::project`].
    pub fn project(&self, p: [f32; 3]) -> (f32, f32, f32) {
        match self {
            Map::Flat(map) => map.project(p),
            Map::Cut(map) => map.project(p),
            Map::Curved(map) => map.project(p),
        }
    }

    /// As [`Lens::nearest`].
    pub fn nearest(&self) -> f32 {
        match self {
            Map::Flat(map) => map.nearest(),
            Map::Cut(map) => map.nearest(),
            Map::Curved(map) => map.nearest(),
        }
    }
}

/// A perspective. Column, row and depth of a point are `x·p/z·p`, `y·p/z·p` and `z·p`, with `p` = (position, 1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Flat {
    pub x: [f32; 4],
    pub y: [f32; 4],
    pub z: [f32; 4],
}

impl Flat {
    fn new(view: &View, origin: DVec3, width: f64, height: f64) -> Self {
        let (across, along) = view.extent();
        let forward = view.vd;
        let eye = view.eye() - origin;
        let row = |axis: DVec3| {
            let offset = -axis.dot(eye);
            [axis.x as f32, axis.y as f32, axis.z as f32, offset as f32]
        };
        Self {
            x: row(view.right() * (width / across) + forward * ((0.5 - view.vs) * width)),
            y: row(view.up() * (-height / along) + forward * ((0.5 + view.vl) * height)),
            z: row(forward),
        }
    }
}

impl Lens for Flat {
    const CLIPS: bool = false;

    #[inline(always)]
    fn project(&self, p: [f32; 3]) -> (f32, f32, f32) {
        let dot = |row: &[f32; 4]| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
        let depth = dot(&self.z);
        let inverse = 1.0 / depth;
        (dot(&self.x) * inverse, dot(&self.y) * inverse, depth)
    }
}

/// A perspective with clipping planes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    flat: Flat,
    nearest: f32,
    farthest: f32,
}

impl Cut {
    fn new(view: &View, flat: Flat) -> Self {
        let farthest = if view.clips_sky() { view.va as f32 } else { f32::INFINITY };
        Self { flat, nearest: (view.vo as f32).max(NEAREST), farthest }
    }
}

impl Lens for Cut {
    const CLIPS: bool = true;

    #[inline(always)]
    fn project(&self, p: [f32; 3]) -> (f32, f32, f32) {
        self.flat.project(p)
    }

    #[inline(always)]
    fn nearest(&self) -> f32 {
        self.nearest
    }

    #[inline(always)]
    fn farthest(&self) -> f32 {
        self.farthest
    }
}

/// A view of another type. Depth is the distance from where a point's ray begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curved {
    view: View,
    right: Vec4,
    up: Vec4,
    forward: Vec4,
    size: (f64, f64),
}

impl Curved {
    fn new(view: &View, origin: DVec3, width: f64, height: f64) -> Self {
        let eye = view.eye() - origin;
        let row = |axis: DVec3| axis.extend(-axis.dot(eye)).as_vec4();
        Self {
            view: *view,
            right: row(view.right()),
            up: row(view.up()),
            forward: row(view.vd),
            size: (width, height),
        }
    }
}

impl Lens for Curved {
    const CLIPS: bool = true;

    #[inline(always)]
    fn project(&self, [x, y, z]: [f32; 3]) -> (f32, f32, f32) {
        let dot = |row: Vec4| row.x * x + row.y * y + row.z * z + row.w;
        let place =
            DVec3::new(dot(self.right).into(), dot(self.up).into(), dot(self.forward).into());
        let depth = match self.view.clip_local(place) {
            Clip::Shown if self.view.kind.has_eye() => place.length(),
            Clip::Shown => place.z,
            Clip::Beyond => BEYOND.into(),
            Clip::Before => 0.0,
        };
        match self.view.project_local(place) {
            Some((x, y)) => {
                ((x * self.size.0) as f32, ((1.0 - y) * self.size.1) as f32, depth as f32)
            }
            None => (0.0, 0.0, 0.0),
        }
    }

    #[inline(always)]
    fn farthest(&self) -> f32 {
        if self.view.is_clipped() { 0.5 * BEYOND } else { f32::INFINITY }
    }
}
