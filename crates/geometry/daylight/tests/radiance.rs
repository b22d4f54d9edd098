//! Skies beside those of Radiance, closed forms, and states at the ends of the formulas' ranges.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use holo_daylight::{
    GeoPlace, PerezWeather, SkyFormula, WHITE_EFFICACY, clear_sky, intermediate_sky, overcast_sky,
    perez_sky, standard_sky, sun_position,
};

/// Radiances by `gensky`, `gendaylit` and `rtrace`; made by `scripts/sky-values`.
const RADIANCES: &str = include_str!("radiance.txt");

/// Numbers of a line after its name, and the directions and the radiance at its end.
fn line(line: &str) -> (&str, Vec<f64>, DVec3, DVec3, f64) {
    let mut words = line.split_whitespace();
    let name = words.next().unwrap_or_default();
    let mut numbers: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
    let rest = numbers.split_off(numbers.len() - 7);
    let direction = DVec3::from_slice(&rest[3..]).normalize();
    (name, numbers, DVec3::from_slice(&rest).normalize(), direction, rest[6])
}

fn lines() -> impl Iterator<Item = (&'static str, Vec<f64>, DVec3, DVec3, f64)> {
    RADIANCES.lines().filter(|text| !text.starts_with('#')).map(line)
}

#[test]
fn clear_intermediate_and_overcast_skies_are_those_of_gensky() {
    let mut count = 0;
    for (name, _, sun, direction, expected) in lines() {
        let sky = match name {
            "clear" => clear_sky(sun),
            "intermediate" => intermediate_sky(sun),
            "overcast" => overcast_sky(sun),
            _ => continue,
        };
        // `gensky` takes 0.274 for 1 - exp(-0.32) in the clear sky.
        let rounded = if name == "clear" { 0.274 / (1.0 - (-0.32_f64).exp()) } else { 1.0 };
        let found = sky.sky.radiance(direction) / rounded;
        assert!(
            (found / expected - 1.0).abs() < 1e-3,
            "{name} {sun} {direction}: {found} {expected}"
        );
        count += 1;
    }
    assert!(count > 500, "{count}");
}

#[test]
fn skies_of_perez_have_the_shape_and_the_sun_of_gendaylit() {
    let (mut states, mut suns, mut before) = (0, 0, None);
    for (name, numbers, sun, direction, expected) in lines().filter(|line| line.0 == "perez") {
        let [direct, diffuse, day, of_sun] = numbers[..] else { panic!("{name}: {numbers:?}") };
        let weather = PerezWeather { direct, diffuse, water: 2.0, day_of_year: day as u32 };
        let sky = perez_sky(sun, &weather);
        let ratio = sky.sky.radiance(direction) / expected;
        // `gendaylit` sums up 145 patches in place of an integral, so its level differs.
        assert!((ratio - 1.0).abs() < 0.05, "{numbers:?} {sun} {direction}: {ratio}");
        let state = (numbers.clone(), sun);
        if let Some((earlier, level)) = &before
            && *earlier == state
        {
            let error: f64 = ratio / level - 1.0;
            assert!(error.abs() < 1e-3, "{numbers:?} {sun} {direction}: {error}");
            continue;
        }
        before = Some((state, ratio));
        states += 1;
        if of_sun > 0.0 {
            let solid_angle = PI * (0.533_f64.to_radians() / 2.0).powi(2);
            let error = sky.sun / (of_sun * solid_angle) - 1.0;
            assert!(error.abs() < 1e-3, "{numbers:?} {sun}: a sun of {} {error}", sky.sun);
            suns += 1;
        }
    }
    assert!(states > 230 && suns > 80, "{states} {suns}");
}

#[test]
fn the_sun_and_the_sky_of_radiances_own_suite_come_out() {
    // gensky 11 15 14:21EDT +s -g .25 -t 3.5 -a 40.7128 -o 74.006, but for the turbidity.
    let sun = DVec3::new(-0.401889, -0.802368, 0.441237).normalize();
    let sky = clear_sky(sun);
    assert!((sky.sun * sun.z - 154.9).abs() < 0.1, "{}", sky.sun * sun.z);
    let zenith =
        1000.0 / 203.0 * ((1.376 * 2.45 - 1.81) * sun.z / (1.0 - sun.z * sun.z).sqrt() + 0.38);
    assert!((sky.sky.radiance(DVec3::Z) - zenith).abs() < 1e-9);
}

#[test]
fn an_overcast_sky_has_its_closed_forms() {
    let sky = overcast_sky(DVec3::new(0.6, 0.0, 0.8)).sky;
    let zenith = sky.radiance(DVec3::Z);
    assert!((sky.horizontal() / (7.0 * PI / 9.0 * zenith) - 1.0).abs() < 1e-4);
    assert!((zenith - (8.6 * 0.8 + 0.123) * 1000.0 / 203.0).abs() < 1e-9);
    assert!((sky.radiance(DVec3::X) / zenith - 1.0 / 3.0).abs() < 1e-9);
}

/// Directions all over the sky, the horizon and the zenith included.
fn all_over() -> impl Iterator<Item = DVec3> {
    (0..=18).flat_map(|ring| {
        (0..24).map(move |sector| {
            let (z, level) = (f64::from(ring) / 18.0 * FRAC_PI_2).sin_cos();
            let (sin, cos) = (f64::from(sector) / 24.0 * 2.0 * PI).sin_cos();
            DVec3::new(level * sin, level * cos, z)
        })
    })
}

