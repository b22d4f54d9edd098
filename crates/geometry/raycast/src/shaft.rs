//! Shafts: tests whether any ray of a bundle can meet anything at all (after Haines & Wallace 1991,
//! "Shaft Culling for Efficient Ray-Cast Radiosity").
//!
//! A shaft is all rays from a point of one parallelogram through a point of another. The rays sweep
//! two convex bodies. One is the hull of the two parallelograms. The other begins at the second one
//! and extends without end in all directions from points of the first to points of the second. A
//! box or triangle is outside a body if some plane separates them. The planes tested are those that
//! bound the body, and those that bound the box or triangle.
//!
//! Invariants: "no" is proved, in f64 and with a margin far above the rounding of f32 rays. "Yes"
//! may be wrong.

use glam::DVec3;
use holo_scene::Placement;

use crate::Raycaster;
use crate::search::{find, triangles};

/// Margin of every comparison, as a share of the scene's reach.
///
/// A traced ray deviates from the exact one. Its origin is rounded by 2⁻²⁴ of at most twice the
/// reach. Its direction is rounded by 2⁻²⁴ over at most seven reaches. The triangle test rounds by
/// a few 2⁻²⁴ of coordinates up to four reaches. The sum is below 1.5e-6 along any axis.
const MARGIN: f64 = 4e-6;

/// Rounding of f64 world coordinates, before the scene's origin is subtracted.
const WORLD_MARGIN: f64 = 1e-14;

/// Sine of the greatest angle between a plane and a body that it bounds. The angle is due to
/// rounding, far below [`MARGIN`] at any distance within the scene.
const LEAN: f64 = 1e-12;

/// Rays from any point of one parallelogram through any point of another, in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// Corners of the first parallelogram, in order around it.
    pub from: [DVec3; 4],
    /// Corners of the second one, in order around it.
    pub through: [DVec3; 4],
    /// True if objects between the parallelograms count. Otherwise the rays begin at the second
    /// one.
    pub between: bool,
}

/// A half space that contains a convex body: normal · x ≥ offset for all its points, within
/// rounding.
#[derive(Clone, Copy, Debug)]
struct ShaftPlane {
    normal: DVec3,
    offset: f64,
}

/// A convex body: the hull of some points, extended without end along some directions.
#[derive(Clone, Debug)]
struct ConvexBody {
    points: Vec<DVec3>,
    /// Unit length.
    directions: Vec<DVec3>,
    planes: Vec<ShaftPlane>,
    margin: f64,
}

impl ConvexBody {
    /// Makes a body with the planes that bound it. Candidates are the planes through an edge of `a`
    /// or `b` and a vertex of the other, and the planes of `a` and `b`.
    fn new(
        points: Vec<DVec3>,
        directions: Vec<DVec3>,
        [a, b]: [&[DVec3; 4]; 2],
        margin: f64,
    ) -> Self {
        let mut body = Self { points, directions, planes: Vec::with_capacity(16), margin };
        for (own, other) in [(a, b), (b, a)] {
            body.bound((own[1] - own[0]).cross(own[3] - own[0]));
            for index in 0..4 {
                let edge = own[(index + 1) % 4] - own[index];
                for vertex in other {
                    body.bound(edge.cross(*vertex - own[index]));
                }
            }
        }
        for axis in DVec3::AXES {
            body.bound(axis);
        }
        body
    }

    /// Adds the planes perpendicular to `normal` that bound the body, if any do.
    fn bound(&mut self, normal: DVec3) {
        let Some(normal) = normal.try_normalize() else { return };
        for normal in [normal, -normal] {
            let known = |plane: &ShaftPlane| plane.normal.dot(normal) > 1.0 - 1e-12;
            if let Some(offset) = self.least(normal).filter(|_| !self.planes.iter().any(known)) {
                self.planes.push(ShaftPlane { normal, offset });
            }
        }
    }

    /// Returns the least value of `normal` · x over the body; `None` if it is unbounded. `normal`
    /// has unit length.
    fn least(&self, normal: DVec3) -> Option<f64> {
        let bounded = self.directions.iter().all(|direction| normal.dot(*direction) >= -LEAN);
        bounded.then(|| {
            self.points.iter().map(|point| normal.dot(*point)).fold(f64::INFINITY, f64::min)
        })
    }

    /// Returns false only if no point of the box is in the body.
    fn may_meet_box(&self, low: DVec3, high: DVec3) -> bool {
        self.planes.iter().all(|plane| {
            let farthest = DVec3::select(plane.normal.cmpge(DVec3::ZERO), high, low);
            plane.normal.dot(farthest) >= plane.offset - self.margin
        })
    }

    /// Returns false only if no point of the triangle is in the body.
    fn may_meet_triangle(&self, triangle: [DVec3; 3]) -> bool {
        let reaches = |plane: &ShaftPlane| {
            triangle.iter().any(|vertex| plane.normal.dot(*vertex) >= plane.offset - self.margin)
        };
        if !self.planes.iter().all(reaches) {
            return false;
        }
        let [a, b, c] = triangle;
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { return true };
        // Is the whole body on one side of the triangle's plane?
        let level = [a, b, c].map(|vertex| normal.dot(vertex));
        let (low, high) = (
            level.into_iter().fold(f64::MAX, f64::min),
            level.into_iter().fold(f64::MIN, f64::max),
        );
        let above = self.least(normal).is_some_and(|least| least > high + self.margin);
        let below = self.least(-normal).is_some_and(|least| least > -low + self.margin);
        !above && !below
    }
}

