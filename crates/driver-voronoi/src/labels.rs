//! Which pixels show parts of one surface, and where edges between surfaces are.
//!
//! Strips of rows are connected by all cores, then strips with each other.
//!
//! Invariant: labels follow from what the pixels see alone: a surface's is that of its first pixel, whatever the strips.

use super::surfaces::{NO_KEY, NO_LABEL, Seen, Window, image_of};
use holo_cpu::zeroed;
use holo_cpu::{Isa, Kernel};
use holo_display::PixelWidth;
use holo_display::for_bands;
use rustc_hash::FxHashMap;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Rows of a strip.
const ROWS: usize = 32;

/// What belongs together even where something in front keeps it apart: a side of a triangle, in one image.
type Part = ((u32, bool), u8, bool);

/// What is found out about a layer's pixels.
pub(crate) struct Labelled {
    /// A label for each pixel: neighbours that continue each other have the same, and so have parts of one side of a triangle.
    pub labels: Vec<u32>,
    /// Whether something else is seen in the 3 × 3 pixels around.
    pub edges: Vec<bool>,
    /// Where the images that are seen at all are seen.
    pub windows: Vec<Window>,
}

/// Labels, edges and windows of what pixels see, of which the keys are told too, in so many images. Nothing is seen but in `rows`.
pub(crate) fn label(
    (seen, keys): (&[Seen], &[u64]),
    width: usize,
    rows: &Range<usize>,
    pixel_width: PixelWidth,
    images: usize,
) -> Labelled {
    let mut labels: Vec<u32> = zeroed(seen.len());
    let found = Mutex::new((Vec::new(), vec![Window::nowhere(); images]));
    for_bands(&mut labels, width, ROWS, |part, labels| {
        if !touches(rows, part) {
            return;
        }
        let first = part * ROWS * width;
        let pixels = first..first + labels.len();
        let strip = Strip { seen: &seen[pixels.clone()], keys: &keys[pixels], width, pixel_width };
        let parts = strip.connect(labels);
        let windows = strip.windows(part * ROWS, images);
        let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
        found.0.push((part, parts));
        found.1.iter_mut().zip(windows).for_each(|(window, other)| window.join(&other));
    });
    let (mut strips, windows) = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    strips.sort_unstable_by_key(|&(part, _)| part);
    join_strips(seen, width, pixel_width, &mut labels, strips);
    let edges = edges(&labels, width, rows);
    let windows = (0..).zip(windows).filter(|(_, window)| window.low.0 < window.high.0);
    let windows = windows.map(|(image, window)| Window { image, ..window }).collect();
    Labelled { labels, edges, windows }
}

/// Whether a strip has any of these rows, or is beside one.
fn touches(rows: &Range<usize>, strip: usize) -> bool {
    rows.start <= (strip + 1) * ROWS && strip * ROWS <= rows.end
}

/// Some rows of a picture.
struct Strip<'a> {
    seen: &'a [Seen],
    keys: &'a [u64],
    width: usize,
    pixel_width: PixelWidth,
}

