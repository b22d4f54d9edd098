//! Finds the points that are nearest to each pixel of a picture, exactly. A point is the middle of
//! a pixel.
//!
//! Where points are dense, the pixels around a pixel are tested in the order of their distance
//! ([`window`](super::window)). Elsewhere squares are divided into quarters. Let K points lie
//! within D of the middle of a square, and let h be half its diagonal. Then the K nearest points of
//! any place in the square lie within D + 2h of its middle. So the points of a quarter are found
//! among those of its square, and those of a pixel among few.
//!
//! Invariants:
//! - The result is a function of the set of points. If two points are at the same distance, the one
//!   with the lower pixel number comes first.
//! - The number of threads changes nothing.

use super::window::{Near, Window};
use holo_display::for_bands;

/// Least number of points in a tile for which the pixels around a pixel are tested one by one. At
/// one point in 16 pixels, both ways take equally long.
const DENSE: usize = TILE * TILE / 16;
/// Side of the largest squares, pixels.
const TILE: usize = 32;
/// Side of the smallest squares, pixels. They are not divided.
const LEAST: usize = 2;

/// A point of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PicturePoint {
    /// Column and row.
    at: [f32; 2],
    pixel: u32,
}

impl PicturePoint {
    fn new(pixel: usize, width: usize) -> Self {
        Self { at: [(pixel % width) as f32, (pixel / width) as f32], pixel: pixel as u32 }
    }

    fn seen_from(&self, [column, row]: [f32; 2]) -> Near {
        let offset = [self.at[0] - column, self.at[1] - row];
        let squared = offset[0] * offset[0] + offset[1] * offset[1];
        Near { squared, offset, pixel: self.pixel }
    }
}

/// Points by tiles.
pub(crate) struct TiledPoints {
    size: (usize, usize),
    /// Tiles across and down.
    tiles: (usize, usize),
    /// Where each tile's points begin, and one more for the end.
    starts: Vec<usize>,
    points: Vec<PicturePoint>,
    window: Window,
}

impl TiledPoints {
    /// Returns the points of a picture of `size` pixels. `has_point` takes the number of a pixel.
    pub fn new(size: (usize, usize), has_point: impl Fn(usize) -> bool) -> Self {
        let (width, height) = size;
        let tiles = (width.div_ceil(TILE), height.div_ceil(TILE));
        let (mut starts, mut points) = (vec![0], Vec::new());
        for tile in 0..tiles.0 * tiles.1 {
            let (left, top) = (tile % tiles.0 * TILE, tile / tiles.0 * TILE);
            let pixels = PixelSquare { left, top, side: TILE }.pixels(size);
            points.extend(
                pixels
                    .filter(|&pixel| has_point(pixel))
                    .map(|pixel| PicturePoint::new(pixel, width)),
            );
            starts.push(points.len());
        }
        let window = Window::new(size, points.iter().map(|point| point.pixel as usize));
        Self { size, tiles, starts, points, window }
    }

    /// Returns the number of points.
    pub fn count(&self) -> usize {
        self.points.len()
    }

    /// Returns the number of points in the tile of 32 × 32 pixels that contains a pixel.
    pub fn count_around(&self, pixel: usize) -> usize {
        let (column, row) = (pixel % self.size.0, pixel / self.size.0);
        self.tile(column / TILE, row / TILE).len()
    }

