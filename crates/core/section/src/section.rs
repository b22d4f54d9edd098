//! A section: a gridded parallelepiped, and the rays between its cells.
//!
//! Computations are in *steps*: 256ths of a cell along each axis from the section's origin. In
//! steps the middle of every byte position is a half-integer and every wall an integer. Both are
//! exact in `f64`, so directions never come from differences of rounded world points.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::cells::{BeamId, CellIndex, CellPair, Numbering, RayCoords};

/// Most cells along one axis. A section then has 30·64⁴ beams; a directory of more is not
/// practical. The paper recommends 4 to 24 cells.
pub const MAX_GRID: u32 = 64;

/// Number of beams of a default grid: the middle of 50,000 to 500,000 on a logarithmic scale
/// (Larson & Simmons 1999, §2.1).
pub const USUAL_BEAMS: f64 = 158_000.0;

/// Steps in a cell along one direction: one for each byte position.
pub(crate) const STEPS_PER_CELL: f64 = 256.0;

/// Least distance between opposite walls, relative to the diagonal.
///
/// In flatter sections, byte positions of grazing rays cannot be distinguished. Rounding a
/// direction to 2⁻⁵³ moves their exit points by up to 1.2e-7 steps, divided by this ratio.
const MIN_FLATNESS: f64 = 1e-5;

/// Greatest uncertainty of a world point, in steps. Byte positions are 1 step apart.
const MAX_UNCERTAINTY: f64 = 0.45;

/// Coordinates and lengths beyond these overflow or underflow when squared or multiplied.
const MAX_COORDINATE: f64 = 1e60;
const MIN_LENGTH: f64 = 1e-60;

/// The side of a section where its views are (Larson & Simmons 1999, §2.1).
#[derive(Serialize, Deserialize, Copy, Clone, Debug, PartialEq, Eq, Hash)]
pub enum ViewClass {
    /// Views look out of the section.
    Interior,
    /// Views look into the section.
    Exterior,
}

/// The numbers that define a section. [`Section::new`] checks them.
#[derive(Serialize, Deserialize, Clone, Debug, PartialEq)]
pub struct SectionSpec {
    /// One corner, in world units.
    pub origin: [f64; 3],
    /// The three edges from that corner, in world units; they need not be perpendicular.
    pub axes: [[f64; 3]; 3],
    /// Cells along each axis, 1 to [`MAX_GRID`].
    pub grid: [u32; 3],
    /// The side of the section where its views are.
    pub class: ViewClass,
    /// True if geometry inside the section is visible: see [`Section::trace_start`].
    pub obstructions: bool,
}

/// The reason why a section is refused.
#[derive(Error, Debug, Clone, PartialEq)]
pub enum SectionError {
    /// A coordinate is not a number, or too large.
    #[error("section origin and axes must be finite numbers below {MAX_COORDINATE:e}, found {0}")]
    Coordinate(f64),
    /// The grid has no cells along an axis, or too many.
    #[error(
        "section grid must have 1 to {MAX_GRID} cells along each axis, found {} {} {}",
        .0[0], .0[1], .0[2]
    )]
    Grid([u32; 3]),
    /// The axes span no volume, or the section is too flat.
    #[error(
        "section axes {axes:?} are degenerate: opposite walls are {height:e} apart, which must be \
         at least {MIN_FLATNESS} of the diagonal {diagonal:e}"
    )]
    Degenerate {
        /// The axes as given.
        axes: [[f64; 3]; 3],
        /// Least distance between opposite walls.
        height: f64,
        /// Longest space diagonal.
        diagonal: f64,
    },
    /// The section is too small for its distance from the world's origin.
    #[error(
        "section at {origin:?} is too small, or its grid too fine: so far from the origin, \
         coordinates are uncertain by {uncertainty:.2} of a 256th of a cell; move the scene nearer \
         to the origin"
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

/// Returns the distance of the ray's infinite line from the eye, world units.
pub fn ray_eye_distance(ray: &SectionRay, eye: DVec3) -> f64 {
    (eye - ray.origin).cross(ray.direction).length()
}

