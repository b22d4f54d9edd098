//! The ranges of numbers that state light.

/// Greatest factor of a lamp.
const MAX_FACTOR: f32 = 1e6;

/// Returns a number if it lies in a range.
fn in_range(text: &str, least: f64, most: f64, what: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|n| (least..=most).contains(n));
    number.ok_or_else(|| format!("`{text}` is no {what}; it lies between {least} and {most}"))
}

/// Reads an irradiance, W·m⁻².
pub fn parse_irradiance(text: &str) -> Result<f64, String> {
    in_range(text, 0.0, 2000.0, "irradiance in W/m²")
}

/// Reads a turn of north, degrees.
pub fn parse_north(text: &str) -> Result<f64, String> {
    in_range(text, -360.0, 360.0, "direction of north in degrees")
}

/// Reads a reflectance.
pub fn parse_ground(text: &str) -> Result<f64, String> {
    in_range(text, 0.0, 1.0, "reflectance of the ground")
}

/// Reads an illuminance, lx.
pub fn parse_illuminance(text: &str) -> Result<f64, String> {
    in_range(text, 0.0, 1e7, "illuminance in lx")
}

/// Reads the factor of a lamp, such as `ceiling=0.5`.
pub fn parse_lamp(text: &str) -> Result<(String, f32), String> {
    let (name, factor) = text
        .rsplit_once('=')
        .ok_or_else(|| format!("`{text}` has no factor; write it like NAME=0.5"))?;
    let factor = in_range(factor, 0.0, f64::from(MAX_FACTOR), "factor of a lamp")?;
    Ok((name.to_owned(), factor as f32))
}
