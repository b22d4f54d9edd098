//! Serpentine error-diffusion dither (Walter et al. 1999, §4, after Floyd & Steinberg 1976): pixels of high priority are chosen more
//! often, and chosen pixels keep their distance.
//!
//! What is left of a pixel's priority goes half to the next pixel and half to the pixel below. The picture is cut into bands of
//! rows that are dithered side by side: one band alone is a chain of additions, each waiting for the last.
//!
//! Always true: never more pixels are chosen than were wanted; priorities are whole numbers, so the choice is the same everywhere.

use super::parallel;
use holo_cpu::{Isa, Kernel};
use holo_display::mix;

/// Bands dithered side by side, a lane of a register each: four bands in scalar code took three times as long.
const BANDS: usize = 16;
/// Pictures of so many rows have twice as many bands, in two halves that two threads can share. Lower ones would have too few rows a band:
/// what a band begins with and ends with is left to chance.
const HALVED_FROM: usize = 1024;
/// Halves at most.
const HALVES: usize = 2;
/// Priorities are multiplied by this before they are halved, unless that makes the threshold too large.
const SCALE: u64 = 256;
/// Largest threshold, and most that a pixel hands on: sums of two stay far within u32.
const MOST: u32 = 1 << 30;

/// Appends about `wanted` pixels, never more, in proportion to their priority.
pub(super) fn choose(
    isa: Isa,
    threads: usize,
    priority: &[u8],
    width: usize,
    wanted: usize,
    seed: u32,
    chosen: &mut Vec<u32>,
) {
    let height = priority.len() / width;
    let total = isa.run(Sum(priority));
    if wanted == 0 || total == 0 {
        return;
    }
    let halves = if height < HALVED_FROM { 1 } else { HALVES };
    let rows = height / (halves * BANDS);
    let wanted_64 = wanted as u64;
    let scale = (u64::from(MOST) * wanted_64 / total).clamp(1, SCALE);
    let threshold = (total * scale).div_ceil(wanted_64).min(MOST.into()) as u32;
    // Each band starts with what a band above would leave it. Far down a uniform picture that was found to be threshold/2 * (1 - 0.6 d)
    // on average, d³ being the share of pixels that are chosen; spread evenly around that, the first rows have their share as well.
    let spread = 1.2 * (wanted as f64 / priority.len() as f64).min(0.5).cbrt();
    let span = (f64::from(threshold) / 2.0 * spread) as u32;
    let start = |first: usize| Start {
        most: threshold / 2,
        span,
        seed,
        first: first as u32,
        width: width as u32,
    };
    let mut hits: [[Vec<u32>; BANDS]; HALVES] = Default::default();
    let scale = scale as u32;
    let mut last = vec![[0_u32; 1]; width];
    let half = rows * BANDS * width;
    if rows > 0 {
        let mut carries = vec![vec![[0_u32; BANDS]; width]; halves];
        for (part, carries) in carries.iter_mut().enumerate() {
            isa.run(Begin { start: start(part * BANDS * width), carries });
        }
        let work = priority.chunks(half).zip(&mut carries).zip(&mut hits).zip(0..);
        let work = work.map(|(((priority, carries), hits), part)| {
            let first_row = part * rows * BANDS;
            Lockstep { priority, width, first_row, scale, threshold, carries, hits }
        });
        if threads > 1 {
            parallel::for_each(work.collect(), |kernel| isa.run(kernel));
        } else {
            work.for_each(|kernel| isa.run(kernel));
        }
        last.iter_mut()
            .zip(&carries[halves - 1])
            .for_each(|(last, carry)| last[0] = carry[BANDS - 1]);
    } else {
        isa.run(Begin { start: start(0), carries: &mut last });
    }
    // Rows that do not divide, or all rows of a low picture, follow the last band.
    let first_row = rows * BANDS * halves;
    let rest = &priority[first_row * width..];
    if let Some(hits) = hits[halves - 1].last_chunk_mut() {
        isa.run(Lockstep {
            priority: rest,
            width,
            first_row,
            scale,
            threshold,
            carries: &mut last,
            hits,
        });
    }
    // What bands started with and what they are left with differ by chance: of a few too many, a few are dropped, evenly, and others each
    // time: a corner that is always dropped is never seen again.
    let count: usize = hits.as_flattened().iter().map(Vec::len).sum();
    let phase = mix(!seed, 0) as usize % count.max(1);
    let quota = |index: usize| (index * wanted + phase) / count;
    let keep = |&(index, _): &(usize, u32)| quota(index) != quota(index + 1);
    let all = hits.into_iter().flatten().flatten().enumerate();
    chosen.extend(all.filter(|hit| count <= wanted || keep(hit)).map(|(_, pixel)| pixel));
}

/// Sum of all priorities.
struct Sum<'a>(&'a [u8]);