/// The affine map between world coordinates and steps.
#[derive(Copy, Clone, Debug, PartialEq)]
pub(crate) struct StepMap {
    pub(crate) origin: DVec3,
    /// World vectors of one step along each axis.
    step: [DVec3; 3],
    /// The rows of the inverse: steps = dual · (world - origin).
    dual: [DVec3; 3],
    /// Number of steps along each axis: 256 × cells.
    pub(crate) size: DVec3,
    /// Sum of the axes' absolute values: a bound on world offsets in the section, for error bounds.
    extent: DVec3,
}

impl StepMap {
    fn new(origin: DVec3, axes: [DVec3; 3], grid: [u32; 3]) -> Self {
        let size = DVec3::from_array(grid.map(|n| f64::from(n) * STEPS_PER_CELL));
        let [a, b, c] = axes;
        let det = a.dot(b.cross(c));
        let dual = [b.cross(c), c.cross(a), a.cross(b)];
        StepMap {
            origin,
            step: [a / size.x, b / size.y, c / size.z],
            dual: [dual[0] * (size.x / det), dual[1] * (size.y / det), dual[2] * (size.z / det)],
            size,
            extent: a.abs() + b.abs() + c.abs(),
        }
    }

    /// Returns the world vector of a difference in steps.
    pub(crate) fn to_world_vector(self, steps: DVec3) -> DVec3 {
        self.step[0] * steps.x + self.step[1] * steps.y + self.step[2] * steps.z
    }

    pub(crate) fn to_world(self, steps: DVec3) -> DVec3 {
        self.origin + self.to_world_vector(steps)
    }

    /// Returns a world vector in steps.
    pub(crate) fn to_steps_vector(self, world: DVec3) -> DVec3 {
        DVec3::new(self.dual[0].dot(world), self.dual[1].dot(world), self.dual[2].dot(world))
    }

    pub(crate) fn to_steps(self, world: DVec3) -> DVec3 {
        self.to_steps_vector(world - self.origin)
    }

    /// Returns how far, in steps, the rounding of a world point inside the section to `f64` can
    /// move it.
    pub(crate) fn uncertainty(self, world: DVec3) -> DVec3 {
        // The first term is half a unit in the last place of the point itself. The second covers
        // the few operations on offsets in the section.
        let error = (world.abs() * 0.51 + self.extent * 4.0) * f64::EPSILON;
        DVec3::new(
            self.dual[0].abs().dot(error),
            self.dual[1].abs().dot(error),
            self.dual[2].abs().dot(error),
        )
    }

    /// Returns the most steps along each axis that a world vector of length 1 can span.
    pub(crate) fn steps_per_length(self) -> DVec3 {
        DVec3::from_array(self.dual.map(DVec3::length))
    }

    /// Returns a byte position on a wall, in steps. It is exact.
    pub(crate) fn cell_point(self, cell: CellIndex, bytes: [u8; 2]) -> DVec3 {
        let (u, v) = cell.directions();
        let mut point = DVec3::ZERO;
        point[cell.axis()] = self.wall_position(cell);
        point[u] = f64::from(u32::from(cell.u) * 256 + u32::from(bytes[0])) + 0.5;
        point[v] = f64::from(u32::from(cell.v) * 256 + u32::from(bytes[1])) + 0.5;
        point
    }

    /// Returns where a cell's wall cuts its axis, in steps.
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
    pub(crate) frame: StepMap,
    numbering: Numbering,
    axes: [DVec3; 3],
    diagonal: f64,
}

