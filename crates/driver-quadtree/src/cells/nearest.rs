//! The points of a picture that are nearest to the middle of each of its pixels: exactly.
//!
//! Where they are dense, the pixels around one are looked at by their distance ([`near`](super::near)). Elsewhere squares are divided. What is among the `K` nearest of any place of a square lies within D + 2h of its middle, if `K` points lie within D of that and h is half
//! the square's diagonal. So a square's points are found among those of the larger square that it is a quarter of, and a pixel's among few.
//!
//! What always holds:
//! - What is found is a function of the set of points, at most one in each pixel: of two at one distance, that of the first pixel comes
//!   first.
//! - The number of threads changes nothing.

use super::near::{Near, Nearest, Window};
use holo_display::for_bands;

/// Points in a tile from which on pixels around one are looked at one by one: at one in 16 pixels either way takes as long.
const DENSE: usize = TILE * TILE / 16;
/// Side of the squares in which points are looked up first, pixels.
const TILE: usize = 32;
/// Side of squares that are not divided.
const LEAST: usize = 2;
/// Added to radii within which points are kept, as their share: what sums of squares round off.
const SLACK: f32 = 1.0 + 1e-5;

/// The middle of a pixel lies between two 256ths; see [`place`].
const MIDDLE: Option<[u8; 2]> = None;

/// A point of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    /// Pixels from the left and from the top.
    pub place: [f32; 2],
    /// The pixel in which it lies.
    pub pixel: u32,
}

impl Point {
    fn squared_from(&self, place: [f32; 2]) -> f32 {
        let [x, y] = [self.place[0] - place[0], self.place[1] - place[1]];
        x * x + y * y
    }
}

/// A place in a pixel, in 256ths of it, or its middle: pixels from the left and from the top.
fn place(pixel: usize, width: usize, within: Option<[u8; 2]>) -> [f32; 2] {
    let [right, down] =
        within.map_or([0.5; 2], |within| within.map(|part| (f32::from(part) + 0.5) / 256.0));
    [(pixel % width) as f32 + right, (pixel / width) as f32 + down]
}

/// Points by tiles.
pub(crate) struct Points {
    size: (usize, usize),
    /// Tiles across and down.
    tiles: (usize, usize),
    /// Where each tile's points begin, and one more for the end.
    first: Vec<u32>,
    points: Vec<Point>,
    window: Window,
}

impl Points {
    /// The middles of the pixels that have a point.
    pub fn in_middles(size: (u32, u32), has_point: impl Fn(usize) -> bool) -> Self {
        Self::new(size, true, |pixel| has_point(pixel).then_some(MIDDLE))
    }

    /// The points that `of` gives for pixels: where in the pixel, in 256ths from its left and from its top.
    pub fn in_pixels(size: (u32, u32), of: impl Fn(usize) -> Option<[u8; 2]>) -> Self {
        Self::new(size, false, |pixel| of(pixel).map(Some))
    }

    fn new(
        (width, height): (u32, u32),
        in_middles: bool,
        of: impl Fn(usize) -> Option<Option<[u8; 2]>>,
    ) -> Self {
        let size = (width as usize, height as usize);
        let tiles = (size.0.div_ceil(TILE), size.1.div_ceil(TILE));
        let (mut first, mut points) = (Vec::with_capacity(tiles.0 * tiles.1 + 1), Vec::new());
        let mut window = Window::new(size, in_middles);
        first.push(0);
        for tile in 0..tiles.0 * tiles.1 {
            let (left, top) = (tile % tiles.0 * TILE, tile / tiles.0 * TILE);
            for row in top..(top + TILE).min(size.1) {
                for pixel in row * size.0 + left..row * size.0 + (left + TILE).min(size.0) {
                    let Some(within) = of(pixel) else { continue };
                    window.put(pixel, within);
                    points.push(Point { place: place(pixel, size.0, within), pixel: pixel as u32 });
                }
            }
            first.push(points.len() as u32);
        }
        Self { size, tiles, first, points, window }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.points.len()
    }

    /// Points in the tile of 32 × 32 pixels around a pixel.
    pub fn count_around(&self, pixel: usize) -> usize {
        let (column, row) = (pixel % self.size.0, pixel / self.size.0);
        self.tile(column / TILE, row / TILE).len()
    }

