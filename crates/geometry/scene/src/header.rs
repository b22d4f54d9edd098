//! Reads the unit and the up axis from the comments at the beginning of a model file.

use crate::text::excerpt;

/// A direction or a length, and the words of the file that say so.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedValue<T> {
    /// What is said.
    pub value: T,
    /// The words, for people.
    pub words: String,
}

/// Facts that a model file states, besides its surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelFacts {
    /// The up axis that the file states.
    pub up: Option<StatedValue<[f64; 3]>>,
    /// Metres per unit that the file states.
    pub unit: Option<StatedValue<f64>>,
    /// The usual up axis of the program that wrote the file.
    pub usual_up: Option<StatedValue<[f64; 3]>>,
    /// Metres per unit that this program usually has.
    pub usual_unit: Option<StatedValue<f64>>,
    /// Cameras of the file by name.
    pub cameras: Vec<ModelCamera>,
}

/// A camera of a model file, in world coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCamera {
    /// Its name, for people.
    pub name: String,
    /// Eye.
    pub eye: [f64; 3],
    /// Direction of the view.
    pub direction: [f64; 3],
    /// Up in the picture.
    pub up: [f64; 3],
    /// Vertical angle in degrees, or the height of a parallel view in scene units.
    pub height: f64,
    /// True for a parallel view.
    pub is_parallel: bool,
}

const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// Bytes and lines at the beginning of a file that are searched for comments.
const MOST_BYTES: usize = 1 << 16;
const MOST_LINES: usize = 200;

/// Names of units in comments.
const UNITS: [(&str, f64); 21] = [
    ("mm", 0.001),
    ("millimeter", 0.001),
    ("millimeters", 0.001),
    ("millimetre", 0.001),
    ("millimetres", 0.001),
    ("cm", 0.01),
    ("centimeter", 0.01),
    ("centimeters", 0.01),
    ("centimetre", 0.01),
    ("centimetres", 0.01),
    ("m", 1.0),
    ("meter", 1.0),
    ("meters", 1.0),
    ("metre", 1.0),
    ("metres", 1.0),
    ("in", 0.0254),
    ("inch", 0.0254),
    ("inches", 0.0254),
    ("ft", 0.3048),
    ("foot", 0.3048),
    ("feet", 0.3048),
];

/// Programs that name themselves, with the up axis and unit of their default settings.
const PROGRAMS: [(&str, [f64; 3], Option<f64>); 9] = [
    ("blender", Y, Some(1.0)),
    ("3ds max", Y, None),
    ("maya", Y, Some(0.01)),
    ("rhino", Y, Some(0.001)),
    ("zbrush", Y, None),
    ("sweet home 3d", Y, Some(0.01)),
    ("cinema 4d", Y, Some(0.01)),
    ("freecad", Z, Some(0.001)),
    ("openscad", Z, Some(0.001)),
];

/// Reads the comments at the beginning of an OBJ file.
pub(crate) fn read(text: &str) -> ModelFacts {
    let mut about = ModelFacts::default();
    let mut rest = text;
    for _ in 0..MOST_LINES {
        let end = rest.bytes().position(|b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
        if text.len() - rest.len() > MOST_BYTES || rest.is_empty() {
            break;
        }
        let line = rest[..end].trim_start_matches('\u{feff}').trim();
        rest = rest.get(end + 1..).unwrap_or("");
        if let Some(comment) = line.strip_prefix('#') {
            read_comment(comment.trim(), &mut about);
        }
    }
    about
}

fn read_comment(comment: &str, about: &mut ModelFacts) {
    let lower = comment.to_lowercase();
    let words: Vec<&str> = lower
        .split(|c: char| !c.is_alphanumeric() && c != '+')
        .filter(|word| !word.is_empty())
        .collect();
    let shown = || excerpt(comment);
    let up = words.windows(2).find_map(|pair| match pair {
        ["y" | "+y", "up"] => Some(Y),
        ["z" | "+z", "up"] => Some(Z),
        _ => None,
    });
    let joined = words.iter().find_map(|word| match *word {
        "yup" => Some(Y),
        "zup" => Some(Z),
        _ => None,
    });
    if let Some(value) = up.or(joined) {
        about.up.get_or_insert_with(|| StatedValue { value, words: shown() });
    }
    let names_units = words.iter().any(|word| *word == "unit" || *word == "units");
    let speaks_of_units = names_units || words.len() <= 3;
    let unit = words.iter().find_map(|word| UNITS.iter().find(|(name, _)| name == word));
    // Single letters and "in" also occur in other sentences.
    let is_sure = |name: &str| name.len() > 2 || names_units;
    if let Some((name, metres)) = unit.filter(|(name, _)| speaks_of_units && is_sure(name)) {
        let value = metres * number_before(&lower, name);
        about.unit.get_or_insert_with(|| StatedValue { value, words: shown() });
    }
    if let Some((_, up, unit)) = PROGRAMS.iter().find(|(name, ..)| lower.contains(name)) {
        about.usual_up.get_or_insert_with(|| StatedValue { value: *up, words: shown() });
        if let Some(value) = *unit {
            about.usual_unit.get_or_insert_with(|| StatedValue { value, words: shown() });
        }
    }
}

/// Returns the number in front of a word, such as 100 in "units of 100 mm"; 1 if no number is
/// there.
fn number_before(text: &str, word: &str) -> f64 {
    let is_word = |part: &str| part.trim_matches(|c: char| !c.is_alphanumeric()) == word;
    let parts: Vec<&str> = text.split_whitespace().collect();
    let before = parts.windows(2).find(|pair| is_word(pair[1])).map(|pair| pair[0].parse());
    before
        .and_then(Result::ok)
        .filter(|number: &f64| number.is_normal() && *number > 0.0)
        .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stated(text: &str) -> (Option<[f64; 3]>, Option<f64>) {
        let about = read(text);
        (about.up.map(|said| said.value), about.unit.map(|said| said.value))
    }

    #[test]
    fn comments_state_units_and_up() {
        for (text, expected) in [
            ("# Metres, +Z up.\nv 0 0 0", (Some(Z), Some(1.0))),
            ("# File units = inches\r\n", (None, Some(0.0254))),
            ("\u{feff}# Units: mm", (None, Some(0.001))),
            ("# The Cornell box, units of 100 mm, +Y up.", (Some(Y), Some(0.1))),
            ("# 1 unit = 2.5 cm", (None, Some(0.025))),
            ("# units: nan m", (None, Some(1.0))),
            ("# This file uses centimeters as units for coordinates.", (None, Some(0.01))),
            ("# Y-up\n# unit ft", (Some(Y), Some(0.3048))),
            ("# exported in 2012 by m. maker for unitless use", (None, None)),
            ("# 4032 vertices in all", (None, None)),
            ("v 1 2 3 # z up", (None, None)),
        ] {
            assert_eq!(stated(text), expected, "{text}");
        }
    }

    #[test]
    fn a_program_s_usual_up_axis_and_unit_are_not_stated_ones() {
        let about = read("# Blender v2.93.4 OBJ File: 'room.blend'\n# www.blender.org\n");
        assert_eq!((about.up, about.unit), (None, None));
        assert_eq!(about.usual_up.map(|said| said.value), Some(Y));
        assert_eq!(about.usual_unit.map(|said| said.value), Some(1.0));
    }
}