impl Section {
    /// Checks a specification.
    ///
    /// # Errors
    /// If a coordinate is not finite, the grid is outside 1 to [`MAX_GRID`], or the axes span
    /// nearly no volume. Also if the section is so small, and so far from the world's origin, that
    /// `f64` coordinates cannot distinguish its byte positions.
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
        // This form also refuses NaN, the height of zero or underflowed axes.
        if !heights.into_iter().all(|h| h >= MIN_FLATNESS * diagonal && h >= MIN_LENGTH) {
            return Err(SectionError::Degenerate { axes: spec.axes, height, diagonal });
        }
        let origin = DVec3::from_array(spec.origin);
        let frame = StepMap::new(origin, axes, spec.grid);
        let farthest = origin.abs() + frame.extent;
        let uncertainty = frame.uncertainty(farthest).max_element();
        if uncertainty > MAX_UNCERTAINTY {
            return Err(SectionError::Unresolved { origin: spec.origin, uncertainty });
        }
        Ok(Section { numbering: Numbering::new(spec.grid), frame, axes, diagonal, spec })
    }

    /// Returns a grid for these axes with about [`USUAL_BEAMS`] beams.
    pub fn default_grid(axes: [[f64; 3]; 3]) -> [u32; 3] {
        Self::grid_near(axes, USUAL_BEAMS)
    }

    /// Returns a grid for these axes with about `beams` beams.
    ///
    /// Its cells are as close to cubes as 4 to 24 cells along an axis allow. An axis of length 0
    /// gets 4 cells.
    pub fn grid_near(axes: [[f64; 3]; 3], beams: f64) -> [u32; 3] {
        let lengths = axes.map(|a| DVec3::from_array(a).length());
        let longest = lengths.into_iter().fold(0.0, f64::max);
        let grid_for = |cells_along_longest: f64| {
            lengths.map(|length| {
                (length / longest * cells_along_longest).round().clamp(4.0, 24.0) as u32
            })
        };
        let miss = |grid: [u32; 3]| (Numbering::new(grid).beam_count() as f64 / beams).ln().abs();
        // 4 to 24 cells along the longest axis, in steps fine enough to meet every such grid.
        (0..=1000)
            .map(|i| grid_for(4.0 + 0.02 * f64::from(i)))
            // Axes of length 0 give NaN, which was converted to 0.
            .map(|grid| grid.map(|n| n.max(4)))
            .min_by(|&a, &b| miss(a).total_cmp(&miss(b)))
            .unwrap_or([4; 3])
    }

    /// Returns the specification that the section was made from.
    pub fn spec(&self) -> &SectionSpec {
        &self.spec
    }

    /// Returns the longest of the four space diagonals, world units.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// Returns the volume, world units cubed.
    pub fn volume(&self) -> f64 {
        self.axes[0].dot(self.axes[1].cross(self.axes[2])).abs()
    }

    /// Returns the number of beams: 2W²D²+2W²H²+2D²H²+8W²DH+8WD²H+8WDH² for a W×D×H grid (Larson &
    /// Simmons 1999, §2.1).
    pub fn beam_count(&self) -> u64 {
        self.numbering.beam_count()
    }

    /// Returns whether both cells are cells of this section, on different walls.
    pub fn contains_pair(&self, pair: CellPair) -> bool {
        self.numbering.contains(pair)
    }

    /// Returns the number of a beam. The pair must be one of this section's, by
    /// [`contains_pair`](Self::contains_pair); for others the number has no meaning.
    pub fn beam(&self, pair: CellPair) -> BeamId {
        self.numbering.beam(pair)
    }

    /// Returns the two cells of a beam; `None` if the section has no such beam.
    pub fn cells(&self, beam: BeamId) -> Option<CellPair> {
        self.numbering.cells(beam)
    }

    /// Returns the ray of a beam at these byte positions, from its entry to its exit point.
    pub fn ray(&self, pair: CellPair, coords: RayCoords) -> SectionRay {
        self.frame.ray(pair, coords)
    }

    /// Returns a world point as fractions of the axes: (0,0,0) to (1,1,1) inside.
    pub fn world_to_local(&self, point: DVec3) -> DVec3 {
        self.frame.to_steps(point) / self.frame.size
    }

    /// Returns the world point at these fractions of the axes.
    pub fn local_to_world(&self, local: DVec3) -> DVec3 {
        self.frame.to_world(local * self.frame.size)
    }

    /// Returns whether the world point is inside or on a wall.
    pub fn contains(&self, point: DVec3) -> bool {
        let local = self.world_to_local(point);
        local.cmpge(DVec3::ZERO).all() && local.cmple(DVec3::ONE).all()
    }

    /// Returns the distance from a ray's entry point at which tracing starts.
    ///
    /// It starts at the entry wall if geometry inside is visible: with `obstructions`, or in an
    /// exterior section. Otherwise it starts at the exit wall.
    pub fn trace_start(&self, ray: &SectionRay) -> f64 {
        if self.spec.obstructions || self.spec.class == ViewClass::Exterior {
            0.0
        } else {
            ray.length
        }
    }
}

/// Returns the distances between opposite walls.
fn heights([a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let height =
        |across: DVec3, u: DVec3, v: DVec3| (across.dot(u.cross(v)) / u.cross(v).length()).abs();
    [height(a, b, c), height(b, c, a), height(c, a, b)]
}
