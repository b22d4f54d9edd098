//! Rays of a beam that pass near an eye (Larson & Simmons 1999, Appendix A).
//!
//! The paper bounds the candidates by cones from two corners of a cell. Here they are found
//! exactly. The *far* cell is the one farther from the eye; its bytes resolve directions best. A
//! line through the eye and a point P of the far cell meets the plane of the *near* wall in Q. The
//! conditions that Q lies in the near cell are linear in P, once multiplied by their denominator.
//! The denominator's sign splits the far cell in two, so the candidates are at most two convex
//! polygons. Lines and half-planes are affine, so all computations are in steps, also in sheared
//! sections.
//!
//! Invariant: every ray lies in the beam. It passes within the radius of the eye, wherever byte
//! positions allow it. If the radius is less than a few roundings to bytes, it passes within these.

use glam::DVec3;

use crate::cells::{CellIndex, CellPair, RayCoords};
use crate::polygon::{Linear, Region, clip_unit_square};
use crate::section::{STEPS_PER_CELL, StepMap};
use crate::sobol::ScrambledSobol;

/// Greatest distance, in byte positions, of the search for a ray nearer to the eye, by growing
/// squares.
///
/// Without it, rays miss eyes far outside: there, one step at the near cell moves the ray by more
/// than the radius at the eye.
const SEARCH: i32 = 3;

/// Number of places that are tried for one sample before the ray nearest to the eye is used.
///
/// Near an edge that both cells touch, the two ends of a ray may be so close that no byte positions
/// around them aim well. Places in enlarged cells may miss too. With one place, only 97 % of the
/// rays passed near an eye at 1.5 section sizes from the Cornell box.
const TRIES: u32 = 8;

/// Distance from the eye, in half diagonals of a byte position, that always counts as near.
///
/// Byte positions aim exactly at the eye in few places only. If all rays moved there, the rest of
/// the picture would stay empty.
const ROUNDING: f64 = 4.0;

/// Number of samples that are tried before a beam counts as having no ray near the eye.
const PROBES: u32 = 16;

/// Greatest enlargement of a cell, in steps: more than any section has, and far from overflow.
const MAX_MARGIN: f64 = 1e9;

/// The rays of one beam near one eye.
#[derive(Clone, Debug)]
pub(crate) struct Proximity {
    frame: StepMap,
    far: CellIndex,
    near: CellIndex,
    far_is_entry: bool,
    /// In steps.
    eye: DVec3,
    /// World units.
    radius: f64,
    /// Half the diagonal of a byte position of the near cell, world units. Rounding moves a ray's
    /// end by no more.
    half_step: f64,
    /// Radius of the eye's jitter, world units: `radius` less the rounding of positions to bytes.
    jitter: f64,
    region: Region,
}

impl Proximity {
    /// Returns `None` if no ray of the beam passes within `radius` of the eye, or the eye is not
    /// finite.
    pub(crate) fn new(
        frame: StepMap,
        pair: CellPair,
        eye: DVec3,
        radius: f64,
        sequence: &ScrambledSobol,
    ) -> Option<Proximity> {
        let eye = frame.to_steps(eye);
        if !eye.is_finite() {
            return None;
        }
        let distance_of =
            |cell| frame.to_world_vector(frame.cell_point(cell, [128; 2]) - eye).length();
        let far_is_entry = distance_of(pair.entry) >= distance_of(pair.exit);
        let (far, near) =
            if far_is_entry { (pair.entry, pair.exit) } else { (pair.exit, pair.entry) };
        let (u, v) = near.directions();
        let half_step = 0.5
            * (frame.to_world_vector(DVec3::AXES[u]).length_squared()
                + frame.to_world_vector(DVec3::AXES[v]).length_squared())
            .sqrt();
        let jitter = (radius - half_step).max(0.0);
        let mut proximity = Proximity {
            frame,
            far,
            near,
            far_is_entry,
            eye,
            radius,
            half_step,
            jitter,
            region: Region::default(),
        };
        proximity.region = proximity.candidates([0.0; 2]);
        if proximity.region.is_empty() {
            // No line through the eye itself runs in the beam, but its sphere may reach into it.
            proximity.region = proximity.candidates(proximity.margins());
            let reaches = |number| proximity.best(sequence, number).1 <= radius;
            if proximity.region.is_empty() || !(0..PROBES).any(reaches) {
                return None;
            }
        }
        Some(proximity)
    }

