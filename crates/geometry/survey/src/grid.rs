//! A scene as cubic cells, each free or touched by a surface.
//!
//! Invariant: no step between cells that share a face crosses a surface. If a surface lies between
//! two such cells, at least one of them is touched.

use glam::{DVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::Scene;

use crate::clip;
use crate::frame::UprightAxes;

/// Most cells of a grid: one byte of memory each.
pub const MAX_CELLS: f64 = 4e6;

/// Most cells along an axis.
const MAX_SIDE: f64 = 400.0;

/// Most points on triangles by which cells are marked: about a second. Scenes with more, such as
/// thousands of triangles as large as the scene, get larger cells.
const MAX_POINTS: f64 = 1e8;

/// Share of corners beyond each end of an axis that may be far outliers, such as the ground plane
/// below a house.
const OUTLIERS: f64 = 0.01;

/// Least ratio of the bounds to the extent without outliers for the bounds to be cut to that
/// extent.
const FAR: f64 = 4.0;

/// The cells of a scene, in local coordinates relative to the scene's origin.
pub(crate) struct SceneGrid {
    pub frame: UprightAxes,
    /// The lowest corner.
    pub low: DVec3,
    /// The side of a cell.
    pub cell: f64,
    /// Number of cells to the right, ahead and up.
    pub size: [usize; 3],
    touched: Vec<bool>,
}

impl SceneGrid {
    /// Makes the grid of a scene. `None` if it has no triangle or is a point.
    pub(crate) fn new(raycaster: &Raycaster, frame: UprightAxes) -> Option<SceneGrid> {
        let scene = raycaster.scene();
        let local = |p: Vec3| frame.to_local(p.as_dvec3());
        let (low, high) = extent(&points(scene, local))?;
        let size = high - low;
        if size.max_element() <= 0.0 || !size.is_finite() {
            return None;
        }
        // A flat scene needs cells, too.
        let thick = size.max(DVec3::splat(size.max_element() * 0.01));
        let volume = thick.x * thick.y * thick.z;
        let cell = (volume / MAX_CELLS).cbrt().max(thick.max_element() / MAX_SIDE);
        let longest = thick.length() / cell;
        let points = |triangle| {
            let [a, b, c] = scene.corners(triangle).map(|p| local(p) / cell);
            let [along, across] = steps(b - a, c - a).map(|count| count.min(2.0 * longest));
            // Larger cells save nothing of a small triangle's four points.
            (along + 1.0) * (across + 1.0) - 4.0
        };
        let points: f64 = scene.triangles().map(points).sum();
        let cell = cell * (points / MAX_POINTS).sqrt().max(1.0);
        let counts = (thick / cell).ceil() + 2.0;
        let low = low - (counts * cell - size) * 0.5;
        let size = counts.to_array().map(|n| n as usize);
        let touched = vec![false; size.iter().product()];
        let mut grid = SceneGrid { frame, low, cell, size, touched };
        for triangle in scene.triangles() {
            grid.touch(scene.corners(triangle).map(local));
        }
        Some(grid)
    }

    /// Marks the cells that a triangle touches, by points on it at most half a cell apart.
    fn touch(&mut self, triangle: [DVec3; 3]) {
        let size = DVec3::from_array(self.size.map(|n| n as f64));
        let polygon = clip::to_box(triangle.map(|p| (p - self.low) / self.cell), size);
        for k in 2..polygon.len() {
            let (a, p, q) = (polygon[0], polygon[k - 1] - polygon[0], polygon[k] - polygon[0]);
            let [along, across] = steps(p, q);
            for i in 0..=along as usize {
                let u = i as f64 / along;
                for j in 0..=across as usize {
                    let v = j as f64 / across * (1.0 - u);
                    self.touch_point(a + p * u + q * v);
                }
            }
        }
    }

    fn touch_point(&mut self, point: DVec3) {
        let at = point.to_array().map(|c| c.max(0.0) as usize);
        let within = [0, 1, 2].map(|axis| at[axis].min(self.size[axis] - 1));
        let index = self.index(within);
        self.touched[index] = true;
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.size[1] + y) * self.size[2] + z
    }

    /// Returns the column of cells at a place, from below.
    pub(crate) fn column(&self, x: usize, y: usize) -> &[bool] {
        &self.touched[self.index([x, y, 0])..][..self.size[2]]
    }

    /// Returns the middle of a cell.
    pub(crate) fn middle(&self, at: [usize; 3]) -> DVec3 {
        self.low + (DVec3::from_array(at.map(|c| c as f64)) + 0.5) * self.cell
    }
}

