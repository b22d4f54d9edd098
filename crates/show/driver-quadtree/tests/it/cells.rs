//! Cells of samples: which sample a pixel shows, how far cells reach, and what depth keeps apart.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

use crate::common::*;
use glam::DVec3;
use holo_display::{Frame, SelectOptions, select_beams};
use holo_driver_quadtree::{Filling, QuadtreeParams, ViewCells};
use holo_picture::{View, ViewKind, ViewSpec};
use holo_section::{BeamId, RayCoords, Sample, Section};
use proptest::prelude::*;
use std::sync::Arc;

const BOTH: [Filling; 2] = [Filling::Smooth, Filling::Constant];

fn empty(section: &Section, view: &View, size: (u32, u32), filling: Filling) -> ViewCells {
    ViewCells::new(Arc::from([section.clone()]), *view, size, filling, QuadtreeParams::default())
}

fn put(cells: &mut ViewCells, stored: &[Stored]) {
    stored
        .iter()
        .for_each(|(beam, sample)| cells.insert(key(0, *beam), 1, std::slice::from_ref(sample)));
}

fn drawn(
    section: &Section,
    view: &View,
    size: (u32, u32),
    filling: Filling,
    stored: &[Stored],
) -> Frame {
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
    fn order_and_batches_change_no_bit_and_every_value_is_finite(
        mut samples in any_samples(),
        seed in any::<u64>(),
    ) {
        const SIZE: (u32, u32) = (24, 18);
        let (section, view) = (room_section(4), room_view(SIZE));
        let selection = select_beams(std::slice::from_ref(&section), &view, SIZE, &SelectOptions::default());
        let beam = |number: usize| -> BeamId { selection.beams[number % selection.beams.len()].key.beam };
        let mut pictures = Vec::new();
        for filling in BOTH {
            let mut cells = empty(&section, &view, SIZE, filling);
            for (number, paths, sample) in &samples {
                cells.insert(key(0, beam(*number)), *paths, &[*sample]);
            }
            let frame = cells.draw();
            let mut channels = frame.picture.pixels.iter().flatten();
            prop_assert!(channels.all(|value| value.is_finite() && *value >= 0.0));
            prop_assert!(frame.depth.iter().all(|depth| *depth >= 0.0));
            pictures.push(bits(&frame));
        }
        let mut random = Random(seed);
        for last in (1..samples.len()).rev() {
            samples.swap(last, (random.bits() % (last as u64 + 1)) as usize);
        }
        for (filling, picture) in BOTH.into_iter().zip(pictures) {
            let mut cells = empty(&section, &view, SIZE, filling);
            for (number, paths, sample) in &samples {
                cells.insert(key(0, beam(*number)), *paths, &[*sample]);
            }
            prop_assert_eq!(&bits(&cells.draw()), &picture);
        }
    }
}

/// A wall straight ahead: one depth, as near as makes no jump.
fn wall(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    ([0.5; 3], if direction.x > 0.0 { (10.0 - origin.x) / direction.x } else { f64::INFINITY })
}

/// Returns samples of a scene at random places of the picture, each with its own colour. Also
/// returns where they land, in pixels from the left and top.
fn numbered(
    scene: Scene,
    section: &Section,
    view: &View,
    size: (u32, u32),
    count: usize,
    seed: u64,
) -> Vec<(Stored, [f64; 2])> {
    let stored = near_samples(scene, section, view, count, seed, clean);
    let place = |(number, (beam, sample)): (usize, Stored)| {
        let ray = section.ray(section.cells(beam).unwrap(), sample.coords);
        let surface = ray.origin + ray.direction * sample.distance(section.diagonal());
        let (x, y, _) = view.project(surface)?;
        let rgbe = [number as u8 | 1, (number >> 7) as u8, 128 + (number >> 15) as u8, 128];
        let stored = (beam, Sample::from_codes(sample.coords, rgbe, sample.distance_code()));
        Some((stored, [x * f64::from(size.0), (1.0 - y) * f64::from(size.1)]))
    };
    let mut found: Vec<(Stored, [f64; 2])> =
        stored.into_iter().enumerate().filter_map(place).collect();
    // One of two with the same colour.
    found.sort_by_key(|((_, sample), _)| sample.rgbe);
    found.dedup_by_key(|((_, sample), _)| sample.rgbe);
    found.retain(|(_, [x, y])| {
        (0.0..f64::from(size.0)).contains(x) && (0.0..f64::from(size.1)).contains(y)
    });
    found
}

