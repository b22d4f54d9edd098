//! The pyramid of leaves: what each square of the picture holds, surface by surface.
//!
//! Level 0 is the pixels, each further level the squares of 2 × 2 of the one below. It is made in bands of rows, each through all the
//! levels that lie within it while it is in the cache, by all cores.
//!
//! What always holds:
//! - The surfaces of a leaf are disjoint in depth, nearest first, and each surface of a child lies within one of its parent.
//! - The same bins give the same bits, whichever memory is used again and however many threads there are.

use super::quarters::{Joined, LANES};
use super::sums::Summed;
use super::surface::{Bins, Surface, adjacent, gap_allowed, of_pixel};
use holo_display::for_bands;
use holo_cpu::{Isa, Kernel};
use holo_cpu::{prefetch, zeroed};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Pixels whose sums are asked for ahead, of those that are made.
const AHEAD: usize = 40;
/// Levels that are made band by band, of 2 to their number less one rows of pixels.
const BAND_LEVELS: usize = 6;

/// A leaf, one cache line: what it is read for lies together.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Leaf {
    /// Its surface, if that is a single one; else of no meaning.
    single: Surface,
    /// Several are elsewhere, from here on.
    first: u32,
    pub count: u16,
    /// How many there is room for there.
    room: u16,
}

const _: () = assert!(size_of::<Leaf>() == 64);

impl Leaf {
    /// Its surfaces, nearest first. `several` is where those of leaves of several are.
    #[inline(always)]
    fn surfaces<'a>(&'a self, several: &'a [Surface]) -> &'a [Surface] {
        let count = usize::from(self.count);
        if count <= 1 {
            &std::slice::from_ref(&self.single)[..count]
        } else {
            &several[self.first as usize..self.first as usize + count]
        }
    }

    #[inline(always)]
    fn put(&mut self, several: &mut Vec<Surface>, surfaces: &[Surface]) {
        // Depth bins are 16 bits and surfaces lie at least two apart.
        self.count = surfaces.len() as u16;
        match surfaces {
            [surface] => {
                self.single = *surface;
            }
            [.., last] if self.count > self.room => {
                // Twice the room each time: what is left behind is never more than what is in use.
                self.room = self.count.next_power_of_two();
                self.first = several.len() as u32;
                several.extend_from_slice(surfaces);
                several.extend(std::iter::repeat_n(*last, usize::from(self.room - self.count)));
            }
            _ => several[self.first as usize..][..surfaces.len()].copy_from_slice(surfaces),
        }
    }
}

/// Samples of surfaces together.
fn samples(surfaces: &[Surface]) -> u32 {
    surfaces.iter().fold(0, |sum, surface| sum.saturating_add(surface.count))
}

/// All leaves of one size.
pub(crate) struct Level {
    pub width: usize,
    pub height: usize,
    leaves: Vec<Leaf>,
    /// Samples of each leaf, row by row. Apart: in a burst all are read, and few leaves.
    pub samples: Vec<u32>,
    /// Those of leaves that have several, band by band.
    several: Vec<Vec<Surface>>,
    /// Rows of leaves to a band, as a logarithm.
    band: usize,
}

/// Leaves side by side.
trait Leaves {
    fn size(&self) -> (usize, usize);
    fn at(&self, column: usize, row: usize) -> &[Surface];
    fn row(&self, row: usize) -> &[Leaf];
}

impl Leaves for Level {
    fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    #[inline(always)]
    fn at(&self, column: usize, row: usize) -> &[Surface] {
        self.leaf(column, row)
    }

    #[inline(always)]
    fn row(&self, row: usize) -> &[Leaf] {
        &self.leaves[row * self.width..][..self.width]
    }
}

impl Level {
    fn new(number: usize, width: usize, height: usize) -> Self {
        // Larger leaves are one band.
        let band = (BAND_LEVELS - 1).checked_sub(number).unwrap_or(usize::BITS as usize - 1);
        let bands = (height.saturating_sub(1) >> band) + 1;
        let leaves = width * height;
        Self {
            width,
            height,
            leaves: zeroed(leaves),
            samples: zeroed(leaves),
            several: vec![Vec::new(); bands],
            band,
        }
    }

