//! Tests records against closed forms, and the store against its guarantees.

#![allow(clippy::unwrap_used, reason = "a test that cannot set up its scene has failed")]

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_light::{Arrival, Found, Hemisphere, Record, Source, Store, limit_outliers};
use holo_raycast::{Raycaster, SurfacePoint};
use holo_scene::{Bsdf, Material, Scene};
use proptest::prelude::*;

const AXES: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];

/// Returns the record of radiance and distance as functions of direction, with rays at the centres
/// of strata.
fn gathered(rays: u32, light: impl Fn(Vec3) -> (f32, f32)) -> Record {
    let hemisphere = Hemisphere::new(rays);
    let arrivals: Vec<Arrival> = (0..hemisphere.rays())
        .map(|index| {
            let (radiance, distance) = light(hemisphere.direction(index, [0.5, 0.5]));
            Arrival { radiance: Vec3::splat(radiance), distance }
        })
        .collect();
    hemisphere.record(&arrivals, AXES)
}

#[test]
fn strata_have_equal_flux_and_even_light_is_exact() {
    let hemisphere = Hemisphere::new(400);
    // 64 positions in every stratum. The mean cosine under a cosine's density is 2/3. The midpoints
    // of this many squared sines approximate its integral to 1e-4.
    let places = (0..64).map(|i| [(i as f32 + 0.5) / 64.0, 0.5]);
    let cosines =
        places.map(|u| (0..hemisphere.rays()).map(|i| hemisphere.direction(i, u).z).sum::<f32>());
    assert!((cosines.sum::<f32>() / (64 * hemisphere.rays()) as f32 - 2.0 / 3.0).abs() < 1e-3);
    let record = gathered(400, |_| (3.0, 2.0));
    for c in 0..3 {
        assert!((record.irradiance[c] - 3.0 * PI).abs() < 1e-4);
        assert!(Vec3::from(record.shift[c]).length() < 1e-4, "even light has no gradient");
    }
    assert!((record.radius - 2.0).abs() < 1e-5 && record.nearest == 2.0 && record.error < 1e-3);
}

#[test]
fn a_single_bright_ray_does_not_dominate_a_record() {
    let gather = |outlier: f32, most: f32| {
        let arrival = |index: usize| {
            let radiance =
                if index == 123 { Vec3::new(2.0, 1.0, 0.5) * outlier } else { Vec3::ONE };
            Arrival { radiance, distance: 1.0 }
        };
        let mut arrivals: Vec<Arrival> = (0..1000).map(arrival).collect();
        limit_outliers(&mut arrivals, most);
        arrivals.iter().map(|arrival| arrival.radiance).sum::<Vec3>()
    };
    let (fair, held) = (gather(20.0, 0.03), gather(400.0, 0.03));
    assert_eq!(fair, gather(20.0, f32::INFINITY), "light within the share does not change");
    // The limit is a share of the light of this ray and 999 others.
    let brought = (held - 999.0).dot(Vec3::from_array(holo_color::WEIGHTS));
    assert!((brought / (999.0 + brought) - 0.03).abs() < 1e-3, "{brought}");
    assert!(((held.x - 999.0) / (held.z - 999.0) - 4.0).abs() < 1e-2, "its hue stays");
    assert_eq!(gather(0.0, 0.03), Vec3::splat(999.0));
    // Each of 64 rays contributes 1/64.
    let even = [Arrival { radiance: Vec3::ONE, distance: 1.0 }; 64];
    let mut few = even;
    limit_outliers(&mut few, 0.002);
    assert!(
        few.iter().zip(&even).all(|(held, whole)| held.radiance == whole.radiance),
        "even light stays whole"
    );
    let mut dark = [Arrival::default(); 8];
    limit_outliers(&mut dark, 0.03);
    assert!(dark.iter().all(|arrival| arrival.radiance == Vec3::ZERO));
}