impl Raycaster {
    /// Returns whether any ray of the shaft may meet anything. "No" is certain, also for rays that
    /// this raycaster traces.
    ///
    /// Takes a few microseconds, and more if the shaft passes close to much geometry. A shaft that
    /// is not finite may meet anything.
    #[must_use]
    pub fn may_hit(&self, shaft: &Shaft) -> bool {
        let (hierarchy, reach) = self.hierarchy();
        if hierarchy.nodes.is_empty() && self.instances().is_none() {
            return false;
        }
        let origin = self.scene().origin;
        let corners = shaft.from.iter().chain(&shaft.through);
        let world =
            corners.clone().fold(0.0, |most: f64, corner| most.max(corner.abs().max_element()));
        if !corners.clone().all(|corner| corner.is_finite()) {
            return true;
        }
        let margin =
            MARGIN * f64::from(reach) + WORLD_MARGIN * (world + origin.abs().max_element());
        let (a, b) =
            (shaft.from.map(|corner| corner - origin), shaft.through.map(|corner| corner - origin));
        let directions = b
            .iter()
            .flat_map(|to| a.iter().filter_map(|from| (*to - *from).try_normalize()))
            .collect();
        let beyond = ConvexBody::new(b.to_vec(), directions, [&a, &b], margin);
        if self.meets(&beyond) {
            return true;
        }
        shaft.between && {
            let hull = ConvexBody::new(
                a.iter().chain(&b).copied().collect(),
                Vec::new(),
                [&a, &b],
                margin,
            );
            self.meets(&hull)
        }
    }

    fn meets(&self, body: &ConvexBody) -> bool {
        let met = |triangle| {
            body.may_meet_triangle(self.vertices(triangle).map(|vertex| vertex.as_dvec3()))
        };
        let (own, _) = self.hierarchy();
        let may_meet_box = |low, high| body.may_meet_box(low, high);
        if find(own, may_meet_box, |leaf| triangles(own, leaf).any(met)) {
            return true;
        }
        let Some(instances) = self.instances() else { return false };
        find(&instances.top, may_meet_box, |index| {
            let instance = &self.scene().instances()[index as usize];
            let mesh = instances.mesh(index);
            let may_meet_placed = |low, high| {
                let (low, high) = placed(&instance.placement, low, high);
                body.may_meet_box(low, high)
            };
            find(mesh, may_meet_placed, |leaf| {
                triangles(mesh, leaf).any(|triangle| met(instance.first_triangle + triangle))
            })
        })
    }
}

/// Returns the box around a placed box.
fn placed(placement: &Placement, low: DVec3, high: DVec3) -> (DVec3, DVec3) {
    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
    let rows = placement.rows().map(|[x, y, z, sum]| (DVec3::new(x, y, z), sum));
    let middle = DVec3::from_array(rows.map(|(row, sum)| row.dot(middle) + sum));
    let half = DVec3::from_array(rows.map(|(row, _)| row.abs().dot(half)));
    (middle - half, middle + half)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f64, half: f64) -> [DVec3; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| DVec3::new(x * half, y * half, z))
    }

    /// Returns the shaft from a square of half width 1 at z = 0 through one at z = 1. Beyond it,
    /// the half width at z is 2z - 1.
    fn widening() -> ConvexBody {
        let (a, b) = (square(0.0, 1.0), square(1.0, 1.0));
        let directions = b
            .iter()
            .flat_map(|to| a.iter().filter_map(|from| (*to - *from).try_normalize()))
            .collect();
        ConvexBody::new(b.to_vec(), directions, [&a, &b], 1e-9)
    }

    #[test]
    fn the_planes_of_a_shaft_are_those_of_a_frustum() {
        let body = widening();
        for z in [1.5, 3.0, 40.0] {
            for (x, y) in [(1.0, 0.0), (-1.0, 0.3), (0.5, 1.0), (-1.0, -1.0)] {
                let at = |half: f64| DVec3::new(x * half, y * half, z);
                let (inside, outside) = (at((2.0 * z - 1.0) * 0.999), at((2.0 * z - 1.0) * 1.001));
                assert!(body.may_meet_box(inside, inside), "{z} {x} {y}");
                assert!(!body.may_meet_box(outside, outside), "{z} {x} {y}");
            }
        }
        let before = DVec3::new(0.0, 0.0, 0.99);
        assert!(!body.may_meet_box(before, before), "before the second square");
    }

    #[test]
    fn the_plane_of_a_large_triangle_separates_it_from_a_shaft() {
        let body = widening();
        // The plane passes below the second square's edge x = 1, by s. From there it rises less
        // steeply than the shaft's side z = (x + 1)/2. The triangle extends across all planes of
        // the shaft.
        let corner = |x: f64, y: f64, s: f64| DVec3::new(x, y, 0.4 * (x - 1.0) + 1.0 - s);
        let slope = |s| [corner(-50.0, -90.0, s), corner(90.0, -90.0, s), corner(20.0, 180.0, s)];
        assert!(!body.may_meet_triangle(slope(2.0)));
        assert!(body.may_meet_triangle(slope(-0.5)));
    }
}
