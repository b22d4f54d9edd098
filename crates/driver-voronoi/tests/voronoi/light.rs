//! How bright it is: what samples converge to, and what stands in for them.

use crate::common::{self, Random};
use crate::stage::{
    Light, SIZE, Stage, bits, bright, diffuse, error, even, kd, plate, shadow, shine, wall,
};
use glam::DVec3;
use holo_light::{Record, Store};
use holo_scene::{Bsdf, Material, Scene};
use holo_section::{BeamId, BeamKey, Sample};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

#[test]
fn light_converges_to_the_mean_of_each_pixel_and_shadows_stay_sharp() {
    let stage = Stage::new(&[wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0)], vec![diffuse([0.5; 3])]);
    let truth = stage.truth(shadow);
    let all = stage.samples(shadow, 1_200_000, common::exponential);
    let rms: Vec<f32> =
        [100, 10, 1].map(|part| error(&stage.draw(&all[..all.len() / part]), &truth).1).into();
    // Ten times the samples: of even light alone the error would fall to a third, of edges alone too.
    assert!(rms[1] < 0.7 * rms[0] && rms[2] < 0.7 * rms[1], "{rms:?}");
    // Samples on a pixel at the end, by the wall's share of all rays: the error is below that of the pixels' own means.
    let landed = stage.draw(&all).samples_used as f32 / truth.len() as f32;
    assert!(landed > 20.0 && rms[2] < 0.5 / landed.sqrt(), "{landed} {rms:?}");
}

#[test]
fn without_samples_surfaces_are_lit_from_the_eye_and_counted_and_lamps_shine() {
    let quads = [wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0), wall(5.0, [1.2, 3.1], [2.4, 1.4], 1)];
    let lamp =
        Material { emission: [3.0, 2.0, 1.0], two_sided_emission: true, ..diffuse([0.0; 3]) };
    let stage = Stage::new(&quads, vec![diffuse([0.5; 3]), lamp]);
    let drawn = stage.empty().draw();
    let shining = drawn.picture.pixels.iter().filter(|pixel| **pixel == [3.0, 2.0, 1.0]).count();
    assert!(shining > 50, "{shining}");
    assert!(drawn.picture.pixels.iter().all(|pixel| pixel[1] > 0.0), "nothing is black");
    assert_eq!(drawn.empty_pixels, u64::from(SIZE.0 * SIZE.1));
    let middles = drawn.depth.iter().filter(|&&depth| depth > 6.0).count();
    assert_eq!(drawn.guessed_pixels, middles as u64, "a lamp's light is no guess");
    assert!(drawn.guessed_pixels > 2000);
    let known = stage.draw(&stage.samples(even, 4000, common::clean));
    assert_eq!(known.guessed_pixels, 0);
}

/// A record of even light at a point of the wall at x = 8.
fn record(y: f32, z: f32, irradiance: f32, scene: &Scene) -> Record {
    let point = DVec3::new(8.0, f64::from(y), f64::from(z)) - scene.origin;
    Record {
        point: point.as_vec3().to_array(),
        radius: 3.0,
        normal: [-1.0, 0.0, 0.0],
        nearest: 2.0,
        irradiance: [irradiance; 3],
        error: 0.0,
        shift: [[0.0; 3]; 3],
        turn: [[0.0; 3]; 3],
        rays: 1,
        flags: 0,
        id: u64::from(y.to_bits()) << 32 | u64::from(z.to_bits()),
    }
}

#[test]
fn records_of_indirect_light_light_what_has_no_samples_and_nothing_that_they_do_not_see() {
    let stage = plate();
    let records = Store::new(0.01);
    let even = std::f32::consts::PI * 0.5;
    for y in -4..=8 {
        (-4..=8).for_each(|z| {
            assert!(
                records
                    .insert(record(y as f32, z as f32, even, stage.raycaster.scene()), |_| false)
            )
        });
    }
    let records = Arc::new(records);
    let drawn = stage.empty().with_records(Arc::clone(&records)).draw();
    let (mut wall, mut plate) = (0, 0);
    for (pixel, depth) in drawn.picture.pixels.iter().zip(&drawn.depth) {
        if *depth > 6.0 {
            wall += 1;
            // Half the light of the records: radiance is albedo times irradiance over π. Edges are mixtures.
            assert!((pixel[1] - 0.35).abs() < 1e-4 || pixel[1] < 0.35, "{pixel:?}");
        } else {
            plate += 1;
        }
    }
    assert!(wall > 1500 && plate > 300, "{wall} {plate}");
    assert_eq!(drawn.guessed_pixels, plate, "no record lies on the plate");
    let exact = drawn.picture.pixels.iter().filter(|pixel| (pixel[1] - 0.35).abs() < 1e-4).count();
    assert!(exact > 1300, "{exact}");
    // Where there are samples they alone decide.
    let samples = stage.samples(bright, 20_000, common::clean);
    let mut canvas = stage.empty().with_records(records);
    samples.iter().for_each(|(beam, sample)| {
        canvas.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample))
    });
    assert_eq!(bits(&canvas.draw()), bits(&stage.draw(&samples)));
}