#[test]
fn rotation_gradients_are_those_of_a_sky_with_a_slope() {
    // A sky of 1 + x. If the surface turns by a towards x, the cosine's derivative is sin θ cos φ,
    // and ∫ sin θ cos φ (1 + sin θ cos φ) dω = 2π/3.
    let record = gathered(4096, |d| (1.0 + d.x, 1.0));
    assert!((record.irradiance[0] - PI).abs() < 1e-3);
    // For a turn towards +x, (old normal × new normal) is z × x = y.
    let turn = Vec3::from(record.turn[0]);
    assert!((turn.y - 2.0 * PI / 3.0).abs() < 0.02 * PI && turn.x.abs() < 1e-3, "{turn}");
}

#[test]
fn translation_gradients_are_those_of_a_half_bright_ceiling() {
    // A ceiling at height 1 that shines where x > 0. By the strip's closed form, E(x) = π/2 (1 +
    // x/√(1+x²)), with slope π/2 at 0.
    let record = gathered(16_384, |d| (f32::from(d.x > 0.0), 1.0 / d.z));
    let shift = Vec3::from(record.shift[0]);
    // The border of the bright half is off the borders of sectors by up to half a sector: 0.014 of
    // π/2.
    assert!((shift.x - 0.5 * PI).abs() < 0.05 * PI && shift.y.abs() < 0.03, "{shift}");
    let at = |x: f32| record.extrapolate(Vec3::new(x, 0.0, 0.0), Vec3::Z).x;
    let exact = |x: f32| 0.5 * PI * (1.0 + x / x.hypot(1.0));
    for x in [-0.2, -0.1, 0.1, 0.2] {
        // The error of linear extrapolation is of third order here, besides the gradient's own
        // error.
        assert!((at(x) - exact(x)).abs() < 0.05 * PI * x.abs() + x.abs().powi(3) * PI, "{x}");
    }
}

/// Tests the light of a small flat source at the origin and beside it, and on a slightly turned
/// surface, to first order.
#[test]
fn a_small_source_has_exact_gradients() {
    let (at, normal) = (Vec3::new(0.4, -0.7, 1.1), Vec3::new(-0.5, 0.3, -1.0).normalize());
    let exact = |point: Vec3, up: Vec3| {
        let w = at - point;
        2.0 * up.dot(w) * -normal.dot(w) / w.length_squared().powi(2)
    };
    let part = 0.25 * exact(Vec3::ZERO, Vec3::Z);
    let source =
        Source { irradiance: Vec3::new(part, 2.0 * part, 0.0), towards: at, normal: Some(normal) };
    let mut record = gathered(1000, |_| (0.0, 1.0));
    record.add(&[source; 4]);
    assert!((record.irradiance[0] - 4.0 * part).abs() < 1e-6 && record.error < 1e-3, "{record:?}");
    let h = 1e-2;
    for step in [Vec3::X, Vec3::Y, Vec3::new(-0.6, 0.8, 0.0)] {
        let slope = (exact(step * h, Vec3::Z) - exact(-step * h, Vec3::Z)) / (2.0 * h);
        let found = (record.extrapolate(step * h, Vec3::Z)
            - record.extrapolate(-step * h, Vec3::Z))
            / (2.0 * h);
        assert!((found.x - slope).abs() < 2e-3 * 4.0 * part, "{step}: {found} {slope}");
        assert!(
            (found.y - 2.0 * slope).abs() < 4e-3 * 4.0 * part && found.z == 0.0,
            "{step}: {found}"
        );
        let (one, other) = ((Vec3::Z + step * h).normalize(), (Vec3::Z - step * h).normalize());
        let turned =
            record.extrapolate(Vec3::ZERO, one).x - record.extrapolate(Vec3::ZERO, other).x;
        let exact = exact(Vec3::ZERO, one) - exact(Vec3::ZERO, other);
        assert!((turned - exact).abs() < 2e-3 * h * 4.0 * part, "{step}: {turned} {exact}");
    }
    // Light shown by a mirror has no gradient, because its source does not move with the mirror.
    // Sources that differ increase the error.
    let mut record = gathered(1000, |_| (0.0, 1.0));
    record.add(&[Source { normal: None, ..source }, Source::default()]);
    assert_eq!(record.shift, [[0.0; 3]; 3]);
    assert!((record.error - 1.0).abs() < 1e-5, "{}", record.error);
}