    /// Surfaces of a leaf, nearest first.
    #[inline(always)]
    pub fn leaf(&self, column: usize, row: usize) -> &[Surface] {
        self.leaves[row * self.width + column].surfaces(&self.several[row >> self.band])
    }

    /// Asks for a leaf's place, counted row by row.
    #[inline(always)]
    pub fn prefetch(&self, index: usize) {
        self.leaves.get(index).into_iter().for_each(prefetch);
    }

    /// Puts other surfaces in the place of a leaf's.
    pub fn put(&mut self, column: usize, row: usize, surfaces: &[Surface]) {
        let several = &mut self.several[row >> self.band];
        let index = row * self.width + column;
        self.leaves[index].put(several, surfaces);
        self.samples[index] = samples(surfaces);
    }

    /// The rows of one band each: empty, or as they are.
    fn parts(&mut self, is_empty: bool) -> impl Iterator<Item = LevelPart<'_>> {
        let Self { width, leaves, samples, several, band, .. } = self;
        let most = width
            .saturating_mul(1_usize.checked_shl(*band as u32).unwrap_or(usize::MAX))
            .min(leaves.len())
            .max(1);
        let leaves = leaves.chunks_mut(most).zip(samples.chunks_mut(most));
        leaves.zip(several).enumerate().map(move |(number, ((leaves, samples), several))| {
            if is_empty {
                several.clear();
            }
            let (width, height) = (*width, leaves.len() / *width);
            LevelPart { width, height, first: number * most, leaves, samples, several, is_empty }
        })
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
        let last = of_children(self, number, column, row, parts, surfaces);
        surfaces.extend(last);
    }
}

/// Some rows of a level that is being made.
struct LevelPart<'a> {
    width: usize,
    height: usize,
    /// Number of its first leaf in the level.
    first: usize,
    leaves: &'a mut [Leaf],
    samples: &'a mut [u32],
    several: &'a mut Vec<Surface>,
    /// Whether what its leaves hold is of no meaning.
    is_empty: bool,
}

impl Leaves for LevelPart<'_> {
    fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    #[inline(always)]
    fn at(&self, column: usize, row: usize) -> &[Surface] {
        self.leaves[row * self.width + column].surfaces(self.several)
    }

    #[inline(always)]
    fn row(&self, row: usize) -> &[Leaf] {
        &self.leaves[row * self.width..][..self.width]
    }
}

impl LevelPart<'_> {
    /// Gives a leaf its surfaces.
    #[inline(always)]
    fn set(&mut self, index: usize, surfaces: &[Surface]) {
        if self.is_empty {
            self.leaves[index] = Leaf::zeroed();
        }
        self.leaves[index].put(self.several, surfaces);
        self.samples[index] = samples(surfaces);
    }

    /// Gives a leaf none, as most have where samples are few.
    #[inline(always)]
    fn set_none(&mut self, index: usize) {
        let leaf = &mut self.leaves[index];
        self.samples[index] = 0;
        if self.is_empty {
            *leaf = Leaf::zeroed();
        } else {
            leaf.count = 0;
        }
    }

    /// Gives a leaf one surface. Read from where it has just been put together, as a whole, it would be waited for.
    #[inline(always)]
    fn set_one(&mut self, index: usize, surface: Surface) {
        self.take(index, Leaf { single: surface, first: 0, count: 1, room: 0 }, surface.count);
    }

    /// Takes a leaf of one surface or none, and how many samples it has.
    #[inline(always)]
    fn take(&mut self, index: usize, leaf: Leaf, samples: u32) {
        let own = &mut self.leaves[index];
        self.samples[index] = samples;
        if self.is_empty {
            *own = leaf;
        } else {
            // Where it has room for several stays known. What is there is not read: it would be waited for.
            (own.single, own.count) = (leaf.single, leaf.count);
        }
    }

    /// Makes those leaves of level `number` above others that are stale, by level and number.
    #[inline(always)]
    fn make(
        &mut self,
        number: usize,
        below: &impl Leaves,
        is_stale: &impl Fn(usize, usize) -> bool,
        scratch: &mut Scratch,
        isa: Isa,
    ) {
        let Scratch { parts, surfaces, joined, .. } = scratch;
        for row in 0..self.height {
            for first in (0..self.width).step_by(LANES) {
                let start = row * self.width + first;
                let lanes = 0..LANES.min(self.width - first);
                if !lanes.clone().any(|lane| is_stale(number, self.first + start + lane)) {
                    continue;
                }
                let quarters = |row: usize| {
                    if row < below.size().1 { &below.row(row)[2 * first..] } else { &[] }
                };
                joined.join(number, [quarters(2 * row), quarters(2 * row + 1)], isa);
                for lane in lanes {
                    if !is_stale(number, self.first + start + lane) {
                        continue;
                    }
                    if joined.left[lane] == 0 {
                        self.take(start + lane, joined.leaves[lane], joined.samples[lane]);
                    } else {
                        surfaces.clear();
                        let last = of_children(below, number, first + lane, row, parts, surfaces);
                        surfaces.extend(last);
                        self.set(start + lane, surfaces);
                    }
                }
            }
        }
    }
}

