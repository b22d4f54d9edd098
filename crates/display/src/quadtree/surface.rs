//! The pyramid of leaves: what each square of the picture holds, surface by surface.
//!
//! Level 0 is the pixels, each further level the squares of 2 × 2 of the one below. A leaf lists its surfaces, nearest
//! first: depth bins are one surface while they are adjacent, so no mean is ever taken across a jump in depth.
//!
//! Invariant: the surfaces of a leaf are disjoint in depth, and each surface of a child lies within one of its parent.

use crate::quadtree::bins::{FAR, NEAR_CLASSES, Sums, luminance};

/// Degrees of freedom that an estimate of noise from finer leaves needs before a leaf's own spread is not used for it.
const ENOUGH_FREEDOM: f32 = 6.0;

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
    pub mean: [f32; 3],
    /// Mean of compressed luminance.
    pub compressed: f32,
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
        let exact_mean = sums.mean();
        let mean = exact_mean.map(|channel| channel as f32);
        let (weight, weight_squared) = (sums.weight(), sums.weight_squared());
        let (compressed, compressed_square) = sums.mean_compressed();
        let (mut spread_luminance, mut spread_compressed) = (0.0, 0.0);
        if sums.count > 1 {
            let [r, g, b] = exact_mean;
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
            mean,
            compressed: compressed as f32,
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
        let luminance_step = luminance(other.mean) - luminance(self.mean);
        let compressed_step = other.compressed - self.compressed;
        self.spread_luminance += other.spread_luminance + luminance_step * luminance_step * cross;
        self.spread_compressed += other.spread_compressed + compressed_step * compressed_step * cross;
        for (mean, new) in self.mean.iter_mut().zip(other.mean) {
            *mean += (new - *mean) * part;
        }
        self.compressed += compressed_step * part;
        self.weight = weight;
        self.weight_squared += other.weight_squared;
        self.count = self.count.saturating_add(other.count);
        self.bins = (self.bins.0.min(other.bins.0), self.bins.1.max(other.bins.1));
        self.within = self.within.plus(other.within);
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
        let mean = luminance(self.mean).max(f32::MIN_POSITIVE);
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

/// All leaves of one size.
pub(crate) struct Level {
    pub width: usize,
    pub height: usize,
    /// Where each leaf's surfaces begin, and one more for the end.
    first: Vec<u32>,
    surfaces: Vec<Surface>,
}

impl Level {
    /// Surfaces of a leaf, nearest first.
    #[inline]
    pub fn leaf(&self, column: usize, row: usize) -> &[Surface] {
        let index = row * self.width + column;
        &self.surfaces[self.first[index] as usize..self.first[index + 1] as usize]
    }

    fn pixels<B: Iterator<Item = (u16, Sums)>>(bins: impl Fn(usize) -> B, width: usize, height: usize) -> Self {
        let mut level = Self { width, height, first: Vec::with_capacity(width * height + 1), surfaces: Vec::new() };
        level.surfaces.reserve(width * height);
        level.first.push(0);
        for pixel in 0..width * height {
            let mut open: Option<((u16, u16), Sums)> = None;
            for (bin, sums) in bins(pixel) {
                match &mut open {
                    Some((range, joined)) if adjacent(range.1, bin, gap_allowed(0)) => {
                        range.1 = bin;
                        joined.join(&sums);
                    }
                    _ => {
                        level.surfaces.extend(open.map(|(range, sums)| Surface::new(range, &sums)));
                        open = Some(((bin, bin), sums));
                    }
                }
            }
            level.surfaces.extend(open.map(|(range, sums)| Surface::new(range, &sums)));
            level.first.push(level.surfaces.len() as u32);
        }
        level
    }

    fn parent(&self, number: usize) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut level = Self { width, height, first: Vec::with_capacity(width * height + 1), surfaces: Vec::new() };
        level.first.push(0);
        let gap = gap_allowed(number);
        let mut parts: Vec<Surface> = Vec::new();
        for row in 0..height {
            for column in 0..width {
                parts.clear();
                for child_row in 2 * row..(2 * row + 2).min(self.height) {
                    for child_column in 2 * column..(2 * column + 2).min(self.width) {
                        parts.extend_from_slice(self.leaf(child_column, child_row));
                    }
                }
                // Stable, and the order of children is fixed: the same bits every time.
                parts.sort_by_key(|part| part.bins.0);
                let mut parts = parts.iter();
                if let Some(&nearest) = parts.next() {
                    let (mut open, mut joined) = (nearest, false);
                    for part in parts {
                        if adjacent(open.bins.1, part.bins.0, gap) {
                            open.join(part);
                            joined = true;
                        } else {
                            if joined {
                                open.close();
                            }
                            level.surfaces.push(open);
                            (open, joined) = (*part, false);
                        }
                    }
                    if joined {
                        open.close();
                    }
                    level.surfaces.push(open);
                }
                level.first.push(level.surfaces.len() as u32);
            }
        }
        level
    }
}

/// All levels, from pixels, whose bins `bins` gives, to leaves of at most `levels` doublings.
pub(crate) fn pyramid<B: Iterator<Item = (u16, Sums)>>(
    bins: impl Fn(usize) -> B,
    width: usize,
    height: usize,
    levels: usize,
) -> Vec<Level> {
    let mut pyramid = vec![Level::pixels(bins, width, height)];
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
