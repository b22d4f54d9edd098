//! Files of all types and symmetries bring the lamp that they were written from.

use glam::DVec3;
use holo_photometry::{OpeningShape, Photometry, PhotometryError};

use crate::written::*;

/// Compares a file with its lamp in 200 directions for which `covers` holds, and its flux if the
/// file covers all directions.
fn is_lamp(name: &str, text: &str, lamp: Lamp, covers: fn(DVec3) -> bool) -> Photometry {
    let read = Photometry::read(text.as_bytes()).unwrap_or_else(|error| panic!("{name}: {error}"));
    let mut compared = 0;
    for at in 0..400 {
        let z = 1.0 - (2.0 * f64::from(at) + 1.0) / 400.0;
        let (y, x) = (2.399_963_2 * f64::from(at)).sin_cos();
        let level = (1.0 - z * z).sqrt();
        let away = DVec3::new(level * x, level * y, z);
        let found = f64::from(read.web.intensity(away.as_vec3()));
        if covers(away) {
            compared += 1;
            let expected = lamp(away);
            assert!((found / expected - 1.0).abs() < 5e-3, "{name} {away}: {found} {expected}");
        } else {
            assert_eq!(found, 0.0, "{name} {away}");
        }
    }
    assert!(compared >= 190, "{name}: {compared}");
    if compared == 400 {
        let (found, expected) = (read.web.flux(), flux(lamp));
        assert!((found / expected - 1.0).abs() < 2e-3, "{name}: {found} {expected}");
    }
    read
}

#[test]
fn ies_files_of_type_c_bring_their_lamp_with_every_symmetry() {
    let everywhere = |_: DVec3| true;
    let vertical = angles(0.0, 180.0, 5.0);
    let ies = Ies::default();
    for (name, lamp, horizontal) in [
        ("one plane", ROUND, vec![0.0]),
        ("a quarter", SAME_ACROSS_BOTH, angles(0.0, 90.0, 7.5)),
        ("a half", SAME_ACROSS_Y, angles(0.0, 180.0, 7.5)),
        ("the other half", SAME_ACROSS_X, angles(90.0, 270.0, 7.5)),
        ("all", NO_SYMMETRY, angles(0.0, 360.0, 7.5)),
        ("all but the last", NO_SYMMETRY, angles(0.0, 352.5, 7.5)),
    ] {
        is_lamp(name, &ies.write(lamp, &vertical, &horizontal), lamp, everywhere);
    }
    // Angles need not be even, and the lower half may be all.
    let below = |d: DVec3| d.z <= 0.0;
    let uneven = [0.0, 3.0, 5.0, 11.0, 16.0, 20.0, 26.0, 31.0, 37.5, 41.0, 46.0, 51.0, 57.0, 61.0];
    let uneven: Vec<f64> = uneven.into_iter().chain([67.0, 72.0, 77.0, 83.0, 86.0, 90.0]).collect();
    let horizontal = angles(0.0, 90.0, 7.5);
    let text = ies.write(SAME_ACROSS_BOTH, &uneven, &horizontal);
    let read = is_lamp("below", &text, SAME_ACROSS_BOTH, below);
    assert_eq!((read.web.halves(), read.name.as_str()), ([true, false], "a lamp"));
}

#[test]
fn ies_files_of_types_a_and_b_turn_about_their_axes() {
    let ahead = |d: DVec3| d.z < 0.0;
    let (all, half) = (angles(-90.0, 90.0, 5.0), angles(0.0, 90.0, 5.0));
    for kind in [2, 3] {
        let ies = Ies { kind, ..Ies::default() };
        let text = ies.write(NO_SYMMETRY, &all, &all);
        is_lamp("ahead", &text, NO_SYMMETRY, ahead);
        let text = ies.write(SAME_ACROSS_BOTH, &half, &half);
        let read = is_lamp("a quarter", &text, SAME_ACROSS_BOTH, ahead);
        assert!(read.notes.iter().any(|note| note.contains("vertical")));
        // Horizontal angles turn to the sides y, vertical ones to x.
        let text = ies.write(SAME_ACROSS_Y, &all, &half);
        is_lamp("half", &text, SAME_ACROSS_Y, ahead);
    }
}

