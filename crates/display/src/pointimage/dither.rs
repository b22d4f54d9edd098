//! Serpentine error-diffusion dither (Walter et al. 1999, §4, after Floyd & Steinberg 1976): pixels of high priority are chosen more
//! often, and chosen pixels keep their distance.
//!
//! What is left of a pixel's priority goes half to the next pixel and half to the pixel below. The picture is cut into bands of
//! rows that are dithered side by side: one band alone is a chain of additions, each waiting for the last.
//!
//! Always true: never more pixels are chosen than were wanted; priorities are whole numbers, so the choice is the same everywhere.

use super::random;

/// Bands dithered side by side. Tried at 512²: 1, 2, 4, 8.
const BANDS: usize = 4;
/// Priorities are multiplied by this before they are halved.
const SCALE: u64 = 256;

/// Appends about `wanted` pixels, never more, in proportion to their priority.
pub(super) fn choose(priority: &[u8], width: usize, wanted: usize, seed: u32, chosen: &mut Vec<u32>) {
    let height = priority.len() / width;
    let total: u64 = priority.chunks(1 << 16).map(sum).sum();
    if wanted == 0 || total == 0 {
        return;
    }
    let bands = if height >= 2 * BANDS { BANDS } else { 1 };
    let threshold = (total * SCALE).div_ceil(wanted as u64);
    // Each band starts with what a band above would leave it. Far down a uniform picture that was found to be threshold/2 * (1 - 0.6 d)
    // on average, d³ being the share of pixels that are chosen; spread evenly around that, the first rows have their share as well.
    let spread = 1.2 * (wanted as f64 / priority.len() as f64).min(0.5).cbrt();
    let half = threshold as f64 / 2.0;
    let start = |index: usize| half * (1.0 - spread * f64::from(random::mix(seed, index as u32)) / f64::from(u32::MAX));
    let mut carries: Vec<Vec<u64>> =
        (0..bands).map(|band| (0..width).map(|x| start(band * width + x) as u64).collect()).collect();
    let rows = height / bands;
    let mut hits: [Vec<u32>; BANDS] = Default::default();
    if bands == BANDS {
        for row in 0..rows {
            let lines = std::array::from_fn(|band| &priority[(band * rows + row) * width..][..width]);
            let firsts = std::array::from_fn(|band| ((band * rows + row) * width) as u32);
            lockstep::<BANDS>(lines, firsts, &mut carries, row % 2 == 1, threshold, &mut hits);
        }
    }
    // Rows that do not divide, or all rows of a small picture, follow the last band.
    let from = if bands == BANDS { rows * BANDS } else { 0 };
    let last = bands - 1;
    for row in from..height {
        let line = [&priority[row * width..][..width]];
        lockstep::<1>(line, [(row * width) as u32], &mut carries[last..], row % 2 == 1, threshold, &mut hits[last..]);
    }
    // What bands started with and what they are left with differ by chance: of a few too many, a few are dropped, evenly.
    let count: usize = hits.iter().map(Vec::len).sum();
    let keep = |&(index, _): &(usize, u32)| index * wanted / count != (index + 1) * wanted / count;
    let all = hits.into_iter().flatten().enumerate();
    chosen.extend(all.filter(|hit| count <= wanted || keep(hit)).map(|(_, pixel)| pixel));
}

fn sum(priority: &[u8]) -> u64 {
    // Within u32 for 2¹⁶ bytes.
    priority.iter().map(|&priority| u32::from(priority)).sum::<u32>().into()
}

/// One row of each of `N` bands.
fn lockstep<const N: usize>(
    lines: [&[u8]; N],
    firsts: [u32; N],
    carries: &mut [Vec<u64>],
    backwards: bool,
    threshold: u64,
    hits: &mut [Vec<u32>],
) {
    let width = lines[0].len();
    let mut error = [0_u64; N];
    let mut carries = carries.iter_mut();
    let below: [&mut [u64]; N] =
        std::array::from_fn(|_| carries.next().map_or(&mut [][..], |carry| &mut carry[..width]));
    for step in 0..width {
        let x = if backwards { width - 1 - step } else { step };
        for band in 0..N {
            let mut value = u64::from(lines[band][x]) * SCALE + below[band][x] + error[band];
            if value >= threshold {
                value -= threshold;
                hits[band].push(firsts[band] + x as u32);
            }
            let half = value / 2;
            below[band][x] = half;
            error[band] = value - half;
        }
    }
    // The next row begins below the last pixel: nothing is lost at the edge.
    let end = if backwards { 0 } else { width - 1 };
    for band in 0..N {
        below[band][end] += error[band];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_are_chosen_as_priority_says_and_never_too_many() {
        let (width, height) = (200, 160);
        // Left half four times the right half.
        let priority: Vec<u8> = (0..width * height).map(|pixel| if pixel % width < 100 { 200 } else { 50 }).collect();
        for wanted in [1, 30, 1000, 8000, 20_000, 60_000] {
            let mut chosen = Vec::new();
            choose(&priority, width, wanted, 5, &mut chosen);
            assert!(chosen.len() <= wanted, "{} of {wanted}", chosen.len());
            // Each pixel at most once.
            chosen.sort_unstable();
            assert!(chosen.windows(2).all(|two| two[0] < two[1]), "{wanted}");
            if (1000..=8000).contains(&wanted) {
                assert!(chosen.len() as f64 > 0.95 * wanted as f64, "{} of {wanted}", chosen.len());
                let left = chosen.iter().filter(|&&pixel| pixel as usize % width < 100).count();
                let ratio = left as f64 / (chosen.len() - left) as f64;
                assert!((3.6..4.4).contains(&ratio), "{left} of {} are on the left", chosen.len());
            }
        }
    }

    #[test]
    fn chosen_pixels_keep_their_distance() {
        let width = 256;
        let mut chosen = Vec::new();
        choose(&vec![100; width * width], width, width * width / 64, 9, &mut chosen);
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