/// Records of one point with different random numbers vary at most by their stated error.
#[test]
fn the_stated_error_is_that_of_the_record() {
    let mut state = 1_u64;
    let mut random = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    // Noise in every ray, of mean 1 and relative standard deviation 1/√3, plus a slope that strata
    // remove.
    let hemisphere = Hemisphere::new(300);
    let records: Vec<Record> = (0..400)
        .map(|_| {
            let ray = |index| {
                let light =
                    hemisphere.direction(index, [0.5; 2]).x + 2.0 + 2.0 * (random() - 0.5) * 2.0;
                Arrival { radiance: Vec3::splat(light), distance: 1.0 }
            };
            let arrivals: Vec<Arrival> = (0..hemisphere.rays()).map(ray).collect();
            hemisphere.record(&arrivals, AXES)
        })
        .collect();
    let count = records.len() as f32;
    let mean = records.iter().map(|r| r.irradiance[0]).sum::<f32>() / count;
    let spread = (records.iter().map(|r| (r.irradiance[0] - mean).powi(2)).sum::<f32>()
        / (count - 1.0))
        .sqrt()
        / mean;
    let said = records.iter().map(|r| r.error).sum::<f32>() / count;
    // 4 standard errors of a standard deviation from 400 values, and the slope within strata.
    assert!(said > spread * 0.86 && said < spread * 1.2, "{said} {spread}");
}

/// Returns a floor, and a wall without thickness that stands on it at x = 0.
fn walled() -> Raycaster {
    let corners = [
        [-10.0, -10.0, 0.0],
        [10.0, -10.0, 0.0],
        [10.0, 10.0, 0.0],
        [-10.0, 10.0, 0.0],
        [0.0, -10.0, 0.0],
        [0.0, 10.0, 0.0],
        [0.0, 10.0, 5.0],
        [0.0, -10.0, 5.0],
    ]
    .map(DVec3::from_array);
    let grey = Material {
        name: "grey".into(),
        bsdf: Bsdf::Diffuse { kd: [0.5; 3] },
        emission: [0.0; 3],
        two_sided_emission: false,
    };
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let (scene, _) =
        Scene::from_world(&corners, &triangles, &[0; 4], vec![grey], [0.0; 3]).unwrap();
    Raycaster::build(Arc::new(scene)).unwrap()
}

/// Returns what the store finds at a point, on the side of `normal`.
fn found_at(
    store: &Store,
    raycaster: &Raycaster,
    point: &SurfacePoint,
    normal: Vec3,
) -> Option<Found> {
    store.irradiance(point.point, normal, f32::INFINITY, |record| {
        raycaster.parted(point, normal, record.point.into(), record.normal.into())
    })
}

fn local(raycaster: &Raycaster, x: f64, y: f64) -> SurfacePoint {
    let from = DVec3::new(x, y, 3.0);
    let (ray, _) = raycaster.localize(from, DVec3::NEG_Z).unwrap();
    let hit = raycaster.nearest(&ray).unwrap();
    raycaster.surface(hit.triangle, hit.u, hit.v)
}

fn record(point: Vec3, light: f32, radius: f32, id: u64) -> Record {
    Record {
        point: point.to_array(),
        radius,
        normal: [0.0, 0.0, 1.0],
        nearest: 0.01,
        irradiance: [light; 3],
        error: 0.0,
        shift: [[0.0; 3]; 3],
        turn: [[0.0; 3]; 3],
        rays: 1,
        flags: 0,
        id,
    }
}