impl Kernel for Sum<'_> {
    type Output = u64;

    #[inline(always)]
    fn run(self) -> u64 {
        let mut total = 0;
        for part in self.0.chunks(1 << 16) {
            // Within u32 for 2¹⁶ bytes.
            let mut sum = 0;
            for &priority in part {
                sum += u32::from(priority);
            }
            total += u64::from(sum);
        }
        total
    }
}

/// What bands start with: `most` less a random part of `span`.
#[derive(Clone, Copy)]
struct Start {
    most: u32,
    span: u32,
    seed: u32,
    /// Index of the first number, and of those that belong to one band.
    first: u32,
    width: u32,
}

/// Fills in what `N` bands start with, column by column.
struct Begin<'a, const N: usize> {
    start: Start,
    carries: &'a mut [[u32; N]],
}

impl<const N: usize> Kernel for Begin<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Start { most, span, seed, first, width } = self.start;
        for (carry, x) in self.carries.iter_mut().zip(first..) {
            for (carry, band) in carry.iter_mut().zip(0..) {
                let random = u64::from(mix(seed, x.wrapping_add(width.wrapping_mul(band))));
                *carry = most - ((random * u64::from(span)) >> 32) as u32;
            }
        }
    }
}

/// `N` bands of as many rows each, all of `priority`.
struct Lockstep<'a, const N: usize> {
    priority: &'a [u8],
    width: usize,
    first_row: usize,
    scale: u32,
    threshold: u32,
    /// What each column of each band hands down.
    carries: &'a mut [[u32; N]],
    hits: &'a mut [Vec<u32>; N],
}

impl<const N: usize> Kernel for Lockstep<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { priority, width, first_row, scale, threshold, carries, hits } = self;
        let rows = priority.len() / width / N;
        let carries = &mut carries[..width];
        // The bands' priorities column by column, and which were chosen.
        let mut columns = vec![[0_u8; N]; width];
        for row in 0..rows {
            let lines: [&[u8]; N] =
                std::array::from_fn(|band| &priority[(band * rows + row) * width..][..width]);
            gather(&lines, &mut columns);
            // Serpentine. Nothing is lost at the edge: the next row begins below this one's last pixel.
            if row % 2 == 0 {
                let error = diffuse(columns.iter_mut().zip(carries.iter_mut()), scale, threshold);
                hand_down(carries.last_mut(), error);
            } else {
                let error =
                    diffuse(columns.iter_mut().zip(carries.iter_mut()).rev(), scale, threshold);
                hand_down(carries.first_mut(), error);
            }
            for (column, x) in columns.iter().zip(0..) {
                // A byte is 1 or 0.
                let mut bytes = [0; BANDS];
                bytes[..N].copy_from_slice(column);
                let mut bits = u128::from_le_bytes(bytes);
                while bits != 0 {
                    let band = bits.trailing_zeros() as usize / 8;
                    hits[band].push(((first_row + band * rows + row) * width + x) as u32);
                    bits &= bits - 1;
                }
            }
        }
    }
}

/// The numbers of each column of these lines.
#[inline(always)]
fn gather<const N: usize>(lines: &[&[u8]; N], columns: &mut [[u8; N]]) {
    let mut done = 0;
    if N == BANDS {
        // By squares: one number after another took half of the dither's time.
        for square in columns.as_flattened_mut().as_chunks_mut::<{ BANDS * BANDS }>().0 {
            let mut rows = [[0; BANDS]; BANDS];
            for (row, line) in rows.iter_mut().zip(lines) {
                *row = line[done..].first_chunk().copied().unwrap_or_default();
            }
            for (column, numbers) in square.as_chunks_mut().0.iter_mut().zip(transposed(rows)) {
                *column = numbers;
            }
            done += BANDS;
        }
    }
    for (x, column) in columns.iter_mut().enumerate().skip(done) {
        for (number, line) in column.iter_mut().zip(lines) {
            *number = line[x];
        }
    }
}

/// A square of numbers with rows and columns exchanged: each round turns the bits of all places, row before column, by one.
#[inline(always)]
fn transposed(mut square: [[u8; BANDS]; BANDS]) -> [[u8; BANDS]; BANDS] {
    const HALF: usize = BANDS / 2;
    for _ in 0..BANDS.ilog2() {
        let old = square;
        for row in 0..HALF {
            let (one, other) = (&old[row], &old[row + HALF]);
            for x in 0..HALF {
                (square[2 * row][2 * x], square[2 * row][2 * x + 1]) = (one[x], other[x]);
                (square[2 * row + 1][2 * x], square[2 * row + 1][2 * x + 1]) =
                    (one[x + HALF], other[x + HALF]);
            }
        }
    }
    square
}

