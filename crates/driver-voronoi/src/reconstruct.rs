//! Light for every pixel from the sums of its surface: as wide a mean as noise asks, no wider than the light allows.
//!
//! Means over ever wider tents (half-widths of 1, 2, 4, ... pixels), each over pixels of one label only. A pixel takes the
//! widest mean that lies within the confidence intervals of all narrower ones (the rule of intersecting confidence intervals:
//! Goldenshluger & Nemirovski 1997; Katkovnik 1999), or the first that is exact enough. So noise is averaged where light is
//! even, and a shadow's edge stays where the samples tell it from noise. The less it is sure that a mean lies within those
//! intervals, the more a pixel keeps of the narrower ones, where those are of samples enough: a mean that is only just taken changes
//! nothing, so that neither pixels side by side nor one picture and the next differ by which was.
//!
//! Pictures are made block by block: what a block's light was made of reaches as far as the widest tent that one of its pixels
//! looked at, so that new samples farther off than that change no bit of it.
//!
//! What always holds:
//! - Only pixels of the same label have a part in a pixel's light.
//! - As samples grow, every pixel tends to the mean of its own.

use super::blocks::{self, COLUMNS, Mask, ROWS};
use super::deposit::{Sums, luminance};
use super::light::{KNOWN, Light, OPEN};
use super::lone;
use super::shade::FULL_WEIGHT;
use super::surfaces::{NO_LABEL, Surfaces};
use super::tents::{KINDS, Passes};
use holo_cpu::zeroed;
use holo_cpu::{Isa, Kernel};
use holo_display::for_bands;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

/// Tents tried: the widest has 2⁷ pixels on each side of its middle.
const LEVELS: usize = 8;

/// Half the width of a confidence interval, in standard errors.
const CONFIDENCE: f32 = 3.0;

/// The same within two pixels of an edge: where surfaces meet or hide each other, light more often changes within some pixels than
/// elsewhere.
const BESIDE_EDGES: f32 = 2.0;

/// A mean with no more relative error than this is not widened: a step of an 8-bit display.
const ENOUGH: f32 = 0.004;

/// Samples from which a variance is estimated at the least, and of which a mean is that wider ones are held against.
const FEWEST: f32 = 12.0;

/// Rows of one piece of work where a row is made of those above and below: so many that what is shared between pieces is not much.
const MANY_ROWS: usize = 48;

/// What is kept of each mean: its luminance, its samples and their variance.
const KEPT: usize = 3;

/// Memory for reconstructing, kept from one picture to the next: to get it anew from the system took a sixth of a picture's time.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Sums of tents, and of those twice as wide.
    cells: Vec<f32>,
    wider: Vec<f32>,
    /// By level: rows of each of what is kept of means.
    means: Vec<Vec<f32>>,
    /// How near any mean that a pixel took came to not being taken, 1 being as near as may be.
    doubts: Vec<f32>,
}

/// Weight in sums of one sample along the eye's ray.
pub(crate) fn weight_of_one(paths: u16) -> f32 {
    (FULL_WEIGHT * u64::from(paths.max(1))) as f32
}

