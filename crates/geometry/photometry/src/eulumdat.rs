//! EULUMDAT (LDT): one value to a line.

use crate::angles::{check_ascent, closed, make};
use crate::text::{Quantity, excerpt, parse};
use crate::web::{MAX_ANGLES, MAX_CANDELA};
use crate::{LuminousOpening, OpeningShape, Photometry, PhotometryError, WebPole};

/// Most sets of lamps. Files have one, at most twenty.
const MAX_SETS: usize = 100;

/// Ratios of direct light by room, which stand before the angles.
const RATIOS: usize = 10;

const ANGLE: Quantity =
    Quantity { what: "angle", range: "from 0 to 360 degrees", least: 0.0, most: 360.0 };
const SIZE: Quantity = Quantity {
    what: "size of the luminous area",
    range: "a number from 0 to 1e6 millimetres",
    least: 0.0,
    most: 1e6,
};

/// The lines of a file.
struct Lines<'a> {
    lines: Vec<&'a str>,
}

impl Lines<'_> {
    /// Returns the text of a line, from 1.
    fn text(&self, line: usize, what: &'static str) -> Result<&str, PhotometryError> {
        let ends = PhotometryError::Ends { line: self.lines.len(), what };
        self.lines.get(line - 1).copied().map(str::trim).ok_or(ends)
    }

    /// Returns the number of a line.
    fn number(&self, line: usize, quantity: Quantity) -> Result<f64, PhotometryError> {
        quantity.read(line, self.text(line, quantity.what)?)
    }

    /// Returns the number of a line that may be empty, which stands for 0.
    fn number_or_0(&self, line: usize, quantity: Quantity) -> Result<f64, PhotometryError> {
        match self.text(line, quantity.what)? {
            "" => Ok(0.0),
            text => quantity.read(line, text),
        }
    }

    fn count(
        &self,
        line: usize,
        what: &'static str,
        most: usize,
    ) -> Result<usize, PhotometryError> {
        let quantity = Quantity { what, range: "a number of 1 or more", least: 1.0, most: 1e9 };
        let found = self.number(line, quantity)? as usize;
        match found > most {
            true => Err(PhotometryError::Limit { line, what, found, most }),
            false => Ok(found),
        }
    }
}

pub(crate) fn read(text: &str) -> Result<Photometry, PhotometryError> {
    let lines = Lines { lines: text.lines().take(MAX_LINES).collect() };
    let symmetry = lines.lines.get(2).and_then(|line| line.trim().parse::<usize>().ok());
    let symmetry = symmetry.filter(|&symmetry| symmetry <= 4).ok_or(PhotometryError::Foreign)?;
    let planes = lines.count(4, "C-planes", MAX_ANGLES)?;
    let rows = lines.count(6, "angles of a plane", MAX_ANGLES)?;
    let mut notes = Vec::new();
    let opening = opening(&lines)?;
    let factor = Quantity {
        what: "factor of the intensities",
        range: "a number from 0 to 1e9",
        least: 0.0,
        most: 1e9,
    };
    let factor = match lines.number_or_0(24, factor)? {
        // Programs that do not know it write 0.
        0.0 => 1.0,
        factor => factor,
    };
    let sets = lines.count(26, "sets of lamps", MAX_SETS)?;
    if sets > 1 {
        notes.push(format!("it has {sets} sets of lamps, of which the first is used"));
    }
    let lumens = lines.number(
        27 + lumens_of_first_set(&lines, sets),
        Quantity {
            what: "lumens of the lamps",
            range: "a number from 0 to 1e12",
            least: 0.0,
            most: 1e12,
        },
    )?;
    let angles_at = 27 + 6 * sets + RATIOS;
    let angles = |first: usize, count: usize| -> Result<Vec<f64>, PhotometryError> {
        (first..first + count).map(|line| lines.number(line, ANGLE)).collect()
    };
    let turns = angles(angles_at, planes)?;
    check_ascent(&turns, angles_at, "C-plane")?;
    let polar = angles(angles_at + planes, rows)?;
    check_ascent(&polar, angles_at + planes, "gamma")?;
    let values_at = angles_at + planes + rows;
    if polar.last().is_some_and(|last| *last > 180.01) {
        let (what, problem) = ("gamma", "end at 180 degrees at most".to_owned());
        return Err(PhotometryError::Angles { line: values_at - 1, what, problem });
    }
    let stored = stored_planes(symmetry, &turns).ok_or_else(|| PhotometryError::Angles {
        line: angles_at,
        what: "C-plane",
        problem: format!("of symmetry {symmetry} must divide a circle, but {planes} are given"),
    })?;
    // Intensities are those for 1000 lumens.
    let factor = factor * lumens / 1000.0;
    let candela = Quantity {
        what: "intensity",
        range: "a number from 0 to 1e12",
        least: 0.0,
        most: MAX_CANDELA,
    };
    let mut given = Vec::with_capacity(stored.len());
    for (number, angle) in stored.into_iter().enumerate() {
        let first = values_at + number * rows;
        let plane: Vec<f64> = (first..first + rows)
            .map(|line| Ok((lines.number(line, candela)? * factor).min(MAX_CANDELA)))
            .collect::<Result<_, PhotometryError>>()?;
        given.push((angle, plane));
    }
    // A plane at an angle is the same at this sum minus it.
    let mirrors: &[f64] = match symmetry {
        2 => &[360.0],
        3 => &[180.0],
        4 => &[180.0, 360.0],
        _ => &[],
    };
    for sum in mirrors {
        given.extend(given.clone().into_iter().map(|(angle, plane)| (sum - angle, plane)));
    }
    let turns = if given.len() == 1 { given } else { closed(given) };
    let web = make(values_at, WebPole::Nadir, &polar, &turns)?;
    let lamp_lumens = (lumens > 0.0).then_some(lumens);
    let name = excerpt(lines.text(9, "name")?);
    Ok(Photometry { name, web, opening, lamp_lumens, tilt: None, notes })
}

