//! Colours of all pixels of a tile together: what [`Reader::colour`] finds for one, for sixteen side by side.
//!
//! Level by level, the leaves of a tile and those around it are laid out in rows of numbers, of which a row of pixels takes its bilinear
//! means and intersects its intervals. Leaves of up to half a tile have mostly one surface, and pixels for which they have more are read
//! one by one; larger ones are laid out once for each of their surfaces that the tile shows.
//!
//! Always true: a colour is that of [`Reader::colour`], bit for bit: the same operations in the same order.

use super::around::{Leaves, NO_LEAVES, Neighbours, Pair, Row};
use super::leaf::{Noise, Reader, UNSEEN};
use super::paint::TILE;
use super::pyramid::Level;
use super::surface::{Bins, Surface, gap_allowed};
use holo_cpu::{Isa, Kernel};
use glam::Vec4;
use std::ops::Range;

/// Pixels of a tile.
const LANES: usize = TILE * TILE;
/// Pixels from which on finding them together is less work.
const MANY: usize = 24;
/// Start of a pixel that asks for nothing, and of one that is done.
const IDLE: u32 = u32::MAX;
/// Rows of leaves that a tile's pixels are read from at most: of leaves of 2 × 2 pixels, and one more on either side.
const MOST_ROWS: usize = TILE / 2 + 2;

/// What a tile's pixels ask for, and what they get. Pixels are row by row.
pub(super) struct TileColours {
    /// Level that a pixel starts at.
    start: [u32; LANES],
    /// First and last bin of the surface that it asks for.
    first: [i32; LANES],
    last: [i32; LANES],
    few_samples: [f32; LANES],
    half_widths: [[f32; LANES]; 4],
    /// Of pixels that start at level 0, their own means.
    own_mean: [[f32; LANES]; 4],
    own_weight: [f32; LANES],
    own_weight_squared: [f32; LANES],
    low: [[f32; LANES]; 4],
    high: [[f32; LANES]; 4],
    best: [[f32; LANES]; 3],
    /// Highest level that was averaged over.
    reach: [u32; LANES],
    asking: usize,
    /// What pixels are read from at a level; memory to be used again.
    pairs: Vec<Pair>,
}

impl TileColours {
    pub fn new() -> Self {
        Self {
            start: [IDLE; LANES],
            first: [0; LANES],
            last: [0; LANES],
            few_samples: [0.0; LANES],
            half_widths: [[0.0; LANES]; 4],
            own_mean: [[0.0; LANES]; 4],
            own_weight: [1.0; LANES],
            own_weight_squared: [1.0; LANES],
            low: [[0.0; LANES]; 4],
            high: [[0.0; LANES]; 4],
            best: [[0.0; LANES]; 3],
            reach: [0; LANES],
            asking: 0,
            pairs: vec![Pair { own: NO_LEAVES, beside: NO_LEAVES }; MOST_ROWS],
        }
    }

    /// Number of a pixel of the picture in its tile.
    #[inline(always)]
    pub fn lane(column: usize, row: usize) -> usize {
        row % TILE * TILE + column % TILE
    }

    /// Asks for the colour of a pixel's own surface, given its noise.
    #[inline(always)]
    pub fn ask_own(&mut self, lane: usize, own: &Surface, noise: &Noise) {
        self.ask(lane, 0, own.bins, noise);
        self.own_mean.iter_mut().zip(own.mean).for_each(|(all, own)| all[lane] = own);
        (self.own_weight[lane], self.own_weight_squared[lane]) = (own.weight, own.weight_squared);
    }

    /// Asks for the colour of a surface at a pixel, as [`Reader::colour`] takes it, given its noise. Of the pixel's own:
    /// [`ask_own`](Self::ask_own).
    #[inline(always)]
    pub fn ask(&mut self, lane: usize, start: usize, bins: Bins, noise: &Noise) {
        self.start[lane] = start as u32;
        (self.first[lane], self.last[lane]) = (i32::from(bins.first), i32::from(bins.last));
        self.few_samples[lane] = noise.few_samples;
        for (all, own) in self.half_widths.iter_mut().zip(noise.half_widths.to_array()) {
            all[lane] = own;
        }
        self.reach[lane] = 0;
        self.asking += 1;
    }