/// Light of every pixel. Samples are means of `paths` paths.
///
/// `before` is the light of some of these samples and the blocks whose sums are others now: only what they have a part in is made
/// again.
pub(crate) fn light(
    surfaces: &Surfaces,
    sums: &[Sums],
    paths: u16,
    before: Option<(Light, Mask)>,
    scratch: &mut Scratch,
) -> Light {
    let size = surfaces.size;
    let (width, height) = size;
    let seen = seen_blocks(surfaces);
    let (mut light, wanted) = match before {
        None => (Light::unknown(size), seen.clone()),
        Some((light, changed)) => {
            let reach = |block: usize| (1 << light.reaches[block]) - 1;
            let wanted =
                Mask::new(size, |block| seen.has(block) && changed.has_near(block, reach(block)));
            (light, wanted)
        }
    };
    light.restore();
    let labels = &surfaces.labels;
    let Scratch { cells, wider, means, doubts } = scratch;
    if doubts.len() != width * height {
        *doubts = zeroed(width * height);
    }
    for memory in [&mut *cells, &mut *wider] {
        if memory.len() != KINDS * width * height {
            *memory = zeroed(KINDS * width * height);
        }
    }
    let (one, with_samples) = (weight_of_one(paths), Labels::none(labels.len()));
    let mut open = wanted.clone();
    for level in 0..LEVELS {
        let step = (1_usize << level) / 2;
        // Narrow tents have a part in wide ones: as far off as all wider ones reach.
        let needed = open.widened((1 << (LEVELS - 1)) - (1 << level)).within(&seen);
        let runs = [needed.heightened(step).within(&seen).runs(width), needed.runs(width)];
        if means.len() == level {
            means.push(Vec::new());
        }
        let (means, kept) = means.split_at_mut(level);
        let Some(kept) = kept.first_mut() else { break };
        if kept.len() != KEPT * width * height {
            *kept = zeroed(KEPT * width * height);
        }
        let lines = choices(&mut light, size).into_iter().zip(wider.chunks_mut(KINDS * width));
        let lines = lines.zip(kept.chunks_mut(KEPT * width)).zip(doubts.chunks_mut(width));
        let lines =
            lines.map(|(((choices, sums), kept), doubts)| Line { choices, sums, kept, doubts });
        let mut lines: Vec<Line> =
            lines.filter(|line| !runs[1][line.choices.row / ROWS].is_empty()).collect();
        if level > 0 {
            // Rows a step apart, one after the other.
            lines.sort_unstable_by_key(|line| (line.choices.row % step, line.choices.row));
        }
        let found: Vec<Found> = (0..blocks::count(size)).map(|_| Found::default()).collect();
        let columns: Vec<_> = open.runs(width);
        for_bands(&mut lines, 1, if level > 0 { MANY_ROWS } else { ROWS }, |_, lines| {
            Isa::best().run(Part {
                lines,
                labels,
                width,
                sums,
                one,
                from: cells,
                means,
                step,
                runs: &runs,
                edges: &surfaces.edges,
                open: &columns,
                with_samples: &with_samples,
                found: &found,
            });
        });
        let reached = |block: usize| open.has(block).then(|| &found[block]);
        for block in 0..found.len() {
            if let Some(found) = reached(block) {
                // What has no samples yet may get some from as far as the widest tents reach.
                let starves = found.starves.load(Ordering::Relaxed);
                light.reaches[block] =
                    if starves { LEVELS as u8 - 1 } else { light.reaches[block].max(level as u8) };
                if level == 0 {
                    light.reaches[block] = 0;
                    light.without[block] = found.without.load(Ordering::Relaxed);
                }
            }
        }
        open = Mask::new(size, |block| {
            reached(block).is_some_and(|found| found.is_open.load(Ordering::Relaxed))
        });
        if !open.any() {
            break;
        }
        std::mem::swap(cells, wider);
    }
    let lone = lone::find(surfaces, sums, &light, one);
    light.replace(&lone);
    light
}

/// Blocks that see anything but the sky: no others have a part in any light, since the sky's label is no surface's.
///
/// Mirrors and panes are mostly small and far apart: their layers took a fifth of a picture's time where all that lies between them was
/// added up too.
fn seen_blocks(surfaces: &Surfaces) -> Mask {
    let (width, height) = surfaces.size;
    let (columns, rows) = surfaces.bounds();
    let across = blocks::across(width).max(1);
    let part = |block: usize, size: usize, whole: usize, range: &Range<usize>| {
        (block * size).max(range.start)..((block + 1) * size).min(whole).min(range.end)
    };
    Mask::new(surfaces.size, |block| {
        let columns = part(block % across, COLUMNS, width, &columns);
        let mut rows = part(block / across, ROWS, height, &rows);
        let sees = |row: usize| {
            surfaces.labels[row * width..][columns.clone()].iter().any(|&label| label != NO_LABEL)
        };
        !columns.is_empty() && rows.any(sees)
    })
}

/// Labels, each in or not.
struct Labels(Vec<AtomicU64>);