/// Returns the steps along and across a triangle with these two sides, in cells. Points of
/// neighbouring steps are at most half a cell apart.
fn steps(p: DVec3, q: DVec3) -> [f64; 2] {
    let count = |side: DVec3| (2.0 * side.length()).ceil().max(1.0);
    [count(p), count(q).max(count(q - p))]
}

/// Most corners of a scene with instances whose extent is determined. All of them would take more
/// memory than the scene.
const MOST_OF_INSTANCES: usize = 1 << 20;

/// Returns the corners of a scene in local coordinates. If instances make them too many, these are
/// the outermost ones and an even selection.
fn points(scene: &Scene, local: impl Fn(Vec3) -> DVec3) -> Vec<DVec3> {
    let all = || scene.points().map(&local);
    if scene.instances().is_empty() {
        return all().collect();
    }
    let mut outermost: [Option<DVec3>; 6] = [None; 6];
    let mut count = 0;
    for point in all() {
        count += 1;
        for axis in 0..3 {
            let [low, high] = [2 * axis, 2 * axis + 1];
            if outermost[low].is_none_or(|least| point[axis] < least[axis]) {
                outermost[low] = Some(point);
            }
            if outermost[high].is_none_or(|most| point[axis] > most[axis]) {
                outermost[high] = Some(point);
            }
        }
    }
    let selection = all().step_by(count / MOST_OF_INSTANCES + 1);
    selection.chain(outermost.into_iter().flatten()).collect()
}

/// Returns the least and greatest coordinates, without a few corners that lie far outside.
fn extent(points: &[DVec3]) -> Option<(DVec3, DVec3)> {
    if points.is_empty() {
        return None;
    }
    let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
    for axis in 0..3 {
        let mut sorted: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let few = (sorted.len() as f64 * OUTLIERS) as usize;
        let (first, last) = (sorted[0], sorted[sorted.len() - 1]);
        let (near, far) = (sorted[few], sorted[sorted.len() - 1 - few]);
        let margin = 0.1 * (far - near);
        let is_spread = far > near && last - first > FAR * (far - near);
        (low[axis], high[axis]) = match is_spread {
            true => ((near - margin).max(first), (far + margin).min(last)),
            false => (first, last),
        };
    }
    Some((low, high))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use holo_scene::Material;

    use super::*;

    /// Returns the grid of a square of side 1 with each of its halves so many times.
    fn grid_of_copies(copies: usize) -> SceneGrid {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]].to_vec();
        let triangles = [[0, 1, 2], [0, 2, 3]].repeat(copies);
        let ids = vec![0; triangles.len()];
        let materials = vec![Material::grey("m")];
        let made = Scene::new(DVec3::ZERO, corners, triangles, ids, materials, [0.0; 3]);
        let raycaster = Raycaster::build(Arc::new(made.unwrap())).unwrap();
        SceneGrid::new(&raycaster, UprightAxes::new(DVec3::Z)).unwrap()
    }

    #[test]
    fn thousands_of_large_triangles_get_larger_cells_and_touch_all_of_them() {
        let fine = grid_of_copies(1);
        assert!((400..404).contains(&fine.size[0]), "{:?}", fine.size);
        let coarse = grid_of_copies(4000);
        // A copy needs 800 x 1132 points in the fine grid.
        let points = 8000.0 * 1.42 * (2.0 / coarse.cell).powi(2);
        assert!((0.8..1.1).contains(&(points / MAX_POINTS)), "{points}");
        for grid in [fine, coarse] {
            let touched = grid.touched.iter().filter(|&&touched| touched).count() as f64;
            let cells = grid.cell.powi(-2);
            assert!((0.9..1.3).contains(&(touched / cells)), "{touched} of {cells}");
        }
    }
}