    /// Calls `find(pixel, nearest, item)` for each wanted pixel and its item. `nearest` are the `K`
    /// points nearest to the pixel, the nearest first, or all points if there are fewer. Does
    /// nothing if there are no points.
    pub fn for_each<const K: usize, T: Send>(
        &self,
        items: &mut [T],
        wanted: impl Fn(usize) -> bool + Sync,
        find: impl Fn(usize, &[Near], &mut T) + Sync,
    ) {
        if self.points.is_empty() {
            return;
        }
        let width = self.size.0;
        for_bands(items, width, TILE, |part, rows| {
            let mut search = NearestSearch::default();
            let mut nearest = Vec::with_capacity(K + 1);
            let top = part * TILE;
            for column in 0..self.tiles.0 {
                let square = PixelSquare { left: column * TILE, top, side: TILE };
                let is_dense = self.tile(column, part).len() >= DENSE;
                let mut rest = Vec::new();
                for pixel in square.pixels(self.size).filter(|&pixel| wanted(pixel)) {
                    if is_dense && self.window.find(pixel, K, &mut nearest) {
                        find(pixel, &nearest, &mut rows[pixel - top * width]);
                    } else {
                        rest.push(pixel);
                    }
                }
                if rest.is_empty() {
                    continue;
                }
                self.around(&square, K, &mut search);
                let is_left = |pixel: usize| rest.binary_search(&pixel).is_ok();
                search.divide(0, square, self.size, K, &is_left, &mut |pixel, points| {
                    sort_nearest(points, PicturePoint::new(pixel, width).at, K, &mut nearest);
                    find(pixel, &nearest, &mut rows[pixel - top * width]);
                });
            }
        });
    }

    /// Finds the points that may be among the `most` nearest of some place in a tile.
    fn around(&self, tile: &PixelSquare, most: usize, search: &mut NearestSearch) {
        let NearestSearch { lists, squares } = search;
        let Some(found) = lists.first_mut() else { return };
        found.clear();
        let (column, row) = (tile.left / TILE, tile.top / TILE);
        let mut rings = 0;
        let last = self.tiles.0.max(self.tiles.1);
        // Rings of tiles until there are enough points, then those that may have nearer ones.
        while found.len() < most && rings <= last {
            self.ring(column, row, rings, found);
            rings += 1;
        }
        let radius = tile.reach(found, most, squares);
        let needed = (radius / TILE as f32 - 0.5).ceil() as usize;
        for ring in rings..=needed.min(last) {
            self.ring(column, row, ring, found);
        }
        found.retain(|point| point.seen_from(tile.middle()).squared <= radius * radius);
    }

    /// Adds the points of the tiles at a distance of `ring` tiles.
    fn ring(&self, column: usize, row: usize, ring: usize, found: &mut Vec<PicturePoint>) {
        for other_row in row.saturating_sub(ring)..=(row + ring).min(self.tiles.1 - 1) {
            // All of the first and the last row, and both ends of those between.
            let step = if other_row.abs_diff(row) == ring { 1 } else { 2 * ring };
            for end in (0..=2 * ring).step_by(step.max(1)) {
                let other = (column + end).checked_sub(ring);
                if let Some(other) = other.filter(|&other| other < self.tiles.0) {
                    found.extend_from_slice(self.tile(other, other_row));
                }
            }
        }
    }

    fn tile(&self, column: usize, row: usize) -> &[PicturePoint] {
        let tile = row * self.tiles.0 + column;
        &self.points[self.starts[tile]..self.starts[tile + 1]]
    }
}

/// Puts the `most` points that are nearest to a place into `nearest`, the nearest first.
fn sort_nearest(points: &[PicturePoint], place: [f32; 2], most: usize, nearest: &mut Vec<Near>) {
    nearest.clear();
    for near in points.iter().map(|point| point.seen_from(place)) {
        let is_before = |other: &Near| (other.squared, other.pixel) < (near.squared, near.pixel);
        let at = nearest.iter().rposition(is_before).map_or(0, |last| last + 1);
        if at < most {
            nearest.truncate(most - 1);
            nearest.insert(at, near);
        }
    }
}

/// A square of pixels.
#[derive(Clone, Copy)]
struct PixelSquare {
    left: usize,
    top: usize,
    side: usize,
}

impl PixelSquare {
    fn middle(&self) -> [f32; 2] {
        [self.left, self.top].map(|from| from as f32 + 0.5 * (self.side - 1) as f32)
    }

    /// Returns the square's pixels in the picture, in the order of their numbers.
    fn pixels(self, (width, height): (usize, usize)) -> impl Iterator<Item = usize> {
        let columns = self.left..(self.left + self.side).min(width);
        (self.top..(self.top + self.side).min(height))
            .flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }

    /// Returns a radius around the square's middle that contains the `most` nearest points of every
    /// pixel in the square. Infinite if there are fewer points. `squares` is scratch.
    fn reach(&self, points: &[PicturePoint], most: usize, squares: &mut Vec<f32>) -> f32 {
        if points.len() < most {
            return f32::INFINITY;
        }
        squares.clear();
        squares.extend(points.iter().map(|point| point.seen_from(self.middle()).squared));
        let (_, &mut squared, _) = squares.select_nth_unstable_by(most - 1, f32::total_cmp);
        // The corners are pixels' middles, so this is more than twice half the diagonal.
        squared.sqrt() + std::f32::consts::SQRT_2 * self.side as f32
    }
}

/// The points of a square and of those that it lies in, and scratch.
struct NearestSearch {
    lists: Vec<Vec<PicturePoint>>,
    squares: Vec<f32>,
}

impl Default for NearestSearch {
    fn default() -> Self {
        Self { lists: vec![Vec::new(); (TILE / LEAST).ilog2() as usize + 1], squares: Vec::new() }
    }
}

impl NearestSearch {
    /// Calls `find` for each wanted pixel of a square, with points that include its `most` nearest.
    /// The list of this depth has such points for the square.
    fn divide(
        &mut self,
        depth: usize,
        square: PixelSquare,
        size: (usize, usize),
        most: usize,
        wanted: &impl Fn(usize) -> bool,
        find: &mut impl FnMut(usize, &[PicturePoint]),
    ) {
        if square.side == LEAST || self.lists[depth].len() <= 2 * most {
            let pixels = square.pixels(size).filter(|&pixel| wanted(pixel));
            pixels.for_each(|pixel| find(pixel, &self.lists[depth]));
            return;
        }
        let side = square.side / 2;
        for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let quarter = PixelSquare {
                left: square.left + right * side,
                top: square.top + down * side,
                side,
            };
            if !quarter.pixels(size).any(wanted) {
                continue;
            }
            let (above, below) = self.lists.split_at_mut(depth + 1);
            let radius = quarter.reach(&above[depth], most, &mut self.squares);
            let is_near = |point: &&PicturePoint| {
                point.seen_from(quarter.middle()).squared <= radius * radius
            };
            below[0].clear();
            below[0].extend(above[depth].iter().filter(is_near));
            self.divide(depth + 1, quarter, size, most, wanted, find);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A picture's size, and which of its pixels have points: many in one corner, few elsewhere.
    fn points() -> impl Strategy<Value = ((usize, usize), Vec<bool>)> {
        (1..130_usize, 1..50_usize, any::<u64>(), 0..5_u32).prop_map(
            |(width, height, seed, few)| {
                let mut state = seed | 1;
                let mut random = move || {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    (state >> 33) as u32
                };
                let has_point = |pixel: usize| {
                    let is_in_corner = pixel % width < width / 2 && pixel / width < height / 2;
                    random() % (if is_in_corner { 3 } else { 9 << (2 * few) }) == 0
                };
                ((width, height), (0..width * height).map(has_point).collect())
            },
        )
    }

    fn check<const K: usize>(size: (usize, usize), has_point: &[bool]) {
        let pixels = || (0..has_point.len()).filter(|&pixel| has_point[pixel]);
        let found = TiledPoints::new(size, |pixel| has_point[pixel]);
        assert_eq!(found.count(), pixels().count());
        let mut items: Vec<Vec<Near>> = vec![Vec::new(); has_point.len()];
        // Some pixels are not wanted.
        let wanted = |pixel: usize| pixel % 5 != 3;
        found.for_each::<K, _>(&mut items, wanted, |_, nearest, item| *item = nearest.to_vec());
        for (pixel, item) in items.iter().enumerate() {
            // By looking at all.
            let seen = |other: usize| {
                PicturePoint::new(other, size.0).seen_from(PicturePoint::new(pixel, size.0).at)
            };
            let mut all: Vec<Near> = pixels().map(seen).filter(|_| wanted(pixel)).collect();
            all.sort_by(|a, b| a.squared.total_cmp(&b.squared));
            all.truncate(K);
            assert_eq!(*item, all, "{pixel} of {size:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        #[test]
        fn what_is_found_is_what_looking_at_all_finds((size, has_point) in points()) {
            check::<1>(size, &has_point);
            check::<8>(size, &has_point);
            check::<12>(size, &has_point);
        }
    }
}