impl Labels {
    fn none(pixels: usize) -> Labels {
        Labels((0..pixels / 64 + 1).map(|_| AtomicU64::new(0)).collect())
    }

    #[inline]
    fn insert(&self, label: u32) {
        let (word, bit) = (&self.0[label as usize / 64], 1 << (label % 64));
        // Mostly it is there already, and reading is cheap.
        if word.load(Ordering::Relaxed) & bit == 0 {
            word.fetch_or(bit, Ordering::Relaxed);
        }
    }

    #[inline]
    fn has(&self, label: u32) -> bool {
        self.0[label as usize / 64].load(Ordering::Relaxed) >> (label % 64) & 1 != 0
    }
}

/// What is found out about a block.
#[derive(Default)]
struct Found {
    /// Whether any choice is still open.
    is_open: AtomicBool,
    /// Whether a pixel's surface has no samples anywhere near.
    starves: AtomicBool,
    /// Surfaces' pixels without samples of their own.
    without: AtomicU32,
}

/// A row: its choices, where its sums go, where what is kept of its means goes, and its doubts.
struct Line<'a> {
    choices: Choices<'a>,
    sums: &'a mut [f32],
    kept: &'a mut [f32],
    doubts: &'a mut [f32],
}

/// Some rows' tents and choices of a level.
struct Part<'a, 'b> {
    lines: &'b mut [Line<'a>],
    labels: &'b [u32],
    width: usize,
    sums: &'b [Sums],
    one: f32,
    /// Narrower tents.
    from: &'b [f32],
    /// What is kept of all narrower tents' means.
    means: &'b [Vec<f32>],
    step: usize,
    /// By rows of blocks, columns that are wanted of the sums along rows, and of the tents.
    runs: &'b [Vec<Vec<Range<usize>>>; 2],
    /// Pixels with something else beside them.
    edges: &'b [bool],
    /// The same of blocks with open choices.
    open: &'b [Vec<Range<usize>>],
    with_samples: &'b Labels,
    found: &'b [Found],
}

impl Kernel for Part<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Part {
            lines,
            labels,
            width,
            sums,
            one,
            from,
            means,
            step,
            runs,
            edges,
            open,
            with_samples,
            found,
        } = self;
        let mut passes =
            (step > 0).then(|| Passes::new(from, labels, width, step, [&runs[0], &runs[1]]));
        for Line { choices, sums: line, kept, doubts } in lines {
            let row = choices.row;
            let pixels = row * width..(row + 1) * width;
            let labels = &labels[pixels.clone()];
            match &mut passes {
                Some(passes) => passes.widen(row, line),
                None => {
                    for columns in &runs[1][row / ROWS] {
                        let sums = &sums[pixels.clone()];
                        alone(sums, labels, one, columns, with_samples, line);
                    }
                }
            }
            for columns in &open[row / ROWS] {
                for left in columns.clone().step_by(COLUMNS) {
                    let segment = left..(left + COLUMNS).min(columns.end);
                    let found = &found[blocks::of(row * width + left, width)];
                    match means.len() {
                        0 => choices.begin(segment.clone(), labels, line, found),
                        1 => choices.leave_starving(segment.clone(), labels, with_samples, found),
                        _ => {}
                    }
                    if choices.is_open(&segment) {
                        let limits = limits(edges, width, row, &segment);
                        if choices.consider(line, means, (kept, doubts), &segment, &limits) {
                            found.is_open.store(true, Ordering::Relaxed);
                        }
                    }
                }
            }
        }
    }
}

/// Pixels whose sums are converted together.
const TOGETHER: usize = 16;

