//! Finds samples on surfaces that a nearer surface hides (Larson & Simmons 1999, Figure 6). Their
//! rays pass the eye at some distance and look behind the nearer surface.
//!
//! Without a scene, the nearer surface is known only by its samples. Some of the samples nearest to
//! a sample in the picture may lie in front of it. The sample is hidden if these surround it. At
//! the nearer surface's edge they do not, so the surface does not grow.
//!
//! Invariant: samples whose rays pass near the eye see exactly their pixel, and are never hidden.

use super::nearest::TiledPoints;
use super::squares::SquareSums;
use super::step::DepthSteps;

/// Number of nearest samples that are tested, the sample itself included.
const TESTED: usize = 12;
/// Side, in pixels, of the squares whose nearest depths are computed.
const SQUARE: usize = 8;
/// Least number of samples in 3 × 3 such squares for these to include the nearest samples of each
/// sample in the middle square.
const DENSE: u32 = 64;

/// The samples of a square of the picture.
#[derive(Clone, Copy)]
struct Summary {
    nearest: f32,
    count: u32,
}

/// Returns for each pixel whether its site is hidden. `depth` is the depth of each pixel's site.
/// Only pixels for which `may_be` is true are tested.
pub(super) fn hidden(
    size: (usize, usize),
    depth: &[f32],
    steps: &DepthSteps,
    may_be: impl Fn(usize) -> bool + Sync,
    has_site: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let points = TiledPoints::new(size, &has_site);
    let sites = (0..).zip(depth).filter(|(pixel, _)| has_site(*pixel));
    let sites = sites.map(|(pixel, &nearest)| (pixel, Summary { nearest, count: 1 }));
    let nothing = Summary { nearest: f32::INFINITY, count: 0 };
    let around = SquareSums::<Summary, SQUARE>::new(size, nothing, sites, |a, b| Summary {
        nearest: a.nearest.min(b.nearest),
        count: a.count + b.count,
    });
    let mut hidden = vec![false; depth.len()];
    let wanted =
        |pixel: usize| may_be(pixel) && may_hide(around.around(pixel), depth[pixel], steps);
    points.for_each::<TESTED, bool>(&mut hidden, wanted, |pixel, nearest, hidden| {
        let mut front = [[0.0; 2]; TESTED];
        let mut count = 0;
        for near in nearest {
            if steps.is_in_front(depth[near.pixel as usize], depth[pixel], near.squared.sqrt()) {
                front[count] = near.offset;
                count += 1;
            }
        }
        *hidden = surround(&front[..count]);
    });
    hidden
}

/// Returns whether a sample around may be in front of a sample of this depth.
fn may_hide(around: Summary, depth: f32, steps: &DepthSteps) -> bool {
    around.count < DENSE || steps.may_be_in_front(around.nearest, depth)
}

/// Returns whether points surround the origin: no line through it has all of them on one side.
fn surround(points: &[[f32; 2]]) -> bool {
    let cross = |a: &[f32; 2], b: &[f32; 2]| a[0] * b[1] - a[1] * b[0];
    // If some line has all of them on one side, so has a line through one of the points.
    points.len() > 2
        && points.iter().all(|a| points.iter().any(|b| cross(a, b) < 0.0))
        && points.iter().all(|a| points.iter().any(|b| cross(a, b) > 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points in directions of so many degrees.
    fn around(degrees: &[f32]) -> Vec<[f32; 2]> {
        let at = |(number, degrees): (usize, &f32)| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            [cosine, sine].map(|along| along * (1.0 + number as f32))
        };
        degrees.iter().enumerate().map(at).collect()
    }

    #[test]
    fn points_stand_around_a_place_if_no_half_of_its_surroundings_is_free_of_them() {
        for turn in [0.0, 17.0, 133.0, 251.0] {
            let degrees =
                |list: &[f32]| around(&list.iter().map(|at| at + turn).collect::<Vec<f32>>());
            assert!(surround(&degrees(&[0.0, 120.0, 240.0])));
            assert!(surround(&degrees(&[0.0, 90.0, 181.0])));
            assert!(surround(&degrees(&[10.0, 350.0, 170.0, 200.0])));
            assert!(!surround(&degrees(&[0.0, 90.0, 179.0])));
            assert!(!surround(&degrees(&[0.0, 40.0, 80.0, 120.0, 160.0, 175.0])));
            assert!(!surround(&degrees(&[0.0, 180.5])));
        }
        assert!(!surround(&[]));
        assert!(!surround(&[[0.0, 0.0]; 4]), "where it is, nothing is around it");
    }
}
