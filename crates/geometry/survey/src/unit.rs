//! Guesses the length of a scene's unit.

use crate::Guess;

/// Metres in one unit of length.
pub type Unit = f64;

/// Usual units of models: metres, name, and the height of a storey in the unit.
const UNITS: [(Unit, &str, std::ops::Range<f64>); 5] = [
    (1.0, "metres", 1.9..6.0),
    (0.3048, "feet", 6.5..18.0),
    (0.0254, "inches", 78.0..200.0),
    (0.01, "centimetres", 200.0..600.0),
    (0.001, "millimetres", 1900.0..6000.0),
];

/// Returns a unit's name, or else its length in metres.
#[must_use]
pub fn unit_words(unit: Unit) -> String {
    let known = UNITS.iter().find(|(metres, ..)| (metres / unit - 1.0).abs() < 1e-6);
    known.map_or_else(|| format!("units of {unit} m"), |(_, name, _)| (*name).to_owned())
}

/// Guesses the unit from the height of storeys.
pub(crate) fn by_storey(height: f64) -> Option<Guess<Unit>> {
    let (unit, name, _) = UNITS.iter().find(|(_, _, storeys)| storeys.contains(&height))?;
    Some(Guess::new(*unit, format!("{name}, because rooms are {height:.3} units high")))
}

/// Guesses the unit from the longest extent of a scene, which may be an object.
pub(crate) fn by_extent(extent: f64) -> Guess<Unit> {
    let unit = match extent {
        300.0..3000.0 => 0.01,
        3000.0.. => 0.001,
        _ => 1.0,
    };
    let (words, metres) = (unit_words(unit), extent * unit);
    Guess::new(
        unit,
        format!("{words}, because the longest side of {extent:.3} units is then {metres:.2} m"),
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_storey_determines_the_unit() {
        for (height, unit) in
            [(2.6, 1.0), (8.0, 0.3048), (96.0, 0.0254), (260.0, 0.01), (2600.0, 0.001)]
        {
            assert_eq!(by_storey(height).unwrap().value, unit, "{height}");
        }
        assert_eq!(by_storey(0.7), None);
        assert_eq!(unit_words(0.0254), "inches");
        assert_eq!(unit_words(2.0), "units of 2 m");
    }
}