    /// Takes in that a pixel depends on a level.
    pub fn depends(&mut self, lane: usize, level: usize) {
        self.reach[lane] = self.reach[lane].max(level as u32);
    }

    /// Takes a colour as a pixel's, that was averaged up to a level.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, colour: [f32; 3], reach: usize) {
        for (all, own) in self.best.iter_mut().zip(colour) {
            all[lane] = own;
        }
        self.reach[lane] = reach as u32;
    }

    /// The colour of a pixel, and the highest level that was averaged over.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> ([f32; 3], usize) {
        ([self.best[0][lane], self.best[1][lane], self.best[2][lane]], self.reach[lane] as usize)
    }

    /// As [`get`](Self::get), of some pixels.
    #[inline(always)]
    pub fn copy(&self, lanes: Range<usize>, colours: &mut [[f32; 3]], reach: &mut [u8]) {
        let [red, green, blue] = [0, 1, 2].map(|channel| &self.best[channel][lanes.clone()]);
        for (colour, ((&red, &green), &blue)) in
            colours.iter_mut().zip(red.iter().zip(green).zip(blue))
        {
            *colour = [red, green, blue];
        }
        reach.iter_mut().zip(&self.reach[lanes]).for_each(|(reach, &level)| *reach = level as u8);
    }

    /// Finds the colours of all pixels that have asked, of the tile whose first pixel is given.
    pub fn find(&mut self, reader: &Reader, column: usize, row: usize, isa: Isa) {
        if self.asking >= MANY {
            isa.run(Find { lanes: self, reader, column, row });
        } else if self.asking > 0 {
            for lane in 0..LANES {
                if self.start[lane] != IDLE {
                    let half_widths = Vec4::from_array(self.half_widths.map(|all| all[lane]));
                    let noise = Noise { half_widths, few_samples: self.few_samples[lane] };
                    let bins =
                        Bins { first: self.first[lane] as u16, last: self.last[lane] as u16 };
                    let (column, row) = (column + lane % TILE, row + lane / TILE);
                    let colour = reader.mean(column, row, self.start[lane] as usize, bins, &noise);
                    self.set(lane, colour, reader.reach.take().max(self.reach[lane] as usize));
                }
            }
        }
        // Each pixel's is told.
        reader.reach.set(0);
        self.start.fill(IDLE);
        self.asking = 0;
    }
}

/// Weighted sums over the leaves around one pixel.
#[derive(Default)]
struct Sums {
    weight: f32,
    weight_squared: f32,
    sum: [f32; 4],
}

impl Sums {
    /// Adds a share of a leaf, if it meets the bins from `near` to `far`.
    #[inline(always)]
    fn add(&mut self, leaves: &Leaves, at: usize, (near, far): (i32, i32), share: f32) {
        let is_met = (leaves.last[at] >= near) & (leaves.first[at] <= far);
        let part = share * if is_met { leaves.weight[at] } else { 0.0 };
        self.weight += part;
        self.weight_squared += share * share * if is_met { leaves.weight_squared[at] } else { 0.0 };
        for channel in 0..4 {
            self.sum[channel] += part * leaves.mean[channel][at];
        }
    }
}

/// Means over neighbouring leaves, of a row of pixels, as [`Blend`](super::leaf::Blend) has one.
struct Blends {
    mean: [Row; 4],
    error: Row,
    /// Whether a pixel's leaf has its surface; 0: no.
    has_own: [u32; TILE],
    /// Whether one of the leaves has several surfaces; 0: no.
    many: [u32; TILE],
}

