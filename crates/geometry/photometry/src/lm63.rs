//! IES LM-63, from 1986 to 2019.
//!
//! Differences between the years: 1986 has no first line of its own. The factor after the ballast's
//! is that of lamp and ballast together until 1995, 1 in 2002, and a code for the kind of file in
//! 2019. Round openings have a negative width alone until 1995, and negative width and length
//! since.

use crate::angles::{Planes, SAME, check_ascent, closed, make};
use crate::text::{Quantity, Words};
use crate::web::{MAX_ANGLES, MAX_CANDELA, MAX_WEB_VALUES};
use crate::{
    LuminousOpening, OpeningShape, PhotometricWeb, Photometry, PhotometryError, TiltTable, WebPole,
};

/// Metres in a foot.
const FOOT: f64 = 0.3048;

const COUNT: Quantity =
    Quantity { what: "number of angles", range: "1 or more", least: 1.0, most: 1e9 };
const FACTOR: Quantity =
    Quantity { what: "factor", range: "a number from 0 to 1e9", least: 0.0, most: 1e9 };
const SIZE: Quantity =
    Quantity { what: "size of the opening", range: "within 1000", least: -1e3, most: 1e3 };
const ANGLE: Quantity =
    Quantity { what: "angle", range: "from -360 to 360 degrees", least: -360.0, most: 360.0 };
const CANDELA: Quantity =
    Quantity { what: "candela value", range: "from 0 to 1e12", least: 0.0, most: MAX_CANDELA };

/// Returns the index of the line with `TILT=`, if the text is an IES file.
pub(crate) fn tilt_line(text: &str) -> Option<usize> {
    text.lines().position(|line| tilt_of(line).is_some())
}

/// Returns what follows `TILT=`.
fn tilt_of(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let (word, rest) = (line.get(..4)?, line.get(4..)?.trim_start());
    word.eq_ignore_ascii_case("TILT").then(|| rest.strip_prefix('='))?.map(str::trim)
}

/// Reads a file whose line `tilt` is `TILT=`.
pub(crate) fn read(text: &str, tilt: usize) -> Result<Photometry, PhotometryError> {
    let mut notes = Vec::new();
    let tilt_word = text.lines().nth(tilt).and_then(tilt_of).unwrap_or_default();
    let mut words = Words::after(text, tilt + 1);
    let table = match tilt_word.to_ascii_uppercase().as_str() {
        "NONE" => None,
        "INCLUDE" => Some(tilt_table(&mut words)?),
        _ => {
            notes.push(format!(
                "its light by tilt is in another file, `{}`, which is not read",
                crate::text::excerpt(tilt_word)
            ));
            None
        }
    };
    let lamps = Quantity { what: "number of lamps", range: "from 0 to 1e6", least: 0.0, most: 1e6 };
    let lumens = Quantity {
        what: "lumens of a lamp",
        range: "from 0 to 1e12, or -1 for absolute photometry",
        least: -1.0,
        most: 1e12,
    };
    let (lamps, lumens) = (words.number(lamps)?, words.number(lumens)?);
    let multiplier = words.number(FACTOR)?;
    let [rows, columns] = [words.number(COUNT)?, words.number(COUNT)?].map(|n| n as usize);
    let line = words.line;
    for (what, found) in [("vertical angles", rows), ("horizontal angles", columns)] {
        if found > MAX_ANGLES {
            return Err(PhotometryError::Limit { line, what, found, most: MAX_ANGLES });
        }
    }
    if rows * columns > MAX_WEB_VALUES {
        let (what, found) = ("candela values", rows * columns);
        return Err(PhotometryError::Limit { line, what, found, most: MAX_WEB_VALUES });
    }
    let kind = Quantity { what: "type", range: "1 (C), 2 (B) or 3 (A)", least: 1.0, most: 3.0 };
    let kind = words.number(kind)?;
    let unit = Quantity {
        what: "unit of lengths",
        range: "1 (feet) or 2 (metres)",
        least: 1.0,
        most: 2.0,
    };
    let unit = if words.number(unit)? < 2.0 { FOOT } else { 1.0 };
    let sizes = words.numbers(3, SIZE)?;
    let opening = opening([sizes[0] * unit, sizes[1] * unit, sizes[2] * unit]);
    let (ballast, both) = (words.number(FACTOR)?, words.number(FACTOR)?);
    // In 2019 the second one is no factor.
    let first = text.lines().next().unwrap_or_default();
    let is_code = first.contains("2019");
    let factor = multiplier * ballast * if is_code { 1.0 } else { both };
    let watts = Quantity { what: "watts", range: "from -1 to 1e9", least: -1.0, most: 1e9 };
    words.number(watts)?;
    let vertical = words.numbers(rows, ANGLE)?;
    check_ascent(&vertical, words.line, "vertical")?;
    let horizontal = words.numbers(columns, ANGLE)?;
    check_ascent(&horizontal, words.line, "horizontal")?;
    let line = words.line;
    let candela = words.numbers(rows * columns, CANDELA)?;
    let planes: Vec<Vec<f64>> = candela
        .chunks(rows)
        .map(|plane| plane.iter().map(|value| (value * factor).min(MAX_CANDELA)).collect())
        .collect();
    let web = match kind as u32 {
        1 => web_c(line, &vertical, &horizontal, planes)?,
        2 => web_ab(line, WebPole::Width, [&vertical, &horizontal], &planes, &mut notes)?,
        _ => web_ab(line, WebPole::Length, [&vertical, &horizontal], &planes, &mut notes)?,
    };
    if factor == 0.0 {
        notes.push("its factors make its light 0".to_owned());
    }
    let lamp_lumens = (lumens > 0.0 && lamps > 0.0).then_some(lamps * lumens);
    Ok(Photometry { name: name(text, tilt), web, opening, lamp_lumens, tilt: table, notes })
}