/// The sums of each pixel of these columns alone, and which labels have any.
#[inline(always)]
fn alone(
    sums: &[Sums],
    labels: &[u32],
    one: f32,
    columns: &Range<usize>,
    with_samples: &Labels,
    cells: &mut [f32],
) {
    let (width, share) = (labels.len(), one.recip());
    let mut last = NO_LABEL;
    for first in columns.clone().step_by(TOGETHER) {
        let pixels = first..(first + TOGETHER).min(columns.end);
        let (mut kinds, mut upper) = ([[0_u64; TOGETHER]; KINDS], 0);
        for (i, (sum, &label)) in
            sums[pixels.clone()].iter().zip(&labels[pixels.clone()]).enumerate()
        {
            let [red, green, blue] = sum.light;
            for (kind, value) in
                kinds.iter_mut().zip([red, green, blue, sum.weight, sum.square as u64])
            {
                kind[i % TOGETHER] = value;
            }
            upper |= sum.square >> 64;
            // Neighbours mostly have the same.
            if sum.weight != 0 && label != last {
                with_samples.insert(label);
                last = label;
            }
        }
        for (kind, values) in kinds.iter().enumerate() {
            let cells = &mut cells[kind * width..][pixels.clone()];
            let converted = values.map(|value| value as f32 * share);
            cells.copy_from_slice(&converted[..cells.len()]);
        }
        // Of 128 bits mostly the lower half alone is used.
        if upper != 0 {
            let squares = cells[(KINDS - 1) * width..][pixels.clone()].iter_mut();
            squares
                .zip(&sums[pixels])
                .for_each(|(square, sum)| *square = sum.square as f32 * share);
        }
    }
}

/// The square of what half a confidence interval is at these pixels, in standard errors.
#[inline(always)]
fn limits(edges: &[bool], width: usize, row: usize, segment: &Range<usize>) -> [f32; COLUMNS] {
    let (last, here) = (edges.len() / width - 1, row * width);
    let rows = [row.saturating_sub(1) * width, here, (row + 1).min(last) * width];
    let mut limits = [CONFIDENCE * CONFIDENCE; COLUMNS];
    for (limit, column) in limits.iter_mut().zip(segment.clone()) {
        let beside =
            edges[here + column.saturating_sub(1)] | edges[here + (column + 1).min(width - 1)];
        if beside | rows.iter().any(|row| edges[row + column]) {
            *limit = BESIDE_EDGES * BESIDE_EDGES;
        }
    }
    limits
}

/// The choices of a row's pixels.
struct Choices<'a> {
    row: usize,
    light: [&'a mut [f32]; 3],
    states: &'a mut [u8],
}

/// All rows' choices.
fn choices(light: &mut Light, (width, height): (usize, usize)) -> Vec<Choices<'_>> {
    let [red, green, blue] = &mut light.channels;
    let mut channels = [red, green, blue].map(|channel| channel.chunks_mut(width.max(1)));
    let rows = (0..height).zip(light.states.chunks_mut(width.max(1))).map(|(row, states)| {
        let light = channels.each_mut().map(|rows| rows.next().unwrap_or_default());
        Choices { row, light, states }
    });
    rows.collect()
}

