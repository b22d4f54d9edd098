//! Rays of one eye through neighbouring pixels, and the pyramid around them.
//!
//! Invariant: the pyramid is wider than its rays by more than the rounding of the tests. It
//! excludes no box or triangle that a ray may meet.

use crate::node::{LANES, ROW, TriangleBlock, WIDTH, WideNode};
use crate::prepared::{LENGTH_SQUARED, Prepared};
use crate::simd::ChildDistances;
use crate::triangle::Directions;
use crate::{MAX_TILE, Ray};

/// Margin of the pyramid, as a share of the scene's size and of distances: about fifty roundings.
pub(crate) const SLACK: f32 = 4e-6;

/// Slope that counts as 0, because rays move by less than the margin.
const LEAST_SLOPE: f32 = 1e-7;

/// Number of rows of rays.
pub(crate) const ROWS: usize = MAX_TILE / ROW;

/// A side of the pyramid, compared with one side of a box. `(row * step + origin + shift) * factor`
/// bounds the distances along the main axis at which a ray may be in the box.
#[derive(Clone, Copy)]
struct PyramidSide {
    axis: usize,
    /// Index into `WideNode::bounds`.
    row: usize,
    shift: f32,
    factor: f32,
    /// True if it is a lower bound.
    is_lower: bool,
}

/// The rays, and the pyramid around them. Distances are along the main axis of the rays.
pub(crate) struct Bundle<'a> {
    pub rays: &'a [Ray],
    pub eye: [f32; 3],
    /// The eye's coordinates in the order of `axes`.
    origin: [f32; 3],
    axes: [usize; 3],
    /// Direction of the rays along the main axis: 1 or -1.
    sign: f32,
    /// Least and greatest slope along the minor axes.
    slopes: [(f32, f32); 2],
    sides: [PyramidSide; 6],
    pub slack: f32,
    /// Shears by axis, row and ray.
    pub shear: [[[f32; ROW]; ROWS]; 2],
    /// Distance along the main axis per unit of `t`.
    pub speed: [[f32; ROW]; ROWS],
    pub t_min: [[f32; ROW]; ROWS],
    pub directions: [Directions; ROWS],
}

impl<'a> Bundle<'a> {
    /// Makes a bundle. `None` if the rays have different main axes, do not begin at one point near
    /// the scene, or cannot all hit something.
    #[inline(always)]
    pub(crate) fn new(rays: &'a [Ray], reach: f32) -> Option<Self> {
        let first = rays.first()?;
        let eye = first.origin.to_array();
        let Prepared { axes, sheared_origin: origin, direction, .. } =
            Prepared::new(first.origin, first.direction)?;
        let main = axes[2];
        let is_reversed = direction[main % 3] < 0.0;
        let sign = if is_reversed { -1.0 } else { 1.0 };
        let mut is_one = rays.len() <= MAX_TILE && first.origin.abs().max_element() <= 2.0 * reach;
        let mut towards = [[[0.0_f32; ROW]; ROWS]; 3];
        let mut t_min = [[0.0; ROW]; ROWS];
        for (i, ray) in rays.iter().enumerate().take(MAX_TILE) {
            let (row, lane) = (i / ROW, i % ROW);
            for (axis, towards) in towards.iter_mut().enumerate() {
                towards[row][lane] = ray.direction[axis];
            }
            t_min[row][lane] = ray.t_min.max(0.0);
            is_one &=
                (ray.origin == first.origin) & !ray.t_min.is_nan() & (t_min[row][lane] < ray.t_max);
        }
        // Unused rays get the direction of the first one.
        for i in rays.len()..MAX_TILE {
            for (axis, towards) in towards.iter_mut().enumerate() {
                towards[i / ROW][i % ROW] = direction[axis];
            }
        }
        let mut slopes = [(f32::INFINITY, f32::NEG_INFINITY); 2];
        let mut shear = [[[0.0; ROW]; ROWS]; 2];
        let mut speed = [[0.0; ROW]; ROWS];
        let mut directions = [Directions::NONE; ROWS];
        for row in 0..ROWS {
            let [x, y, z] = [0, 1, 2].map(|axis: usize| &towards[axis][row]);
            let [across, up, along] = axes.map(|axis| &towards[axis % 3][row]);
            let mut fits = [true; ROW];
            for i in 0..ROW {
                let [a, b, c] = [x[i].abs(), y[i].abs(), z[i].abs()];
                let square = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
                let goes_far = LENGTH_SQUARED.contains(&square);
                let is_main = [(a >= b) & (a >= c), (a < b) | (a < c), (a < b) | (a < c)][main % 3]
                    & [true, b >= c, b < c][main % 3];
                shear[0][row][i] = across[i] / along[i];
                shear[1][row][i] = up[i] / along[i];
                speed[row][i] = along[i] * sign;
                fits[i] = goes_far & is_main & (speed[row][i] > 0.0);
            }
            is_one &= fits.iter().all(|&fits| fits);
            directions[row] = Directions::new(x, y, z);
            for (axis, (low, high)) in slopes.iter_mut().enumerate() {
                for slope in shear[axis][row].map(|shear| shear * sign) {
                    (*low, *high) = (lesser(slope, *low), greater(slope, *high));
                }
            }
        }
        if !is_one {
            return None;
        }
        let slack = SLACK * reach;
        let along = |row: usize, shift: f32, is_lower: bool| PyramidSide {
            axis: main,
            row,
            shift,
            factor: sign,
            is_lower,
        };
        let near = usize::from(is_reversed);
        let mut sides = [along(near, -slack * sign, true); 6];
        sides[1] = along(near + 1, slack * sign, false);
        for (other, &(low, high)) in slopes.iter().enumerate() {
            // Neither may be 0. The change makes the pyramid wider.
            let low = if low.abs() < LEAST_SLOPE { -LEAST_SLOPE } else { low };
            let high = if high.abs() < LEAST_SLOPE { LEAST_SLOPE } else { high };
            let axis = axes[other];
            // high * distance >= the box's least coordinate, low * distance <= its greatest.
            sides[2 + 2 * other] = PyramidSide {
                axis,
                row: 0,
                shift: -slack,
                factor: high.recip(),
                is_lower: high > 0.0,
            };
            sides[3 + 2 * other] = PyramidSide {
                axis,
                row: 1,
                shift: slack,
                factor: low.recip(),
                is_lower: low < 0.0,
            };
        }
        Some(Self {
            rays,
            eye,
            origin,
            axes,
            sign,
            slopes,
            sides,
            slack,
            shear,
            speed,
            t_min,
            directions,
        })
    }