    /// Lets `find(pixel, nearest, item)` change the items of wanted pixels, `nearest` being the `K` points nearest to the pixel's middle, the
    /// nearest first: fewer only if there are no more. No item changes where there is no point at all.
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
            let mut search = Search::<K>::default();
            let mut nearest = Nearest::<K>::default();
            let mut rest = [false; TILE * TILE];
            for tile in 0..self.tiles.0 {
                let square = Square { left: tile * TILE, top: part * TILE, side: TILE };
                let is_dense = self.tile(tile, part).len() >= DENSE;
                let mut any = false;
                let columns = square.left..(square.left + TILE).min(width);
                for (down, items) in rows.chunks_mut(width).enumerate() {
                    for column in columns.clone() {
                        let pixel = (square.top + down) * width + column;
                        let mut is_left = wanted(pixel);
                        if is_left && is_dense && self.window.find(pixel, &mut nearest) {
                            find(pixel, nearest.as_slice(), &mut items[column]);
                            is_left = false;
                        }
                        rest[down * TILE + column - square.left] = is_left;
                        any |= is_left;
                    }
                }
                if !any {
                    continue;
                }
                self.around(&square, K, &mut search.lists[0], &mut search.squares);
                let is_left = |pixel: usize| {
                    rest[(pixel / width - square.top) * TILE + pixel % width - square.left]
                };
                search.divide(0, square, self.size, &is_left, &mut |pixel, points| {
                    nearest.clear();
                    let middle = place(pixel, width, MIDDLE);
                    points.iter().for_each(|point| nearest.add(point.place, point.pixel, middle));
                    find(pixel, nearest.as_slice(), &mut rows[pixel - part * TILE * width]);
                });
            }
        });
    }

    /// The points that may be among the `most` nearest of some place of a tile.
    fn around(&self, tile: &Square, most: usize, found: &mut Vec<Point>, squares: &mut Vec<f32>) {
        found.clear();
        let (column, row) = (tile.left / TILE, tile.top / TILE);
        let mut rings = 0;
        let last = self.tiles.0.max(self.tiles.1);
        // Rings of tiles until there are enough, and then as many more as may hold nearer ones.
        while found.len() < most && rings <= last {
            self.ring(column, row, rings, found);
            rings += 1;
        }
        let radius = tile.reach(found, most, squares);
        let needed = (radius / TILE as f32 - 0.5).ceil() as usize;
        for ring in rings..=needed.min(last) {
            self.ring(column, row, ring, found);
        }
        let middle = tile.middle();
        found.retain(|point| point.squared_from(middle) <= radius * radius);
    }

    /// Adds the points of the tiles so many tiles away.
    fn ring(&self, column: usize, row: usize, ring: usize, found: &mut Vec<Point>) {
        for other_row in row.saturating_sub(ring)..=(row + ring).min(self.tiles.1 - 1) {
            // All of the first and the last row, and both ends of those between.
            let step = if other_row.abs_diff(row) == ring { 1 } else { 2 * ring };
            for end in (0..=2 * ring).step_by(step.max(1)) {
                if let Some(other) =
                    (column + end).checked_sub(ring).filter(|&other| other < self.tiles.0)
                {
                    found.extend_from_slice(self.tile(other, other_row));
                }
            }
        }
    }

    fn tile(&self, column: usize, row: usize) -> &[Point] {
        let tile = row * self.tiles.0 + column;
        &self.points[self.first[tile] as usize..self.first[tile + 1] as usize]
    }
}

/// A square of pixels.
#[derive(Clone, Copy)]
struct Square {
    left: usize,
    top: usize,
    side: usize,
}

impl Square {
    fn middle(&self) -> [f32; 2] {
        [self.left, self.top].map(|from| from as f32 + 0.5 * self.side as f32)
    }

    /// Its pixels, as far as the picture goes.
    fn pixels(self, (width, height): (usize, usize)) -> impl Iterator<Item = usize> {
        let columns = self.left..(self.left + self.side).min(width);
        (self.top..(self.top + self.side).min(height))
            .flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }

    /// How far from its middle those lie that are among the `most` nearest points of any place in it; infinite if there are no more points.
    fn reach(&self, points: &[Point], most: usize, squares: &mut Vec<f32>) -> f32 {
        if points.len() < most {
            return f32::INFINITY;
        }
        let middle = self.middle();
        squares.clear();
        squares.extend(points.iter().map(|point| point.squared_from(middle)));
        let (_, &mut squared, _) = squares.select_nth_unstable_by(most - 1, f32::total_cmp);
        (squared.sqrt() + std::f32::consts::SQRT_2 * self.side as f32) * SLACK
    }
}

/// Scratch of one thread: the points of a square and of those that it lies in.
struct Search<const K: usize> {
    lists: Vec<Vec<Point>>,
    squares: Vec<f32>,
}

impl<const K: usize> Default for Search<K> {
    fn default() -> Self {
        Self { lists: vec![Vec::new(); (TILE / LEAST).ilog2() as usize + 1], squares: Vec::new() }
    }
}

