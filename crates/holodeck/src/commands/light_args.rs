//! Options for sky, sun and lamps.

use std::path::PathBuf;

use clap::Args;
use holo_daylight::{CivilTime, GeoPlace};
use holodeck::light::{self, SkyChoice, StatedLight};

/// Options for sky, sun and lamps.
#[derive(Args, Clone, Debug, Default)]
pub struct LightArgs {
    /// The sky: the same radiance R,G,B in every direction, such as 1,1,1; a sky of the CIE or of
    /// Perez; or a picture of all directions. A picture is twice as wide as high, with north in its
    /// middle, or it is a cube, as a cross or strip
    #[arg(
        long,
        value_name = "R,G,B|overcast|clear|intermediate|uniform|cie:1..15|perez|FILE.hdr|FILE.exr"
    )]
    pub sky: Option<SkyChoice>,
    /// The place, degrees north and east, such as 52.37,4.90
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    pub place: Option<GeoPlace>,
    /// The date, hour and time zone, such as 2026-06-21T15:30+02:00. With a place, the sky is clear
    /// unless --sky says otherwise
    #[arg(long, value_name = "DATE")]
    pub at: Option<CivilTime>,
    /// For --sky perez: irradiance by the sun on a surface that faces it
    #[arg(long, value_name = "W/m2", value_parser = light::parse_irradiance)]
    pub direct: Option<f64>,
    /// For --sky perez: irradiance by the sky on a horizontal surface
    #[arg(long, value_name = "W/m2", value_parser = light::parse_irradiance)]
    pub diffuse: Option<f64>,
    /// A weather file: it has a place, and for --sky perez the irradiances of each hour
    #[arg(long, value_name = "FILE.epw")]
    pub weather: Option<PathBuf>,
    /// Turn north clockwise, seen from above [default: 0: the scene's Y if Z is up, -Z if Y is up]
    #[arg(
        long,
        value_name = "DEGREES",
        allow_hyphen_values = true,
        value_parser = light::parse_north
    )]
    pub north: Option<f64>,
    /// Reflectance of the ground that skies have below the horizon [default: 0.2]
    #[arg(long, value_name = "0..1", value_parser = light::parse_ground)]
    pub ground: Option<f64>,
    /// Make the sky so bright that it gives this illuminance on horizontal ground
    #[arg(long, value_name = "LUX", value_parser = light::parse_illuminance)]
    pub illuminance: Option<f64>,
    /// Dim a lamp or switch it off. It is named by its material, its light, the light's type, its
    /// luminaire or the luminaire's group; `sun` and `sky` are names too. May be repeated
    #[arg(long, value_name = "NAME=FACTOR", value_parser = light::parse_lamp)]
    pub lamp: Vec<(String, f32)>,
}

impl LightArgs {
    /// Returns the light that they state.
    pub fn stated(&self) -> StatedLight {
        StatedLight {
            sky: self.sky.clone(),
            place: self.place,
            at: self.at,
            direct: self.direct,
            diffuse: self.diffuse,
            weather: self.weather.clone(),
            north: self.north,
            ground: self.ground,
            illuminance: self.illuminance,
            lamps: self.lamp.clone(),
            luminaires: Vec::new(),
        }
    }
}
