//! Tests the engine `cached` against closed forms and the path engine: results are within its
//! accuracy, and no light passes through walls.

use crate::common::{BLACK, Model, estimate, form_factor};
use bytemuck::Zeroable;
use glam::DVec3;
use holo_light::Record;
use holo_scene::Bsdf;
use holo_tracer::Tracer;

const GREY: Bsdf = Bsdf::Diffuse { kd: [0.5; 3] };

/// A closed box whose walls all shine a little and reflect half: the same radiance everywhere, Le /
/// (1 - ρ).
#[test]
fn a_furnace_has_the_exact_brightness_at_any_accuracy() {
    let mut model = Model::default();
    let wall = model.material(GREY, [1.0, 2.0, 0.5]);
    model.cuboid([-1.0, -2.0, -1.5], [1.0, 2.0, 1.5], false, wall);
    for accuracy in [0.02, 0.05, 0.2] {
        let tracer = model.tracer(None).with_cache(accuracy, 1);
        for direction in [[0.3, 0.2, 1.0], [1.0, -0.4, 0.1], [-0.2, 1.0, -0.6]] {
            let found =
                estimate(&tracer, DVec3::new(0.1, 0.2, -0.3), DVec3::from_array(direction), 64);
            for (found, le) in found.mean.into_iter().zip([1.0, 2.0, 0.5]) {
                // Half of the light is indirect, and the standard error of a record is at most the
                // accuracy.
                let error = found / (2.0 * le) - 1.0;
                assert!(error.abs() < 2.25 * f64::from(accuracy), "{accuracy}: {error}");
            }
        }
    }
}

/// A room whose lamp shines upwards only: most of it has nothing but indirect light.
fn room() -> Model {
    let mut model = Model::default();
    let white = model.material(Bsdf::Diffuse { kd: [0.7, 0.6, 0.5] }, [0.0; 3]);
    let lamp = model.material(BLACK, [20.0; 3]);
    model.cuboid([-2.0, -3.0, 0.0], [2.0, 3.0, 2.5], false, white);
    model.cuboid([0.4, -1.0, 0.0], [1.2, 0.5, 0.8], true, white);
    let square = [[-0.3, -0.3, 1.5], [0.3, -0.3, 1.5], [0.3, 0.3, 1.5], [-0.3, 0.3, 1.5]];
    model.polygon(&square, lamp);
    model
}

#[test]
fn a_room_lit_from_above_only_is_within_the_accuracy_of_paths() {
    const CACHES: u32 = 8;
    let accuracy = 0.02;
    let model = room();
    let path = model.tracer(None);
    let caches: Vec<_> =
        (0..CACHES).map(|name| model.tracer(None).with_cache(accuracy, u64::from(name))).collect();
    let eye = DVec3::new(-1.5, -2.5, 1.2);
    let (mut sum, mut squares, mut noise, mut count) = (0.0, 0.0, 0.0, 0.0);
    for y in 0..6 {
        for x in 0..8 {
            let towards = DVec3::new(0.3 + 0.2 * f64::from(x), 0.9, 0.5 - 0.2 * f64::from(y));
            let truth = estimate(&path, eye, towards, 16_384);
            for cached in &caches {
                let found = estimate(cached, eye, towards, 32);
                if truth.mean == [0.0; 3] {
                    // The dark side of the lamp.
                    assert_eq!(found.mean, [0.0; 3]);
                    continue;
                }
                let error = found.mean[1] / truth.mean[1] - 1.0;
                sum += error;
                squares += error * error;
                noise += (truth.error[1].powi(2) + found.error[1].powi(2)) / truth.mean[1].powi(2);
                count += 1.0;
            }
        }
    }
    let (mean, rms) = (sum / count, (squares / count).sqrt());
    let accuracy = f64::from(accuracy);
    assert!(rms < 3.0 * accuracy + (noise / count).sqrt(), "errors of {rms}");
    // The rays of a record leave an error of at most the accuracy. The coarse records at the ends
    // of these rays add an error of the same size, independently for each record. About 40 records
    // of each cache contribute here.
    let chance = 2.0 * accuracy / f64::from(40 * CACHES).sqrt();
    assert!(mean.abs() < accuracy + 3.0 * chance, "mean error {mean}");
}

