//! The 10-byte sample: colours without bias, distances within their stated error.

use crate::common::Rng;
use holo_section::{RayCoords, Sample, SampleKind, distance, rgbe};

#[test]
fn the_layout_is_coordinates_colour_and_little_endian_distance() {
    let sample = Sample::from_codes(RayCoords([1, 2, 3, 4]), [5, 6, 7, 8], 0x0a09);
    assert_eq!(bytemuck::bytes_of(&sample), [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
    let encoded = Sample::encode(RayCoords([9; 4]), [1.0, 0.5, 0.0], f64::INFINITY, 3.0, 77);
    assert_eq!(encoded.rgb(), [1.0, 0.5, 0.0]);
    assert_eq!(
        (encoded.distance_code(), encoded.distance(3.0)),
        (distance::NOTHING_HIT, f64::INFINITY)
    );
    for kind in [SampleKind::Uniform, SampleKind::ViewpointLimited, SampleKind::SingleRay] {
        assert_eq!(SampleKind::from_code(kind as u8), Some(kind));
    }
    assert_eq!(SampleKind::from_code(3), None);
}

#[test]
fn the_largest_channel_is_within_0_4_percent_and_the_others_within_a_step() {
    let mut rng = Rng(10);
    for _ in 0..500_000 {
        let scale = rng.between(-80.0, 80.0).exp();
        let rgb = [0; 3].map(|_| (rng.unit() * scale) as f32);
        let back = rgbe::decode(rgbe::encode(rgb, rng.next() as u32));
        let largest = f64::from(rgb.into_iter().fold(0.0, f32::max));
        for (x, y) in rgb.into_iter().zip(back) {
            let error = (f64::from(x) - f64::from(y)).abs();
            assert!(error <= largest / 127.5, "{rgb:?} became {back:?}");
            if f64::from(x) == largest {
                assert!(error <= 0.004 * largest, "{rgb:?} became {back:?}");
            }
        }
    }
}

#[test]
fn over_all_dithers_the_mean_of_a_smaller_channel_is_its_value() {
    // The dither itself rounds the first of the smaller channels. So 2¹⁶ evenly spaced dithers are
    // exact for multiples of 2⁻¹⁶ of a step.
    let mut rng = Rng(11);
    for _ in 0..20 {
        // The peak, just below 1, makes a step 1/256.
        let green = rng.below(255 << 16) as f64 / f64::from(256 << 16);
        let sum: f64 = (0..1u32 << 16)
            .map(|k| f64::from(rgbe::decode(rgbe::encode([0.9, green as f32, 0.0], k << 16))[1]))
            .sum();
        assert_eq!(sum / 65536.0, f64::from(green as f32));
    }
}

#[test]
fn rounding_has_no_bias_and_the_two_dithered_channels_are_independent() {
    let mut rng = Rng(12);
    for rgb in [
        [0.7f32, 0.123_456_7, 0.654_321],
        [3.1e-9, 3.099e-9, 3.1e-9],
        [0.999, 255.4, 255.3],
        [1e20, 1e16, 3e19],
    ] {
        let n = 400_000;
        let codes: Vec<[u8; 4]> = (0..n).map(|_| rgbe::encode(rgb, rng.next() as u32)).collect();
        let step = 2f64.powi(i32::from(codes[0][3]) - 136);
        let largest = (0..3).max_by(|&a, &b| rgb[a].total_cmp(&rgb[b]).then(b.cmp(&a))).unwrap();
        let mut centred: Vec<Vec<f64>> = Vec::new();
        for channel in (0..3).filter(|&c| c != largest) {
            let value = f64::from(rgb[channel]) / step;
            let fraction = value - value.floor();
            let sd = (fraction * (1.0 - fraction)).sqrt().max(1e-9);
            let z: Vec<f64> = codes.iter().map(|c| (f64::from(c[channel]) - value) / sd).collect();
            // In standard deviations of a mean of n samples: beyond 5 by chance once in 1.7
            // million.
            let mean = z.iter().sum::<f64>() / f64::from(n).sqrt();
            assert!(mean.abs() < 5.0, "{rgb:?} channel {channel}: {mean} standard errors");
            centred.push(z);
        }
        let correlation: f64 = centred[0].iter().zip(&centred[1]).map(|(a, b)| a * b).sum::<f64>()
            / f64::from(n).sqrt();
        assert!(correlation.abs() < 5.0, "{rgb:?}: correlation of {correlation} standard errors");
    }
}

#[test]
fn every_normalised_colour_survives_decoding_and_encoding() {
    let mut rng = Rng(13);
    for e in 1..=255u8 {
        for _ in 0..200 {
            let mut code = [rng.next() as u8, rng.next() as u8, rng.next() as u8, e];
            code[rng.below(3) as usize] |= 128;
            assert_eq!(rgbe::encode(rgbe::decode(code), rng.next() as u32), code);
        }
    }
}

#[test]
fn impossible_colours_become_the_nearest_possible() {
    let tiny = f32::from_bits(1);
    for dither in [0, 1 << 31, u32::MAX] {
        assert_eq!(rgbe::encode([0.0; 3], dither), [0; 4]);
        assert_eq!(rgbe::encode([f32::NAN, -1.0, f32::NEG_INFINITY], dither), [0; 4]);
        assert_eq!(rgbe::encode([tiny, tiny, tiny], dither), [0; 4]);
        assert_eq!(rgbe::encode([f32::INFINITY; 3], dither), [255; 4]);
        assert_eq!(rgbe::encode([f32::MAX, f32::NAN, -0.0], dither), [255, 0, 0, 255]);
        assert_eq!(rgbe::decode([255, 0, 0, 255])[0], rgbe::MAX_CHANNEL);
        assert_eq!(rgbe::decode(rgbe::encode([1.0, f32::NAN, 0.25], dither)), [1.0, 0.0, 0.25]);
    }
    assert_eq!(rgbe::decode([200, 100, 50, 0]), [0.0; 3]);
}

#[test]
fn every_distance_code_decodes_to_a_distance_that_encodes_to_it_and_they_increase() {
    for diagonal in [1e-4, 1.0, 12.0, 7.77e7] {
        let mut before = 0.0;
        for code in 0..distance::NOTHING_HIT {
            let d = distance::decode(code, diagonal);
            assert!(d > before && d.is_finite());
            assert_eq!(distance::encode(d, diagonal), code);
            before = d;
        }
    }
    assert_eq!(distance::decode(distance::NOTHING_HIT, 1.0), f64::INFINITY);
}

#[test]
fn distances_are_monotone_and_within_their_stated_error() {
    let mut rng = Rng(14);
    let diagonal = 12.0;
    let mut distances: Vec<f64> = (0..300_000).map(|_| rng.between(-12.0, 34.0).exp()).collect();
    distances.sort_by(f64::total_cmp);
    let mut before = 0;
    for d in distances {
        let code = distance::encode(d, diagonal);
        assert!(code >= before);
        before = code;
        let back = distance::decode(code, diagonal);
        let allowed = if d < diagonal { diagonal / 4096.0 * (1.0 + 1e-12) } else { 2.5e-4 * d };
        // The last code's step ends here. Its middle stands for all greater distances.
        let beyond = d > diagonal * (1.0 + 1.0 / 2048.0f64).powi(65535 - 2048);
        assert!((back - d).abs() <= allowed || beyond, "{d} became {back}");
    }
}

#[test]
fn distances_follow_the_original_where_the_border_is_the_same() {
    // Values written by the original for a border of 12.
    for (d, code, back) in [
        (1.0, 170, 0.999_023),
        (20.0, 3094, 20.000_72),
        (100.0, 6391, 100.006_851),
        (1000.0, 11108, 1000.144),
    ] {
        assert_eq!(distance::encode(d, 12.0), code);
        assert!((distance::decode(code, 12.0) - back).abs() < 5e-4 * back.max(1.0) * 1e-2, "{d}");
    }
}

#[test]
fn impossible_distances_have_codes_too() {
    assert_eq!(distance::encode(f64::NAN, 1.0), distance::NOTHING_HIT);
    assert_eq!(distance::encode(f64::INFINITY, 1.0), distance::NOTHING_HIT);
    assert_eq!(distance::encode(f64::MAX, 1.0), 65534);
    assert_eq!(distance::encode(f64::MAX, 1e-4), 65534);
    assert_eq!(distance::encode(-3.0, 1.0), 0);
    assert_eq!(distance::encode(f64::NEG_INFINITY, 1.0), 0);
    assert_eq!(distance::encode(1.0, 1.0), 2048);
}
