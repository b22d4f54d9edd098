//! Cells of samples: whose colour a pixel has, how far it goes, and what depth keeps apart.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

mod common;

use common::*;
use glam::DVec3;
use holo_display::{Cells, CellsParams, Filling, Frame, LeafSize, Quadtree, QuadtreeParams, SelectOptions, select_beams};
use holo_picture::{View, ViewKind, ViewSpec};
use holo_section::{BeamId, RayCoords, Sample, Section};
use proptest::prelude::*;
use std::sync::Arc;
use std::time::Duration;

const BOTH: [Filling; 2] = [Filling::Smooth, Filling::Constant];
const SOON: Duration = Duration::from_millis(1);
const LATE: Duration = Duration::from_millis(33);

fn empty(section: &Section, view: &View, size: (u32, u32), filling: Filling) -> Cells {
    Cells::new(Arc::from([section.clone()]), *view, size, CellsParams { filling, ..CellsParams::default() })
}

fn put(cells: &mut Cells, stored: &[Stored]) {
    stored.iter().for_each(|(beam, sample)| cells.insert(0, *beam, 1, std::slice::from_ref(sample)));
}

fn drawn(section: &Section, view: &View, size: (u32, u32), filling: Filling, stored: &[Stored]) -> Frame {
    let mut cells = empty(section, view, size, filling);
    put(&mut cells, stored);
    cells.draw()
}

fn bits(frame: &Frame) -> (Vec<[u32; 3]>, Vec<u32>, [u64; 4]) {
    (
        frame.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect(),
        frame.depth.iter().map(|depth| depth.to_bits()).collect(),
        [frame.uncovered_pixels, frame.empty_pixels, frame.unseen_pixels, frame.samples_used],
    )
}