    /// Returns the positions of a sample's ray.
    pub(crate) fn coords(&self, sequence: &ScrambledSobol, number: u32) -> RayCoords {
        self.best(sequence, number).0
    }

    /// Returns the ray of the first place that is good enough, or else the nearest ray; and its
    /// distance from the eye.
    fn best(&self, sequence: &ScrambledSobol, number: u32) -> (RayCoords, f64) {
        let good = self.radius.max(ROUNDING * self.half_step);
        let mut best = self.nearby_ray(sequence.point(number));
        for again in 1..TRIES {
            if best.1 <= good {
                break;
            }
            // A shift of every coordinate keeps the set of points well spread.
            let shift = again.wrapping_mul(0x9e37_79b9);
            let other = self.nearby_ray(sequence.point(number).map(|x| x.wrapping_add(shift)));
            if other.1 < best.1 {
                best = other;
            }
        }
        best
    }

    /// Returns a coordinate of the far cell's points, in steps, as a function of the position in
    /// the cell. Positions are 0 to 1 in each direction.
    fn far_coordinate(&self, axis: usize) -> Linear {
        let (u, v) = self.far.directions();
        if axis == u {
            Linear([STEPS_PER_CELL, 0.0, f64::from(self.far.u) * STEPS_PER_CELL])
        } else if axis == v {
            Linear([0.0, STEPS_PER_CELL, f64::from(self.far.v) * STEPS_PER_CELL])
        } else {
            Linear([0.0, 0.0, self.frame.wall_position(self.far)])
        }
    }

    /// Returns the points P of the far cell whose lines through the eye meet the near cell. The
    /// near cell is enlarged by `margins`, in steps along u and v.
    ///
    /// The near wall lies at w along axis a. Then Q = E + (P-E)(w-E_a)/D, where D = P_a-E_a. If D
    /// is positive, the condition Q_u ≥ low is (E_u-low)·D + (P_u-E_u)(w-E_a) ≥ 0, and the others
    /// are alike. If D is negative, all signs turn.
    fn candidates(&self, margins: [f64; 2]) -> Region {
        let (near, eye) = (self.near, self.eye);
        let axis = near.axis();
        let to_wall = self.frame.wall_position(near) - eye[axis];
        let denominator = self.far_coordinate(axis).combine(1.0, Linear([0.0; 3]), 0.0, -eye[axis]);
        let mut constraints = vec![denominator];
        let (u, v) = near.directions();
        for (axis, cell, margin) in [(u, near.u, margins[0]), (v, near.v, margins[1])] {
            let low = f64::from(cell) * STEPS_PER_CELL - margin;
            let high = (f64::from(cell) + 1.0) * STEPS_PER_CELL + margin;
            let across = self.far_coordinate(axis).combine(
                to_wall,
                Linear([0.0; 3]),
                0.0,
                -eye[axis] * to_wall,
            );
            constraints.push(denominator.combine(eye[axis] - low, across, 1.0, 0.0));
            constraints.push(denominator.combine(high - eye[axis], across, -1.0, 0.0));
        }
        let turned: Vec<Linear> = constraints.iter().map(|c| Linear(c.0.map(|x| -x))).collect();
        Region::new(&[clip_unit_square(&constraints), clip_unit_square(&turned)])
    }