#[test]
fn no_light_comes_through_a_wall_without_thickness() {
    let raycaster = walled();
    let store = Store::new(0.01);
    assert!(store.insert(record(local(&raycaster, 0.5, 0.0).point, 7.0, 2.0, 1), |_| false));
    let beside = found_at(&store, &raycaster, &local(&raycaster, 0.1, 0.1), Vec3::Z);
    assert_eq!(beside.map(|found| found.irradiance), Some(Vec3::splat(7.0)));
    for x in [-0.01, -0.1, -0.5, -1.0] {
        assert_eq!(found_at(&store, &raycaster, &local(&raycaster, x, 0.1), Vec3::Z), None, "{x}");
    }
    // The same holds on the other side of the floor.
    let point = local(&raycaster, 0.5, 0.0);
    assert_eq!(found_at(&store, &raycaster, &point, Vec3::NEG_Z), None);
}

#[test]
fn light_on_bumps_is_predicted_by_the_records_of_their_mean_normal() {
    let store = Store::new(0.01);
    // Light grows towards +x: by 2 for each unit of sine.
    let turn = [[0.0, 2.0, 0.0]; 3];
    assert!(store.insert(Record { turn, ..record(Vec3::ZERO, 3.0, 2.0, 1) }, |_| false));
    let around = |normal: Vec3, lit: Vec3| {
        store.irradiance_around(Vec3::ZERO, [normal, lit], f32::INFINITY, |_| false)
    };
    for sine in [-0.6f32, 0.0, 0.5] {
        let lit = Vec3::new(sine, 0.0, (1.0 - sine * sine).sqrt());
        let found = around(Vec3::Z, lit).map(|found| found.irradiance);
        assert_eq!(found, Some(Vec3::splat(3.0 + 2.0 * sine)), "{sine}");
    }
    // Another surface has other records.
    assert_eq!(around(Vec3::X, Vec3::Z), None);
}

#[test]
fn a_record_serves_its_own_surface_and_none_a_step_before_or_behind_it() {
    let store = Store::new(0.01);
    assert!(store.insert(record(Vec3::ZERO, 3.0, 2.0, 1), |_| false));
    let known = |point: Vec3, normal: Vec3| {
        store.irradiance(point, normal, f32::INFINITY, |_| false).is_some()
    };
    for distance in [0.1_f32, 0.5, 1.0, 1.9] {
        assert!(known(Vec3::new(distance, 0.0, 0.0), Vec3::Z), "{distance}");
        // Meshes are at least this flat.
        assert!(known(Vec3::new(distance, 0.0, 0.005 * distance), Vec3::Z), "{distance}");
        for step in [-0.1, -0.05, 0.05, 0.1] {
            assert!(
                !known(Vec3::new(distance, 0.0, step * distance), Vec3::Z),
                "{distance} {step}"
            );
        }
        // A ball and a bowl, smooth or faceted: the normal is that of the point or of half the way.
        for radius in [10.0_f32, -10.0] {
            let angle = distance / radius;
            let point = Vec3::new(radius * angle.sin(), 0.0, radius * (angle.cos() - 1.0));
            for turned in [angle, 0.5 * angle] {
                assert!(
                    known(point, Vec3::new(turned.sin(), 0.0, turned.cos())),
                    "{distance} {radius}"
                );
            }
        }
    }
}

#[test]
fn a_record_of_grade_1_counts_as_sixteen_others() {
    let store = Store::new(0.01);
    let graded =
        |light, grade: u32, id| Record { flags: grade << 8, ..record(Vec3::ZERO, light, 2.0, id) };
    let found = |enough: f32| store.irradiance(Vec3::X, Vec3::Z, enough, |_| false).unwrap();
    assert!(store.insert(graded(1.0, 0, 1), |_| false));
    assert_eq!((found(f32::INFINITY).weight, store.grade(), store.rays()), (0.5, 0, 1));
    assert!(store.insert(graded(18.0, 1, 2), |_| false));
    let both = found(f32::INFINITY);
    assert_eq!((both.irradiance, both.weight, both.records), (Vec3::splat(17.0), 8.5, 2));
    assert_eq!((store.grade(), store.rays()), (1, 2));
    // The exact one is newer, so it is met first.
    assert_eq!((found(2.0).irradiance, found(2.0).records), (Vec3::splat(18.0), 1));
    // No tracer makes these.
    for flags in [2, 4 << 8, 1 << 16] {
        assert!(!store.insert(Record { flags, ..record(Vec3::ZERO, 1.0, 2.0, 3) }, |_| false));
    }
}