impl<const K: usize> Search<K> {
    /// Calls `find` for each wanted pixel of a square, whose points are in the list of this depth, with those that its nearest are among.
    fn divide(
        &mut self,
        depth: usize,
        square: Square,
        size: (usize, usize),
        wanted: &impl Fn(usize) -> bool,
        find: &mut impl FnMut(usize, &[Point]),
    ) {
        if square.side == LEAST || self.lists[depth].len() <= 2 * K {
            square
                .pixels(size)
                .filter(|&pixel| wanted(pixel))
                .for_each(|pixel| find(pixel, &self.lists[depth]));
            return;
        }
        let side = square.side / 2;
        for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let quarter =
                Square { left: square.left + right * side, top: square.top + down * side, side };
            if !quarter.pixels(size).any(wanted) {
                continue;
            }
            let (above, below) = self.lists.split_at_mut(depth + 1);
            let radius = quarter.reach(&above[depth], K, &mut self.squares);
            let middle = quarter.middle();
            below[0].clear();
            below[0].extend(
                above[depth].iter().filter(|point| point.squared_from(middle) <= radius * radius),
            );
            self.divide(depth + 1, quarter, size, wanted, find);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A picture's size, and pixels with points in them.
    type Scattered = ((u32, u32), Vec<(usize, [u8; 2])>);

    /// Some pixels of a picture with points in them: many in one corner, few elsewhere.
    fn points() -> impl Strategy<Value = Scattered> {
        (1..150_u32, 1..110_u32, any::<u64>(), 0..5_u32).prop_map(|(width, height, seed, few)| {
            let mut state = seed | 1;
            let mut random = move || {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as u32
            };
            let mut has = move |pixel: u32| {
                let (column, row) = (pixel % width, pixel / width);
                let (many, here) = (column < width / 2 && row < height / 2, random());
                (here % (if many { 3 } else { 9 << (2 * few) }) == 0)
                    .then_some([(here >> 8) as u8, (here >> 16) as u8])
            };
            let found = (0..width * height)
                .filter_map(|pixel| has(pixel).map(|within| (pixel as usize, within)));
            ((width, height), found.collect())
        })
    }

    /// The nearest by looking at all.
    fn expected(
        size: (u32, u32),
        points: &[(usize, Option<[u8; 2]>)],
        pixel: usize,
        most: usize,
    ) -> Vec<(f32, u32)> {
        let width = size.0 as usize;
        let from = place(pixel, width, MIDDLE);
        let squared = |&(other, within): &(usize, _)| {
            (
                Point { place: place(other, width, within), pixel: other as u32 }
                    .squared_from(from),
                other as u32,
            )
        };
        let mut all: Vec<(f32, u32)> = points.iter().map(squared).collect();
        all.sort_by(|a, b| a.partial_cmp(b).unwrap());
        all.truncate(most);
        all
    }

    fn check<const K: usize>(
        size: (u32, u32),
        found: &Points,
        points: &[(usize, Option<[u8; 2]>)],
    ) {
        let mut items: Vec<Vec<(f32, u32)>> = vec![Vec::new(); (size.0 * size.1) as usize];
        // Some pixels are not wanted.
        let wanted = |pixel: usize| pixel % 5 != 3;
        found.for_each::<K, _>(&mut items, wanted, |_, nearest, item| {
            *item = nearest.iter().map(|near| (near.squared, near.pixel)).collect();
        });
        for (pixel, item) in items.iter().enumerate() {
            let expected =
                if wanted(pixel) { expected(size, points, pixel, K) } else { Vec::new() };
            assert_eq!(*item, expected, "{pixel} of {size:?}, {} points", points.len());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        #[test]
        fn what_is_found_is_what_looking_at_all_finds((size, points) in points()) {
            let all: Vec<Option<[u8; 2]>> = {
                let mut all = vec![None; (size.0 * size.1) as usize];
                points.iter().for_each(|&(pixel, within)| all[pixel] = Some(within));
                all
            };
            let placed: Vec<_> = points.iter().map(|&(pixel, within)| (pixel, Some(within))).collect();
            let found = Points::in_pixels(size, |pixel| all[pixel]);
            assert_eq!(found.count(), points.len());
            check::<1>(size, &found, &placed);
            check::<8>(size, &found, &placed);
            let middles: Vec<_> = points.iter().map(|&(pixel, _)| (pixel, MIDDLE)).collect();
            let found = Points::in_middles(size, |pixel| all[pixel].is_some());
            check::<8>(size, &found, &middles);
            check::<12>(size, &found, &middles);
        }
    }
}
