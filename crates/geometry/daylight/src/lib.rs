//! Skies and the sun by formulas: how bright each part of the sky is, and where the sun stands.
//!
//! Nothing here knows a scene. Directions are unit vectors in the horizon's frame: x points east,
//! y north, z to the zenith. Radiances and irradiances are those of white light in W·sr⁻¹·m⁻² and
//! W·m⁻², of which each has [`WHITE_EFFICACY`] lumens, as in Radiance.
//!
//! Sources:
//! - CIE S 011/E:2003, "Spatial distribution of daylight: CIE standard general sky".
//! - The zenith and the sun of clear, intermediate and overcast skies are those of Radiance's
//!   `gensky`.
//! - Perez, Seals and Michalsky 1993, "All-weather model for sky luminance distribution", Solar
//!   Energy 50(3), with the erratum in 51(5). Its illuminances are from Perez et al. 1990,
//!   "Modeling daylight availability and irradiance components from direct and global irradiance",
//!   Solar Energy 44(5).
//! - Reda and Andreas 2004, "Solar position algorithm for solar radiation applications", by the
//!   crate `solar-positioning`.
//!
//! Invariant: every radiance is finite and not negative, wherever the sun stands.
#![forbid(unsafe_code)]

mod civil_time;
mod formula;
mod level;
mod perez;
mod solar;
mod standard;
mod weather;

pub use civil_time::{CivilTime, CivilTimeError};
pub use formula::{SkyFormula, SkyShape};
pub use level::{SkyLevel, clear_sky, intermediate_sky, overcast_sky, standard_sky};
pub use perez::{PerezSky, PerezWeather, perez_sky};
pub use solar::{GeoPlace, PlaceError, SunPosition, sun_position};
pub use standard::STANDARD_SKIES;
pub use weather::{MAX_WEATHER_BYTES, WeatherError, WeatherFile, WeatherHour};

/// Lumens per watt of white light: Radiance's, and those of the whole program.
pub const WHITE_EFFICACY: f64 = 179.0;
