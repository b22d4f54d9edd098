//! Tests of sums.

use super::*;
use crate::sums::NEAR_CLASSES;
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
        let kept: Vec<(u16, Sums)> = bins.of(1).map(|(bin, sums)| (bin, sums.sums())).collect();
        let expected: Vec<(u16, Sums)> = model.into_iter().take(BINS_KEPT).collect();
        prop_assert_eq!(kept, expected);
        prop_assert_eq!(bins.of(0).count() + bins.of(2).count(), 0);
        prop_assert!(bins.further.packed.len() < BINS_KEPT);
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
        let expected: Vec<(u16, Sums)> = whole.of(0).map(|(bin, sums)| (bin, sums.sums())).collect();
        prop_assert_eq!(found, expected);
    }
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