impl Strip<'_> {
    /// Labels within the strip: one more than the number of a surface's first pixel in it. Gives the first pixels of triangles' parts.
    fn connect(&self, labels: &mut [u32]) -> FxHashMap<Part, u32> {
        let mut parts = FxHashMap::default();
        let pixels = self.keys.len();
        for start in (0..pixels).step_by(self.width.max(1)) {
            let end = (start + self.width).min(pixels);
            let mut pixel = start;
            while pixel < end {
                // Most pixels are amid one triangle: what is to the left is known to be one with what is above.
                let amid = self.amid(pixel, end);
                if amid > 0 {
                    let label = labels[pixel - 1];
                    labels[pixel..pixel + amid].fill(label);
                    pixel += amid;
                    continue;
                }
                let skies = self.keys[pixel..end].iter().take_while(|&&key| key == NO_KEY).count();
                if skies == 0 {
                    self.connect_one(pixel, pixel > start, labels, &mut parts);
                }
                pixel += skies.max(1);
            }
        }
        let (mut last, mut first) = (NO_LABEL, NO_LABEL);
        for pixel in 0..labels.len() {
            let label = labels[pixel];
            // A label is that of an earlier pixel, which is done. Neighbours mostly have the same.
            if label != last {
                (last, first) = (
                    label,
                    label.checked_sub(1).map_or(NO_LABEL, |earlier| labels[earlier as usize]),
                );
            }
            // Where nothing is seen, memory stays untouched.
            if label != first {
                labels[pixel] = first;
            }
        }
        parts
    }

    /// How many pixels from this one on, before `end`, see the same part as those to their left and above them.
    fn amid(&self, pixel: usize, end: usize) -> usize {
        let Some(above) = pixel.checked_sub(self.width) else { return 0 };
        if pixel.is_multiple_of(self.width.max(1)) {
            return 0;
        }
        let key = self.keys[pixel - 1];
        if key == NO_KEY || self.keys[above - 1] != key {
            return 0;
        }
        let rows = self.keys[pixel..end].iter().zip(&self.keys[above..]);
        rows.take_while(|&(&here, &above)| (here == key) & (above == key)).count()
    }

    /// Connects a pixel with its neighbours to the left, if it has one, and above.
    fn connect_one(
        &self,
        pixel: usize,
        has_left: bool,
        labels: &mut [u32],
        parts: &mut FxHashMap<Part, u32>,
    ) {
        let here = &self.seen[pixel];
        let left = has_left.then(|| pixel - 1);
        let above = pixel.checked_sub(self.width);
        labels[pixel] = pixel as u32 + 1;
        let mut alone = true;
        for other in [left, above].into_iter().flatten() {
            if here.continues(&self.seen[other], self.pixel_width) {
                alone = alone && self.seen[other].side() != here.side();
                join(labels, pixel as u32, other as u32);
            }
        }
        // Only where a triangle begins can it be a new part of one: most pixels continue their neighbour's.
        if alone {
            let first = *parts.entry(part(here)).or_insert(pixel as u32);
            join(labels, pixel as u32, first);
        }
    }

    /// Where in the picture these rows, from `top`, show each image.
    fn windows(&self, top: usize, images: usize) -> Vec<Window> {
        let mut windows = vec![Window::nowhere(); images];
        if let [window] = &mut windows[..] {
            for (row, line) in self.keys.chunks(self.width.max(1)).enumerate() {
                let is_there = |key: &u64| *key != NO_KEY && image_of(*key) == 0;
                let Some((first, last)) =
                    line.iter().position(is_there).zip(line.iter().rposition(is_there))
                else {
                    continue;
                };
                let y = (top + row) as f32;
                window.join(&Window {
                    image: 0,
                    low: (first as f32, y),
                    high: (last as f32 + 1.0, y + 1.0),
                });
            }
            return windows;
        }
        for (row, line) in self.keys.chunks(self.width.max(1)).enumerate() {
            for (column, &key) in line.iter().enumerate().filter(|(_, key)| **key != NO_KEY) {
                if let Some(window) = windows.get_mut(usize::from(image_of(key))) {
                    let (x, y) = (column as f32, (top + row) as f32);
                    window.low = (window.low.0.min(x), window.low.1.min(y));
                    window.high = (window.high.0.max(x + 1.0), window.high.1.max(y + 1.0));
                }
            }
        }
        windows
    }
}

fn part(seen: &Seen) -> Part {
    (seen.side(), seen.image, seen.through)
}

