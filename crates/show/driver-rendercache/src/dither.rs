//! The error-diffusion dither (Walter et al. 1999, §4, after Floyd & Steinberg 1976). It chooses
//! pixels of high priority more often, and spreads the chosen pixels evenly.
//!
//! Invariants:
//! - At most as many pixels are chosen as were wanted, and none twice.
//! - Priorities are whole numbers, so the choice is the same on any processor.

use holo_display::mix;

/// Priorities are multiplied by this, so that halving them loses little.
const SCALE: u64 = 256;

/// Returns at most, and about, `wanted` pixels, in proportion to their priority.
pub(crate) fn choose(priority: &[u8], width: usize, wanted: usize, seed: u32) -> Vec<u32> {
    let total = SCALE * priority.iter().map(|&priority| u64::from(priority)).sum::<u64>();
    if wanted == 0 || total == 0 {
        return Vec::new();
    }
    let threshold = total.div_ceil(wanted as u64);
    let mut below = first_row(width, threshold, wanted as f64 / priority.len() as f64, seed);
    let mut chosen = Vec::new();
    for (row, line) in priority.chunks(width).enumerate() {
        let mut error = 0;
        let mut visit = |x: usize| {
            let mut left = SCALE * u64::from(line[x]) + below[x] + error;
            if left >= threshold {
                left -= threshold;
                chosen.push((row * width + x) as u32);
            }
            // Half of the rest goes to the next pixel, and half to the pixel below.
            (below[x], error) = (left / 2, left - left / 2);
        };
        // Scanlines alternate in direction: the next one begins below this one's last pixel.
        if row % 2 == 0 {
            (0..width).for_each(&mut visit);
            below[width - 1] += error;
        } else {
            (0..width).rev().for_each(&mut visit);
            below[0] += error;
        }
    }
    drop_surplus(&mut chosen, wanted, seed);
    chosen
}

/// Returns the rest that the row above the picture would pass to the first row.
///
/// In a uniform picture, far from the top, the mean rest was found to be threshold/2 · (1 - 0.6 d).
/// Here d³ is the share of chosen pixels. Random values around this mean give the first rows their
/// share of pixels, and each frame other pixels.
fn first_row(width: usize, threshold: u64, share: f64, seed: u32) -> Vec<u64> {
    let span = threshold as f64 / 2.0 * 1.2 * share.min(0.5).cbrt();
    let random = |x: u32| f64::from(mix(seed, x)) / f64::from(u32::MAX);
    (0..width as u32).map(|x| threshold / 2 - (random(x) * span) as u64).collect()
}

/// Drops pixels evenly until `wanted` are left. Each seed drops other pixels, so that none is
/// dropped in every frame.
fn drop_surplus(chosen: &mut Vec<u32>, wanted: usize, seed: u32) {
    let count = chosen.len();
    if count > wanted {
        let phase = mix(!seed, 0) as usize % count;
        let quota = |index: usize| (index * wanted + phase) / count;
        let mut index = 0;
        chosen.retain(|_| {
            index += 1;
            quota(index - 1) != quota(index)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_chosen_in_proportion_to_priority_and_never_too_many() {
        let (width, height) = (200_usize, 160);
        // Left half four times the right half.
        let priority: Vec<u8> =
            (0..width * height).map(|pixel| if pixel % width < 100 { 200 } else { 50 }).collect();
        for in_10_000 in [1, 10, 300, 2500, 6000, 19_000] {
            let wanted = (width * height * in_10_000).div_ceil(10_000);
            let chosen = choose(&priority, width, wanted, 5);
            assert!(chosen.len() <= wanted, "{} of {wanted}", chosen.len());
            let mut sorted = chosen.clone();
            sorted.sort_unstable();
            sorted.dedup();
            assert_eq!(sorted.len(), chosen.len(), "{wanted}: a pixel is chosen twice");
            if (300..=2500).contains(&in_10_000) {
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
        let chosen = choose(&vec![100; width * width], width, width * width / 64, 9);
        let place = |pixel: u32| (i64::from(pixel) % 256, i64::from(pixel) / 256);
        let near = chosen.iter().filter(|&&one| {
            chosen.iter().any(|&other| {
                let ((x, y), (u, v)) = (place(one), place(other));
                one != other && (x - u).pow(2) + (y - v).pow(2) < 9
            })
        });
        // If pixels were independent, each of 24 neighbours would be chosen with probability 1/64,
        // and a third of the pixels would have a chosen one so near.
        let share = near.count() as f64 / chosen.len() as f64;
        assert!(share < 0.05, "{share}");
    }

    #[test]
    fn another_seed_chooses_other_pixels() {
        let [one, other] = [1, 2].map(|seed| choose(&[7; 64 * 64], 64, 128, seed));
        let same = one.iter().filter(|pixel| other.contains(pixel)).count();
        assert!(same < 32, "{same} of {} pixels are the same", one.len());
    }
}
