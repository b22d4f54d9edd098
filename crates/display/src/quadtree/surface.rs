//! The pyramid of leaves: what each square of the picture holds, surface by surface.
//!
//! Level 0 is the pixels, each further level the squares of 2 × 2 of the one below. A leaf lists its surfaces, nearest
//! first: depth bins are one surface while they are adjacent, so no mean is ever taken across a jump in depth.
//!
//! Invariant: the surfaces of a leaf are disjoint in depth, and each surface of a child lies within one of its parent.

use crate::quadtree::bins::{FAR, NEAR_CLASSES, Sums, luminance};
use std::borrow::Borrow;

/// Degrees of freedom that an estimate of noise from finer leaves needs before a leaf's own spread is not used for it.
const ENOUGH_FREEDOM: f32 = 6.0;

/// Pixels whose sums are asked for ahead: they lie in the order in which pixels were first hit.
const AHEAD: usize = 12;

/// One surface in a leaf: moments of its samples. "Spread" is Σ w (x − mean)².
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// First and last depth bin.
    pub bins: (u16, u16),
    pub count: u32,
    /// Samples that pass near the eye, as [`Sums::near`] has them; of a single pixel only.
    pub near: [u32; NEAR_CLASSES],
    pub weight: f32,
    pub weight_squared: f32,
    /// Means of the colour and, last, of compressed luminance.
    pub mean: [f32; 4],
    spread_luminance: f32,
    spread_compressed: f32,
    /// Noise about the means of the smallest leaves that have enough samples to tell, without the picture's own variation
    /// across larger leaves.
    within: Within,
}

/// Noise pooled over small leaves, each counting by its degrees of freedom.
#[derive(Clone, Copy, Debug, Default)]
struct Within {
    /// Sum of freedom × variance.
    luminance: f32,
    /// Sum of freedom × *deviation*: the few leaves that an edge crosses, where the picture itself spreads, then raise the
    /// mean little. (Tails of plain luminance are too heavy for that: rare bright samples are most of its variance.)
    compressed: f32,
    /// Effective number of samples less the number of means.
    freedom: f32,
}

impl Within {
    fn plus(self, other: Self) -> Self {
        Self {
            luminance: self.luminance + other.luminance,
            compressed: self.compressed + other.compressed,
            freedom: self.freedom + other.freedom,
        }
    }
}

/// Standard deviations of one sample of mean weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deviation {
    pub luminance: f32,
    pub compressed: f32,
    /// Degrees of freedom of the estimate.
    pub freedom: f32,
}

impl Surface {
    fn new(bins: (u16, u16), sums: &Sums) -> Self {
        let [r, g, b] = sums.mean();
        let (weight, weight_squared) = (sums.weight(), sums.weight_squared());
        let (compressed, compressed_square) = sums.mean_compressed();
        let (mut spread_luminance, mut spread_compressed) = (0.0, 0.0);
        if sums.count > 1 {
            let mean_luminance = 0.265 * r + 0.670 * g + 0.065 * b;
            let variance = sums.mean_luminance_squared() - mean_luminance * mean_luminance;
            spread_luminance = (variance.max(0.0) * weight) as f32;
            spread_compressed = ((compressed_square - compressed * compressed).max(0.0) * weight) as f32;
        }
        let mut surface = Self {
            bins,
            count: sums.count,
            near: sums.near,
            weight: weight as f32,
            weight_squared: weight_squared as f32,
            mean: [r as f32, g as f32, b as f32, compressed as f32],
            spread_luminance,
            spread_compressed,
            within: Within::default(),
        };
        surface.within = surface.own_noise();
        surface
    }

    /// Adds a neighbour's part of the same surface (the update of Chan, Golub & LeVeque 1979).
    fn join(&mut self, other: &Self) {
        let weight = self.weight + other.weight;
        let part = other.weight / weight;
        let cross = self.weight * part;
        let luminance_step = other.luminance() - self.luminance();
        let compressed_step = other.mean[3] - self.mean[3];
        self.spread_luminance += other.spread_luminance + luminance_step * luminance_step * cross;
        self.spread_compressed += other.spread_compressed + compressed_step * compressed_step * cross;
        for (mean, new) in self.mean.iter_mut().zip(other.mean) {
            *mean += (new - *mean) * part;
        }
        self.weight = weight;
        self.weight_squared += other.weight_squared;
        self.count = self.count.saturating_add(other.count);
        self.bins = (self.bins.0.min(other.bins.0), self.bins.1.max(other.bins.1));
        self.within = self.within.plus(other.within);
    }

