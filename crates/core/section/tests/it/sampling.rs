//! Uniform rays of a beam: spread over it, and different from beam to beam.
// Clippy allows these in tests, but not in the tests' helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use crate::common::{SHEARED, chi2, chi2_limit, cornell, section};
use holo_section::{BeamId, RayCoords, Section};

fn coords(section: &Section, index: u16, beam: u64, number: u32) -> [u8; 4] {
    section.beam_sampler(index, BeamId(beam), None).unwrap().coords(number).0
}

#[test]
fn the_rays_of_a_beam_are_in_the_beam_and_repeat_exactly() {
    let section = section([3.0, 2.0, 1.0], SHEARED, [3, 4, 5]);
    for beam in (0..section.beam_count()).map(BeamId) {
        let sampler = section.beam_sampler(3, beam, None).unwrap();
        assert!(!sampler.is_limited());
        for number in [0, 1, 77, u32::MAX] {
            let chosen = sampler.coords(number);
            assert_eq!(chosen.0, coords(&section, 3, beam.0, number));
            let ray = sampler.ray(chosen);
            let hit = section.line(ray.origin, ray.direction).unwrap();
            assert_eq!((section.beam(hit.pair), hit.coords), (beam, chosen));
        }
    }
    assert!(section.beam_sampler(0, BeamId(section.beam_count()), None).is_none());
}

#[test]
fn over_many_beams_each_sample_is_uniform_in_every_coordinate_and_pair_of_coordinates() {
    let section = cornell();
    let beams = 1u64 << 16;
    for number in [0, 1, 2, 5, 1000] {
        let all: Vec<[u8; 4]> = (0..beams).map(|beam| coords(&section, 0, beam, number)).collect();
        for a in 0..4 {
            let mut counts = [0u32; 256];
            all.iter().for_each(|c| counts[usize::from(c[a])] += 1);
            let found = chi2(&counts, beams as f64 / 256.0);
            assert!(found < chi2_limit(255.0), "sample {number}, coordinate {a}: chi² {found}");
            for b in 0..a {
                let mut counts = [0u32; 1024];
                all.iter().for_each(|c| {
                    counts[usize::from(c[a] >> 3) * 32 + usize::from(c[b] >> 3)] += 1
                });
                let found = chi2(&counts, beams as f64 / 1024.0);
                assert!(
                    found < chi2_limit(1023.0),
                    "sample {number}, coordinates {a} and {b}: chi² {found}"
                );
            }
        }
    }
}

#[test]
fn over_many_beams_two_samples_are_independent_within_their_strata() {
    // Samples 0 and 1 lie in different halves of each coordinate. Within the halves they are
    // independent. Three things are therefore uniform together: the half, the top 3 bits of one
    // position in its half, and the top 4 bits of the other.
    let section = cornell();
    let beams = 1u64 << 16;
    for a in 0..4 {
        let mut counts = [0u32; 2 * 8 * 16];
        for beam in 0..beams {
            let (x, y) = (coords(&section, 0, beam, 0)[a], coords(&section, 0, beam, 1)[a]);
            assert_ne!(x >> 7, y >> 7);
            counts[usize::from(x >> 7) * 128
                + usize::from(x >> 4 & 7) * 16
                + usize::from(y >> 3 & 15)] += 1;
        }
        let found = chi2(&counts, beams as f64 / 256.0);
        assert!(found < chi2_limit(255.0), "coordinate {a}: chi² {found}");
    }
}

#[test]
fn sections_do_not_share_their_samples() {
    let section = cornell();
    let same = (0..4096)
        .filter(|&beam| coords(&section, 0, beam, 0) == coords(&section, 1, beam, 0))
        .count();
    assert!(same <= 1, "{same} of 4096 agree in 32 bits");
}

#[test]
fn a_prefix_fills_a_beam_better_than_chance() {
    // 4096 samples go into the 4096 boxes of an 8×8×8×8 split. Random samples would leave a share
    // of 1/e = 36.8 % empty.
    let section = cornell();
    let sampler = section.beam_sampler(0, BeamId(4321), None).unwrap();
    let mut seen = vec![false; 4096];
    for number in 0..4096 {
        let RayCoords(c) = sampler.coords(number);
        seen[c.iter().fold(0, |sum, &x| sum * 8 + usize::from(x >> 5))] = true;
    }
    let empty = seen.iter().filter(|&&s| !s).count();
    println!("empty boxes: {empty} of 4096");
    // For random samples, the standard deviation is below 25 boxes.
    assert!(empty < 1507 - 10 * 25, "{empty} of 4096 boxes are empty");
}