    /// Returns margins around the near cell, in steps along u and v. If some line within the radius
    /// of the eye meets the cell, the line through the eye itself meets the cell enlarged by these.
    ///
    /// The margins are larger than necessary, because every ray is tested afterwards.
    fn margins(&self) -> [f64; 2] {
        let axis = self.near.axis();
        let wall = self.frame.wall_position(self.near);
        let reach = self.frame.steps_per_length() * self.radius;
        let (u, v) = self.near.directions();
        let mut margins = [0.0f64; 2];
        let mut signs = [false; 2];
        for corner in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
            let denominator = self.far_coordinate(axis).at(corner) - self.eye[axis];
            signs[usize::from(denominator > 0.0)] = true;
            // The plane through P parallel to the near wall passes within the radius of the eye, so
            // lines may have any direction.
            if denominator.abs() <= reach[axis] {
                return [MAX_MARGIN; 2];
            }
            let magnified = ((self.far_coordinate(axis).at(corner) - wall) / denominator).abs();
            for (margin, along) in margins.iter_mut().zip([u, v]) {
                let slope =
                    ((self.far_coordinate(along).at(corner) - self.eye[along]) / denominator).abs();
                *margin = margin
                    .max(2.0 * magnified * (reach[along] + reach[axis] * slope))
                    .min(MAX_MARGIN);
            }
        }
        if signs == [true; 2] { [MAX_MARGIN; 2] } else { margins }
    }

    /// Returns the ray of one point of the sequence, and its distance from the eye. The first two
    /// coordinates give the far position, the others the eye's jitter.
    fn nearby_ray(&self, point: [u32; 4]) -> (RayCoords, f64) {
        let [s, t, disk_area, disk_angle] = point.map(|x| (f64::from(x) + 0.5) / 4_294_967_296.0);
        let far_bytes = self.region.sample(s, t).map(|x| (x * STEPS_PER_CELL) as u8);
        let far = self.frame.cell_point(self.far, far_bytes);
        let to_eye = self.frame.to_world_vector(self.eye - far);
        if to_eye.length() <= self.radius {
            // Every ray through this position passes near enough.
            let near_bytes = [disk_area, disk_angle].map(|x| (x * STEPS_PER_CELL) as u8);
            return self.measured(far_bytes, near_bytes);
        }
        let (side, up) = to_eye.normalize().any_orthonormal_pair();
        let (sin, cos) = (disk_angle * std::f64::consts::TAU).sin_cos();
        let jittered = self.eye
            + self
                .frame
                .to_steps_vector((side * cos + up * sin) * (self.jitter * disk_area.sqrt()));
        // Positions beyond the cell's borders are mirrored. Rays stay evenly spread, and none moves
        // farther from the ray without jitter.
        let mirror = |x: f64| {
            let x = x.rem_euclid(2.0 * STEPS_PER_CELL);
            x.min(2.0 * STEPS_PER_CELL - x) as u8
        };
        let chosen = self.measured(far_bytes, self.near_position(far, jittered).map(mirror));
        if chosen.1 <= self.radius { chosen } else { self.nearest_around(far_bytes, chosen) }
    }

    /// Returns the ray nearest to the eye among the byte positions around one of the far cell, or
    /// the first within the radius.
    fn nearest_around(&self, [u, v]: [u8; 2], chosen: (RayCoords, f64)) -> (RayCoords, f64) {
        let mut best = chosen;
        for ring in 0..=SEARCH {
            for du in -ring..=ring {
                for dv in -ring..=ring {
                    let on_ring = du.abs() == ring || dv.abs() == ring;
                    let (Ok(u), Ok(v)) =
                        (u8::try_from(i32::from(u) + du), u8::try_from(i32::from(v) + dv))
                    else {
                        continue;
                    };
                    if !on_ring {
                        continue;
                    }
                    // The conversion saturates: a line beside the cell gets its border, and one
                    // along the wall (NaN) its corner.
                    let near = self
                        .near_position(self.frame.cell_point(self.far, [u, v]), self.eye)
                        .map(|x| x as u8);
                    let candidate = self.measured([u, v], near);
                    if candidate.1 < best.1 {
                        best = candidate;
                    }
                }
            }
            if best.1 <= self.radius.max(self.half_step) {
                break;
            }
        }
        best
    }

    /// Returns where the line from a far point through the eye meets the near wall, in steps from
    /// the near cell's corner. Both points are in steps.
    fn near_position(&self, far: DVec3, eye: DVec3) -> [f64; 2] {
        let axis = self.near.axis();
        let along = (self.frame.wall_position(self.near) - far[axis]) / (eye[axis] - far[axis]);
        let met = far + (eye - far) * along;
        let (u, v) = self.near.directions();
        [
            met[u] - f64::from(self.near.u) * STEPS_PER_CELL,
            met[v] - f64::from(self.near.v) * STEPS_PER_CELL,
        ]
    }

    /// Returns the ray of these byte positions, and its distance from the eye in world units.
    fn measured(&self, far_bytes: [u8; 2], near_bytes: [u8; 2]) -> (RayCoords, f64) {
        let far = self.frame.cell_point(self.far, far_bytes);
        let direction =
            self.frame.to_world_vector(self.frame.cell_point(self.near, near_bytes) - far);
        let distance = self.frame.to_world_vector(self.eye - far).cross(direction).length()
            / direction.length();
        let ([a, b], [c, d]) =
            if self.far_is_entry { (far_bytes, near_bytes) } else { (near_bytes, far_bytes) };
        (RayCoords([a, b, c, d]), distance)
    }
}
