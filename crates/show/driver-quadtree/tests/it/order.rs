//! A picture at rest is a function of the set of its samples.

use crate::common::*;
use holo_display::Frame;
use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_section::{BeamId, RayCoords, Sample};
use proptest::prelude::*;
use std::sync::Arc;

const SIZE: (u32, u32) = (24, 18);

fn bits(frame: &Frame) -> (Vec<[u32; 3]>, Vec<u32>, [u64; 3]) {
    (
        frame.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect(),
        frame.depth.iter().map(|depth| depth.to_bits()).collect(),
        [frame.uncovered_pixels, frame.empty_pixels, frame.samples_used],
    )
}

/// Any ten bytes as a sample of any beam that the view crosses: all exponents, all distances.
fn samples() -> impl Strategy<Value = Vec<(usize, u16, Sample)>> {
    let sample = (any::<[u8; 4]>(), any::<[u8; 4]>(), any::<u16>(), any::<bool>()).prop_map(
        |(coords, mut rgbe, code, ordinary)| {
            if ordinary {
                rgbe[3] = 120 + rgbe[3] % 16;
            }
            Sample::from_codes(RayCoords(coords), rgbe, if ordinary { code % 4096 } else { code })
        },
    );
    prop::collection::vec((any::<usize>(), 1..70_u16, sample), 1..600)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn order_and_batches_change_no_bit(mut samples in samples(), seed in any::<u64>()) {
        let (section, view) = (room_section(4), room_view(SIZE));
        let selection = holo_display::select_beams(
            std::slice::from_ref(&section), &view, SIZE, &holo_display::SelectOptions::default());
        let beam = |number: usize| -> BeamId { selection.beams[number % selection.beams.len()].key.beam };
        let new = || Quadtree::new(Arc::from([section.clone()]), view, SIZE, QuadtreeParams::default());

        let mut first = new();
        for (number, paths, sample) in &samples {
            first.insert(key(0, beam(*number)), *paths, std::slice::from_ref(sample));
        }
        let mut random = Random(seed);
        for last in (1..samples.len()).rev() {
            samples.swap(last, (random.bits() % (last as u64 + 1)) as usize);
        }
        let mut shuffled = new();
        for (number, paths, sample) in &samples {
            shuffled.insert(key(0, beam(*number)), *paths, std::slice::from_ref(sample));
        }
        let mut batched = new();
        samples.sort_by_key(|&(number, paths, _)| (beam(number), paths));
        for same in samples.chunk_by(|a, b| (beam(a.0), a.1) == (beam(b.0), b.1)) {
            let batch: Vec<Sample> = same.iter().map(|sample| sample.2).collect();
            batched.insert(key(0, beam(same[0].0)), same[0].1, &batch);
        }
        let expected = bits(&first.draw());
        prop_assert_eq!(&expected, &bits(&shuffled.draw()));
        prop_assert_eq!(&expected, &bits(&batched.draw()));
        prop_assert_eq!(&expected, &bits(&first.draw()), "drawing twice");
    }
}

#[test]
fn a_realistic_picture_is_the_same_in_any_order() {
    let size = (80, 60);
    let (section, view) = (room_section(8), room_view(size));
    let mut stored = near_samples(room, &section, &view, 20_000, 1, one_path);
    stored.extend(batch_samples(room, &section, &view, size, 60_000, 2, one_path));
    let forwards = quadtree(&section, &view, size, QuadtreeParams::default(), &stored).draw();
    stored.reverse();
    let backwards = quadtree(&section, &view, size, QuadtreeParams::default(), &stored).draw();
    assert!(forwards.picture.pixels.iter().all(|pixel| pixel[1] > 0.0));
    assert_eq!(bits(&forwards), bits(&backwards));
    // And it does depend on the samples.
    stored.truncate(stored.len() - 100);
    let fewer = quadtree(&section, &view, size, QuadtreeParams::default(), &stored).draw();
    assert_ne!(bits(&forwards), bits(&fewer));
}

#[test]
fn unknown_sections_and_beams_are_left_out() {
    let (section, view) = (room_section(4), room_view(SIZE));
    let sample = Sample::from_codes(RayCoords([128; 4]), [128, 128, 128, 128], 3000);
    let mut tree =
        Quadtree::new(Arc::from([section.clone()]), view, SIZE, QuadtreeParams::default());
    let empty = bits(&tree.draw());
    tree.insert(key(1, BeamId(0)), 1, &[sample]);
    tree.insert(key(0, BeamId(section.beam_count())), 1, &[sample]);
    tree.insert(key(0, BeamId(u64::MAX)), 0, &[sample]);
    assert_eq!(empty, bits(&tree.draw()));
}
