//! A section: a gridded parallelepiped, and the rays between its cells.
//!
//! Works in *steps*: 256ths of a cell along each axis from the section's origin. In steps the middle of every byte
//! position is a half-integer and every wall an integer, both exact in `f64`, so directions never come from differences
//! of rounded world points.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::cells::{BeamId, CellIndex, CellPair, Numbering, RayCoords, locality_key};

/// Most cells along one axis: 30·64⁴ beams, more than which no directory of beams is practical (the paper recommends 4
/// to 24).
pub const MAX_GRID: u32 = 64;

/// Byte positions in a cell along one direction.
pub(crate) const STEPS_PER_CELL: f64 = 256.0;

/// Least distance between opposite walls, relative to the diagonal. Flatter sections could not tell the byte positions
/// of grazing rays apart: a direction rounded to 2⁻⁵³ moves their exit points by up to 1.2e-7 steps, divided by this
/// ratio.
const MIN_FLATNESS: f64 = 1e-5;

/// Most uncertainty of a world point, in steps, that still tells byte positions (1 step apart) from each other.
const MAX_UNCERTAINTY: f64 = 0.45;

/// Lengths and coordinates beyond these over- or underflow when squared or multiplied.
const MAX_COORDINATE: f64 = 1e60;
const MIN_LENGTH: f64 = 1e-60;

/// Where view rays originate, and so which geometry is seen (paper §2.1).
#[derive(Serialize, Deserialize, Copy, Clone, Debug, PartialEq, Eq, Hash)]
pub enum ViewClass {
    /// One looks out of the section.
    Interior,
    /// One looks into it.
    Exterior,
}

/// What defines a section, as read from a command line or a file; [`Section::new`] checks it.
#[derive(Serialize, Deserialize, Clone, Debug, PartialEq)]
pub struct SectionSpec {
    /// One corner, in world units.
    pub origin: [f64; 3],
    /// The three edges from that corner, in world units; they need not be perpendicular.
    pub axes: [[f64; 3]; 3],
    /// Cells along each axis, 1 to [`MAX_GRID`].
    pub grid: [u32; 3],
    /// Interior or exterior.
    pub class: ViewClass,
    /// Whether geometry inside the section is seen: see [`Section::trace_start`].
    pub obstructions: bool,
}

/// Why a section is refused.
#[derive(Error, Debug, Clone, PartialEq)]
pub enum SectionError {
    /// A coordinate is not a number, or absurdly large.
    #[error("section origin and axes must be finite numbers below {MAX_COORDINATE:e}, found {0}")]
    Coordinate(f64),
    /// The grid has no cells, or too many.
    #[error("section grid must have 1 to {MAX_GRID} cells along each axis, found {} {} {}", .0[0], .0[1], .0[2])]
    Grid([u32; 3]),
    /// The axes span no volume.
    #[error(
        "section axes {axes:?} are degenerate: opposite walls are {height:e} apart, which must be at least \
         {MIN_FLATNESS} of the diagonal {diagonal:e}"
    )]
    Degenerate {
        /// The axes as given.
        axes: [[f64; 3]; 3],
        /// Least distance between opposite walls.
        height: f64,
        /// Longest space diagonal.
        diagonal: f64,
    },
    /// Too small for its distance from the world's origin.
    #[error(
        "section at {origin:?} is too small or its grid too fine for its place: world coordinates there are uncertain \
         by {uncertainty:.2} of a 256th of a cell; move the scene nearer to the origin"
    )]
    Unresolved {
        /// The section's origin.
        origin: [f64; 3],
        /// Rounding error of a world point, in 256ths of a cell.
        uncertainty: f64,
    },
}

/// A ray through a section, from its entry point to its exit point.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct SectionRay {
    /// Entry point, world.
    pub origin: DVec3,
    /// Unit direction, world.
    pub direction: DVec3,
    /// Distance from the entry to the exit point, world units.
    pub length: f64,
}