/// Returns the luminaire's name: the first keyword that has one.
fn name(text: &str, tilt: usize) -> String {
    let value = |keyword: &str| {
        let of = |line: &str| {
            let (found, rest) = line.trim_start().strip_prefix('[')?.split_once(']')?;
            found.trim().eq_ignore_ascii_case(keyword).then(|| rest.trim().to_owned())
        };
        text.lines().take(tilt).find_map(of).filter(|name| !name.is_empty())
    };
    let found = ["LUMINAIRE", "LUMCAT", "MANUFAC"].iter().find_map(|keyword| value(keyword));
    found.map_or_else(String::new, |name| crate::text::excerpt(&name))
}

fn tilt_table(words: &mut Words) -> Result<TiltTable, PhotometryError> {
    let geometry = Quantity { what: "lamp's geometry", range: "1, 2 or 3", least: 1.0, most: 3.0 };
    words.number(geometry)?;
    let count = words.number(COUNT)? as usize;
    if count > MAX_ANGLES {
        let (line, what) = (words.line, "angles of tilt");
        return Err(PhotometryError::Limit { line, what, found: count, most: MAX_ANGLES });
    }
    let angles = words.numbers(count, ANGLE)?;
    check_ascent(&angles, words.line, "tilt")?;
    let factors = words.numbers(count, FACTOR)?;
    Ok(TiltTable(angles.into_iter().zip(factors).map(|(angle, factor)| [angle, factor]).collect()))
}

/// Returns the opening of a width (across), a length (along) and a height. Negative numbers are
/// diameters.
fn opening([width, length, height]: [f64; 3]) -> LuminousOpening {
    let (is_round_across, is_round_along) = (width < 0.0, length < 0.0);
    let (mut x, mut y, z) = (length.abs(), width.abs(), height.abs());
    let shape = if height < 0.0 {
        // Both diameters of a cylinder, or all of an ellipsoid, are negative.
        match (is_round_across, is_round_along) {
            (_, false) if x > 0.0 && (is_round_across || y == 0.0) => OpeningShape::CylinderAlongX,
            (false, _) if y > 0.0 && (is_round_along || x == 0.0) => OpeningShape::CylinderAlongY,
            (false, false) => OpeningShape::Box,
            _ => OpeningShape::Ellipsoid,
        }
    } else {
        match (is_round_across || is_round_along, height > 0.0) {
            (true, true) => OpeningShape::CylinderAlongZ,
            (true, false) => OpeningShape::Ellipse,
            (false, true) => OpeningShape::Box,
            (false, false) => OpeningShape::Rectangle,
        }
    };
    // One diameter stands for both.
    match shape {
        OpeningShape::CylinderAlongX if y == 0.0 => y = z,
        OpeningShape::CylinderAlongY if x == 0.0 => x = z,
        OpeningShape::Ellipse | OpeningShape::CylinderAlongZ | OpeningShape::Ellipsoid => {
            (x, y) = (if x == 0.0 { y } else { x }, if y == 0.0 { x } else { y });
        }
        _ => {}
    }
    LuminousOpening::new(shape, [x, y, z])
}