    fn luminance(&self) -> f32 {
        let [r, g, b, _] = self.mean;
        luminance([r, g, b])
    }

    /// Completes a surface joined of several.
    fn close(&mut self) {
        if self.within.freedom < ENOUGH_FREEDOM {
            self.within = self.own_noise();
        }
    }

    /// Noise as the spread about the leaf's own mean.
    fn own_noise(&self) -> Within {
        let freedom = self.weight * self.weight / self.weight_squared - 1.0;
        // Σw − Σw²/Σw: its product with a variance is the spread expected.
        let divisor = self.weight - self.weight_squared / self.weight;
        if self.count < 2 || freedom <= 0.0 || divisor <= 0.0 {
            return Within::default();
        }
        Within {
            luminance: freedom * self.spread_luminance / divisor,
            compressed: freedom * (self.spread_compressed / divisor).sqrt(),
            freedom,
        }
    }

    /// Standard deviations of one sample about the surface's mean in this leaf, noise and the picture's own variation
    /// together: of luminance over its mean, and of compressed luminance.
    pub fn total_deviation(&self) -> (f32, f32) {
        let divisor = (self.weight - self.weight_squared / self.weight).max(f32::MIN_POSITIVE);
        let mean = self.luminance().max(f32::MIN_POSITIVE);
        ((self.spread_luminance / divisor).sqrt() / mean, (self.spread_compressed / divisor).sqrt())
    }

    /// The noise of its samples, as far as it can be told.
    pub fn deviation(&self) -> Deviation {
        let scale = if self.within.freedom > 0.0 { 1.0 / self.within.freedom } else { 0.0 };
        Deviation {
            luminance: (self.within.luminance * scale).sqrt(),
            compressed: self.within.compressed * scale,
            freedom: self.within.freedom,
        }
    }
}

/// Where a leaf's surfaces are.
#[derive(Clone, Copy)]
struct Leaf {
    first: u32,
    count: u16,
    /// Surfaces that there is room for.
    room: u16,
}

/// All leaves of one size.
pub(crate) struct Level {
    pub width: usize,
    pub height: usize,
    leaves: Vec<Leaf>,
    surfaces: Vec<Surface>,
}

impl Level {
    fn new(width: usize, height: usize) -> Self {
        Self { width, height, leaves: Vec::with_capacity(width * height), surfaces: Vec::with_capacity(width * height) }
    }

    /// Surfaces of a leaf, nearest first.
    #[inline]
    pub fn leaf(&self, column: usize, row: usize) -> &[Surface] {
        let leaf = self.leaves[row * self.width + column];
        &self.surfaces[leaf.first as usize..leaf.first as usize + usize::from(leaf.count)]
    }

    /// Takes the surfaces from `first` on for the next leaf.
    fn end_leaf(&mut self, first: usize) {
        // Depth bins are 16 bits and surfaces lie at least two apart.
        let count = (self.surfaces.len() - first) as u16;
        self.leaves.push(Leaf { first: first as u32, count, room: count });
    }

    /// Puts other surfaces in the place of a leaf's.
    pub fn put(&mut self, column: usize, row: usize, surfaces: &[Surface]) {
        let leaf = &mut self.leaves[row * self.width + column];
        let count = surfaces.len() as u16;
        if count <= leaf.room {
            let first = leaf.first as usize;
            self.surfaces[first..first + surfaces.len()].copy_from_slice(surfaces);
            leaf.count = count;
        } else if let Some(&last) = surfaces.last() {
            // Twice the room each time: what is left behind is never more than what is in use.
            let room = count.next_power_of_two();
            *leaf = Leaf { first: self.surfaces.len() as u32, count, room };
            self.surfaces.extend_from_slice(surfaces);
            self.surfaces.extend(std::iter::repeat_n(last, usize::from(room - count)));
        }
    }