/// Distance of the ray's infinite line from the eye, world units.
pub fn ray_eye_distance(ray: &SectionRay, eye: DVec3) -> f64 {
    (eye - ray.origin).cross(ray.direction).length()
}

/// The affine map between world coordinates and steps.
#[derive(Copy, Clone, Debug, PartialEq)]
pub(crate) struct Frame {
    pub(crate) origin: DVec3,
    /// World vectors of one step along each axis.
    step: [DVec3; 3],
    /// Rows of the inverse: steps = dual · (world - origin).
    dual: [DVec3; 3],
    /// Steps along each axis: 256 × cells.
    pub(crate) size: DVec3,
    /// Sum of the axes' absolute values: how large world offsets in the section can be, for error bounds.
    extent: DVec3,
}

impl Frame {
    fn new(origin: DVec3, axes: [DVec3; 3], grid: [u32; 3]) -> Self {
        let size = DVec3::from_array(grid.map(|n| f64::from(n) * STEPS_PER_CELL));
        let [a, b, c] = axes;
        let det = a.dot(b.cross(c));
        let dual = [b.cross(c), c.cross(a), a.cross(b)];
        Frame {
            origin,
            step: [a / size.x, b / size.y, c / size.z],
            dual: [dual[0] * (size.x / det), dual[1] * (size.y / det), dual[2] * (size.z / det)],
            size,
            extent: a.abs() + b.abs() + c.abs(),
        }
    }

    /// World vector of a difference in steps.
    pub(crate) fn to_world_vector(self, steps: DVec3) -> DVec3 {
        self.step[0] * steps.x + self.step[1] * steps.y + self.step[2] * steps.z
    }

    pub(crate) fn to_world(self, steps: DVec3) -> DVec3 {
        self.origin + self.to_world_vector(steps)
    }

    /// Steps of a world vector.
    pub(crate) fn to_steps_vector(self, world: DVec3) -> DVec3 {
        DVec3::new(self.dual[0].dot(world), self.dual[1].dot(world), self.dual[2].dot(world))
    }

    pub(crate) fn to_steps(self, world: DVec3) -> DVec3 {
        self.to_steps_vector(world - self.origin)
    }

    /// How far, in steps, the rounding of a world point inside the section to `f64` can move it.
    pub(crate) fn uncertainty(self, world: DVec3) -> DVec3 {
        // Half a unit in the last place of the point itself; the rest covers the few operations on offsets in the
        // section.
        let error = (world.abs() * 0.51 + self.extent * 4.0) * f64::EPSILON;
        DVec3::new(
            self.dual[0].abs().dot(error),
            self.dual[1].abs().dot(error),
            self.dual[2].abs().dot(error),
        )
    }

    /// Most steps along each axis that a world vector of length 1 can span.
    pub(crate) fn steps_per_length(self) -> DVec3 {
        DVec3::from_array(self.dual.map(DVec3::length))
    }

    /// A byte position on a wall, in steps; exact.
    pub(crate) fn cell_point(self, cell: CellIndex, bytes: [u8; 2]) -> DVec3 {
        let (u, v) = cell.directions();
        let mut point = DVec3::ZERO;
        point[cell.axis()] = self.wall_position(cell);
        point[u] = f64::from(u32::from(cell.u) * 256 + u32::from(bytes[0])) + 0.5;
        point[v] = f64::from(u32::from(cell.v) * 256 + u32::from(bytes[1])) + 0.5;
        point
    }

    /// Where a cell's wall cuts its axis, in steps.
    pub(crate) fn wall_position(self, cell: CellIndex) -> f64 {
        if cell.side() == 0 { 0.0 } else { self.size[cell.axis()] }
    }

    pub(crate) fn ray(self, pair: CellPair, coords: RayCoords) -> SectionRay {
        let [eu, ev, xu, xv] = coords.0;
        let entry = self.cell_point(pair.entry, [eu, ev]);
        let exit = self.cell_point(pair.exit, [xu, xv]);
        let across = self.to_world_vector(exit - entry);
        let length = across.length();
        SectionRay { origin: self.to_world(entry), direction: across / length, length }
    }
}