/// Most lines that are looked at: more than the greatest file has.
const MAX_LINES: usize = 2 * crate::MAX_WEB_VALUES;

/// Returns the place of the first set's flux after the number of sets. Sets usually follow each
/// other; some programs write the first value of all sets first.
fn lumens_of_first_set(lines: &Lines, sets: usize) -> usize {
    let is_number = |place: usize| {
        let line = lines.lines.get(26 + place).map(|line| line.trim());
        line.is_some_and(|line| parse(line).is_some())
    };
    if sets > 1 && is_number(1) && !is_number(2) { 2 * sets } else { 2 }
}

/// Returns the angles of the planes whose intensities a file has. `None` if its planes do not suit
/// its symmetry.
fn stored_planes(symmetry: usize, turns: &[f64]) -> Option<Vec<f64>> {
    let count = turns.len();
    let planes = |first: usize, last: usize| -> Vec<f64> {
        // Planes beyond the last are the first ones again, a turn later.
        (first..=last).map(|at| turns[at % count] + 360.0 * (at / count) as f64).collect()
    };
    match symmetry {
        0 => Some(turns.to_vec()),
        1 => Some(vec![turns[0]]),
        2 if count.is_multiple_of(2) => Some(planes(0, count / 2)),
        3 if count.is_multiple_of(4) => Some(planes(3 * count / 4, 3 * count / 4 + count / 2)),
        4 if count.is_multiple_of(4) => Some(planes(0, count / 4)),
        _ => None,
    }
}

/// Returns the luminous area. C0 runs across a long luminaire, and C90 along it.
fn opening(lines: &Lines) -> Result<LuminousOpening, PhotometryError> {
    let metres = |line: usize| Ok::<_, PhotometryError>(lines.number_or_0(line, SIZE)? / 1000.0);
    let (mut length, mut width) = (metres(16)?, metres(17)?);
    let mut height = 0.0;
    for line in 18..=21 {
        height += metres(line)? / 4.0;
    }
    if length == 0.0 && width == 0.0 {
        (length, width) = (metres(13)?, metres(14)?);
        height = 0.0;
    }
    let is_round = width == 0.0;
    let shape = match (is_round, height > 0.0) {
        (true, false) => OpeningShape::Ellipse,
        (true, true) => OpeningShape::CylinderAlongZ,
        (false, false) => OpeningShape::Rectangle,
        (false, true) => OpeningShape::Box,
    };
    Ok(LuminousOpening::new(shape, [if is_round { length } else { width }, length, height]))
}
