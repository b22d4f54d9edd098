//! Finds thin slabs of solid glass, such as window panes with a thickness.
//!
//! Light leaves a slab in the direction in which it entered, a little beside. A thin slab is
//! therefore a pane in its middle. Shadow rays and displays go straight through panes. They do not
//! go through solid glass, so daylight behind it is noisy.

use glam::{DMat4, DVec3};

/// Greatest area of a slab's rim over that of one face. A square then has a side of 40 times its
/// thickness.
const GREATEST_RIM: f64 = 0.1;

/// Greatest difference of a corner from its plane over the thickness, and of the areas of the two
/// faces over one of them.
const SAME: f64 = 0.01;

/// Greatest area in which two slabs may touch, over the area of the smaller one. Slabs touch at
/// their rims, in corners of glass and in rows of panes.
const GREATEST_CONTACT: f64 = 0.1;

/// A box around glass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GlassBox {
    low: DVec3,
    high: DVec3,
}

impl GlassBox {
    pub(crate) fn around(points: impl IntoIterator<Item = DVec3>) -> GlassBox {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        points.into_iter().for_each(|point| (low, high) = (low.min(point), high.max(point)));
        GlassBox { low, high }
    }

    /// Returns a box around this one in another place.
    pub(crate) fn placed(&self, matrix: DMat4) -> GlassBox {
        let sides = [self.low, self.high];
        let corner =
            |k: usize| DVec3::from_array([0, 1, 2].map(|axis: usize| sides[k >> axis & 1][axis]));
        GlassBox::around((0..8).map(|k| matrix.transform_point3(corner(k))))
    }

    pub(crate) fn meets(&self, other: &GlassBox) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}

/// A thin slab of solid glass: two parallel faces of equal shape, and a rim.
#[derive(Clone, Debug)]
pub(crate) struct Slab {
    /// All its triangles.
    pub triangles: Vec<usize>,
    /// A box around it that is larger by its thickness.
    pub bounds: GlassBox,
    /// A corner, and the unit normal of the faces.
    origin: DVec3,
    normal: DVec3,
    /// Heights of the lower and of the upper face above the corner.
    heights: [f64; 2],
    /// Area of a face.
    area: f64,
}

impl Slab {
    /// Returns the slab that these triangles are.
    pub(crate) fn of(triangles: &[usize], corners: &impl Fn(usize) -> [DVec3; 3]) -> Option<Slab> {
        let doubled = |k: usize| {
            let [a, b, c] = corners(k);
            (b - a).cross(c - a)
        };
        let areas = triangles.iter().map(|&k| doubled(k));
        let largest = areas.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
        let normal = largest.try_normalize()?;
        let origin = corners(*triangles.first()?)[0];
        let height = |point: DVec3| (point - origin).dot(normal);
        let heights = || triangles.iter().flat_map(|&k| corners(k)).map(height);
        let (low, high) = (heights().fold(0.0, f64::min), heights().fold(0.0, f64::max));
        let thickness = high - low;
        // The lower face, the upper face, and the rim: sums along the normal, and sums in all.
        let (mut along, mut all) = ([0.0; 3], [0.0; 3]);
        for &k in triangles {
            let face = side(corners(k).map(height), [low, high])?;
            along[face] += 0.5 * doubled(k).dot(normal);
            all[face] += 0.5 * doubled(k).length();
        }
        let area = all[1];
        let is_even = |face: usize| (along[face].abs() - area).abs() <= SAME * area;
        let is_slab = thickness > 0.0
            && is_even(0)
            && is_even(1)
            && (along[0] + along[1]).abs() <= SAME * area
            && all[2] <= GREATEST_RIM * area;
        let GlassBox { low: near, high: far } =
            GlassBox::around(triangles.iter().flat_map(|&k| corners(k)));
        let bounds = GlassBox { low: near - thickness, high: far + thickness };
        let triangles = triangles.to_vec();
        is_slab.then_some(Slab { triangles, bounds, origin, normal, heights: [low, high], area })
    }

    /// Returns whether two slabs touch at more than their rims.
    pub(crate) fn touches(&self, other: &Slab, corners: &impl Fn(usize) -> [DVec3; 3]) -> bool {
        if !self.bounds.meets(&other.bounds) {
            return false;
        }
        let (across, up) = self.normal.any_orthonormal_pair();
        let spans = |slab: &Slab| {
            let points = slab.triangles.iter().flat_map(|&k| corners(k));
            GlassBox::around(points.map(|point| {
                let from = point - self.origin;
                DVec3::new(from.dot(across), from.dot(up), from.dot(self.normal))
            }))
        };
        let (own, others) = (spans(self), spans(other));
        let common = own.high.min(others.high) - own.low.max(others.low);
        let is_near = common.z >= -SAME * (self.heights[1] - self.heights[0]);
        let contact = common.x.max(0.0) * common.y.max(0.0);
        is_near && contact > GREATEST_CONTACT * self.area.min(other.area)
    }

    /// Returns whether a triangle belongs to the upper face.
    pub(crate) fn is_upper(&self, corners: [DVec3; 3]) -> bool {
        let height = |point: DVec3| (point - self.origin).dot(self.normal);
        side(corners.map(height), self.heights) == Some(1)
    }

    /// Returns the place in the middle between the faces.
    pub(crate) fn in_middle(&self, point: DVec3) -> DVec3 {
        let [low, high] = self.heights;
        point + self.normal * (0.5 * (low + high) - (point - self.origin).dot(self.normal))
    }
}

/// Returns 0 for a triangle of the lower face, 1 for the upper one and 2 for the rim. `None` if a
/// corner lies elsewhere.
fn side(corners: [f64; 3], [low, high]: [f64; 2]) -> Option<usize> {
    let near = SAME * (high - low);
    let (lower, upper) = (|h: &f64| *h - low <= near, |h: &f64| high - *h <= near);
    if !corners.iter().all(|h| lower(h) || upper(h)) {
        return None;
    }
    Some(match (corners.iter().all(lower), corners.iter().all(upper)) {
        (true, _) => 0,
        (_, true) => 1,
        _ => 2,
    })
}