/// A section, valid by construction.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    spec: SectionSpec,
    pub(crate) frame: Frame,
    numbering: Numbering,
    axes: [DVec3; 3],
    diagonal: f64,
}

impl Section {
    /// Checks a specification.
    ///
    /// # Errors
    /// Coordinates that are not finite, a grid outside 1 to [`MAX_GRID`], axes that span (nearly) no volume, or a
    /// section so small and far from the world's origin that `f64` world coordinates cannot tell its byte positions
    /// apart.
    pub fn new(spec: SectionSpec) -> Result<Section, SectionError> {
        for &x in spec.origin.iter().chain(spec.axes.iter().flatten()) {
            if !x.is_finite() || x.abs() > MAX_COORDINATE {
                return Err(SectionError::Coordinate(x));
            }
        }
        if spec.grid.iter().any(|n| !(1..=MAX_GRID).contains(n)) {
            return Err(SectionError::Grid(spec.grid));
        }
        let axes = spec.axes.map(DVec3::from_array);
        let [a, b, c] = axes;
        let diagonal = [a + b + c, a + b - c, a - b + c, b + c - a]
            .iter()
            .map(|d| d.length())
            .fold(0.0, f64::max);
        let heights = heights(axes);
        let height = heights.into_iter().fold(f64::INFINITY, f64::min);
        // Written so that a NaN height (of zero or underflowed axes) is refused too.
        if !heights.into_iter().all(|h| h >= MIN_FLATNESS * diagonal && h >= MIN_LENGTH) {
            return Err(SectionError::Degenerate { axes: spec.axes, height, diagonal });
        }
        let origin = DVec3::from_array(spec.origin);
        let frame = Frame::new(origin, axes, spec.grid);
        let farthest = origin.abs() + frame.extent;
        let uncertainty = frame.uncertainty(farthest).max_element();
        if uncertainty > MAX_UNCERTAINTY {
            return Err(SectionError::Unresolved { origin: spec.origin, uncertainty });
        }
        Ok(Section { numbering: Numbering::new(spec.grid), frame, axes, diagonal, spec })
    }

    /// A grid for these axes: cells as near to cubes as 4 to 24 cells a side allow, with 50,000 to 500,000 beams (paper
    /// §2.1), as near to the middle of that range (on a logarithmic scale) as can be. Axes without length get 4 cells.
    pub fn default_grid(axes: [[f64; 3]; 3]) -> [u32; 3] {
        const TARGET: f64 = 158_000.0;
        let lengths = axes.map(|a| DVec3::from_array(a).length());
        let longest = lengths.into_iter().fold(0.0, f64::max);
        let grid_for = |cells_along_longest: f64| {
            lengths.map(|length| {
                (length / longest * cells_along_longest).round().clamp(4.0, 24.0) as u32
            })
        };
        let miss = |grid: [u32; 3]| (Numbering::new(grid).beam_count() as f64 / TARGET).ln().abs();
        // 4 to 24 cells along the longest axis in steps fine enough that every grid on the way is met.
        (0..=1000)
            .map(|i| grid_for(4.0 + 0.02 * f64::from(i)))
            // NaN, of axes without length, became 0.
            .map(|grid| grid.map(|n| n.max(4)))
            .min_by(|&a, &b| miss(a).total_cmp(&miss(b)))
            .unwrap_or([4; 3])
    }

    /// The specification that the section was made from.
    pub fn spec(&self) -> &SectionSpec {
        &self.spec
    }

    /// Longest of the four space diagonals, world units.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// Volume, world units cubed.
    pub fn volume(&self) -> f64 {
        self.axes[0].dot(self.axes[1].cross(self.axes[2])).abs()
    }