/// Returns what `measure` returns with each of `caches` caches, each empty at first.
///
/// One tracer serves all: a new one follows some light before anything is asked of it, which takes
/// longer than most measurements.
fn with_caches<T>(
    mut tracer: Tracer,
    accuracy: f32,
    caches: u64,
    measure: impl Fn(&Tracer) -> T,
) -> Vec<T> {
    let mut found = Vec::new();
    for name in 0..caches {
        tracer = tracer.with_cache(accuracy, name);
        found.push(measure(&tracer));
    }
    found
}

/// Returns the mean relative error of a furnace's brightness, seen in several directions with
/// several caches, and its standard error.
fn error_of_a_furnace(add: impl FnOnce(&mut Model)) -> (f64, f64) {
    const CACHES: u64 = 24;
    let mut model = Model::default();
    let wall = model.material(GREY, [1.0, 2.0, 0.5]);
    model.cuboid([-1.0, -2.0, -1.5], [1.0, 2.0, 1.5], false, wall);
    add(&mut model);
    let errors = with_caches(model.tracer(None), 0.05, CACHES, |tracer| {
        let directions = [[0.3, 0.2, 1.0], [-0.2, 0.4, -1.0], [0.1, 0.9, -1.4], [1.0, -0.4, 0.1]];
        let mean = directions.map(|d| {
            estimate(tracer, DVec3::new(0.1, 0.2, -0.3), DVec3::from_array(d), 64).mean[1] / 4.0
                - 1.0
        });
        mean.iter().sum::<f64>() / mean.len() as f64
    });
    let n = CACHES as f64;
    let mean = errors.iter().sum::<f64>() / n;
    (mean, (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt())
}

/// Adds shelves above and below the eye, tilted.
fn shelves(model: &mut Model, bsdf: [Bsdf; 2]) {
    for (z, bsdf) in [-0.9, 0.8].into_iter().zip(bsdf) {
        let material = model.material(bsdf, [0.0; 3]);
        model.polygon(
            &[[-0.9, -1.8, z], [0.9, -1.8, z + 0.2], [0.9, 1.8, z + 0.2], [-0.9, 1.8, z]],
            material,
        );
    }
}

/// Light that panes and mirrors reflect and transmit counts once: by light samples, by records or
/// by images. So they change nothing where all is equally bright.
#[test]
fn panes_and_mirrors_in_a_furnace_change_nothing() {
    let [thin, thick] = [1.5, 2.4].map(|ior| Bsdf::ThinGlass { ior, transmittance: [1.0; 3] });
    let mirror = Bsdf::Mirror { ks: [1.0; 3] };
    for shelved in [[thin, thick], [mirror, mirror], [thick, mirror]] {
        let (mean, error) = error_of_a_furnace(|model| shelves(model, shelved));
        // Student's t with 23 degrees of freedom exceeds 5 once in 20,000 sets of seeds; there are
        // three sets. The second condition makes sure that the test can fail.
        assert!(
            mean.abs() < 5.0 * error && error < 0.004,
            "{shelved:?}: {mean} with an error of {error}"
        );
    }
}

/// A lamp shines through a pane into a mirror, which reflects its light to a floor that the lamp
/// does not reach directly. The pane reflects nothing, because no rays of records are aimed at
/// lamps that panes reflect. A part of such light is cut off as outliers.
fn mirrored() -> Model {
    let mut model = Model::default();
    let floor = model.material(GREY, [0.0; 3]);
    let mirror = model.material(Bsdf::Mirror { ks: [0.9, 0.7, 0.5] }, [0.0; 3]);
    let pane =
        model.material(Bsdf::ThinGlass { ior: 1.0, transmittance: [0.8, 0.9, 1.0] }, [0.0; 3]);
    let lamp = model.material(BLACK, [20.0, 10.0, 30.0]);
    model.polygon(&[[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0]], floor);
    model.polygon(&[[-0.2, -0.2, 1.0], [0.2, -0.2, 1.0], [0.2, 0.2, 1.0], [-0.2, 0.2, 1.0]], lamp);
    for (z, material) in [(1.5, pane), (2.0, mirror)] {
        model.polygon(
            &[[-0.8, -0.8, z], [-0.8, 0.8, z], [0.9, 0.8, z + 0.1], [0.9, -0.8, z + 0.1]],
            material,
        );
    }
    model
}

#[test]
fn light_from_a_mirror_on_a_floor_is_as_bright_as_with_paths_within_the_accuracy() {
    const CACHES: u64 = 100;
    const ACCURACY: f32 = 0.03;
    let model = mirrored();
    for bounces in [Some(1), None] {
        let path = model.tracer(bounces);
        for at in [[0.5, 0.1], [-0.6, 0.4], [0.9, -0.9]] {
            let eye = DVec3::new(-1.5, 1.0, 0.7);
            let towards = DVec3::new(at[0], at[1], 0.0) - eye;
            let truth = estimate(&path, eye, towards, 65_536);
            // Each with a record of its own.
            let found = with_caches(model.tracer(bounces), ACCURACY, CACHES, |tracer| {
                estimate(tracer, eye, towards, 16).mean
            });
            for c in 0..3 {
                let n = CACHES as f64;
                let mean = found.iter().map(|mean| mean[c]).sum::<f64>() / n;
                let squares = found.iter().map(|found| (found[c] - mean).powi(2)).sum::<f64>();
                let chance = truth.error[c].hypot((squares / (n * (n - 1.0))).sqrt());
                // 18 comparisons at 4.5 sigma: by chance once in 8,000 sets of seeds.
                let difference = (truth.mean[c] - mean).abs();
                assert!(
                    difference < f64::from(ACCURACY) * truth.mean[c] + 4.5 * chance,
                    "{bounces:?} {at:?}: {truth:?} {mean} ± {chance}"
                );
                assert!(
                    truth.mean[c] > 0.0 && chance < 0.1 * mean,
                    "{bounces:?} {at:?}: {truth:?} {mean} ± {chance}"
                );
            }
        }
    }
}

/// A lamp that shines only upwards at a mirror, and two rugs that see it there but not each other.
/// One rug is for records; the other one, at [`FAR_RUG`], is beyond their reach.
fn two_rugs() -> Model {
    let mut model = Model::default();
    let rug = model.material(GREY, [0.0; 3]);
    let mirror = model.material(Bsdf::Mirror { ks: [SHOWN; 3] }, [0.0; 3]);
    let lamp = model.material(BLACK, [LAMP; 3]);
    // So many parts that no samples are aimed at their images in the mirror.
    const PARTS: u32 = 40;
    for part in 0..PARTS {
        let edge = |i: u32| LAMP_HALF * (2.0 * f64::from(i) / f64::from(PARTS) - 1.0);
        let [west, east, south, north] = [edge(part), edge(part + 1), -LAMP_HALF, LAMP_HALF];
        model.polygon(
            &[[west, south, 1.0], [east, south, 1.0], [east, north, 1.0], [west, north, 1.0]],
            lamp,
        );
    }
    model.square(MIRROR_HEIGHT, 0.6, false, mirror);
    model.polygon(&[[-1.5, 0.5, 0.0], [-0.6, 0.5, 0.0], [-0.6, 1.3, 0.0], [-1.5, 1.3, 0.0]], rug);
    let [x, y, _] = FAR_RUG;
    let [west, east, south, north] = [x - 0.05, x + 0.05, y - 0.05, y + 0.05];
    model.polygon(
        &[[west, south, 0.0], [east, south, 0.0], [east, north, 0.0], [west, north, 0.0]],
        rug,
    );
    model
}

const LAMP: f32 = 100.0;
const LAMP_HALF: f64 = 0.15;
const SHOWN: f32 = 0.8;
const MIRROR_HEIGHT: f64 = 2.0;
const FAR_RUG: [f64; 3] = [1.2, 0.9, 0.0];

/// Paths that hit the lamp after the mirror have the right mean. Once there are some records, each
/// path brings at most eight times the mean of the records.
#[test]
fn mirrored_lamps_on_paths_without_records_are_clamped_to_the_mean_of_records() {
    const PATHS: u64 = 200_000;
    let tracer = two_rugs().tracer(None).with_cache(0.01, 1);
    let eye = DVec3::new(0.0, 0.0, 0.5);
    let at = DVec3::from_array(FAR_RUG);
    let luminances = || -> Vec<f64> {
        let radiance = |seed| tracer.trace(eye, (at - eye).normalize(), seed).radiance;
        // All surfaces are grey, so one channel suffices.
        (0..PATHS)
            .map(|seed| f64::from(radiance(seed)[1]))
            .filter(|&radiance| radiance > 0.0)
            .collect()
    };
    // The rug sees the whole of the mirrored lamp.
    let above = 2.0 * MIRROR_HEIGHT - 1.0;
    let corner = |(x, y)| [LAMP_HALF * f64::from(x), LAMP_HALF * f64::from(y), above];
    let share = form_factor(&[(-1, -1), (1, -1), (1, 1), (-1, 1)].map(corner), at, DVec3::Z);
    let of_one = f64::from(0.5 * SHOWN * LAMP);
    let expected = share * of_one;

    let furnish = |rows: std::ops::Range<u32>| {
        tracer.set_effort(u32::MAX);
        for (row, column) in rows.flat_map(|row| (0..12).map(move |column| (row, column))) {
            let near =
                DVec3::new(-1.45 + 0.07 * f64::from(column), 0.55 + 0.06 * f64::from(row), 0.0);
            let _ = tracer.trace(eye, (near - eye).normalize(), u64::from(12 * row + column));
        }
        tracer.set_effort(0);
        let light = tracer.light().unwrap();
        let records: Vec<_> = (0..light.len()).filter_map(|index| light.get(index)).collect();
        let sum: f64 = records.iter().map(|record| f64::from(record.irradiance[1])).sum();
        (records.len(), sum / records.len() as f64)
    };

    // While there are few records, nothing is clamped.
    let (few, _) = furnish(0..1);
    let found = luminances();
    let mean = found.iter().sum::<f64>() / PATHS as f64;
    let square = found.iter().map(|light| light * light).sum::<f64>() / PATHS as f64;
    let chance = ((square - mean * mean) / PATHS as f64).sqrt();
    // 4.5 standard deviations: by chance once in 150,000.
    assert!((mean - expected).abs() < 4.5 * chance, "{mean} ± {chance}, not {expected}");
    let brightest = |found: &[f64]| found.iter().copied().fold(0.0, f64::max);
    let unclamped = brightest(&found);
    let (count, usual) = furnish(1..12);
    let held = 8.0 * std::f64::consts::FRAC_1_PI * usual;
    assert!(few < 16 && count >= 16 && held < 0.1 * of_one, "{few} and {count} records of {usual}");
    assert!(unclamped > 1.2 * held, "{unclamped}, {held}");
    let clamped = brightest(&luminances());
    assert!((clamped / held - 1.0).abs() < 1e-4, "{clamped}, not {held}");
    assert_eq!(tracer.light().map(|light| light.len()), Some(count));
}

#[test]
fn direct_light_alone_includes_light_from_mirrors_and_panes() {
    let model = mirrored();
    let (path, cached) = (model.tracer(Some(0)), model.tracer(Some(0)).with_cache(0.03, 1));
    let eye = DVec3::new(-1.5, 1.0, 0.7);
    let towards = DVec3::new(0.5, 0.1, 0.0) - eye;
    let (truth, found) =
        (estimate(&path, eye, towards, 131_072), estimate(&cached, eye, towards, 131_072));
    for c in 0..3 {
        let chance = truth.error[c].hypot(found.error[c]);
        assert!(truth.mean[c] > 5.0 * truth.error[c]);
        assert!((truth.mean[c] - found.mean[c]).abs() < 4.5 * chance, "{truth:?} {found:?}");
    }
    assert!(cached.light().is_some_and(|light| light.is_empty()));
}

#[test]
fn a_dark_room_beside_a_bright_one_stays_dark() {
    let mut model = room();
    // The wall at y = 3 has no thickness, and floor and ceiling continue beyond it.
    model.polygon(&[[-2.0, 3.0, 0.0], [2.0, 3.0, 0.0], [2.0, 6.0, 0.0], [-2.0, 6.0, 0.0]], 0);
    model.polygon(&[[-2.0, 3.0, 2.5], [-2.0, 6.0, 2.5], [2.0, 6.0, 2.5], [2.0, 3.0, 2.5]], 0);
    let tracer = model.tracer(None).with_cache(0.05, 1);
    // Light the bright room first, so that there are records all along the wall.
    for i in 0..2000 {
        let at =
            DVec3::new(-1.9 + 3.8 * f64::from(i % 50) / 50.0, 2.0 + f64::from(i / 50) / 41.0, 1.0);
        let traced = tracer.trace(at, DVec3::NEG_Z, u64::from(i as u32));
        assert!(traced.radiance[0] > 0.0);
    }
    for i in 0..200 {
        let at = DVec3::new(-1.9 + 0.019 * f64::from(i), 3.001 + 0.002 * f64::from(i), 1.0);
        assert_eq!(
            tracer.trace(at, DVec3::NEG_Z, i as u64).radiance,
            [0.0; 3],
            "light through the wall at {at}"
        );
    }
}

#[test]
fn direct_light_alone_needs_no_records() {
    let tracer = room().tracer(Some(0)).with_cache(0.05, 1);
    let truth = room().tracer(Some(0));
    let (eye, towards) = (DVec3::new(-1.5, -2.5, 1.2), DVec3::new(0.8, 1.0, 0.6));
    let (found, exact) =
        (estimate(&tracer, eye, towards, 4096), estimate(&truth, eye, towards, 4096));
    for c in 0..3 {
        let z = (found.mean[c] - exact.mean[c]) / found.error[c].hypot(exact.error[c]);
        assert!(z.abs() < 4.5, "{z}");
    }
    assert!(tracer.light().is_some_and(|light| light.is_empty()));
}

#[test]
fn one_bounce_is_one_bounce() {
    let (path, cached) = (room().tracer(Some(1)), room().tracer(Some(1)).with_cache(0.02, 1));
    let (eye, towards) = (DVec3::new(-1.5, -2.5, 1.2), DVec3::new(0.8, 1.0, -0.6));
    let (found, truth) =
        (estimate(&cached, eye, towards, 64), estimate(&path, eye, towards, 20_000));
    for c in 0..3 {
        let noise = found.error[c].hypot(truth.error[c]);
        assert!(
            (found.mean[c] - truth.mean[c]).abs() < 0.06 * truth.mean[c] + 4.5 * noise,
            "{found:?} {truth:?}"
        );
    }
    // Light of all bounces is more.
    let all = estimate(&room().tracer(None), eye, towards, 4096);
    assert!(all.mean[0] > 1.1 * truth.mean[0]);
}

#[test]
fn one_thread_makes_the_same_picture_again() {
    let radiances = |name| {
        let tracer = room().tracer(None).with_cache(0.1, name);
        let eye = DVec3::new(-1.5, -2.5, 1.2);
        (0..64)
            .map(|i| tracer.trace(eye, DVec3::new(0.3, 0.9, 0.5 - 0.015 * i as f64), i).radiance)
            .collect::<Vec<_>>()
    };
    assert_eq!(radiances(1), radiances(1));
    assert_ne!(radiances(1), radiances(2));
}

/// The floor sees no lamp, so a sample there is the mean of the records around, without noise of its
/// own.
#[test]
fn records_become_more_exact_as_samples_accumulate() {
    const CACHES: u64 = 8;
    let model = room();
    let eye = DVec3::new(-1.0, 1.0, 1.2);
    let floor: Vec<DVec3> = (0..24)
        .map(|i| DVec3::new(f64::from(i % 6) * 0.3 - 1.7, f64::from(i / 6) - 1.5, 0.0))
        .collect();
    // Light of the floor by the records of the first samples, and by those of all samples.
    let mut light = [vec![], vec![]];
    for name in 0..CACHES {
        let tracer = model.tracer(None).with_cache(0.2, name);
        let store = tracer.light().unwrap();
        let shown = || {
            tracer.set_effort(0);
            let shown: Vec<f64> = floor
                .iter()
                .map(|&point| f64::from(tracer.trace(eye, point - eye, 0).radiance[1]))
                .collect();
            tracer.set_measured_effort();
            shown
        };
        tracer.set_measured_effort();
        let mut samples = 0_u32;
        // When the second grade begins, records of the first cover the room.
        while store.grade() < 2 {
            let i = samples;
            samples += 1;
            assert!(samples < 3_000_000);
            // All directions.
            let z = 1.0 - 2.0 * (f64::from(i) * 0.618_034).fract();
            let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
            let flat = (1.0 - z * z).sqrt();
            let _ = tracer.trace(eye, DVec3::new(flat * cos, flat * sin, z), u64::from(i));
            if i == 100_000 {
                assert_eq!(store.grade(), 0);
                light[0].push(shown());
            }
        }
        light[1].push(shown());
    }
    let spread = |light: &[Vec<f64>]| -> f64 {
        let at = |point: usize| {
            let values: Vec<f64> = light.iter().map(|values| values[point]).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter().map(|value| (value / mean - 1.0).powi(2)).sum::<f64>()
        };
        (0..floor.len()).map(at).sum()
    };
    let [first, refined] = light.map(|light| spread(&light));
    // At most a quarter, if it were for the new records alone. The rest allows for chance.
    assert!(refined < 0.5 * first, "{first} {refined}");
}

#[test]
fn a_place_without_records_begins_with_grade_0() {
    let tracer = room().tracer(None).with_cache(0.2, 1);
    let store = tracer.light().unwrap();
    let elsewhere = Record {
        point: [1000.0, 0.0, 0.0],
        normal: [0.0, 0.0, 1.0],
        radius: 1.0,
        flags: 2 << 8,
        ..Record::zeroed()
    };
    assert!(store.receive(elsewhere));
    tracer.set_measured_effort();
    let eye = DVec3::new(-1.0, 1.0, 1.2);
    for seed in 0..20_000 {
        let (sin, cos) = (seed as f64).sin_cos();
        let _ = tracer.trace(eye, DVec3::new(cos, sin, -1.0), seed);
    }
    let records = (1..store.len()).map(|index| store.get(index).unwrap());
    let grades: Vec<u32> = records.filter(|record| record.kind() == 0).map(|r| r.grade()).collect();
    let of_grade_0 = grades.iter().filter(|&&grade| grade == 0).count();
    assert!(grades[0] == 0 && of_grade_0 > 1 && of_grade_0 < grades.len(), "{grades:?}");
}

#[test]
fn limited_effort_gives_paths_until_there_are_records() {
    let model = room();
    let eager = model.tracer(None).with_cache(0.05, 1);
    let waiting = model.tracer(None).with_cache(0.05, 1);
    waiting.set_effort(1);
    let never = model.tracer(None).with_cache(0.05, 1);
    never.set_effort(0);
    let measured = model.tracer(None).with_cache(0.05, 1);
    measured.set_measured_effort();
    let path = model.tracer(None);
    let (eye, rays) = (DVec3::new(-1.5, -2.5, 1.2), 20_000);
    let mut sums = [0.0; 3];
    let mut squares = [0.0; 3];
    for i in 0..rays {
        // All directions.
        let (angle, z) = (2.4 * f64::from(i), 1.0 - 2.0 * (f64::from(i) * 0.618_034).fract());
        let towards =
            DVec3::new((1.0 - z * z).sqrt() * angle.cos(), (1.0 - z * z).sqrt() * angle.sin(), z);
        let seed = i as u64;
        if i < 300 {
            let _ = (eager.trace(eye, towards, seed), waiting.trace(eye, towards, seed));
        }
        for (n, tracer) in [&path, &never, &measured].into_iter().enumerate() {
            let green = f64::from(tracer.trace(eye, towards, seed).radiance[1]);
            sums[n] += green;
            squares[n] += green * green;
        }
    }
    // Those that are for what is looked at.
    let made = |tracer: &Tracer| {
        let light = tracer.light().unwrap();
        (0..light.len()).filter(|i| light.get(*i).unwrap().flags == 0).count()
    };
    // The effort of 1 allows 300 rays for 300 samples. A record takes at least 128 rays, and one is
    // begun whenever none are owed.
    let (waited, eagerly) = (made(&waiting), made(&eager));
    assert!((1..=3).contains(&waited) && eagerly > 3, "{eagerly} and {waited}");
    assert_eq!(made(&never), 0);
    let mean = sums.map(|sum| sum / f64::from(rays));
    let variance = [0, 1, 2].map(|n| squares[n] / f64::from(rays) - mean[n] * mean[n]);
    for n in [1, 2] {
        // Records have their own error: the accuracy of 0.05.
        let allowed = if n == 1 { 0.0 } else { 0.05 * mean[0] };
        let error = ((variance[0] + variance[n]) / f64::from(rays)).sqrt();
        let beyond = ((mean[n] - mean[0]).abs() - allowed) / error;
        assert!(beyond < 4.5, "{n}: {mean:?}, {beyond} standard errors");
    }
    assert!(made(&measured) > 0);
}