#[test]
fn eulumdat_files_bring_their_lamp_with_every_symmetry() {
    let everywhere = |_: DVec3| true;
    let stored = |first, last| angles(first, last, 7.5);
    for (name, lamp, symmetry, stored) in [
        ("none", NO_SYMMETRY, 0, stored(0.0, 352.5)),
        ("round", ROUND, 1, vec![0.0]),
        ("C0 to C180", SAME_ACROSS_Y, 2, stored(0.0, 180.0)),
        // These planes begin at C270.
        ("C270 to C90", SAME_ACROSS_X, 3, stored(270.0, 450.0)),
        ("both", SAME_ACROSS_BOTH, 4, stored(0.0, 90.0)),
    ] {
        let read = is_lamp(name, &eulumdat(lamp, symmetry, 48, 5.0, &stored), lamp, everywhere);
        // C0 runs across the luminaire, and C90 along it.
        assert_eq!(read.opening.shape, OpeningShape::Rectangle);
        assert_eq!(read.opening.size, [0.15, 1.2, 0.0]);
        assert_eq!((read.lamp_lumens, read.name.as_str()), (Some(4000.0), "a lamp"));
    }
}

#[test]
fn factors_of_all_years_are_multiplied_in() {
    let (vertical, horizontal) = (angles(0.0, 180.0, 5.0), vec![0.0]);
    let everywhere = |_: DVec3| true;
    // 1986: no first line, and the second factor is that of ballast and lamp.
    let old = Ies { header: "", multiplier: 2.0, ballast: [0.9, 0.8], ..Ies::default() };
    is_lamp("1986", &old.write(ROUND, &vertical, &horizontal), ROUND, everywhere);
    // 2019: the second one is a code.
    let new = Ies { header: "IES:LM-63-2019\n", ballast: [0.9, 1.0], ..Ies::default() };
    let text = new.write(ROUND, &vertical, &horizontal).replace("0.9 1 20", "0.9 1.11001 20");
    is_lamp("2019", &text, ROUND, everywhere);
    let commas = Ies::default().write(ROUND, &vertical, &horizontal).replace(' ', ", ");
    is_lamp("commas", &commas.replace("\n", "\r\n"), ROUND, everywhere);
}

#[test]
fn a_tilt_table_is_interpolated() {
    let tilt = "TILT=INCLUDE\n1\n4\n0 30 60 90\n1 0.9 0.7 0.4\n";
    let ies = Ies { tilt, ..Ies::default() };
    let text = ies.write(ROUND, &angles(0.0, 180.0, 5.0), &[0.0]);
    let table = is_lamp("tilt", &text, ROUND, |_| true).tilt.unwrap();
    for (angle, factor) in [(0.0, 1.0), (15.0, 0.95), (45.0, 0.8), (90.0, 0.4), (120.0, 0.4)] {
        assert!((table.factor(angle) - factor).abs() < 1e-12, "{angle}");
    }
    let other = Ies { tilt: "TILT=lamp.tlt\n", ..Ies::default() };
    let read = Photometry::read(other.write(ROUND, &[0.0, 180.0], &[0.0]).as_bytes()).unwrap();
    assert!(read.notes[0].contains("lamp.tlt"));
}

#[test]
fn more_light_than_the_lamps_have_is_noted() {
    let text = Ies::default().write(ROUND, &angles(0.0, 180.0, 5.0), &[0.0]);
    let read = Photometry::read(text.replace("1 -1 1 ", "2 300 1 ").as_bytes()).unwrap();
    assert_eq!(read.lamp_lumens, Some(600.0));
    assert!(read.notes[0].contains("600 lm"), "{:?}", read.notes);
    let dark: Result<_, PhotometryError> =
        Photometry::read(text.replace("1 -1 1 ", "1 -1 0 ").as_bytes());
    let dark = dark.unwrap();
    assert_eq!(dark.web.flux(), 0.0);
    assert!(dark.notes[0].contains("light 0"), "{:?}", dark.notes);
}