    /// Number of beams: 2W²D²+2W²H²+2D²H²+8W²DH+8WD²H+8WDH² for a W×D×H grid (paper §2.1).
    pub fn beam_count(&self) -> u64 {
        self.numbering.beam_count()
    }

    /// Whether both cells are cells of this section, on different walls.
    pub fn contains_pair(&self, pair: CellPair) -> bool {
        self.numbering.contains(pair)
    }

    /// Number of a beam. The pair must be one of this section's ([`contains_pair`](Self::contains_pair)): for others
    /// the number is some beam's or none's.
    pub fn beam(&self, pair: CellPair) -> BeamId {
        self.numbering.beam(pair)
    }

    /// The two cells of a beam; `None` when the section has no such beam.
    pub fn cells(&self, beam: BeamId) -> Option<CellPair> {
        self.numbering.cells(beam)
    }

    /// A key by which to order beams so that those with neighbouring cells at both ends come near each other: wall
    /// pair, then the Morton order of the four cell indices. Distinct beams have distinct keys; `u64::MAX` when there
    /// is no such beam.
    pub fn locality_key(&self, beam: BeamId) -> u64 {
        self.cells(beam).map_or(u64::MAX, locality_key)
    }

    /// The ray of a beam at the given byte positions, from its entry to its exit point.
    pub fn ray(&self, pair: CellPair, coords: RayCoords) -> SectionRay {
        self.frame.ray(pair, coords)
    }

    /// World point to fractions of the axes: (0,0,0) to (1,1,1) inside.
    pub fn world_to_local(&self, point: DVec3) -> DVec3 {
        self.frame.to_steps(point) / self.frame.size
    }

    /// Fractions of the axes to world point.
    pub fn local_to_world(&self, local: DVec3) -> DVec3 {
        self.frame.to_world(local * self.frame.size)
    }

    /// Whether the world point is inside or on a wall.
    pub fn contains(&self, point: DVec3) -> bool {
        let local = self.world_to_local(point);
        local.cmpge(DVec3::ZERO).all() && local.cmple(DVec3::ONE).all()
    }

    /// Euclidean distance from a world point to the section, 0 inside; exact for sheared sections too.
    pub fn distance_to(&self, point: DVec3) -> f64 {
        if self.contains(point) {
            return 0.0;
        }
        let [a, b, c] = self.axes;
        let p = point - self.frame.origin;
        [(a, b, c), (b, c, a), (c, a, b)]
            .into_iter()
            .map(|(u, v, across)| {
                distance_to_parallelogram(p, u, v).min(distance_to_parallelogram(p - across, u, v))
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Where along a ray (distance from its entry point) tracing starts: at the entry wall when things inside are to be
    /// seen (`obstructions`, or an exterior section), otherwise at the exit wall.
    pub fn trace_start(&self, ray: &SectionRay) -> f64 {
        if self.spec.obstructions || self.spec.class == ViewClass::Exterior {
            0.0
        } else {
            ray.length
        }
    }
}

/// Distances between opposite walls.
fn heights([a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let height =
        |across: DVec3, u: DVec3, v: DVec3| (across.dot(u.cross(v)) / u.cross(v).length()).abs();
    [height(a, b, c), height(b, c, a), height(c, a, b)]
}

/// Distance from `p` to the parallelogram at the origin with edges `u` and `v`.
fn distance_to_parallelogram(p: DVec3, u: DVec3, v: DVec3) -> f64 {
    let normal = u.cross(v);
    let area2 = normal.length_squared();
    let (s, t) = (p.cross(v).dot(normal) / area2, u.cross(p).dot(normal) / area2);
    if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
        return p.dot(normal).abs() / area2.sqrt();
    }
    let to_segment = |p: DVec3, edge: DVec3| {
        let along = (p.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        (p - edge * along).length()
    };
    to_segment(p, u).min(to_segment(p, v)).min(to_segment(p - v, u)).min(to_segment(p - u, v))
}