    fn pixels<S: Borrow<Sums>, B: Iterator<Item = (u16, S)>>(
        bins: impl Fn(usize) -> B,
        prefetch: impl Fn(usize),
        width: usize,
        height: usize,
    ) -> Self {
        let mut level = Self::new(width, height);
        for pixel in 0..width * height {
            prefetch(pixel + AHEAD);
            let first = level.surfaces.len();
            of_pixel(bins(pixel), &mut level.surfaces);
            level.end_leaf(first);
        }
        level
    }

    fn parent(&self, number: usize) -> Self {
        let mut level = Self::new(self.width.div_ceil(2), self.height.div_ceil(2));
        let mut parts = Vec::new();
        for row in 0..level.height {
            for column in 0..level.width {
                let first = level.surfaces.len();
                self.of_children(number, column, row, &mut parts, &mut level.surfaces);
                level.end_leaf(first);
            }
        }
        level
    }

    /// Adds to `surfaces` those of the leaf of level `number` above four of this one's. `parts` is scratch.
    pub fn of_children(
        &self,
        number: usize,
        column: usize,
        row: usize,
        parts: &mut Vec<Surface>,
        surfaces: &mut Vec<Surface>,
    ) {
        let gap = gap_allowed(number);
        parts.clear();
        for child_row in 2 * row..(2 * row + 2).min(self.height) {
            for child_column in 2 * column..(2 * column + 2).min(self.width) {
                parts.extend_from_slice(self.leaf(child_column, child_row));
            }
        }
        // Stable, and the order of children is fixed: the same bits every time.
        parts.sort_by_key(|part| part.bins.0);
        let mut parts = parts.iter();
        let Some(&nearest) = parts.next() else { return };
        let (mut open, mut joined) = (nearest, false);
        for part in parts {
            if adjacent(open.bins.1, part.bins.0, gap) {
                open.join(part);
                joined = true;
            } else {
                if joined {
                    open.close();
                }
                surfaces.push(open);
                (open, joined) = (*part, false);
            }
        }
        if joined {
            open.close();
        }
        surfaces.push(open);
    }
}

/// Adds to `surfaces` those of one pixel's bins, which are given nearest first.
pub(crate) fn of_pixel<S: Borrow<Sums>>(bins: impl Iterator<Item = (u16, S)>, surfaces: &mut Vec<Surface>) {
    let mut bins = bins.peekable();
    while let Some((first, sums)) = bins.next() {
        let mut last = first;
        let mut next = || {
            let (bin, sums) = bins.next_if(|(bin, _)| adjacent(last, *bin, gap_allowed(0)))?;
            last = bin;
            Some(sums)
        };
        // Mostly there is one bin, whose sums are not copied.
        let surface = match next() {
            None => Surface::new((first, first), sums.borrow()),
            Some(second) => {
                let mut joined = *sums.borrow();
                joined.join(second.borrow());
                while let Some(more) = next() {
                    joined.join(more.borrow());
                }
                Surface::new((first, last), &joined)
            }
        };
        surfaces.push(surface);
    }
}

/// All levels, from pixels, whose bins `bins` gives and `prefetch` asks for ahead, to leaves of at most `levels` doublings.
pub(crate) fn pyramid<S: Borrow<Sums>, B: Iterator<Item = (u16, S)>>(
    bins: impl Fn(usize) -> B,
    prefetch: impl Fn(usize),
    width: usize,
    height: usize,
    levels: usize,
) -> Vec<Level> {
    let mut pyramid = vec![Level::pixels(bins, prefetch, width, height)];
    while pyramid.len() <= levels {
        let finest = &pyramid[pyramid.len() - 1];
        if finest.width <= 1 && finest.height <= 1 {
            break;
        }
        pyramid.push(finest.parent(pyramid.len()));
    }
    pyramid
}

/// Steps from one bin to the next that still are one surface: a slanted surface drops further across a larger leaf.
pub(crate) fn gap_allowed(level: usize) -> u16 {
    1 + level.min(3) as u16
}

/// Whether a surface that ends at one bin goes on at another.
pub(crate) fn adjacent(end: u16, next: u16, gap: u16) -> bool {
    next <= end || (next < FAR && next - end <= gap)
}
