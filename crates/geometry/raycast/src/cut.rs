//! Cuts of a scene at a height, as architects draw plans.

use glam::DVec3;
use rayon::prelude::*;

use crate::Raycaster;

/// Greatest cosine between the up axis and the normal of a face that a plan shows. Steeper faces
/// are walls and furniture, and others are floors that the cut happens to meet.
const MOST_TILTED: f64 = 0.5;

/// A line of a cut, in the scene's coordinates.
pub type CutLine = [DVec3; 2];

impl Raycaster {
    /// Returns the lines in which a plane at each of `heights` cuts the scene's steep faces. The
    /// planes are at right angles to the unit vector `up`, and heights are measured along it from
    /// the origin of the scene's coordinates, scene units. Each cut has at most `most` lines, the
    /// longest first.
    pub fn cuts(&self, up: DVec3, heights: &[f64], most: usize) -> Vec<Vec<CutLine>> {
        let origin = self.scene().origin;
        let base = origin.dot(up);
        let of_triangle = |triangle: u32, height: f64| {
            let corners = self.vertices(triangle).map(|corner| corner.as_dvec3());
            let cut = line(corners, corners.map(|corner| corner.dot(up) + base - height))?;
            // Few triangles come this far.
            let normal = self.geometric_normal(triangle).as_dvec3().normalize_or_zero();
            (normal.dot(up).abs() <= MOST_TILTED).then(|| cut.map(|end| origin + end))
        };
        let of_height = |&height: &f64| {
            let triangles = self.scene().triangles().into_par_iter();
            let mut lines: Vec<CutLine> =
                triangles.filter_map(|triangle| of_triangle(triangle, height)).collect();
            let length = |[from, to]: &CutLine| from.distance_squared(*to);
            lines.sort_by(|one, other| length(other).total_cmp(&length(one)));
            lines.truncate(most);
            lines
        };
        heights.iter().map(of_height).collect()
    }
}

/// Returns the line in which a plane cuts a triangle whose corners lie at these distances above it.
/// A corner in the plane counts as above it, so that neighbours agree.
fn line(corners: [DVec3; 3], above: [f64; 3]) -> Option<CutLine> {
    let mut ends = [(0, 1), (1, 2), (2, 0)].into_iter().filter_map(|(from, to)| {
        let is_crossed = (above[from] >= 0.0) != (above[to] >= 0.0);
        // The difference is not 0, because the signs differ.
        let share = above[from] / (above[from] - above[to]);
        is_crossed.then(|| corners[from].lerp(corners[to], share))
    });
    let line = [ends.next()?, ends.next()?];
    (line[0] != line[1]).then_some(line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_scene::{Material, Scene};
    use std::sync::Arc;

    /// A box of 4 × 3 × 2.5 at `at`, a table-top of 1 × 1 at height 0.8, and a ramp from 0.6 to
    /// 1.4.
    fn furnished(at: DVec3) -> Raycaster {
        let corner = |n: u32| {
            let bit = |b: u32| f64::from(n >> b & 1);
            at + DVec3::new(4.0 * bit(0), 3.0 * bit(1), 2.5 * bit(2))
        };
        let mut positions: Vec<DVec3> = (0..8).map(corner).collect();
        let sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4]];
        let sides = [&sides[..], &[[1, 3, 7, 5], [8, 9, 10, 11], [12, 13, 14, 15]]].concat();
        positions.extend(
            [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)]
                .map(|(x, y)| at + DVec3::new(x, y, 0.8)),
        );
        positions.extend(
            [(0.5, 2.2, 0.6), (3.0, 2.2, 1.4), (3.0, 2.8, 1.4), (0.5, 2.8, 0.6)]
                .map(|(x, y, z)| at + DVec3::new(x, y, z)),
        );
        let triangles: Vec<[u32; 3]> =
            sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let ids = vec![0; triangles.len()];
        let named = vec![Material::grey("wall")];
        let (scene, _) = Scene::from_world(&positions, &triangles, &ids, named, [0.0; 3]).unwrap();
        Raycaster::build(Arc::new(scene)).unwrap()
    }

    #[test]
    fn a_cut_shows_the_walls_all_around_and_no_floor() {
        for at in [DVec3::ZERO, DVec3::new(1e6, -3e5, 400.0)] {
            let caster = furnished(at);
            let heights = [at.z + 1.2, at.z + 0.8, at.z - 1.0, at.z];
            let cuts = caster.cuts(DVec3::Z, &heights, 1000);
            let length = |lines: &[CutLine]| -> f64 {
                lines.iter().map(|[from, to]| from.distance(*to)).sum()
            };
            assert!((length(&cuts[0]) - 14.0).abs() < 1e-5, "{}", length(&cuts[0]));
            assert!((length(&cuts[1]) - 14.0).abs() < 1e-5, "table-top and ramp are no walls");
            assert!(cuts[0].iter().flatten().all(|end| (end.z - heights[0]).abs() < 1e-6));
            assert!(cuts[2].is_empty(), "nothing is below the floor");
            assert!(length(&cuts[3]) <= 14.0 + 1e-5);
        }
    }

    #[test]
    fn the_longest_lines_stay() {
        let cuts = furnished(DVec3::ZERO).cuts(DVec3::Z, &[1.2], 3);
        let lengths: Vec<f64> = cuts[0].iter().map(|[from, to]| from.distance(*to)).collect();
        assert_eq!(lengths.len(), 3);
        assert!(lengths.is_sorted_by(|one, other| one >= other), "{lengths:?}");
    }
}