    /// Returns the distances at which the pyramid may enter the eight boxes, and one bit per box
    /// that it may enter before `limit`.
    #[inline(always)]
    pub(crate) fn enter(&self, node: &WideNode, limit: f32) -> (ChildDistances, u32) {
        let mut near = [0.0_f32; WIDTH];
        let mut far = [limit; WIDTH];
        let origin = &self.eye;
        for side in &self.sides {
            let axis = side.axis % 3;
            let base = (node.origin[axis] - origin[axis] + side.shift) * side.factor;
            let step = node.step[axis] * side.factor;
            let row = &node.bounds[axis][side.row % 3];
            let mut at = [0.0; WIDTH];
            for i in 0..WIDTH {
                at[i] = f32::from(row[i]) * step + base;
            }
            if side.is_lower {
                for i in 0..WIDTH {
                    near[i] = greater(at[i], near[i]);
                }
            } else {
                for i in 0..WIDTH {
                    far[i] = lesser(at[i], far[i]);
                }
            }
        }
        let mut mask = 0;
        for i in 0..WIDTH {
            near[i] *= 1.0 - SLACK;
            mask |= u32::from(near[i] <= far[i] * (1.0 + SLACK) + self.slack) << i;
        }
        (ChildDistances(near), mask)
    }

    /// Returns the corners of the block's triangles relative to the origin, along the axes of the
    /// rays.
    #[inline(always)]
    pub(crate) fn relative(&self, block: &TriangleBlock) -> Corners {
        let mut corners = [[[0.0; LANES]; 3]; 3];
        for (axis, corners) in corners.iter_mut().enumerate() {
            let from = &block.vertices[self.axes[axis] % 3];
            for (vertex, lanes) in corners.iter_mut().enumerate() {
                for (lane, corner) in lanes.iter_mut().enumerate() {
                    *corner = from[vertex][lane] - self.origin[axis];
                }
            }
        }
        Corners(corners)
    }

    /// Returns one bit per triangle that is neither wholly outside the pyramid nor beyond `limit`,
    /// and the distance of each triangle's nearest corner.
    #[inline(always)]
    pub(crate) fn inside(&self, corners: &Corners, limit: f32) -> (u32, [f32; LANES]) {
        let Corners([across, up, along]) = corners;
        let mut nearest = [f32::INFINITY; LANES];
        let mut farthest = [f32::NEG_INFINITY; LANES];
        let mut beyond = [[f32::INFINITY; LANES]; 2];
        let mut before = [[f32::NEG_INFINITY; LANES]; 2];
        for vertex in 0..3 {
            for lane in 0..LANES {
                let z = along[vertex][lane] * self.sign;
                nearest[lane] = lesser(z, nearest[lane]);
                farthest[lane] = greater(z, farthest[lane]);
                for (axis, other) in [across, up].into_iter().enumerate() {
                    let (low, high) = self.slopes[axis];
                    beyond[axis][lane] = lesser(other[vertex][lane] - high * z, beyond[axis][lane]);
                    before[axis][lane] = greater(other[vertex][lane] - low * z, before[axis][lane]);
                }
            }
        }
        let mut mask = 0;
        for lane in 0..LANES {
            let is_in = (nearest[lane] <= limit + self.slack)
                & (farthest[lane] >= -self.slack)
                & (beyond[0][lane] <= self.slack)
                & (beyond[1][lane] <= self.slack)
                & (before[0][lane] >= -self.slack)
                & (before[1][lane] >= -self.slack);
            mask |= u32::from(is_in) << lane;
        }
        (mask, nearest)
    }
}

/// Returns the lesser number, or `b` if `a` is NaN: one instruction, unlike `f32::min`.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Returns the greater number, or `b` if `a` is NaN.
#[inline(always)]
pub(crate) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Indexed by axis of the rays, vertex and lane.
pub(crate) struct Corners([[[f32; LANES]; 3]; 3]);

impl Corners {
    /// Returns a lane's corners by vertex and axis.
    #[inline(always)]
    pub(crate) fn of(&self, lane: usize) -> [[f32; 3]; 3] {
        let lane = lane % LANES;
        [0, 1, 2].map(|vertex| [0, 1, 2].map(|axis: usize| self.0[axis][vertex][lane]))
    }
}
