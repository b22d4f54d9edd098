//! The names of skies.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::value_ranges::check_sky;

/// The sky that was stated.
#[derive(Clone, Debug, PartialEq)]
pub enum SkyChoice {
    /// The same radiance in every direction, W·sr⁻¹·m⁻².
    Radiance([f32; 3]),
    /// The same radiance above the horizon, and a ground.
    Uniform,
    /// The CIE's overcast sky.
    Overcast,
    /// The CIE's intermediate sky.
    Intermediate,
    /// The CIE's clear sky.
    Clear,
    /// A general sky of the CIE, 1 to 15.
    Standard(usize),
    /// The all-weather sky of Perez.
    Perez,
    /// A picture of all directions.
    Picture(PathBuf),
}

impl FromStr for SkyChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<SkyChoice, String> {
        let words = "overcast, clear, intermediate, uniform, cie:1 to cie:15, perez, a radiance R,G,B \
                     or a picture FILE.hdr or FILE.exr";
        match text {
            "uniform" => return Ok(SkyChoice::Uniform),
            "overcast" => return Ok(SkyChoice::Overcast),
            "intermediate" => return Ok(SkyChoice::Intermediate),
            "clear" => return Ok(SkyChoice::Clear),
            "perez" => return Ok(SkyChoice::Perez),
            _ => {}
        }
        if let Some(number) = text.strip_prefix("cie:") {
            let number = number.parse().ok().filter(|number| (1..=15).contains(number));
            return number.map(SkyChoice::Standard).ok_or_else(|| {
                format!("`{text}`: the general skies of the CIE are cie:1 to cie:15")
            });
        }
        let path = Path::new(text);
        let extension = path.extension().map(|ending| ending.to_ascii_lowercase());
        if extension.is_some_and(|ending| ending == "hdr" || ending == "exr") {
            return Ok(SkyChoice::Picture(path.to_owned()));
        }
        let numbers: Vec<f32> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
        let radiance: Option<[f32; 3]> =
            numbers.try_into().ok().filter(|_| text.split(',').count() == 3);
        let radiance = radiance.ok_or_else(|| format!("`{text}` is no sky; there are {words}"))?;
        check_sky(radiance).map(SkyChoice::Radiance).map_err(|error| format!("`{text}`: {error}"))
    }
}

impl fmt::Display for SkyChoice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            SkyChoice::Radiance([r, g, b]) => write!(f, "{r},{g},{b}"),
            SkyChoice::Uniform => f.write_str("uniform"),
            SkyChoice::Overcast => f.write_str("overcast"),
            SkyChoice::Intermediate => f.write_str("intermediate"),
            SkyChoice::Clear => f.write_str("clear"),
            SkyChoice::Standard(number) => write!(f, "cie:{number}"),
            SkyChoice::Perez => f.write_str("perez"),
            SkyChoice::Picture(path) => write!(f, "{}", path.display()),
        }
    }
}