#[test]
fn a_constant_cell_is_the_nearest_sample_s_and_none_reaches_over_more_than_a_tenth_of_the_picture()
{
    const SIZE: (u32, u32) = (120, 90);
    let (section, view) = (room_section(8), view([3.0, 4.0, 3.0], [10.0, 4.0, 3.0], 60.0, SIZE));
    let most = (0.1 * f64::from(SIZE.0 * SIZE.1) / std::f64::consts::PI).sqrt();
    for (count, seed) in [(1, 1), (3, 2), (40, 3), (900, 4), (12_000, 5)] {
        let samples = numbered(wall, &section, &view, SIZE, count, seed);
        let stored: Vec<Stored> = samples.iter().map(|(stored, _)| *stored).collect();
        let frame = drawn(&section, &view, SIZE, Filling::Constant, &stored);
        let (mut shown, mut far) = (0, 0);
        for (pixel, colour) in frame.picture.pixels.iter().enumerate() {
            let middle =
                [pixel as u32 % SIZE.0, pixel as u32 / SIZE.0].map(|at| f64::from(at) + 0.5);
            let distance = |place: &[f64; 2]| (place[0] - middle[0]).hypot(place[1] - middle[1]);
            let nearest =
                samples.iter().map(|(_, place)| distance(place)).fold(f64::INFINITY, f64::min);
            if *colour == [0.0; 3] {
                assert!(nearest > 0.5, "a pixel with a sample shows one");
                far += usize::from(nearest > most);
                continue;
            }
            shown += 1;
            let own = samples
                .iter()
                .find(|((_, sample), _)| holo_section::rgbe::decode(sample.rgbe) == *colour);
            let own = distance(&own.expect("a colour of a sample").1);
            // A cell's point is the middle of its sample's pixel: up to half a diagonal away.
            let placed = std::f64::consts::FRAC_1_SQRT_2 + 0.006;
            assert!(own <= nearest + 2.0 * placed, "{count}: {own} {nearest}");
            assert!(own <= most + placed, "{count}: {own} {most}");
        }
        if count == 1 {
            // The circle in the picture, and nothing else.
            assert!(shown + far == frame.picture.pixels.len(), "{shown} {far}");
        }
        if count >= 900 {
            // One place in 10,000 may be too far from all samples.
            assert!(
                shown + 5 >= frame.picture.pixels.len(),
                "no holes where there are samples all over: {shown}"
            );
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

/// Returns samples of random rays of the beams that a view wants, in proportion to their weight.
/// About `count` of the rays may be visible.
fn spread_samples(
    scene: Scene,
    section: &Section,
    view: &View,
    size: (u32, u32),
    count: usize,
    seed: u64,
) -> Vec<Stored> {
    let mut random = Random(seed);
    let selection =
        select_beams(std::slice::from_ref(section), view, size, &SelectOptions::default());
    let mut stored = Vec::new();
    for wanted in &selection.beams {
        let share = f64::from(wanted.weight) * count as f64 / selection.covered.pixels;
        for _ in 0..(share + random.unit()) as u32 {
            let coords = RayCoords((random.bits() as u32).to_le_bytes());
            stored.push(traced(scene, section, wanted.key.beam, coords, &mut random, clean));
        }
    }
    stored
}

#[test]
fn no_light_crosses_a_step_in_depth_no_halo_grows_and_nothing_shows_through() {
    const SIZE: (u32, u32) = (120, 90);
    const SEEDS: u64 = 16;
    /// Of the disc, pixels.
    const RADIUS: f64 = 29.69;
    let (section, view) = (room_section(4), view([3.0, 4.0, 3.0], [10.0, 4.0, 3.0], 60.0, SIZE));
    for (density, filling) in
        [0.05, 0.2, 0.7].into_iter().flat_map(|density| BOTH.map(|filling| (density, filling)))
    {
        let (mut growth, mut leaves) = (Vec::new(), Vec::new());
        let (mut through, mut inside, mut mixed) = (0_u32, 0_u32, 0_u32);
        for seed in 0..SEEDS {
            let count = (f64::from(SIZE.0 * SIZE.1) * density) as usize;
            let stored = spread_samples(disc, &section, &view, SIZE, count, seed);
            let frame = drawn(&section, &view, SIZE, filling, &stored);
            let tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &stored).draw();
            let radius = |frame: &Frame| {
                let red: f64 = frame.picture.pixels.iter().map(|pixel| f64::from(pixel[0])).sum();
                (red / std::f64::consts::PI).sqrt() - RADIUS
            };
            growth.push(radius(&frame));
            leaves.push(radius(&tree));
            for (pixel, (colour, depth)) in
                frame.picture.pixels.iter().zip(&frame.depth).enumerate()
            {
                let middle =
                    [pixel as u32 % SIZE.0, pixel as u32 / SIZE.0].map(|at| f64::from(at) + 0.5);
                let from_middle = (middle[0] - 60.0).hypot(middle[1] - 45.0);
                // A pixel shows both if its own samples pass near the eye and see both.
                if colour[0] > 0.0 && colour[1] > 0.0 {
                    assert!(
                        (from_middle - RADIUS).abs() < 1.5 && filling == Filling::Smooth,
                        "{colour:?} {from_middle}"
                    );
                    mixed += 1;
                } else if *colour != [0.0; 3] {
                    assert_eq!(colour[0] > 0.0, *depth < 5.0, "light and depth are of one surface");
                }
                if from_middle < RADIUS - 3.0 / density.sqrt() {
                    inside += 1;
                    through += u32::from(colour[1] > 0.0);
                }
            }
        }
        let mean = |of: &[f64]| of.iter().sum::<f64>() / SEEDS as f64;
        let (mean, leaves) = (mean(&growth), mean(&leaves));
        println!(
            "{filling:?}, {density} a pixel: the radius grows by {mean:.2} pixels (quadtree \
             {leaves:.2}), {mixed} mixed"
        );
        // Half a pixel is allowed because a pixel with two surfaces shows the nearer. Rays from
        // aside do not reach all of the wall beside the disc. A nearer surface that won within its
        // samples' spacing would grow by most of that spacing.
        assert!(
            mean < 0.5 + 0.25 / density.sqrt() && mean < leaves && mean > -0.5,
            "{mean} {leaves}"
        );
        assert!(through * 1000 <= inside, "{through} of {inside}");
        assert!(u64::from(mixed) < SEEDS * 30, "{mixed}");
    }
}

/// The wall ahead with stripes: most pixels have an edge.
fn stripes(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let (_, distance) = wall(origin, direction);
    let place = origin + direction * distance;
    let bright = f32::from(u8::from((3.1 * place.y + 1.3 * place.z).rem_euclid(1.0) < 0.4));
    ([0.2 + 0.7 * bright, 0.5 - 0.3 * bright, 0.3], distance)
}

#[test]
fn as_samples_grow_every_pixel_tends_to_the_mean_over_it() {
    const SIZE: (u32, u32) = (24, 18);
    const SEEDS: usize = 12;
    let (section, view) = (room_section(8), view([3.0, 4.0, 3.0], [10.0, 4.2, 3.1], 25.0, SIZE));
    let reference = truth(stripes, &view, SIZE, 64);
    let pictures = |a_pixel: usize| -> Vec<Frame> {
        let count = a_pixel * (SIZE.0 * SIZE.1) as usize;
        let of = |seed: usize| near_samples(stripes, &section, &view, count, seed as u64, clean);
        (0..SEEDS).map(|seed| drawn(&section, &view, SIZE, Filling::Smooth, &of(seed))).collect()
    };
    let error = |frames: &[Frame]| {
        frames.iter().map(|frame| relative_error(frame, &reference)).sum::<f64>() / SEEDS as f64
    };
    let (few, many) = (pictures(40), pictures(400));
    // The error of a mean of n falls as 1/n.
    let ratio = error(&few) / error(&many);
    assert!(ratio > 7.0, "ten times the samples: a {ratio:.1}th of the squared error");
    let (mut tested, mut worst) = (0, 0.0_f64);
    for (pixel, reference) in reference.iter().enumerate() {
        let values: Vec<f64> =
            many.iter().map(|frame| f64::from(frame.picture.pixels[pixel][1])).collect();
        let mean = values.iter().sum::<f64>() / SEEDS as f64;
        let variance =
            values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
        // Where colours hardly differ within a pixel, their rounding does.
        let error = (variance / SEEDS as f64).sqrt().max(2e-4 * mean);
        worst = worst.max((mean - f64::from(reference[1])).abs() / error);
        tested += 1;
    }
    // Student's t with 11 degrees of freedom passes 9.0 once in 10⁶ pixels: once in 2000 runs.
    assert!(tested == 432 && worst < 9.0, "{worst}");
}

#[test]
fn views_of_every_type_are_shown_as_well_as_by_leaves() {
    const SIZE: (u32, u32) = (96, 72);
    let section = room_section(8);
    for kind in ViewKind::ALL {
        let vh = match kind {
            ViewKind::Perspective => 70.0,
            ViewKind::Parallel => 2.5,
            ViewKind::Cylindrical => 320.0,
            ViewKind::Angular => 300.0,
            _ => 170.0,
        };
        let spec = ViewSpec {
            kind: Some(kind),
            vh: Some(vh),
            vp: Some(DVec3::new(3.3, 4.1, 3.0)),
            ..ViewSpec::default()
        };
        let spec = ViewSpec { vd: Some(DVec3::new(0.9, 0.35, -0.1)), ..spec };
        let (view, size) = spec.resolve(SIZE).unwrap();
        let mut random = Random(5);
        let mut stored = Vec::new();
        while stored.len() < 2000 {
            let Some((origin, direction)) = view.try_ray(random.unit(), random.unit()) else {
                continue;
            };
            let Some(hit) = section.line(origin, direction) else { continue };
            stored.push(traced(
                room,
                &section,
                section.beam(hit.pair),
                hit.coords,
                &mut random,
                clean,
            ));
        }
        let mut reference = vec![[0.0; 3]; (size.0 * size.1) as usize];
        for (pixel, reference) in reference.iter_mut().enumerate() {
            let (x, y) = View::pixel_centre(size, pixel as u32 % size.0, pixel as u32 / size.0);
            if let Some((origin, direction)) = view.try_ray(x, y) {
                *reference = room(origin, direction).0;
            }
        }
        let leaves = quadtree(&section, &view, size, QuadtreeParams::default(), &stored).draw();
        let leaves = relative_error(&leaves, &reference);
        for filling in BOTH {
            let frame = drawn(&section, &view, size, filling, &stored);
            let error = relative_error(&frame, &reference);
            println!("{kind:?} {filling:?}: {error:.4}, leaves {leaves:.4}");
            assert!(
                error < if filling == Filling::Smooth { leaves } else { 1.5 * leaves },
                "{kind:?} {filling:?} {error}"
            );
            // Pixels that look nowhere are black, and no others.
            let looks = |pixel: &usize| reference[*pixel] != [0.0; 3];
            let black = (0..reference.len())
                .filter(looks)
                .filter(|&pixel| frame.picture.pixels[pixel] == [0.0; 3]);
            assert!(
                black.count() as u64 <= frame.uncovered_pixels + reference.len() as u64 / 1000,
                "{kind:?}"
            );
        }
    }
}

#[test]
fn what_is_known_to_be_empty_is_the_sky_and_what_no_section_covers_is_0() {
    const SIZE: (u32, u32) = (40, 30);
    let section = room_section(4);
    // Past the section's side.
    let view = view([-4.0, 4.0, 5.0], [2.0, 4.0, 4.5], 70.0, SIZE);
    let params = QuadtreeParams { sky: [0.1, 0.2, 0.4].into(), ..QuadtreeParams::default() };
    let selection =
        select_beams(std::slice::from_ref(&section), &view, SIZE, &SelectOptions::default());
    for filling in BOTH {
        let mut cells =
            ViewCells::new(Arc::from([section.clone()]), view, SIZE, filling, params.clone());
        put(&mut cells, &near_samples(room, &section, &view, 300, 1, clean));
        let before = cells.draw();
        let pixels = before.picture.pixels.len() as u64;
        assert!(before.uncovered_pixels > pixels / 8 && before.uncovered_pixels < pixels * 7 / 8);
        let covered = |pixel: &usize| {
            let (x, y) = View::pixel_centre(SIZE, *pixel as u32 % SIZE.0, *pixel as u32 / SIZE.0);
            let (origin, direction) = view.ray(x, y);
            section.line(origin, direction).is_some()
        };
        for pixel in (0..pixels as usize).filter(|pixel| !covered(pixel)) {
            assert_eq!(before.picture.pixels[pixel], [0.0; 3]);
        }
        selection.beams.iter().for_each(|wanted| cells.insert_unseen(key(0, wanted.key.beam)));
        let after = cells.draw();
        // A few pixels' middles are in beams that no jittered ray has met.
        assert!(after.unseen_pixels + after.uncovered_pixels > pixels * 98 / 100);
        let is_sky = |pixel: &usize| {
            after.picture.pixels[*pixel] == [0.1, 0.2, 0.4] && after.depth[*pixel].is_infinite()
        };
        assert_eq!(
            (0..pixels as usize).filter(covered).filter(is_sky).count() as u64,
            after.unseen_pixels
        );
    }
}

#[test]
fn pictures_of_one_pixel_and_of_a_large_screen_have_no_hole() {
    for (size, count) in
        [((1, 1), 1), ((1, 1), 50), ((3, 1), 2), ((2, 67), 9), ((1920, 1080), 1000)]
    {
        let (section, view) =
            (room_section(4), view([3.3, 4.1, 3.2], [10.0, 4.3, 2.2], 60.0, size));
        let stored = near_samples(room, &section, &view, count, 3, clean);
        for filling in BOTH {
            let frame = drawn(&section, &view, size, filling, &stored);
            assert_eq!(frame.picture.pixels.len(), (size.0 * size.1) as usize);
            let holes = frame.picture.pixels.iter().filter(|pixel| **pixel == [0.0; 3]).count();
            let allowed =
                if filling == Filling::Constant { frame.picture.pixels.len() / 500 } else { 0 };
            // A tenth of a tiny picture is less than a pixel.
            let is_small = filling == Filling::Constant && (2..1000).contains(&(size.0 * size.1));
            assert!(holes <= allowed || is_small, "{size:?} {filling:?}: {holes}");
            if size == (1, 1) {
                assert_eq!(frame.empty_pixels, 0);
            }
        }
    }
}

/// A wall with two fifths in shadow.
fn shadow(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let (_, distance) = wall(origin, direction);
    let place = origin + direction * distance;
    ([if place.y + 0.4 * place.z > 4.7 { 0.8 } else { 0.0 }; 3], distance)
}

#[test]
fn clean_samples_are_not_blurred_and_noisy_ones_are_not_believed() {
    const SIZE: (u32, u32) = (120, 90);
    let (section, view) = (room_section(8), view([3.0, 4.0, 3.0], [10.0, 4.0, 3.0], 60.0, SIZE));
    let reference = truth(shadow, &view, SIZE, 4);
    let (mut clean_ratio, mut noisy_ratio, mut bright) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..8 {
        for (noise, ratios) in [(clean as Noise, &mut clean_ratio), (log_normal, &mut noisy_ratio)]
        {
            let stored = near_samples(shadow, &section, &view, 700, seed, noise);
            let frame = drawn(&section, &view, SIZE, Filling::Smooth, &stored);
            let leaves = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &stored).draw();
            ratios.push(relative_error(&frame, &reference) / relative_error(&leaves, &reference));
            bright.push(bias(&frame, &reference));
        }
    }
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    println!(
        "clean {:.2}, noisy {:.2} of the leaves' error; bias {:.3}",
        mean(&clean_ratio),
        mean(&noisy_ratio),
        mean(&bright)
    );
    assert!(mean(&clean_ratio) < 0.8 && mean(&noisy_ratio) < 1.0);
    assert!(mean(&bright).abs() < 0.05);
}

#[test]
fn few_samples_of_one_path_make_no_darker_picture_than_their_leaves() {
    const SIZE: (u32, u32) = (120, 90);
    let (section, view) = (room_section(8), room_view(SIZE));
    let reference = truth(room, &view, SIZE, 4);
    for count in [1080, 3240] {
        let (mut darker, mut worse) = (Vec::new(), Vec::new());
        for seed in 0..16 {
            let stored = near_samples(room, &section, &view, count, seed, one_path);
            let frame = drawn(&section, &view, SIZE, Filling::Smooth, &stored);
            let leaves = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &stored).draw();
            darker.push(bias(&leaves, &reference) - bias(&frame, &reference));
            worse.push(relative_error(&frame, &reference) / relative_error(&leaves, &reference));
        }
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        // One in fifty samples has a third of all light, so most neighbours are too dark.
        // Differences of pairs, at 3 standard errors.
        let squares: Vec<f64> = darker.iter().map(|by| (by - mean(&darker)).powi(2)).collect();
        let error = (mean(&squares) / (darker.len() - 1) as f64).sqrt();
        println!(
            "{count}: darker by {:.3} ± {error:.3}, {:.2} of the leaves' error",
            mean(&darker),
            mean(&worse)
        );
        assert!(mean(&darker) < 3.0 * error && mean(&worse) < 1.0, "{count}: {darker:?}");
    }
}
