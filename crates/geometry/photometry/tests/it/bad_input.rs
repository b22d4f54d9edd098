//! Broken files: an error with its line, never a panic.

use holo_photometry::{MAX_ANGLES, PhotometricWeb, Photometry, WebPole};

use crate::written::*;

fn good_ies() -> String {
    Ies::default().write(SAME_ACROSS_BOTH, &angles(0.0, 180.0, 30.0), &angles(0.0, 90.0, 45.0))
}

fn good_ldt() -> String {
    eulumdat(SAME_ACROSS_BOTH, 4, 8, 30.0, &angles(0.0, 90.0, 45.0))
}

fn error(text: &str) -> String {
    Photometry::read(text.as_bytes()).unwrap_err().to_string()
}

#[test]
fn files_that_end_early_say_where() {
    for good in [good_ies(), good_ldt()] {
        assert!(Photometry::read(good.as_bytes()).is_ok());
        let lines: Vec<&str> = good.lines().collect();
        for count in 0..lines.len() - 1 {
            let said = error(&lines[..count].join("\n"));
            assert!(said.contains("line") || said.contains("no photometric"), "{count}: {said}");
        }
        let said = error(&lines[..lines.len() - 1].join("\n"));
        assert!(said.contains(&format!("line {}", lines.len() - 1)), "{said}");
    }
}

#[test]
fn every_prefix_and_every_changed_byte_gives_a_file_or_an_error() {
    for good in [good_ies(), good_ldt()] {
        for end in 0..good.len() {
            let _ = Photometry::read(&good.as_bytes()[..end]);
        }
        for at in 0..good.len() {
            for byte in [b'-', b'9', b' ', b'\n', 0xFF] {
                let mut bytes = good.clone().into_bytes();
                bytes[at] = byte;
                let _ = Photometry::read(&bytes);
            }
        }
    }
}

#[test]
fn false_numbers_are_named_with_their_line() {
    let good = good_ies();
    let changed = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}: {good}");
        error(&good.replacen(from, to, 1))
    };
    let counts = "1 -1 1 7 3 1 2 0 0 0";
    assert!(changed(counts, "1 -1 nan 7 3 1 2 0 0 0").contains("line 4: factor is `nan`"));
    assert!(changed(counts, "1 -1 1 7 3 4 2 0 0 0").contains("type is `4`"));
    assert!(changed(counts, "1 -1 1 1000000 3 1 2 0 0 0").contains("1000000 vertical angles"));
    assert!(changed(counts, "1 -1 1 7 0 1 2 0 0 0").contains("number of angles is `0`"));
    assert!(changed(counts, "1 -1 1 4000 4000 1 2 0 0 0").contains("16000000 candela values"));
    // One angle too few: the next number is taken for it.
    assert!(changed(counts, "1 -1 1 8 3 1 2 0 0 0").contains("vertical angles must ascend"));
    assert!(changed("0.00000 45.00000 90.00000", "0 45 80").contains("from 0 to 80"));
    assert!(changed("30.00000", "inf").contains("angle is `inf`"));
    let last = good.lines().last().unwrap().split(' ').next_back().unwrap().to_owned();
    assert!(error(&good.replace(&last, "-5")).contains("candela value is `-5`"));
    assert!(error(&good.replace(&last, "NaN")).contains("candela value is `NaN`"));
}

#[test]
fn false_lines_of_eulumdat_are_named() {
    let good = good_ldt();
    let with = |line: usize, text: &str| {
        let mut lines: Vec<&str> = good.lines().collect();
        lines[line - 1] = text;
        error(&lines.join("\n"))
    };
    assert!(with(3, "7").contains("line 3"));
    assert!(with(4, "1000000").contains("line 4: 1000000 C-planes"));
    assert!(with(4, "10").contains("line"));
    assert!(with(6, "x").contains("line 6"));
    assert!(with(16, "-4").contains("line 16: size of the luminous area is `-4`"));
    assert!(with(26, "0").contains("line 26"));
    assert!(with(29, "many").contains("line 29: lumens of the lamps is `many`"));
    assert!(with(43, "90").contains("C-plane angles must ascend"), "{}", with(43, "90"));
    assert!(error("three\nlines\nonly\n").contains("no photometric file"));
    assert!(error("").contains("TILT="));
}

#[test]
fn webs_refuse_what_is_not_possible() {
    let web = |polar: &[f32], turns: &[f32], candela: &[f32]| {
        PhotometricWeb::new(WebPole::Nadir, polar.into(), turns.into(), candela.into())
    };
    assert!(web(&[0.0, 1.0], &[0.0], &[1.0, 2.0]).is_some());
    assert!(web(&[], &[0.0], &[]).is_none());
    assert!(web(&[1.0, 0.0], &[0.0], &[1.0, 2.0]).is_none());
    assert!(web(&[0.0, 1.0], &[0.0], &[1.0]).is_none());
    assert!(web(&[0.0, 1.0], &[0.0], &[1.0, f32::NAN]).is_none());
    assert!(web(&[0.0, 1.0], &[0.0], &[1.0, -1.0]).is_none());
    assert!(web(&[0.0, 4.0], &[0.0], &[1.0, 1.0]).is_none());
    assert!(web(&[0.0], &[0.0, 7.0], &[1.0, 1.0]).is_none());
    let many: Vec<f32> = (0..=MAX_ANGLES).map(|at| at as f32 * 1e-4).collect();
    assert!(web(&many, &[0.0], &vec![0.0; many.len()]).is_none());
}