/// Adds to `surfaces` those of the leaf of level `number` above four others but the last, which it gives. `parts` is scratch.
#[inline(always)]
fn of_children(
    below: &impl Leaves,
    number: usize,
    column: usize,
    row: usize,
    parts: &mut Vec<Surface>,
    surfaces: &mut Vec<Surface>,
) -> Option<Surface> {
    let (width, height) = below.size();
    let nothing: &[Surface] = &[];
    let mut children = [nothing; 4];
    let mut most = 0;
    for (number, child) in children.iter_mut().enumerate() {
        let (column, row) = (2 * column + number % 2, 2 * row + number / 2);
        if column < width && row < height {
            *child = below.at(column, row);
            most = most.max(child.len());
        }
    }
    // Stable, and the order of children is fixed: the same bits every time.
    if most <= 1 {
        let mut sorted = [None; 4];
        for (count, surface) in children.into_iter().flatten().enumerate() {
            let mut at = count;
            while at > 0
                && sorted[at - 1]
                    .is_some_and(|before: &Surface| before.bins.first > surface.bins.first)
            {
                sorted[at] = sorted[at - 1];
                at -= 1;
            }
            sorted[at] = Some(surface);
        }
        join(sorted.into_iter().flatten(), number, surfaces)
    } else {
        parts.clear();
        children.into_iter().for_each(|child| parts.extend_from_slice(child));
        parts.sort_by_key(|part| part.bins.first);
        join(parts.iter(), number, surfaces)
    }
}

/// Adds to `surfaces` those of level `number` that `parts` of the one below, nearest first, are of but the last, which it gives.
#[inline(always)]
fn join<'a>(
    mut parts: impl Iterator<Item = &'a Surface>,
    number: usize,
    surfaces: &mut Vec<Surface>,
) -> Option<Surface> {
    let gap = gap_allowed(number);
    let mut open = parts.next()?.risen(number - 1);
    let mut joined = false;
    for part in parts {
        let part = part.risen(number - 1);
        if adjacent(open.bins.last, part.bins.first, gap) {
            open.join(&part);
            joined = true;
        } else {
            surfaces.push(if joined { open.closed() } else { open });
            (open, joined) = (part, false);
        }
    }
    Some(if joined { open.closed() } else { open })
}

/// Memory to be used again.
#[derive(Default)]
struct Scratch {
    parts: Vec<Surface>,
    surfaces: Vec<Surface>,
    stale: Vec<usize>,
    joined: Box<Joined>,
}

/// Puts those numbers into `list` that are wanted. Without a branch: which these are no processor can tell beforehand.
#[inline(always)]
fn list(numbers: Range<usize>, is_wanted: impl Fn(&usize) -> bool, list: &mut Vec<usize>) {
    list.clear();
    list.resize(numbers.len(), 0);
    let mut count = 0;
    for number in numbers {
        list[count] = number;
        count += usize::from(is_wanted(&number));
    }
    list.truncate(count);
}

/// The levels of one band, from the pixels on.
struct MakeBand<'a, 'b, F, P, I> {
    bins: &'a F,
    prefetch: &'a P,
    is_stale: &'a I,
    levels: &'a mut [LevelPart<'b>],
    isa: Isa,
}