/// Makes a web of type C, and writes out its symmetry.
fn web_c(
    line: usize,
    vertical: &[f64],
    horizontal: &[f64],
    planes: Vec<Vec<f64>>,
) -> Result<PhotometricWeb, PhotometryError> {
    let wrong = |what, problem: String| PhotometryError::Angles { line, what, problem };
    let last = vertical.last().copied().unwrap_or_default();
    if vertical[0] < -SAME || last > 180.0 + SAME {
        let problem = format!("of type C run from 0 to 180, not from {} to {last}", vertical[0]);
        return Err(wrong("vertical", problem));
    }
    let turns = full_circle(horizontal, &planes).ok_or_else(|| {
        let (first, last) = (horizontal[0], horizontal[horizontal.len() - 1]);
        wrong(
            "horizontal",
            format!(
                "of type C run from 0 to 0, 90, 180 or 360, or from 90 to 270, not from {first} to \
                 {last}"
            ),
        )
    })?;
    make(line, WebPole::Nadir, vertical, &turns)
}

/// Returns the planes of a full circle, each with its angle. One plane stands for all.
fn full_circle(horizontal: &[f64], planes: &[Vec<f64>]) -> Option<Planes> {
    let (first, last) = (*horizontal.first()?, *horizontal.last()?);
    let is = |angle: f64, other: f64| (angle - other).abs() <= SAME;
    let given: Planes = horizontal.iter().copied().zip(planes.iter().cloned()).collect();
    if given.len() == 1 {
        return Some(given);
    }
    let with_mirrors = |mirrors: &[&dyn Fn(f64) -> f64]| {
        let mut all = given.clone();
        for mirror in mirrors {
            all.extend(all.clone().into_iter().map(|(angle, plane)| (mirror(angle), plane)));
        }
        closed(all)
    };
    match () {
        () if is(first, 0.0) && is(last, 90.0) => {
            Some(with_mirrors(&[&|angle| 180.0 - angle, &|angle| 360.0 - angle]))
        }
        () if is(first, 0.0) && is(last, 180.0) => Some(with_mirrors(&[&|angle| 360.0 - angle])),
        () if is(first, 90.0) && is(last, 270.0) => Some(with_mirrors(&[&|angle| 180.0 - angle])),
        // Some programs leave out the last plane, which is the first again.
        () if is(first, 0.0) && last > 180.0 => Some(closed(given)),
        () => None,
    }
}

/// Makes a web of type A or B. `pole` is the axis about which angles of longitude turn.
fn web_ab(
    line: usize,
    pole: WebPole,
    [vertical, horizontal]: [&[f64]; 2],
    planes: &[Vec<f64>],
    notes: &mut Vec<String>,
) -> Result<PhotometricWeb, PhotometryError> {
    for (what, angles) in [("vertical", vertical), ("horizontal", horizontal)] {
        let (first, last) = (angles[0], angles[angles.len() - 1]);
        let is_one = angles.len() == 1;
        if first < -180.0 - SAME || last > 180.0 + SAME || is_one {
            let problem =
                format!("of types A and B are several from -90 to 90, not from {first} to {last}");
            return Err(PhotometryError::Angles { line, what, problem });
        }
    }
    // Planes of latitude or longitude, mirrored if they begin at the middle.
    let (vertical, rows) = mirrored(vertical);
    let (horizontal, columns) = mirrored(horizontal);
    if vertical.len() > rows.iter().max().map_or(0, |last| last + 1) {
        notes.push("its vertical angles begin at 0, so its light is the same above".to_owned());
    }
    let at = |h: usize, v: usize| planes[columns[h]][rows[v]];
    // Angles from the pole ascend where latitudes descend.
    let (latitudes, turns): (&[f64], Planes) = match pole {
        WebPole::Width => {
            let plane = |v: usize| (0..horizontal.len()).rev().map(|h| at(h, v)).collect();
            (&horizontal, (0..vertical.len()).map(|v| (vertical[v], plane(v))).collect())
        }
        _ => {
            let plane = |h: usize| (0..vertical.len()).rev().map(|v| at(h, v)).collect();
            (&vertical, (0..horizontal.len()).map(|h| (horizontal[h], plane(h))).collect())
        }
    };
    if latitudes[0] < -90.0 - SAME || latitudes[latitudes.len() - 1] > 90.0 + SAME {
        let what = if pole == WebPole::Width { "horizontal" } else { "vertical" };
        let problem = "of this type lie within -90 and 90".to_owned();
        return Err(PhotometryError::Angles { line, what, problem });
    }
    let polar: Vec<f64> =
        latitudes.iter().rev().map(|latitude| (90.0 - latitude).max(0.0)).collect();
    make(line, pole, &polar, &turns)
}

/// Returns angles, and for each the place of its value. Angles that begin at 0 are mirrored.
fn mirrored(angles: &[f64]) -> (Vec<f64>, Vec<usize>) {
    let given = angles.iter().copied().zip(0..angles.len());
    if angles[0].abs() > SAME {
        return given.unzip();
    }
    let below = given.clone().skip(1).rev().map(|(angle, place)| (-angle, place));
    below.chain(given).unzip()
}