fn is_sound(sky: &SkyFormula) -> bool {
    all_over().all(|direction| {
        let radiance = sky.radiance(direction);
        radiance.is_finite() && (0.0..1e6).contains(&radiance)
    })
}

#[test]
fn every_sky_is_finite_wherever_the_sun_stands() {
    for altitude in [-90.0, -20.0, -2.0, -1e-9, 0.0, 1e-9, 0.3, 15.0, 86.0, 87.0, 89.99, 90.0] {
        for azimuth in [0.0, 123.0] {
            let sun = holo_daylight::SunPosition { altitude, azimuth }.direction();
            let levels = [overcast_sky(sun), clear_sky(sun), intermediate_sky(sun)];
            let standard = (1..=15).map(|number| standard_sky(number, sun).unwrap());
            for level in levels.into_iter().chain(standard) {
                assert!(is_sound(&level.sky), "{altitude} {level:?}");
                assert!(level.sun.is_finite() && level.sun >= 0.0, "{altitude} {level:?}");
            }
            for (direct, diffuse) in
                [(0.0, 0.0), (0.0, 5.0), (900.0, 0.0), (900.0, 0.1), (1.0, 900.0), (1000.0, 300.0)]
            {
                for day_of_year in [1, 366] {
                    let weather = PerezWeather { direct, diffuse, water: 2.0, day_of_year };
                    let sky = perez_sky(sun, &weather);
                    assert!(is_sound(&sky.sky), "{altitude} {weather:?} {sky:?}");
                    assert!(sky.sun.is_finite() && sky.sun >= 0.0, "{altitude} {sky:?}");
                    let arrives = sky.sky.horizontal() * WHITE_EFFICACY;
                    let error = (arrives - sky.diffuse_illuminance).abs();
                    assert!(error <= 5e-3 * sky.diffuse_illuminance, "{altitude} {sky:?}");
                }
            }
        }
    }
    assert_eq!(standard_sky(0, DVec3::Z), None);
    assert_eq!(standard_sky(16, DVec3::Z), None);
}

#[test]
fn every_sky_is_finite_all_over_the_globe_and_the_year() {
    // The fraction of a multiple of an irrational number: even, and different for each state.
    let share = |at: u32, root: f64| (f64::from(at) * root.sqrt()).fract();
    for at in 0..1000 {
        let place = GeoPlace::new(180.0 * share(at, 2.0) - 90.0, 360.0 * share(at, 3.0) - 180.0);
        let day = (365.0 * share(at, 5.0)) as u32;
        let (month, day) = (1 + day * 12 / 365, 1 + day % 28);
        let minute = (1440.0 * share(at, 7.0)) as u32;
        let (hour, minute) = (minute / 60, minute % 60);
        let moment = format!("2026-{month:02}-{day:02}T{hour:02}:{minute:02}Z");
        let place = place.unwrap();
        let sun = sun_position(place, &moment.parse().unwrap()).unwrap().direction();
        let state = format!("{place:?} {moment}");
        let levels = [overcast_sky(sun), clear_sky(sun), intermediate_sky(sun)];
        for level in levels.into_iter().chain((1..=15).filter_map(|k| standard_sky(k, sun))) {
            assert!(is_sound(&level.sky) && level.sun.is_finite(), "{state} {level:?}");
            assert!(level.sun >= 0.0, "{state} {level:?}");
        }
        let (direct, diffuse) = (1000.0 * share(at, 11.0), 600.0 * share(at, 13.0));
        let weather = PerezWeather { direct, diffuse, water: 2.0, day_of_year: 1 + at % 366 };
        let sky = perez_sky(sun, &weather);
        assert!(is_sound(&sky.sky) && sky.sun.is_finite() && sky.sun >= 0.0, "{state} {sky:?}");
    }
}

#[test]
fn a_clear_sky_is_bounded_and_continuous_up_to_a_sun_in_the_zenith() {
    let mut before: Option<f64> = None;
    for step in 0..=100 {
        let altitude = 86.0 + 0.04 * f64::from(step);
        let sun = holo_daylight::SunPosition { altitude, azimuth: 200.0 }.direction();
        let level = clear_sky(sun);
        assert_eq!(level.is_lowered, altitude > 87.0 + 1e-9, "{altitude}");
        let horizontal = level.sky.horizontal();
        assert!(before.is_none_or(|before| (horizontal / before - 1.0).abs() < 0.02), "{altitude}");
        before = Some(horizontal);
    }
}

#[test]
fn a_general_sky_has_its_zenith_and_gradation() {
    let sun = DVec3::new(0.0, -0.8, 0.6);
    // Type 5 is even, and type 12 is the clear sky within rounding of its factors.
    let even = standard_sky(5, sun).unwrap().sky;
    assert!(all_over().all(|direction| even.radiance(direction) == even.radiance(DVec3::Z)));
    let (ours, clear) = (standard_sky(12, sun).unwrap().sky, clear_sky(sun).sky);
    for direction in all_over() {
        let ratio = ours.radiance(direction) / clear.radiance(direction);
        assert!((ratio - 1.0).abs() < 2e-3, "{direction} {ratio}");
    }
    // Type 1: about a third of the zenith at the horizon: 1 / (1 + 4·exp(-0.7)).
    let cloudy = standard_sky(1, sun).unwrap().sky;
    let at_horizon = 1.0 + 4.0 * (-0.7_f64 / 0.01).exp();
    let ratio = cloudy.radiance(DVec3::X) / cloudy.radiance(DVec3::Z);
    assert!((ratio - at_horizon / (1.0 + 4.0 * (-0.7_f64).exp())).abs() < 1e-9, "{ratio}");
}
