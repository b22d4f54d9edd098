//! Tests of sums.

use super::*;
use holo_section::rgbe;
use proptest::prelude::*;

proptest! {
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
fn extreme_colours_neither_overflow_nor_vanish_into_nonsense() {
    let mut sums = Sums::default();
    for _ in 0..1000 {
        sums.add(&Colour::from_rgbe([255; 4]), 65_536, Some(0));
        sums.add(&Colour::from_rgbe([255, 255, 255, 1]), 65_536, Some(7));
    }
    assert!(sums.moments().mean.iter().all(|mean| mean.is_finite() && *mean > 1e12));
    assert_eq!(sums.near, [1000, 0, 0, 0]);
}

/// Of few and of many, of all brightnesses: what is kept is the whole sum.
#[test]
fn words_above_are_kept_wherever_a_sum_needs_them() {
    let grey = |exponent: u8| [128, 128, 128, exponent];
    let cases = [
        // Nothing, the near counts, the weights' squares and with them others, colours, their squares, and all at once.
        (grey(128), 8, None, 300, false),
        (grey(128), 8, Some(2), 300, true),
        ([0; 4], 65_536, None, 2, true),
        (grey(137), 64, None, 1000, true),
        (grey(150), 64, None, 1, true),
        ([255; 4], 65_536, Some(0), 300, true),
        // Blue alone: luminance tells nothing of a product that does not fit, nor of doublings.
        ([0, 0, 255, 136], 46_340, None, 300, true),
        ([0, 0, 1, 150], 64, None, 1, true),
        ([0, 0, 1, 144], 64, None, 1, false),
    ];
    for (rgbe, weight, near, count, has_high) in cases {
        let mut whole = Sums::default();
        let (mut packed, mut high) = (Packed::default(), High::default());
        for _ in 0..count {
            let colour = Colour::from_rgbe(rgbe);
            whole.add(&colour, weight, near);
            if !packed.add(&colour, weight, near) {
                let mut sums =
                    Kept { packed: &packed, high: packed.has_high().then_some(&high) }.sums();
                sums.add(&colour, weight, near);
                (packed, high) = sums.packed();
            }
        }
        let kept = Kept { packed: &packed, high: packed.has_high().then_some(&high) };
        assert_eq!(kept.sums(), whole);
        assert_eq!((kept.count(), kept.near()), (whole.count(), whole.near()));
        assert_eq!(packed.has_high(), has_high, "{rgbe:?} {weight} {count}");
        let (kept, whole) = (kept.moments(), whole.moments());
        assert_eq!(
            (kept.mean, kept.weight, kept.weight_squared),
            (whole.mean, whole.weight, whole.weight_squared)
        );
        assert_eq!(
            (kept.luminance_squared, kept.compressed, kept.compressed_squared),
            (whole.luminance_squared, whole.compressed, whole.compressed_squared)
        );
    }
}

#[test]
fn counts_end_at_the_most_that_there_is_room_for() {
    let colour = Colour::from_rgbe([1, 1, 1, 128]);
    let mut sums = Sums { count: MOST_COUNT - 1, ..Sums::default() };
    let (mut packed, _) = sums.packed();
    assert!(packed.add(&colour, 8, None) && !packed.add(&colour, 8, None));
    (0..3).for_each(|_| sums.add(&colour, 8, None));
    assert!(sums.count() == MOST_COUNT && !sums.packed().0.has_high());
}

#[test]
fn near_samples_of_a_class_end_at_the_most_that_there_is_room_for() {
    let colour = Colour::from_rgbe([1, 1, 1, 128]);
    let mut sums = Sums { count: 5, near: [MOST_NEAR - 1; NEAR_CLASSES], ..Sums::default() };
    (0..3).for_each(|_| sums.add(&colour, 8, Some(1)));
    let (packed, high) = sums.packed();
    let kept = Kept { packed: &packed, high: Some(&high) };
    assert_eq!(kept.near(), [MOST_NEAR - 1, MOST_NEAR, MOST_NEAR - 1, MOST_NEAR - 1]);
    assert_eq!(kept.sums(), sums);
}

/// Squares of the brightest samples end at the most, at some 1000 of them: not at 0.
#[test]
fn sums_end_at_the_most_that_there_is_room_for() {
    let colour = Colour::from_rgbe([255; 4]);
    let mut whole = Sums::default();
    let (mut packed, mut high) = (Packed::default(), High::default());
    for _ in 0..5000 {
        whole.add(&colour, 65_536, None);
        assert!(!packed.add(&colour, 65_536, None));
        let mut sums = Kept { packed: &packed, high: packed.has_high().then_some(&high) }.sums();
        sums.add(&colour, 65_536, None);
        (packed, high) = sums.packed();
    }
    assert_eq!(whole.luminance_squared, MOST_WIDE);
    assert_eq!(Kept { packed: &packed, high: Some(&high) }.sums(), whole);
}