/// Half of the light is indirect; a lamp's is its own.
fn lamp_or_lit(_: DVec3, material: &Material) -> [f32; 3] {
    if material.emits() { material.emission } else { kd(material).map(|channel| 0.75 * channel) }
}

#[test]
fn a_material_without_samples_gets_the_direct_light_of_surfaces_and_not_that_of_lamps() {
    // Side by side: a material of which no sample comes, one with samples, and a lamp.
    let strip = |low: f64, high: f64, material| wall(8.0, [low, -8.0], [high, 12.0], material);
    let quads = [strip(-8.0, 1.0, 0), strip(1.0, 3.0, 1), strip(3.0, 12.0, 2)];
    let lamp = Material { emission: [50.0; 3], ..Material::grey("lamp") };
    let stage = Stage::new(&quads, vec![diffuse([0.2, 0.4, 0.8]), diffuse([0.5; 3]), lamp]);
    let records = Store::new(0.01);
    let half = std::f32::consts::PI * 0.5;
    for y in -4..=8 {
        (-4..=8).for_each(|z| {
            assert!(
                records
                    .insert(record(y as f32, z as f32, half, stage.raycaster.scene()), |_| false)
            )
        });
    }
    let samples = stage.samples(lamp_or_lit, 20_000, common::clean);
    let mut canvas = stage.empty().with_records(Arc::new(records));
    let grey = samples.iter().filter(|(_, sample)| sample.rgb()[2] < 1.5 * sample.rgb()[0]);
    grey.for_each(|(beam, sample)| {
        canvas.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample))
    });
    let pixels = canvas.draw().picture.pixels;
    // Indirect light by the records, direct light as on the other: 1 % for the samples' codes.
    let lit = (44..64)
        .flat_map(|column| (0..48).map(move |row| row * 64 + column))
        .map(|pixel: usize| pixels[pixel]);
    for pixel in lit {
        assert!(
            (0..3).all(|channel| (pixel[channel] / [0.15, 0.3, 0.6][channel] - 1.0).abs() < 0.01),
            "{pixel:?}"
        );
    }
}

/// Rays of the section that pass near the eye, as a session's own samples do.
fn own_samples(stage: &Stage, light: Light, count: usize) -> Vec<(BeamId, Sample)> {
    let mut random = Random(11);
    let mut number = || random.unit();
    let mut found = Vec::new();
    while found.len() < count {
        let (eye, along) = stage.view.ray(number(), number());
        let near = eye + DVec3::new(number() - 0.5, number() - 0.5, number() - 0.5) * 0.01;
        let Some(line) = stage.section.line(near, along) else { continue };
        let bits = (number() * f64::from(u32::MAX)) as u32;
        let at = line.coords;
        let ray = stage.section.ray(line.pair, at);
        let Some((distance, colour)) = shine(&stage.raycaster, ray.origin, ray.direction, light)
        else {
            continue;
        };
        let sample = Sample::encode(at, colour, distance, stage.section.diagonal(), bits);
        found.push((stage.section.beam(line.pair), sample));
    }
    found
}

#[test]
fn light_that_depends_on_the_direction_converges_to_that_of_the_eyes_rays() {
    let metal =
        Material { bsdf: Bsdf::Conductor { ks: [0.8; 3], alpha: 0.3 }, ..Material::grey("metal") };
    let stage = Stage::new(&[wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0)], vec![metal]);
    let truth = stage.truth(even);
    let elsewhere = stage.samples(even, 60_000, common::clean);
    let own = own_samples(&stage, even, 60_000);
    let rms = |count: usize| {
        let all: Vec<_> = elsewhere.iter().chain(&own[..count]).copied().collect();
        error(&stage.draw(&all), &truth).1
    };
    let found = [rms(0), rms(2000), rms(60_000)];
    assert!(found[1] < 0.7 * found[0] && found[2] < 0.5 * found[1], "{found:?}");
    // Of a lobe from 0.1 to 0.9.
    assert!(found[2] < 0.01, "{found:?}");
}

/// As of one lamp in eight, of which a sample asks one.
fn one_lamp(random: &mut Random) -> f32 {
    if random.bits().is_multiple_of(8) { 8.0 } else { 0.0 }
}

#[test]
fn chance_leaves_no_dots() {
    let stage = Stage::new(&[wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0)], vec![diffuse([0.5; 3])]);
    let drawn = stage.draw(&stage.samples(even, 1_200_000, one_lamp));
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    let at = |x: usize, y: usize| drawn.picture.pixels[y * width + x][1];
    let is_dot = |x: usize, y: usize| {
        let around = (y - 1..y + 2)
            .flat_map(|y| (x - 1..x + 2).map(move |x| (x, y)))
            .filter(|&other| other != (x, y));
        let (darkest, brightest) = around
            .map(|(x, y)| at(x, y))
            .fold((f32::INFINITY, 0.0_f32), |(low, high), value| (low.min(value), high.max(value)));
        at(x, y) < 0.8 * darkest || at(x, y) > 1.25 * brightest
    };
    let inner = (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y)));
    let dots: Vec<_> = inner.filter(|&(x, y)| is_dot(x, y)).collect();
    assert!(dots.is_empty(), "{dots:?}");
}