/// Any ten bytes as a sample of any beam that the view crosses: all exponents, all distances.
fn any_samples() -> impl Strategy<Value = Vec<(usize, u16, Sample)>> {
    let sample = (any::<[u8; 4]>(), any::<[u8; 4]>(), any::<u16>(), any::<bool>()).prop_map(
        |(coords, mut rgbe, code, ordinary)| {
            if ordinary {
                rgbe[3] = 120 + rgbe[3] % 16;
            }
            Sample::from_codes(RayCoords(coords), rgbe, if ordinary { code % 4096 } else { code })
        },
    );
    prop::collection::vec((any::<usize>(), 1..70_u16, sample), 1..400)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn order_and_batches_change_no_bit_and_every_value_is_finite(mut samples in any_samples(), seed in any::<u64>()) {
        const SIZE: (u32, u32) = (24, 18);
        let (section, view) = (room_section(4), room_view(SIZE));
        let selection = select_beams(std::slice::from_ref(&section), &view, SIZE, &SelectOptions::default());
        let beam = |number: usize| -> BeamId { selection.beams[number % selection.beams.len()].beam };
        let mut pictures = Vec::new();
        for filling in BOTH {
            let mut cells = empty(&section, &view, SIZE, filling);
            samples.iter().for_each(|(number, paths, sample)| cells.insert(0, beam(*number), *paths, &[*sample]));
            let frame = cells.draw();
            prop_assert!(frame.picture.pixels.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
            prop_assert!(frame.depth.iter().all(|depth| *depth >= 0.0));
            pictures.push(bits(&frame));
        }
        let mut random = Random(seed);
        for last in (1..samples.len()).rev() {
            samples.swap(last, (random.bits() % (last as u64 + 1)) as usize);
        }
        for (filling, picture) in BOTH.into_iter().zip(pictures) {
            let mut cells = empty(&section, &view, SIZE, filling);
            // Another view before, so that nothing stays behind, and a picture in between.
            cells.insert(0, beam(0), 1, &[samples[0].2]);
            cells.reset(view);
            for (number, (place, paths, sample)) in samples.iter().enumerate() {
                cells.insert(0, beam(*place), *paths, &[*sample]);
                if number == samples.len() / 2 {
                    cells.redraw(LATE);
                }
            }
            prop_assert_eq!(&bits(&cells.draw()), &picture);
            cells.redraw(LATE);
            let resting = cells.redraw(LATE).map(bits);
            prop_assert!(resting.is_none_or(|resting| resting == picture));
        }
    }
}

/// A wall straight ahead: one depth, as near as makes no jump.
fn wall(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    ([0.5; 3], if direction.x > 0.0 { (10.0 - origin.x) / direction.x } else { f64::INFINITY })
}

/// Samples of a scene at random places of the picture, each of a colour of its own, and where they land, pixels from the left and top.
fn numbered(scene: Scene, section: &Section, view: &View, size: (u32, u32), count: usize, seed: u64) -> Vec<(Stored, [f64; 2])> {
    let stored = near_samples(scene, section, view, count, seed, clean);
    let place = |(number, (beam, sample)): (usize, Stored)| {
        let ray = section.ray(section.cells(beam).unwrap(), sample.coords);
        let surface = ray.origin + ray.direction * sample.distance(section.diagonal());
        let (x, y, _) = view.project(surface)?;
        let rgbe = [number as u8 | 1, (number >> 7) as u8, 128 + (number >> 15) as u8, 128];
        let stored = (beam, Sample::from_codes(sample.coords, rgbe, sample.distance_code()));
        Some((stored, [x * f64::from(size.0), (1.0 - y) * f64::from(size.1)]))
    };
    let mut found: Vec<(Stored, [f64; 2])> = stored.into_iter().enumerate().filter_map(place).collect();
    // Of two with one colour, one.
    found.sort_by_key(|((_, sample), _)| sample.rgbe);
    found.dedup_by_key(|((_, sample), _)| sample.rgbe);
    found.retain(|(_, [x, y])| (0.0..f64::from(size.0)).contains(x) && (0.0..f64::from(size.1)).contains(y));
    found
}

#[test]
fn a_constant_cell_is_the_nearest_sample_s_and_none_reaches_over_more_than_a_tenth_of_the_picture() {
    const SIZE: (u32, u32) = (120, 90);
    let (section, view) = (room_section(8), view([3.0, 4.0, 3.0], [10.0, 4.0, 3.0], 60.0, SIZE));
    let most = (0.1 * f64::from(SIZE.0 * SIZE.1) / std::f64::consts::PI).sqrt();
    for (count, seed) in [(1, 1), (3, 2), (40, 3), (900, 4), (12_000, 5)] {
        let samples = numbered(wall, &section, &view, SIZE, count, seed);
        let stored: Vec<Stored> = samples.iter().map(|(stored, _)| *stored).collect();
        let frame = drawn(&section, &view, SIZE, Filling::Constant, &stored);
        let (mut shown, mut far) = (0, 0);
        for (pixel, colour) in frame.picture.pixels.iter().enumerate() {
            let middle = [pixel as u32 % SIZE.0, pixel as u32 / SIZE.0].map(|at| f64::from(at) + 0.5);
            let distance = |place: &[f64; 2]| (place[0] - middle[0]).hypot(place[1] - middle[1]);
            let nearest = samples.iter().map(|(_, place)| distance(place)).fold(f64::INFINITY, f64::min);
            if *colour == [0.0; 3] {
                assert!(nearest > 0.5, "a pixel with a sample shows one");
                far += usize::from(nearest > most);
                continue;
            }
            shown += 1;
            let own = samples.iter().find(|((_, sample), _)| holo_section::rgbe::decode(sample.rgbe) == *colour);
            let own = distance(&own.expect("a colour of a sample").1);
            // One sample stands for all in its pixel; places are known to 1/256 of one.
            let slack = if count <= 900 { 0.006 } else { std::f64::consts::SQRT_2 };
            let is_alone = samples.iter().filter(|(_, place)| (distance(place) - own).abs() < 1.5).count() < 2;
            let slack = if is_alone { slack.min(0.006) } else { std::f64::consts::SQRT_2 };
            assert!(own <= nearest + slack, "{count}: {own} {nearest}");
            assert!(own <= most + 0.006, "{count}: {own} {most}");
        }
        if count == 1 {
            // All of the circle that is in the picture, and nothing else.
            assert!(shown + far == frame.picture.pixels.len(), "{shown} {far}");
        }
        if count >= 900 {
            // One place in 10,000 may be too far from all samples.
            assert!(shown + 5 >= frame.picture.pixels.len(), "no holes where there are samples all over: {shown}");
        }
    }
}

/// A red disc before a green wall.
fn disc(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let distance = (6.5 - origin.x) / direction.x;
    let place = origin + direction * distance;
    if direction.x > 0.0 && (place.y - 4.0).hypot(place.z - 3.0) < 1.0 {
        ([1.0, 0.0, 0.0], distance)
    } else {
        ([0.0, 1.0, 0.0], wall(origin, direction).1)
    }
}

/// Samples of random rays of the beams that a view wants, in proportion to their weight; about `count` of them are of rays that it may see.
fn spread_samples(scene: Scene, section: &Section, view: &View, size: (u32, u32), count: usize, seed: u64) -> Vec<Stored> {
    let mut random = Random(seed);
    let selection = select_beams(std::slice::from_ref(section), view, size, &SelectOptions::default());
    let mut stored = Vec::new();
    for wanted in &selection.beams {
        let share = f64::from(wanted.weight) * count as f64 / selection.covered.pixels;
        for _ in 0..(share + random.unit()) as u32 {
            let coords = RayCoords((random.bits() as u32).to_le_bytes());
            stored.push(traced(scene, section, wanted.beam, coords, &mut random, clean));
        }
    }
    stored
}

#[test]
fn no_light_crosses_a_step_in_depth_no_halo_grows_and_nothing_shows_through() {
    const SIZE: (u32, u32) = (120, 90);
    const SEEDS: u64 = 16;
    let (section, view) = (room_section(4), view([3.0, 4.0, 3.0], [10.0, 4.0, 3.0], 60.0, SIZE));
    let reference = truth(disc, &view, SIZE, 4);
    let red = |pixels: &[[f32; 3]]| pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>();
    for density in [0.05, 0.2, 0.7] {
        for filling in BOTH {
            let (mut excess, mut leaf_excess) = (Vec::new(), Vec::new());
            let (mut through, mut inside) = (0.0, 0.0);
            for seed in 0..SEEDS {
                let count = (f64::from(SIZE.0 * SIZE.1) * density) as usize;
                let stored = spread_samples(disc, &section, &view, SIZE, count, seed);
                let frame = drawn(&section, &view, SIZE, filling, &stored);
                let leaves = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &stored).draw();
                leaf_excess.push(red(&leaves.picture.pixels) / red(&reference) - 1.0);
                for (pixel, colour) in frame.picture.pixels.iter().enumerate() {
                    // Pixels with samples that see both are mixtures of both, and few; what lies between samples is of one.
                    if filling == Filling::Constant {
                        assert!(colour[0] == 0.0 || colour[1] == 0.0, "{colour:?}");
                    }
                    let middle = [pixel as u32 % SIZE.0, pixel as u32 / SIZE.0].map(|at| f64::from(at) + 0.5);
                    // The disc's radius is 29.7 pixels.
                    if (middle[0] - 60.0).hypot(middle[1] - 45.0) < 29.7 - 3.0 / density.sqrt() {
                        inside += 1.0;
                        through += f64::from(u8::from(colour[1] > 0.0));
                    }
                }
                excess.push(red(&frame.picture.pixels) / red(&reference) - 1.0);
            }
            let mean = excess.iter().sum::<f64>() / SEEDS as f64;
            let variance = excess.iter().map(|excess| (excess - mean).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
            println!("quadtree {:+.4} {filling:?} {density}: area {mean:+.4} ± {:.4}, through {:.5}", leaf_excess.iter().sum::<f64>() / SEEDS as f64, (variance / SEEDS as f64).sqrt(), through / inside);
        }
    }
}
