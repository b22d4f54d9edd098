//! Where the sun stands, at a place and a moment.

use std::str::FromStr;

use glam::DVec3;
use solar_positioning::time::JulianDate;
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t};
use thiserror::Error;

use crate::civil_time::CivilTime;

/// A place on the globe, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeoPlace {
    /// Degrees north of the equator, -90 to 90.
    pub latitude: f64,
    /// Degrees east of Greenwich, -180 to 180.
    pub longitude: f64,
}

/// Why a place or the sun there is unknown.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PlaceError {
    /// It has another form.
    #[error("`{0}` is no place; write degrees north and east, such as 52.37,4.90")]
    Form(String),
    /// The latitude is out of range.
    #[error("a latitude of {0}° does not exist; it lies between -90 (south) and 90 (north)")]
    Latitude(f64),
    /// The longitude is out of range.
    #[error("a longitude of {0}° does not exist; it lies between -180 (west) and 180 (east)")]
    Longitude(f64),
    /// The moment has no zone, so it is unknown when it is.
    #[error("`{0}` states no time zone; add one, such as +02:00 or Z")]
    Zone(String),
    /// The sun cannot be computed.
    #[error("the sun's position is unknown: {0}")]
    Sun(String),
}

impl GeoPlace {
    /// Makes a place.
    ///
    /// # Errors
    /// If a coordinate is out of range.
    pub fn new(latitude: f64, longitude: f64) -> Result<GeoPlace, PlaceError> {
        if !(-90.0..=90.0).contains(&latitude) {
            return Err(PlaceError::Latitude(latitude));
        }
        if !(-180.0..=180.0).contains(&longitude) {
            return Err(PlaceError::Longitude(longitude));
        }
        Ok(GeoPlace { latitude, longitude })
    }
}

impl FromStr for GeoPlace {
    type Err = PlaceError;

    /// Reads a place such as `52.37,4.90`.
    fn from_str(text: &str) -> Result<GeoPlace, PlaceError> {
        let form = || PlaceError::Form(text.to_owned());
        let (latitude, longitude) = text.split_once(',').ok_or_else(form)?;
        let number = |word: &str| word.trim().parse::<f64>().map_err(|_| form());
        GeoPlace::new(number(latitude)?, number(longitude)?)
    }
}

/// The position of the sun's middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunPosition {
    /// Degrees above the horizon.
    pub altitude: f64,
    /// Degrees from north towards east, 0 to 360.
    pub azimuth: f64,
}

impl SunPosition {
    /// Returns the unit direction towards the sun: x east, y north, z up.
    pub fn direction(&self) -> DVec3 {
        let (sin, cos) = self.altitude.to_radians().sin_cos();
        let (east, north) = self.azimuth.to_radians().sin_cos();
        DVec3::new(east * cos, north * cos, sin)
    }
}

/// Returns where the sun stands. The air's refraction is that of 1010 mbar and 10 °C.
///
/// # Errors
/// [`PlaceError::Zone`] if the moment has no time zone. [`PlaceError::Sun`] if its year is too far
/// away.
pub fn sun_position(place: GeoPlace, moment: &CivilTime) -> Result<SunPosition, PlaceError> {
    let days = moment.julian_day().ok_or_else(|| PlaceError::Zone(moment.to_string()))?;
    let unknown = |error: solar_positioning::Error| PlaceError::Sun(error.to_string());
    let delta = delta_t::estimate_from_date(moment.year(), moment.month()).map_err(unknown)?;
    let air = RefractionCorrection::new(1010.0, 10.0).map_err(unknown)?;
    let time = JulianDate::new(days, delta).map_err(unknown)?;
    let location = Location { latitude: place.latitude, longitude: place.longitude };
    let sun =
        SolarPositions::new().at_from_julian(time, location, 0.0, Some(air)).map_err(unknown)?;
    Ok(SunPosition { altitude: sun.elevation_angle(), azimuth: sun.azimuth() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(place: &str, moment: &str) -> SunPosition {
        sun_position(place.parse().unwrap(), &moment.parse().unwrap()).unwrap()
    }

    #[test]
    fn the_sun_stands_where_the_table_of_nrel_says() {
        // Its air is 820 mbar and 11 °C, which lifts the sun by 0.003° less, and it is 1830 m high.
        let sun = at("39.742476,-105.1786", "2003-10-17T12:30:30-07:00");
        assert!((90.0 - sun.altitude - 50.11162).abs() < 0.01, "{sun:?}");
        assert!((sun.azimuth - 194.34024).abs() < 0.01, "{sun:?}");
    }

    #[test]
    fn the_sun_is_somewhere_all_over_the_globe_and_the_year() {
        for latitude in [-90.0, -66.6, -23.4, 0.0, 23.44, 52.37, 89.9, 90.0] {
            for longitude in [-180.0, -4.9, 0.0, 180.0] {
                for (month, hour) in (1..=12).flat_map(|m| (0..24).map(move |h| (m, h))) {
                    let moment: CivilTime =
                        format!("2026-{month:02}-21T{hour:02}:00Z").parse().unwrap();
                    let place = GeoPlace::new(latitude, longitude).unwrap();
                    let sun = sun_position(place, &moment).unwrap();
                    assert!((sun.direction().length() - 1.0).abs() < 1e-9, "{place:?} {moment}");
                    assert!((0.0..=360.0).contains(&sun.azimuth));
                }
            }
        }
    }

    #[test]
    fn noon_lies_south_in_the_north_and_mornings_lie_east() {
        let noon = at("52.37,4.90", "2026-06-21T13:42+02:00");
        assert!(
            (noon.azimuth - 180.0).abs() < 2.0 && (noon.altitude - 61.1).abs() < 0.2,
            "{noon:?}"
        );
        assert!(noon.direction().y < 0.0);
        let morning = at("52.37,4.90", "2026-06-21T08:00+02:00");
        assert!(morning.direction().x > 0.8, "{morning:?}");
    }

    #[test]
    fn places_that_do_not_exist_are_named() {
        assert_eq!("91,0".parse::<GeoPlace>(), Err(PlaceError::Latitude(91.0)));
        assert_eq!("0,181".parse::<GeoPlace>(), Err(PlaceError::Longitude(181.0)));
        assert!("nan,1".parse::<GeoPlace>().is_err() && "52".parse::<GeoPlace>().is_err());
        let zoneless = "2026-06-21T12:00".parse().unwrap();
        let error = sun_position(GeoPlace::new(0.0, 0.0).unwrap(), &zoneless).unwrap_err();
        assert!(error.to_string().contains("+02:00"), "{error}");
    }
}