impl Choices<'_> {
    /// Opens the choices of surfaces.
    #[inline(always)]
    fn begin(&mut self, segment: Range<usize>, labels: &[u32], cells: &[f32], found: &Found) {
        let weights = &cells[3 * labels.len()..];
        let mut without = 0;
        for column in segment {
            // The sky has no light to be found.
            let is_surface = labels[column] != NO_LABEL;
            self.states[column] = if is_surface { OPEN } else { 0 };
            without += u32::from(is_surface & (weights[column] == 0.0));
        }
        found.without.fetch_add(without, Ordering::Relaxed);
    }

    /// Closes the choices of surfaces without samples.
    #[inline(always)]
    fn leave_starving(
        &mut self,
        segment: Range<usize>,
        labels: &[u32],
        with_samples: &Labels,
        found: &Found,
    ) {
        for column in segment {
            if self.states[column] == OPEN && !with_samples.has(labels[column]) {
                self.states[column] = 0;
                found.starves.store(true, Ordering::Relaxed);
            }
        }
    }

    #[inline(always)]
    fn is_open(&self, segment: &Range<usize>) -> bool {
        self.states[segment.clone()].iter().any(|state| state & OPEN != 0)
    }

    /// Takes the next wider means where they may be had; whether any choice stays open.
    #[inline(always)]
    fn consider(
        &mut self,
        cells: &[f32],
        means: &[Vec<f32>],
        (kept, doubted): (&mut [f32], &mut [f32]),
        segment: &Range<usize>,
        limits: &[f32; COLUMNS],
    ) -> bool {
        let (width, left, count) = (self.states.len(), segment.start, segment.len().min(COLUMNS));
        let of = |kind: usize| &cells[kind * width + left..][..count];
        let (red, green, blue, weight, square) = (of(0), of(1), of(2), of(3), of(4));
        let (mut values, mut samples, mut variances) =
            ([0.0; COLUMNS], [0.0; COLUMNS], [0.0; COLUMNS]);
        // A tent's weights w have (Σw)²/Σw² = 9/4 Σw / max w.
        let spread = if means.is_empty() { 1.0 } else { 2.25 };
        let mut shares = [0.0; COLUMNS];
        for i in 0..count {
            let share = if weight[i] > 0.0 { weight[i].recip() } else { 0.0 };
            let value = luminance([red[i], green[i], blue[i]]) * share;
            let variance = square[i] * share - value * value;
            samples[i] = weight[i] * spread;
            (shares[i], values[i]) = (share, value);
            variances[i] = if variance > 0.0 { variance } else { 0.0 };
        }
        // The variance of the widest mean judges all: narrow ones, of few samples, would think that they agree. An edge
        // within it makes it too large, by so much that two samples on one side still tell. A narrow mean with a rare
        // bright sample knows best how little it knows.
        let (mut stops, mut doubts) = ([0_u8; COLUMNS], [0.0_f32; COLUMNS]);
        if !means.is_empty() {
            doubts[..count].copy_from_slice(&doubted[left..][..count]);
        }
        for narrower in means {
            let its = |what: usize| &narrower[(self.row * KEPT + what) * width + left..][..count];
            let (its_values, its_samples, its_variances) = (its(0), its(1), its(2));
            for i in 0..count {
                let larger =
                    if variances[i] > its_variances[i] { variances[i] } else { its_variances[i] };
                let apart = values[i] - its_values[i];
                let wanted = ENOUGH * its_values[i];
                // Its error is the root of the variance over the samples.
                let (off, limit) = (apart * apart * its_samples[i], limits[i] * larger);
                let stop = (larger <= wanted * wanted * its_samples[i]) | (off > limit);
                stops[i] |= u8::from(stop & (its_samples[i] > 0.0));
                let doubt = off / if limit > f32::MIN_POSITIVE { limit } else { f32::MIN_POSITIVE };
                // A few samples far off are not half believed: they would be seen as specks.
                doubts[i] = if (doubt > doubts[i]) & (its_samples[i] >= FEWEST) {
                    doubt
                } else {
                    doubts[i]
                };
            }
        }
        let states = &mut self.states[left..][..count];
        let doubted = &mut doubted[left..][..count];
        let mut open = 0;
        for i in 0..count {
            let stops = (samples[i] >= FEWEST) & (stops[i] != 0);
            let state = if stops { states[i] & !OPEN } else { states[i] };
            let takes = (state & OPEN != 0) & (samples[i] > 0.0);
            states[i] = state | if takes { KNOWN } else { 0 };
            open |= state;
            doubted[i] = if samples[i] >= FEWEST { doubts[i] } else { 0.0 };
            // Of what is not taken no samples are kept.
            samples[i] = if takes { samples[i] } else { 0.0 };
        }
        for (light, sums) in self.light.iter_mut().zip([red, green, blue]) {
            let light = &mut light[left..][..count];
            for i in 0..count {
                let mean = sums[i] * shares[i];
                let kept = if doubted[i] > 0.0 {
                    doubted[i] * doubted[i] * (light[i] - mean)
                } else {
                    0.0
                };
                light[i] = if samples[i] > 0.0 { mean + kept } else { light[i] };
            }
        }
        for (what, from) in [values, samples, variances].into_iter().enumerate() {
            kept[what * width + left..][..count].copy_from_slice(&from[..count]);
        }
        open & OPEN != 0
    }
}