const NO_BLENDS: Blends =
    Blends { mean: [[0.0; TILE]; 4], error: [0.0; TILE], has_own: [0; TILE], many: [0; TILE] };

struct Find<'a> {
    lanes: &'a mut TileColours,
    reader: &'a Reader<'a>,
    /// First pixel of the tile.
    column: usize,
    row: usize,
}

impl Kernel for Find<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        for (number, level) in self.reader.levels.iter().enumerate() {
            if self.lanes.start.iter().all(|&start| start == IDLE) {
                break;
            }
            if self.lanes.start.iter().any(|&start| start as usize <= number) {
                match number {
                    0 => self.pixels(),
                    _ if 1 << number < TILE => self.small_leaves(number, level),
                    _ => self.large_leaves(number, level),
                }
            }
        }
    }
}

impl Find<'_> {
    /// The pixels' own surfaces.
    #[inline(always)]
    fn pixels(&mut self) {
        let mut blends = NO_BLENDS;
        blends.has_own = [1; TILE];
        for row in 0..TILE {
            if !self.works(row, 0) {
                continue;
            }
            let first = row * TILE;
            for (mean, own) in blends.mean.iter_mut().zip(&self.lanes.own_mean) {
                mean.copy_from_slice(&own[first..][..TILE]);
            }
            let weights = self.lanes.own_weight[first..][..TILE]
                .iter()
                .zip(&self.lanes.own_weight_squared[first..][..TILE]);
            for (error, (weight, weight_squared)) in blends.error.iter_mut().zip(weights) {
                *error = weight_squared.sqrt() / weight;
            }
            self.intersect(row, 0, &blends, false);
        }
    }

    /// Leaves of which a tile has several in a row.
    #[inline(always)]
    fn small_leaves(&mut self, number: usize, level: &Level) {
        let columns = Neighbours::new(self.column, number);
        let mut pairs = std::mem::take(&mut self.lanes.pairs);
        let count = (TILE >> number) + 2;
        for (row, pair) in pairs.iter_mut().enumerate().take(count) {
            let mut leaves = NO_LEAVES;
            for at in 0..count {
                let leaf = self.leaf(level, number, at, row);
                leaves.set(at, leaf.first(), leaf.len() > 1);
            }
            *pair = leaves.pair(self.column, number);
        }
        self.rows(number, &columns, &pairs, None);
        self.lanes.pairs = pairs;
    }

    /// Leaves of which one contains the tile.
    #[inline(always)]
    fn large_leaves(&mut self, number: usize, level: &Level) {
        let columns = Neighbours::new(self.column, number);
        let own = self.leaf(level, number, 1, 1);
        let mut has_own = [0_u32; LANES];
        for surface in own {
            let (first, last) = (i32::from(surface.bins.first), i32::from(surface.bins.last));
            for (has_own, (wanted_first, wanted_last)) in
                has_own.iter_mut().zip(self.lanes.first.iter().zip(&self.lanes.last))
            {
                *has_own |= u32::from((first <= *wanted_first) & (*wanted_last <= last));
            }
        }
        for (start, has_own) in self.lanes.start.iter_mut().zip(has_own) {
            *start = if (*start as usize <= number) & (has_own == 0) { IDLE } else { *start };
        }
        let gap = gap_allowed(number);
        let mut pairs = std::mem::take(&mut self.lanes.pairs);
        for surface in own {
            if !self.is_wanted(number, surface) {
                continue;
            }
            let (near, far) =
                (surface.bins.first.saturating_sub(gap), surface.bins.last.saturating_add(gap));
            for (row, pair) in pairs.iter_mut().enumerate().take(3) {
                let mut leaves = NO_LEAVES;
                for at in 0..3 {
                    let mut meeting = self
                        .leaf(level, number, at, row)
                        .iter()
                        .filter(|surface| !(surface.bins.last < near || surface.bins.first > far));
                    let first = meeting.next();
                    let first = if (at, row) == (1, 1) { Some(surface) } else { first };
                    leaves.set(at, first, meeting.next().is_some());
                }
                *pair = leaves.pair(self.column, number);
            }
            self.rows(number, &columns, &pairs, Some(surface));
        }
        self.lanes.pairs = pairs;
    }

    /// Whether pixels that ask for a surface are read from a level.
    #[inline(always)]
    fn is_wanted(&self, number: usize, surface: &Surface) -> bool {
        let (first, last) = (i32::from(surface.bins.first), i32::from(surface.bins.last));
        let mut wanted = 0;
        for ((&start, &wanted_first), &wanted_last) in
            self.lanes.start.iter().zip(&self.lanes.first).zip(&self.lanes.last)
        {
            wanted |= u32::from(
                (start as usize <= number) & (first <= wanted_first) & (wanted_last <= last),
            );
        }
        wanted != 0
    }

    /// A leaf around the tile, counted from the one before the first.
    #[inline(always)]
    fn leaf<'b>(
        &self,
        level: &'b Level,
        number: usize,
        column: usize,
        row: usize,
    ) -> &'b [Surface] {
        let column = ((self.column >> number) + column).saturating_sub(1).min(level.width - 1);
        let row = ((self.row >> number) + row).saturating_sub(1).min(level.height - 1);
        level.leaf(column, row)
    }

    /// Whether pixels of a row are read from a level.
    #[inline(always)]
    fn works(&self, row: usize, level: usize) -> bool {
        self.lanes.start[row * TILE..][..TILE]
            .iter()
            .fold(false, |any, &start| any | (start as usize <= level))
    }

    /// Reads all rows of pixels from the leaves that `pairs` has, row by row, those that ask for parts of one surface if it is given.
    #[inline(always)]
    fn rows(
        &mut self,
        number: usize,
        columns: &Neighbours,
        pairs: &[Pair],
        surface: Option<&Surface>,
    ) {
        let rows = Neighbours::new(self.row, number);
        for row in 0..TILE {
            if !self.works(row, number) {
                continue;
            }
            let (Some(own), Some(beside)) = (pairs.get(rows.own[row]), pairs.get(rows.beside[row]))
            else {
                continue;
            };
            let weights = [rows.weights[0][row], rows.weights[1][row]];
            let mut blends =
                self.blend(row, [own, beside], weights, columns, i32::from(gap_allowed(number)));
            if blends.many.iter().any(|&many| many != 0) {
                self.read_alone(row, number, &mut blends, surface.is_some());
            }
            self.intersect(row, number, &blends, surface.is_some());
        }
    }

    #[inline(always)]
    fn blend(
        &self,
        row: usize,
        pairs: [&Pair; 2],
        weights: [f32; 2],
        columns: &Neighbours,
        gap: i32,
    ) -> Blends {
        let mut blends = NO_BLENDS;
        let (wanted_first, wanted_last) =
            (&self.lanes.first[row * TILE..][..TILE], &self.lanes.last[row * TILE..][..TILE]);
        let own = &pairs[0].own;
        for at in 0..TILE {
            let (near, far) = (own.first[at] - gap, own.last[at] + gap);
            let mut sums = Sums::default();
            sums.add(&pairs[0].own, at, (near, far), weights[0] * columns.weights[0][at]);
            sums.add(&pairs[0].beside, at, (near, far), weights[0] * columns.weights[1][at]);
            sums.add(&pairs[1].own, at, (near, far), weights[1] * columns.weights[0][at]);
            sums.add(&pairs[1].beside, at, (near, far), weights[1] * columns.weights[1][at]);
            let Sums { weight, weight_squared, sum } = sums;
            let scale = 1.0 / weight;
            for (mean, sum) in blends.mean.iter_mut().zip(sum) {
                mean[at] = sum * scale;
            }
            blends.error[at] = weight_squared.sqrt() * scale;
            let has_own = (own.weight[at] > 0.0)
                & (own.first[at] <= wanted_first[at])
                & (wanted_last[at] <= own.last[at]);
            blends.has_own[at] = u32::from(has_own);
            blends.many[at] = pairs[0].own.many[at]
                | pairs[0].beside.many[at]
                | pairs[1].own.many[at]
                | pairs[1].beside.many[at];
        }
        blends
    }

    /// Reads pixels near leaves of several surfaces one by one. `some` if others of the row are read again.
    #[inline(always)]
    fn read_alone(&self, row: usize, number: usize, blends: &mut Blends, some: bool) {
        for at in 0..TILE {
            let lane = row * TILE + at;
            if blends.many[at] == 0
                || self.lanes.start[lane] as usize > number
                || some && blends.has_own[at] == 0
            {
                continue;
            }
            let bins =
                Bins { first: self.lanes.first[lane] as u16, last: self.lanes.last[lane] as u16 };
            let blend = self.reader.blend(self.column + at, self.row + row, number, bins);
            blends.has_own[at] = u32::from(blend.is_some());
            if let Some(blend) = blend {
                blends
                    .mean
                    .iter_mut()
                    .zip(blend.mean.to_array())
                    .for_each(|(mean, own)| mean[at] = own);
                blends.error[at] = blend.error_of_shown();
            }
        }
    }

    /// Takes the means of one level in, as far as their intervals meet those of all finer ones. Pixels whose leaf does not have their
    /// surface are done, or, if `some`, left to others of the leaf's.
    #[inline(always)]
    fn intersect(&mut self, row: usize, number: usize, blends: &Blends, some: bool) {
        let level = number as u32;
        let lanes = &mut *self.lanes;
        for at in 0..TILE {
            let lane = row * TILE + at;
            let start = lanes.start[lane];
            let has_own = blends.has_own[at] != 0;
            let works = (start <= level) & (has_own | !some);
            let starts = start == level;
            let error = blends.error[at];
            let width = error * (1.0 + lanes.few_samples[lane] * error * error);
            let mut least = f32::INFINITY;
            let mut half = 0.0;
            for channel in 0..4 {
                let mean = blends.mean[channel][at];
                half = lanes.half_widths[channel][lane] * width;
                let (old_low, old_high) = (lanes.low[channel][lane], lanes.high[channel][lane]);
                let low = if starts { f32::NEG_INFINITY } else { old_low };
                let high = if starts { f32::INFINITY } else { old_high };
                let (low_here, high_here) = (mean - half, mean + half);
                let new_low = if low > low_here { low } else { low_here };
                let new_high = if high < high_here { high } else { high_here };
                lanes.low[channel][lane] = if works { new_low } else { old_low };
                lanes.high[channel][lane] = if works { new_high } else { old_high };
                let left = new_high - new_low;
                let point = if left >= 0.0 { 1.0 } else { 0.0 };
                let common = 0.5 * left / half;
                let common = if half > 0.0 { common } else { point };
                least = if common < least { common } else { least };
            }
            let share = if least < 0.0 { 0.0 } else { least };
            let share = if share > 1.0 { 1.0 } else { share };
            let share = if error < f32::INFINITY { share } else { 0.0 };
            let share = if starts { 1.0 } else { share };
            let is_taken = works & has_own & (share != 0.0);
            for channel in 0..3 {
                let old = lanes.best[channel][lane];
                let best = if starts { 0.0 } else { old };
                let better = best + share * (blends.mean[channel][at] - best);
                lanes.best[channel][lane] = if is_taken { better } else { old };
            }
            let reach = lanes.reach[lane];
            lanes.reach[lane] = if works & has_own & (level > reach) { level } else { reach };
            let is_enough = half < UNSEEN * blends.mean[3][at];
            let goes_on = is_taken & !is_enough;
            lanes.start[lane] = if works & !goes_on { IDLE } else { start };
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
#[path = "tile_tests.rs"]
mod tests;
