//! Tests of sums.

use super::*;
use holo_section::rgbe;
use proptest::prelude::*;
use std::collections::BTreeMap;

proptest! {
    #[test]
    fn a_pixel_keeps_its_nearest_bins_with_complete_sums(
        samples in prop::collection::vec((0..9_u16, any::<[u8; 4]>(), 1..70_000_u32), 0..200)
    ) {
        let mut bins = PixelBins::new(3);
        let mut model: BTreeMap<u16, Sums> = BTreeMap::new();
        for &(bin, rgbe, weight) in &samples {
            let colour = Colour::from_rgbe(rgbe);
            bins.add(1, bin, &colour, weight, Some(usize::from(bin) % NEAR_CLASSES));
            model.entry(bin).or_default().add(&colour, weight, Some(usize::from(bin) % NEAR_CLASSES));
        }
        let kept: Vec<(u16, Sums)> = bins.of(1).map(|(bin, sums)| (bin, *sums)).collect();
        let expected: Vec<(u16, Sums)> = model.into_iter().take(BINS_KEPT).collect();
        prop_assert_eq!(kept, expected);
        prop_assert_eq!(bins.of(0).count() + bins.of(2).count(), 0);
        prop_assert!(bins.further.len() < BINS_KEPT);
    }

    #[test]
    fn two_merged_are_as_if_all_had_been_added_to_one(
        samples in prop::collection::vec((0..9_u16, any::<[u8; 4]>(), 1..70_000_u32, any::<bool>()), 0..60)
    ) {
        let mut parts = [PixelBins::new(1), PixelBins::new(1)];
        let mut whole = PixelBins::new(1);
        for &(bin, rgbe, weight, part) in &samples {
            let colour = Colour::from_rgbe(rgbe);
            parts[usize::from(part)].add(0, bin, &colour, weight, None);
            whole.add(0, bin, &colour, weight, None);
        }
        let found: Vec<(u16, Sums)> = merged(&parts[0], &parts[1], 0).collect();
        let expected: Vec<(u16, Sums)> = whole.of(0).map(|(bin, sums)| (bin, *sums)).collect();
        prop_assert_eq!(found, expected);
    }

    /// Means are those of the decoded colours, over the whole range of scenes: 2⁻²⁰ to 4e12.
    #[test]
    fn means_are_exact(samples in prop::collection::vec((any::<[u8; 3]>(), 116..=170_u8, 1..70_000_u32), 1..20)) {
        let mut sums = Sums::default();
        let (mut weights, mut expected) = (0.0, [0.0; 3]);
        for &([r, g, b], exponent, weight) in &samples {
            let rgbe = [r, g, b, exponent];
            sums.add(&Colour::from_rgbe(rgbe), weight, None);
            weights += f64::from(weight);
            for (sum, channel) in expected.iter_mut().zip(rgbe::decode(rgbe)) {
                *sum += f64::from(weight) * f64::from(channel);
            }
        }
        for (mean, sum) in sums.moments().mean.into_iter().zip(expected) {
            prop_assert!((mean - sum / weights).abs() <= 1e-12 * mean, "{} {}", mean, sum / weights);
        }
    }
}

#[test]
fn moments_are_those_of_the_samples() {
    let rgbe = [[128, 64, 32, 129], [200, 220, 20, 127], [0, 0, 0, 0], [255, 255, 255, 133]];
    let mut sums = Sums::default();
    let (mut weights, mut square, mut root, mut root_square) = (0.0, 0.0, 0.0, 0.0);
    for (rgbe, weight) in rgbe.into_iter().zip([3, 8, 64, 20_u32]) {
        sums.add(&Colour::from_rgbe(rgbe), weight, None);
        let luminance = f64::from(luminance(rgbe::decode(rgbe)));
        let weight = f64::from(weight);
        weights += weight;
        square += weight * luminance * luminance;
        root += weight * luminance.powf(0.25);
        root_square += weight * luminance.sqrt();
    }
    // Fixed point keeps luminance to 2⁻²⁰ and its root to 2⁻¹², cut off.
    assert!((sums.moments().luminance_squared / (square / weights) - 1.0).abs() < 1e-5);
    let Moments { compressed: mean, compressed_squared: mean_square, .. } = sums.moments();
    assert!((mean - root / weights).abs() < 1.0 / 4096.0);
    assert!((mean_square - root_square / weights).abs() < 4.0 / 4096.0);
}

#[test]
fn bins_are_logarithmic_and_ordered() {
    let mut last = (0, 0.0);
    for step in 0..20_000 {
        let distance = 1e-4 * 1.002_f64.powi(step);
        let bin = depth_bin(distance * distance);
        assert!(bin >= last.0 && bin < FAR);
        if bin > last.0 && step > 0 && last.1 > 0.0 {
            assert_eq!(bin, last.0 + 1, "no bin is skipped by steps of 0.2 %");
        }
        last = (bin, distance);
        assert!((f64::from(bin_distance(bin)) / distance - 1.0).abs() < 0.016);
    }
    assert!(bin_distance(FAR).is_infinite());
    let octave = depth_bin(4.0 * 7.0 * 7.0) - depth_bin(7.0 * 7.0);
    assert_eq!(octave, BINS_AN_OCTAVE);
}

#[test]
fn extreme_colours_neither_overflow_nor_vanish_into_nonsense() {
    let mut sums = Sums::default();
    for _ in 0..1000 {
        sums.add(&Colour::from_rgbe([255; 4]), 65_536, Some(0));
        sums.add(&Colour::from_rgbe([255, 255, 255, 1]), 65_536, Some(7));
    }
    assert!(sums.moments().mean.iter().all(|mean| mean.is_finite() && *mean > 1e12));
    assert_eq!(sums.near, [1000, 0, 0, 0]);
}