/// Makes labels of strips, each with its number and the first pixels of its parts, those of the picture.
fn join_strips(
    seen: &[Seen],
    width: usize,
    pixel_width: PixelWidth,
    labels: &mut [u32],
    strips: Vec<(usize, FxHashMap<Part, u32>)>,
) {
    let size = ROWS * width;
    let touched: Vec<usize> = strips.iter().map(|&(strip, _)| strip).collect();
    // For the first pixels of surfaces in strips, which are few: the number of another one of the same surface, plus one.
    let mut firsts: Vec<u32> = zeroed(labels.len());
    let of = |labels: &[u32], pixel: usize| (pixel / size * size) as u32 + labels[pixel] - 1;
    let mut known: FxHashMap<Part, u32> = FxHashMap::default();
    for (number, parts) in strips {
        let top = number * size;
        for above in top.saturating_sub(width)..top {
            let pixel = above + width;
            if pixel < seen.len() && seen[pixel].continues(&seen[above], pixel_width) {
                join_firsts(&mut firsts, of(labels, pixel), of(labels, above));
            }
        }
        // The order of a map's entries changes nothing: the least number of a surface wins.
        for (part, pixel) in parts {
            let first = of(labels, top + pixel as usize);
            let other = *known.entry(part).or_insert(first);
            join_firsts(&mut firsts, first, other);
        }
    }
    let picture = &firsts;
    for_bands(labels, width, ROWS, |part, labels| {
        if touched.binary_search(&part).is_err() {
            return;
        }
        let top = (part * size) as u32;
        let (mut last, mut first) = (NO_LABEL, NO_LABEL);
        for label in labels.iter_mut().filter(|label| **label != NO_LABEL) {
            // Neighbours mostly have the same.
            if *label != last {
                (last, first) = (*label, first_of(picture, top + *label - 1) + 1);
            }
            *label = first;
        }
    });
}

fn first_of(firsts: &[u32], mut pixel: u32) -> u32 {
    while let Some(other) = firsts[pixel as usize].checked_sub(1).filter(|&other| other != pixel) {
        pixel = other;
    }
    pixel
}

fn join_firsts(firsts: &mut [u32], a: u32, b: u32) {
    let (ends, starts) = (first_of(firsts, a), first_of(firsts, b));
    let (least, most) = (ends.min(starts), ends.max(starts));
    for pixel in [a, b, most] {
        firsts[pixel as usize] = least + 1;
    }
}

/// The first pixel of a label within a strip; labels are one more than a pixel's number.
fn root(labels: &mut [u32], mut pixel: u32) -> u32 {
    while labels[pixel as usize] != pixel + 1 {
        let above = labels[labels[pixel as usize] as usize - 1];
        labels[pixel as usize] = above;
        pixel = above - 1;
    }
    pixel
}

fn join(labels: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(labels, a), root(labels, b));
    labels[a.max(b) as usize] = a.min(b) + 1;
}

/// Whether a pixel's label is not that of all 3 × 3 pixels around it.
fn edges(labels: &[u32], width: usize, rows: &Range<usize>) -> Vec<bool> {
    let mut edges = vec![false; labels.len()];
    for_bands(&mut edges, width, ROWS, |part, lines| {
        if !touches(rows, part) {
            return;
        }
        for (line, row) in lines.chunks_mut(width).zip(part * ROWS..) {
            Isa::best().run(Edges { line, row, labels });
        }
    });
    edges
}

/// Marks pixels of a row whose labels are not those of all around them.
struct Edges<'a> {
    line: &'a mut [bool],
    row: usize,
    labels: &'a [u32],
}

impl Kernel for Edges<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Edges { line, row, labels } = self;
        let width = line.len();
        let here = &labels[row * width..][..width];
        let rows = row.saturating_sub(1)..(row + 2).min(labels.len() / width);
        for around in rows.map(|row| &labels[row * width..][..width]) {
            differ(line, here, around);
        }
    }
}

/// Marks pixels of a row that differ from one of three in a row beside it, or in their own.
#[inline(always)]
fn differ(line: &mut [bool], here: &[u32], around: &[u32]) {
    for ((edge, here), beside) in line.iter_mut().zip(here).zip(around) {
        *edge |= here != beside;
    }
    if let (Some((_, line)), [_, here @ ..]) = (line.split_first_mut(), here) {
        for ((edge, here), before) in line.iter_mut().zip(here).zip(around) {
            *edge |= here != before;
        }
    }
    if let [_, around @ ..] = around {
        for ((edge, here), after) in line.iter_mut().zip(here).zip(around) {
            *edge |= here != after;
        }
    }
}