#[test]
fn between_records_light_is_exact_to_second_order() {
    // Concave along x and convex along y.
    let exact = |x: f32, y: f32| 4.0 + x - 0.8 * x * x + 0.5 * y * y + 0.3 * x * y;
    let known = |(x, y): (f32, f32), id: u64| Record {
        shift: [[1.0 - 1.6 * x + 0.3 * y, y + 0.3 * x, 0.0]; 3],
        ..record(Vec3::new(x, y, 0.0), exact(x, y), 2.0, id)
    };
    let found = |places: &[(f32, f32)], x: f32, y: f32| {
        let store = Store::new(0.1);
        (1..).zip(places).for_each(|(id, &place)| assert!(store.receive(known(place, id))));
        let never = |_: &Record| false;
        store.irradiance(Vec3::new(x, y, 0.0), Vec3::Z, f32::INFINITY, never).unwrap().irradiance.x
    };
    let around = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.1, -0.6)];
    // Extrapolations to the middle of four records are too bright by 0.075 each.
    assert!((found(&around[..4], 0.0, 0.0) - exact(0.0, 0.0)).abs() < 1e-5);
    // Without symmetry, the error is -½ m·H·m, where m is the weighted mean of the steps.
    let (x, y) = (0.2, -0.1);
    let weights = around.map(|(a, b)| 1.0 - (x - a).hypot(y - b) / 2.0);
    let mean = |at: fn(&(f32, f32)) -> f32, of: f32| {
        let sum: f32 = around.iter().zip(weights).map(|(place, w)| (of - at(place)) * w).sum();
        sum / weights.iter().sum::<f32>()
    };
    let (mx, my) = (mean(|place| place.0, x), mean(|place| place.1, y));
    let error = 0.8 * mx * mx - 0.5 * my * my - 0.3 * mx * my;
    assert!((found(&around, x, y) - exact(x, y) - error).abs() < 1e-5);
    // A single record predicts with its whole gradient.
    let alone = known((0.5, -0.5), 1).extrapolate(Vec3::new(x, y, 0.0), Vec3::Z).x;
    assert!((found(&around[1..2], x, y) - alone).abs() < 1e-5);
}

/// If two records contradict each other, only nearby points use either. Noise is no contradiction,
/// and records that a wall separates do not contradict each other.
#[test]
fn contradicting_records_get_smaller_radii() {
    let radii = |light: f32, error: f32, hidden: bool| {
        let store = Store::new(0.01);
        let noisy = |x: f32, light, id| Record { error, ..record(Vec3::X * x, light, 2.0, id) };
        assert!(store.insert(noisy(0.0, 1.0, 1), |_| hidden));
        assert!(store.insert(noisy(1.0, light, 2), |_| hidden));
        [0, 1].map(|index| store.get(index).map(|record| record.radius))
    };
    let whole = [Some(2.0), Some(2.0)];
    assert_eq!(radii(1.0, 0.03, false), whole);
    assert_eq!(radii(1.1, 0.03, false), whole, "2.2 standard errors");
    assert_eq!(radii(1.4, 0.03, true), whole, "behind a wall");
    assert_eq!(radii(1.4, 0.0, false), whole, "of unknown noise");
    for radius in radii(1.4, 0.03, false) {
        // 0.4 is 7.75 combined standard errors; the share is 1 over its root.
        assert!(radius.is_some_and(|radius| (radius - 0.359).abs() < 1e-3), "{radius:?}");
    }
}