/// Replaces the priorities of a row of each band by whether they were chosen; gives what is left at the end.
#[inline(always)]
fn diffuse<'a, const N: usize>(
    pixels: impl Iterator<Item = (&'a mut [u8; N], &'a mut [u32; N])>,
    scale: u32,
    threshold: u32,
) -> [u32; N] {
    let mut error = [0_u32; N];
    for (priority, below) in pixels {
        // Copies, so that nothing can overlap: else half of the loops that this becomes do one band after another.
        (*priority, *below, error) = step(*priority, *below, error, scale, threshold);
    }
    error
}

/// A pixel of each band: whether it is chosen, what goes down, what goes on.
#[inline(always)]
fn step<const N: usize>(
    priority: [u8; N],
    below: [u32; N],
    error: [u32; N],
    scale: u32,
    threshold: u32,
) -> ([u8; N], [u32; N], [u32; N]) {
    let (mut chosen, mut down, mut on) = ([0; N], [0; N], [0; N]);
    for band in 0..N {
        // More than that cannot be handed on: all around has been chosen already.
        let value = (u32::from(priority[band]) * scale + below[band] + error[band]).min(MOST);
        let hit = value >= threshold;
        let left = if hit { value - threshold } else { value };
        chosen[band] = u8::from(hit);
        down[band] = left / 2;
        on[band] = left - left / 2;
    }
    (chosen, down, on)
}

#[inline(always)]
fn hand_down<const N: usize>(below: Option<&mut [u32; N]>, error: [u32; N]) {
    if let Some(below) = below {
        below.iter_mut().zip(error).for_each(|(below, error)| *below += error);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_cpu::Instructions;

    fn isa() -> Isa {
        Isa::new(Instructions::best()).unwrap()
    }

    #[test]
    fn as_many_are_chosen_as_priority_says_and_never_too_many() {
        for size in [(200, 160), (200, HALVED_FROM + 5)] {
            as_many_are_chosen_of(size);
        }
    }

    fn as_many_are_chosen_of((width, height): (usize, usize)) {
        // Left half four times the right half.
        let priority: Vec<u8> =
            (0..width * height).map(|pixel| if pixel % width < 100 { 200 } else { 50 }).collect();
        for in_10_000 in [1, 10, 300, 2500, 6000, 19_000] {
            let wanted = (width * height * in_10_000).div_ceil(10_000);
            let mut chosen = Vec::new();
            choose(isa(), 1, &priority, width, wanted, 5, &mut chosen);
            assert!(chosen.len() <= wanted, "{} of {wanted}", chosen.len());
            // Each pixel at most once.
            chosen.sort_unstable();
            assert!(chosen.windows(2).all(|two| two[0] < two[1]), "{wanted}");
            if (300..=2500).contains(&in_10_000) {
                assert!(chosen.len() as f64 > 0.95 * wanted as f64, "{} of {wanted}", chosen.len());
                // Where few are chosen in a picture of many rows the left has 4.3 to 4.6 times as many, whatever the number of bands.
                if height > 160 && in_10_000 < 2500 {
                    continue;
                }
                let left = chosen.iter().filter(|&&pixel| pixel as usize % width < 100).count();
                let ratio = left as f64 / (chosen.len() - left) as f64;
                assert!((3.6..4.4).contains(&ratio), "{left} of {} are on the left", chosen.len());
            }
        }
    }

    #[test]
    fn columns_are_gathered_whatever_the_width() {
        for width in [1, 15, 16, 33, 64] {
            let number = |band: usize, x: usize| (31 * band + 7 * x) as u8;
            let lines: Vec<Vec<u8>> =
                (0..BANDS).map(|band| (0..width).map(|x| number(band, x)).collect()).collect();
            let mut columns = vec![[0; BANDS]; width];
            gather(&std::array::from_fn(|band| lines[band].as_slice()), &mut columns);
            for (x, column) in columns.iter().enumerate() {
                assert_eq!(*column, std::array::from_fn(|band| number(band, x)), "{x} of {width}");
            }
        }
    }

    #[test]
    fn chosen_pixels_keep_their_distance() {
        let width = 256;
        let mut chosen = Vec::new();
        choose(isa(), 1, &vec![100; width * width], width, width * width / 64, 9, &mut chosen);
        let place = |pixel: u32| (i64::from(pixel) % 256, i64::from(pixel) / 256);
        let near = chosen.iter().filter(|&&one| {
            chosen.iter().any(|&other| {
                let ((x, y), (u, v)) = (place(one), place(other));
                one != other && (x - u).pow(2) + (y - v).pow(2) < 9
            })
        });
        // Of independent pixels, 24 neighbours with chance 1/64 each: a third would have one so near.
        let share = near.count() as f64 / chosen.len() as f64;
        assert!(share < 0.05, "{share}");
    }
}
