//! Distances of visible surfaces, without drawing a picture.
//!
//! A drawing averages colours over leaves as large as their noise needs. Depths only need the
//! surface that a leaf shows.
//!
//! Invariant: depths are a function of the set of samples, as the picture is.

use crate::Quadtree;
use crate::bins::{FAR, bin_distance};
use crate::shown::seen_surface;

/// Level of the smallest leaves whose depths are returned: 4 × 4 pixels.
const LEVEL: usize = 2;
/// Their side in pixels.
const SIDE: usize = 1 << LEVEL;

impl Quadtree {
    /// Returns column, row and distance from the eye for each square of 4 × 4 pixels with a known
    /// surface. The place is the middle of the square.
    pub(crate) fn depths(&self) -> Vec<(usize, usize, f32)> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let (levels, unseen) = (self.leaves_of_all(), self.unseen_pixels());
        let across = width.div_ceil(SIDE);
        let depth = |square: usize| {
            let middle = |at: usize, size: usize| (SIDE * at + SIDE / 2).min(size - 1);
            let (column, row) = (middle(square % across, width), middle(square / across, height));
            let pixel = row * width + column;
            if !self.covered[pixel] || unseen.get(pixel) == Some(&true) {
                return None;
            }
            let larger = levels.iter().enumerate().skip(LEVEL.min(levels.len() - 1));
            let mut leaves =
                larger.map(|(number, level)| level.leaf(column >> number, row >> number));
            let seen = seen_surface(leaves.find(|leaf| !leaf.is_empty())?)?;
            (seen.bins.first < FAR).then(|| (column, row, bin_distance(seen.bins.first)))
        };
        (0..across * height.div_ceil(SIDE)).filter_map(depth).collect()
    }
}