#[test]
fn received_records_are_not_reported_as_made_here() {
    let store = Store::new(0.01);
    for id in 0..10 {
        let record = record(Vec3::X * id as f32, 1.0, 0.5, id);
        assert!(if id % 3 == 0 { store.receive(record) } else { store.insert(record, |_| false) });
    }
    let ids = |(records, next): (Vec<Record>, usize)| {
        (records.iter().map(|r| r.id).collect::<Vec<_>>(), next)
    };
    assert_eq!(ids(store.made_since(0, 3)), (vec![1, 2, 4], 5));
    assert_eq!(ids(store.made_since(5, 100)), (vec![5, 7, 8], 10));
    assert_eq!(ids(store.made_since(10, 100)), (vec![], 10));
}

#[test]
fn invalid_and_duplicate_records_are_refused() {
    let store = Store::new(0.01);
    let good = record(Vec3::ZERO, 1.0, 1.0, 1);
    let bad: [fn(&mut Record); 7] = [
        |r| r.point[0] = f32::NAN,
        |r| r.radius = 0.0,
        |r| r.radius = f32::INFINITY,
        |r| r.normal = [0.0; 3],
        |r| r.irradiance[2] = -1.0,
        |r| r.irradiance[1] = f32::INFINITY,
        |r| r.shift[1][1] = f32::NAN,
    ];
    for spoil in bad {
        let mut record = good;
        spoil(&mut record);
        assert!(!store.insert(record, |_| false), "{record:?}");
    }
    assert!(store.insert(good, |_| false));
    assert!(!store.insert(good, |_| false), "the same again");
    assert_eq!(store.len(), 1);
}

#[test]
fn readers_see_whole_records_while_others_add_to_them() {
    let raycaster = walled();
    let store = Store::new(0.01);
    std::thread::scope(|scope| {
        for writer in 0..2_u64 {
            let (store, raycaster) = (&store, &raycaster);
            scope.spawn(move || {
                for i in 0..500 {
                    let x = 1.0 + 0.01 * (i % 100) as f64;
                    store.insert(
                        record(
                            local(raycaster, x, 0.02 * i as f64 / 10.0).point,
                            4.0,
                            0.5,
                            writer << 32 | i,
                        ),
                        |_| false,
                    );
                }
            });
        }
        for _ in 0..2 {
            let (store, raycaster) = (&store, &raycaster);
            scope.spawn(move || {
                let point = local(raycaster, 1.5, 0.3);
                for _ in 0..2000 {
                    if let Some(found) = found_at(store, raycaster, &point, Vec3::Z) {
                        assert!((found.irradiance - Vec3::splat(4.0)).abs().max_element() < 1e-4);
                    }
                }
            });
        }
    });
    assert_eq!(store.len(), 1000);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// The set of records does not depend on order or repetition, and interpolated values stay
    /// within their range.
    #[test]
    fn merging_is_idempotent_and_interpolation_stays_within_its_records(
        lights in prop::collection::vec((0.2_f64..3.0, -1.0_f64..1.0, 0.0_f32..10.0, 0.05_f32..2.0), 1..40),
        at in (0.2_f64..3.0, -1.0_f64..1.0),
    ) {
        let raycaster = walled();
        let records: Vec<Record> = lights
            .iter()
            .zip(0..)
            .map(|(&(x, y, light, radius), id)| record(local(&raycaster, x, y).point, light, radius, id))
            .collect();
        let (forwards, backwards) = (Store::new(0.01), Store::new(0.01));
        for record in records.iter().chain(&records) {
            forwards.insert(*record, |_| false);
        }
        records.iter().rev().for_each(|record| { backwards.insert(*record, |_| false); });
        prop_assert_eq!(forwards.len(), records.len());
        prop_assert_eq!(backwards.len(), records.len());
        let point = local(&raycaster, at.0, at.1);
        for store in [&forwards, &backwards] {
            if let Some(found) = found_at(store, &raycaster, &point, Vec3::Z) {
                let (low, high) = lights.iter().fold((f32::INFINITY, 0.0_f32), |(l, h), r| (l.min(r.2), h.max(r.2)));
                prop_assert!(found.irradiance.x >= low * 0.9999 && found.irradiance.x <= high * 1.0001);
                prop_assert!(found.records as usize <= records.len() && found.weight > 0.0);
            }
        }
    }
}