impl<S, B, F, P, I> Kernel for MakeBand<'_, '_, F, P, I>
where
    S: Summed,
    B: Iterator<Item = (u16, S)>,
    F: Fn(usize) -> B,
    P: Fn(usize),
    I: Fn(usize, usize) -> bool,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut scratch = Scratch::default();
        let Some(pixels) = self.levels.first_mut() else { return };
        list(
            0..pixels.leaves.len(),
            |&index| (self.is_stale)(0, pixels.first + index),
            &mut scratch.stale,
        );
        for (at, &index) in scratch.stale.iter().enumerate() {
            let pixel = pixels.first + index;
            scratch
                .stale
                .get(at + AHEAD)
                .into_iter()
                .for_each(|&ahead| (self.prefetch)(pixels.first + ahead));
            let mut bins = (self.bins)(pixel);
            // Most pixels have one bin.
            match (bins.next(), bins.next()) {
                (None, _) => pixels.set_none(index),
                (Some((bin, sums)), None) => {
                    pixels.set_one(index, Surface::new(Bins::of(bin), &sums))
                }
                (Some(first), Some(second)) => {
                    let surfaces = &mut scratch.surfaces;
                    surfaces.clear();
                    of_pixel([first, second].into_iter().chain(bins), surfaces);
                    pixels.set(index, surfaces);
                }
            }
        }
        for number in 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(number);
            if let (Some(below), Some(level)) = (below.last(), above.first_mut()) {
                level.make(number, below, self.is_stale, &mut scratch, self.isa);
            }
        }
    }
}

/// What a pyramid is made from.
pub(crate) struct Source<F, P> {
    /// Width and height of the picture.
    pub size: (usize, usize),
    /// Doublings from pixels to the largest leaves at most.
    pub levels: usize,
    /// The bins of a pixel, nearest first.
    pub bins: F,
    /// Asks for them.
    pub prefetch: P,
    pub isa: Isa,
}

impl<S: Summed, B: Iterator<Item = (u16, S)>, F: Fn(usize) -> B + Sync, P: Fn(usize) + Sync>
    Source<F, P>
{
    /// All levels, from pixels on. The memory of others is used again if it is of a picture of the same size.
    pub fn pyramid(&self, memory: Option<Vec<Level>>) -> Vec<Level> {
        let is_alike =
            |memory: &Vec<Level>| memory.first().is_some_and(|level| level.size() == self.size);
        let mut pyramid = memory.filter(is_alike).unwrap_or_else(|| {
            let mut pyramid = vec![Level::new(0, self.size.0, self.size.1)];
            while pyramid.len() <= self.levels
                && pyramid.last().is_some_and(|last| last.width > 1 || last.height > 1)
            {
                let number = pyramid.len();
                pyramid.push(Level::new(
                    number,
                    pyramid[number - 1].width.div_ceil(2),
                    pyramid[number - 1].height.div_ceil(2),
                ));
            }
            pyramid
        });
        self.make(&mut pyramid, true, &|_, _| true);
        pyramid
    }

    /// Makes the leaves of a pyramid anew whose samples are no longer those that they were made of: with all above them, by level and
    /// number.
    pub fn renew(&self, pyramid: &mut [Level], is_stale: &(impl Fn(usize, usize) -> bool + Sync)) {
        self.make(pyramid, false, is_stale);
    }

    fn make(
        &self,
        pyramid: &mut [Level],
        is_empty: bool,
        is_stale: &(impl Fn(usize, usize) -> bool + Sync),
    ) {
        let mut bands: Vec<Vec<LevelPart>> = Vec::new();
        for level in pyramid.iter_mut().take(BAND_LEVELS) {
            for (number, part) in level.parts(is_empty).enumerate() {
                if bands.len() <= number {
                    bands.push(Vec::new());
                }
                bands[number].push(part);
            }
        }
        for_bands(&mut bands, 1, 1, |_, bands| {
            for levels in bands {
                self.isa.run(MakeBand {
                    bins: &self.bins,
                    prefetch: &self.prefetch,
                    is_stale,
                    levels,
                    isa: self.isa,
                });
            }
        });
        let mut scratch = Scratch::default();
        for number in BAND_LEVELS..pyramid.len() {
            let (below, above) = pyramid.split_at_mut(number);
            if let (Some(below), Some(level)) = (below.last(), above.first_mut()) {
                level.parts(is_empty).for_each(|mut part| {
                    part.make(number, below, is_stale, &mut scratch, self.isa)
                });
            }
        }
    }
}