/// Light on all but what lies between two depths.
fn dark_side(at: DVec3, material: &Material) -> [f32; 3] {
    if at.x > 5.001 && at.x < 5.199 { [0.0; 3] } else { kd(material) }
}

/// A bright board and its side, a third of a pixel wide and before no pixel's middle, before a wall.
fn board() -> Stage {
    let side = ([[5.0, 2.6, 1.4], [5.2, 2.6, 1.4], [5.2, 2.6, 3.1], [5.0, 2.6, 3.1]], 1);
    let quads =
        [wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0), wall(5.0, [2.6, 1.4], [3.6, 3.1], 1), side];
    Stage::new(&quads, vec![diffuse([0.5; 3]), diffuse([0.8; 3])])
}

#[test]
fn a_face_narrower_than_a_pixel_has_its_own_light() {
    let stage = board();
    let truth = stage.truth(dark_side);
    let drawn = stage.draw(&stage.samples(dark_side, 400_000, common::clean));
    // Pixels darker than both the wall and the board show some of the side.
    let (mut found, mut error) = (0, 0.0);
    for (pixel, truth) in
        drawn.picture.pixels.iter().zip(&truth).filter(|(_, truth)| truth[1] < 0.45)
    {
        found += 1;
        error += f64::from((pixel[1] - truth[1]).abs());
    }
    // As bright as the board's front, the side would be 0.8 too bright on a third of each; sixteen points tell its part to 1/16.
    assert!(found > 15 && error / f64::from(found) < 0.8 / 16.0, "{found} {error}");
}

#[test]
fn no_single_sample_changes_the_light_of_a_narrow_face_by_much() {
    let stage = board();
    let truth = stage.truth(dark_side);
    let (side, others): (Vec<_>, Vec<_>) = stage
        .samples(dark_side, 400_000, common::clean)
        .into_iter()
        .partition(|(_, sample)| sample.rgb() == [0.0; 3]);
    let dark: Vec<usize> = (0..truth.len()).filter(|&pixel| truth[pixel][1] < 0.45).collect();
    let shown = |count: usize| {
        let samples: Vec<_> = others.iter().chain(&side[..count]).copied().collect();
        let frame = stage.draw(&samples);
        dark.iter().map(|&pixel| f64::from(frame.picture.pixels[pixel][1])).sum::<f64>()
    };
    assert!(side.len() > 100, "{}", side.len());
    let (first, last) = (shown(0), shown(side.len()));
    let counts: Vec<f64> = (0..24).map(shown).collect();
    let steepest = counts.windows(2).fold(0.0, |most: f64, pair| most.max(pair[0] - pair[1]));
    // The first of four that tell as much as all else takes it a fifth of the way.
    assert!(first > last && steepest < 0.3 * (first - last), "{steepest} of {first} to {last}");
    assert!(counts[23] < last + 0.3 * (first - last), "{counts:?}");
}

/// Light on the left of what the eye sees, in thousandths.
static LEFT: AtomicU32 = AtomicU32::new(0);

/// A wall at x = 8, the light of which changes where the eye looks.
fn stepped(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let distance = (8.0 - origin.x) / direction.x;
    let left = LEFT.load(Ordering::Relaxed) as f32 / 1000.0;
    ([if origin.y + distance * direction.y > 2.03 { 0.5 * left } else { 0.5 }; 3], distance)
}

#[test]
fn a_little_more_light_on_a_part_never_changes_a_pixel_by_much_more() {
    let stage = Stage::new(&[wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0)], vec![diffuse([0.5; 3])]);
    let mut before: Option<Vec<f32>> = None;
    let mut grown = 0.0_f32;
    // From even light to twice as much on the left: from one step to the next, wide means come to be rejected one by one. Of each pixel's
    // own samples, 40, the mean is known well enough to say so.
    for left in (1000..2000).step_by(20) {
        LEFT.store(left, Ordering::Relaxed);
        let count = 40 * (SIZE.0 * SIZE.1) as usize;
        let samples = common::near_samples(
            stepped,
            &stage.section,
            &stage.view,
            count,
            5,
            common::exponential,
        );
        let light: Vec<f32> =
            stage.draw(&samples).picture.pixels.iter().map(|pixel| pixel[1]).collect();
        if let Some(before) = before.replace(light.clone()) {
            grown =
                light.iter().zip(&before).fold(grown, |most, (now, before)| most.max(now / before));
        }
    }
    // A mean is left by the fourth power of how near it is to being rejected: four times as fast as the light grows, 2 % a step, and
    // RGBE's dither of 0.4 % at either end.
    assert!(grown < 1.0 + 4.0 * 0.02 + 0.008, "{grown}");
}
