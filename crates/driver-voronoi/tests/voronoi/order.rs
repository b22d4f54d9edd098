//! The order of samples, and what was drawn before, change no bit; what is asked for is in order, too.

use crate::common::{self, Random, view};
use crate::stage::{bits, even, plate, shadow};
use glam::DVec3;
use holo_display::Search;
use holo_driver_voronoi::Voronoi;
use holo_picture::View;
use holo_section::{BeamId, BeamKey, RayCoords, Sample};
use proptest::prelude::*;
use std::sync::Arc;

#[test]
fn beams_of_what_is_seen_are_in_order_and_hold_the_samples_that_serve() {
    let stage = plate();
    let canvas = stage.empty();
    let found = canvas.surface_beams(Search::Thorough).unwrap()();
    let beams: Vec<BeamKey> = found.iter().map(|(key, _)| *key).collect();
    assert!(beams.is_sorted() && beams.windows(2).all(|pair| pair[0] != pair[1]));
    let all = stage.samples(even, 60_000, common::clean);
    let (chosen, others): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|(beam, _)| beams.contains(&BeamKey { section: 0, beam: *beam }));
    let used = |samples: &[(BeamId, Sample)]| stage.draw(samples).samples_used;
    let (inside, outside) = (used(&chosen), used(&others));
    assert!(inside > 2000 && outside * 20 < inside, "{inside} {outside}");
    // Of those, the more useful ones hold more for each beam.
    let mut useful: Vec<f32> = found.iter().map(|(_, useful)| *useful).collect();
    useful.sort_by(f32::total_cmp);
    let least = useful[useful.len() / 4 * 3];
    let best: Vec<BeamKey> =
        found.iter().filter(|(_, u)| *u >= least).map(|(key, _)| *key).collect();
    let held: Vec<_> = chosen
        .iter()
        .filter(|(beam, _)| best.contains(&BeamKey { section: 0, beam: *beam }))
        .copied()
        .collect();
    let per_beam = |used: u64, beams: usize| used as f64 / beams as f64;
    assert!(per_beam(used(&held), best.len()) > per_beam(inside, beams.len()));
}

#[test]
fn a_picture_drawn_between_samples_changes_no_bit_of_the_next_one() {
    let stage = plate();
    let all = stage.samples(even, 20_000, common::exponential);
    let mut canvas = stage.empty();
    for (number, (beam, sample)) in all.iter().enumerate() {
        canvas.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample));
        if number % 7_000 == 0 {
            let first = canvas.draw();
            assert_eq!(
                bits(&first),
                bits(&canvas.draw()),
                "the same samples give the same picture"
            );
        }
    }
    assert_eq!(bits(&canvas.draw()), bits(&stage.draw(&all)));
}

#[test]
fn a_picture_of_many_blocks_that_is_mended_where_samples_come_is_the_same_as_one_made_anew() {
    // A shadow's edge, noise, and a plate that hides some of the wall: tents of all widths, and blocks far from all that is new.
    let stage = plate();
    let size = (300, 220);
    let view = view([0.5, 2.03, 2.01], [8.0, 2.1, 2.05], 50.0, size);
    let empty = || {
        Voronoi::new(Arc::from([stage.section.clone()]), Arc::clone(&stage.raycaster), view, size)
    };
    let mut all = stage.samples(shadow, 60_000, common::exponential);
    let (mut mended, mut anew) = (empty(), empty());
    // Beam after beam, so that what comes between two pictures lies in a part of it.
    let third = all.len() / 3;
    all[third..].sort_by_key(|(beam, _)| *beam);
    for part in all.chunks(4_000) {
        for canvas in [&mut mended, &mut anew] {
            part.iter().for_each(|(beam, sample)| {
                canvas.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample))
            });
        }
        assert!(mended.draw().samples_used > 0);
    }
    let (mended, anew) = (mended.draw(), anew.draw());
    assert_eq!(bits(&mended), bits(&anew));
    assert_eq!(mended.empty_pixels, anew.empty_pixels);
    assert_eq!(mended.guessed_pixels, anew.guessed_pixels);
}

/// Any ten bytes as a sample of any beam: all exponents, all distances.
fn any_samples() -> impl Strategy<Value = Vec<(u64, u16, Sample)>> {
    let sample = (any::<[u8; 4]>(), any::<[u8; 4]>(), any::<u16>(), any::<bool>()).prop_map(
        |(coords, mut rgbe, code, ordinary)| {
            if ordinary {
                rgbe[3] = 120 + rgbe[3] % 16;
            }
            Sample::from_codes(RayCoords(coords), rgbe, if ordinary { code % 4096 } else { code })
        },
    );
    prop::collection::vec((any::<u64>(), any::<u16>(), sample), 1..400)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_samples_give_a_finite_picture_and_their_order_changes_no_bit(
        wild in any_samples(), seed in any::<u64>(), size in (1..40_u32, 1..40_u32),
    ) {
        let mut stage = plate();
        stage.view = View::new(DVec3::new(0.5, 2.0, 2.0), DVec3::X, DVec3::Z, Some(70.0), Some(60.0), size).unwrap();
        let real = stage.samples(even, 2000, common::one_path).into_iter().map(|(beam, sample)| (beam.0, 1, sample));
        let count = stage.section.beam_count();
        let mut samples: Vec<_> = wild.into_iter().map(|(beam, paths, sample)| (beam % count, paths, sample)).chain(real).collect();
        let draw = |samples: &[(u64, u16, Sample)]| {
            let mut canvas =
                Voronoi::new(Arc::from([stage.section.clone()]), Arc::clone(&stage.raycaster), stage.view, size);
            for (beam, paths, sample) in samples {
                canvas.insert(BeamKey { section: 0, beam: BeamId(*beam) }, *paths, std::slice::from_ref(sample));
            }
            canvas.draw()
        };
        let first = draw(&samples);
        prop_assert!(first.picture.pixels.as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0));
        let mut random = Random(seed);
        for last in (1..samples.len()).rev() {
            samples.swap(last, (random.bits() % (last as u64 + 1)) as usize);
        }
        prop_assert_eq!(bits(&first), bits(&draw(&samples)));
    }
}
