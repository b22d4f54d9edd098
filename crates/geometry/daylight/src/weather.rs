//! EnergyPlus weather files (EPW): the hours of a typical year, with the irradiances of sun and
//! sky.
//!
//! A file begins with header lines, from `LOCATION` to `DATA PERIODS`. One line follows for each
//! hour of the year, or several for parts of an hour. The year in a line is that of the
//! measurement. It is ignored, because such files combine months of several years.

use thiserror::Error;

use crate::civil_time::CivilTime;
use crate::solar::GeoPlace;

/// Most bytes of a file. A year by the minute has 100 MB; by the hour it has 1.5 MB.
pub const MAX_WEATHER_BYTES: u64 = 256 << 20;

/// Most lines before the hours. Files have eight.
const MAX_HEAD: usize = 64;

/// Values from which on a field is marked as missing.
const MISSING: f64 = 9999.0;
const MISSING_DEW_POINT: f64 = 99.9;

/// Fields of a line, from 0.
const DEW_POINT: usize = 7;
const DIRECT: usize = 14;
const DIFFUSE: usize = 15;

/// Why a weather file is of no use.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum WeatherError {
    /// The first line is another one.
    #[error("line 1 does not begin with `LOCATION,`: this is no EPW weather file")]
    NoLocation,
    /// A field is missing or no number.
    #[error("line {line}: field {field} ({what}) is `{found}`, not a number in its range")]
    Field {
        /// The line, from 1.
        line: usize,
        /// The field, from 1.
        field: usize,
        /// Its meaning.
        what: &'static str,
        /// Its text.
        found: String,
    },
    /// There are no hours.
    #[error("line {0}: the file ends before its hours; download it again")]
    NoHours(usize),
    /// The hour is not in the file.
    #[error("the file has no hour {hour} on day {day} of month {month}{why}")]
    NoHour {
        /// The month.
        month: u32,
        /// The day.
        day: u32,
        /// The hour, 1 to 24.
        hour: u32,
        /// What can be done.
        why: &'static str,
    },
    /// The irradiances of the hour are missing.
    #[error("line {line}: {what} is missing at that hour; choose another hour")]
    Missing {
        /// The line, from 1.
        line: usize,
        /// The quantity.
        what: &'static str,
    },
    /// The moment has no zone, and the file has none either.
    #[error("the date and hour of the moment are out of range")]
    CivilTime,
}

/// A weather file, of which hours are read when they are needed.
#[derive(Clone, Debug)]
pub struct WeatherFile {
    /// The city that it names, for people.
    pub city: String,
    /// The place.
    pub place: GeoPlace,
    /// Minutes that its clock is ahead of universal time. It knows no summer time.
    pub zone: i32,
    text: String,
    /// Number of lines before the hours.
    head: usize,
}

/// The weather of an hour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeatherHour {
    /// Irradiance by the sun on a surface that faces it, W·m⁻².
    pub direct: f64,
    /// Irradiance by the sky on a horizontal surface, W·m⁻².
    pub diffuse: f64,
    /// The dew point, °C, if it is known.
    pub dew_point: Option<f64>,
}

impl WeatherHour {
    /// Returns the water in the air, centimetres (Perez et al. 1990, equation 3); 2 if the dew
    /// point is unknown.
    pub fn water(&self) -> f64 {
        self.dew_point.map_or(2.0, |dew_point| (0.07 * dew_point - 0.075).exp())
    }
}

impl WeatherFile {
    /// Reads the head of a file.
    ///
    /// # Errors
    /// If it is no weather file, or its place does not exist.
    pub fn new(text: String) -> Result<WeatherFile, WeatherError> {
        let first = text.lines().next().unwrap_or_default();
        let fields: Vec<&str> = first.trim_start_matches('\u{feff}').split(',').collect();
        if !fields.first().is_some_and(|word| word.trim().eq_ignore_ascii_case("LOCATION")) {
            return Err(WeatherError::NoLocation);
        }
        let latitude = number(&fields, 1, 6, "latitude", -90.0, 90.0)?;
        let longitude = number(&fields, 1, 7, "longitude", -180.0, 180.0)?;
        let zone = number(&fields, 1, 8, "time zone, hours", -12.0, 14.0)?;
        let city = fields.get(1).map_or("", |city| city.trim()).to_owned();
        let is_last = |line: &str| {
            let word = line.split(',').next().unwrap_or_default();
            word.trim().eq_ignore_ascii_case("DATA PERIODS")
        };
        let last = text.lines().take(MAX_HEAD).position(is_last);
        let head = last.ok_or(WeatherError::NoHours(text.lines().count()))? + 1;
        let place = GeoPlace { latitude, longitude };
        Ok(WeatherFile { city, place, zone: (zone * 60.0).round() as i32, text, head })
    }

    /// Returns the weather of the hour that contains a moment.
    ///
    /// # Errors
    /// If the file has no such hour, or its line is damaged or lacks the irradiances.
    pub fn at(&self, moment: &CivilTime) -> Result<WeatherHour, WeatherError> {
        let local = moment.or_zone(self.zone).in_zone(self.zone).ok_or(WeatherError::CivilTime)?;
        let (month, day) = (local.month(), local.day());
        let minute = local.minute_of_day();
        let hour = minute / 60 + 1;
        let mut parts = Vec::new();
        let mut count = 0;
        for (index, line) in self.text.lines().enumerate().skip(self.head) {
            if line.trim().is_empty() {
                continue;
            }
            count += 1;
            let fields: Vec<&str> = line.split(',').collect();
            let whole = |field, what, most| {
                number(&fields, index + 1, field, what, 0.0, most).map(|value| value as u32)
            };
            let date = [whole(1, "month", 12.0)?, whole(2, "day", 31.0)?, whole(3, "hour", 24.0)?];
            if date == [month, day, hour] {
                parts.push((index + 1, line));
            } else if !parts.is_empty() {
                break;
            }
        }
        if count == 0 {
            return Err(WeatherError::NoHours(self.head));
        }
        // Parts of an hour are equally long.
        let part = (minute % 60) as usize * parts.len() / 60;
        let Some(&(number_of_line, line)) = parts.get(part) else {
            let why = match (month, day) {
                (2, 29) => ": its year has no 29 February; choose another day",
                _ => "; choose another day, or a file of a whole year",
            };
            return Err(WeatherError::NoHour { month, day, hour, why });
        };
        weather_of(line, number_of_line)
    }
}

fn weather_of(line: &str, number_of_line: usize) -> Result<WeatherHour, WeatherError> {
    let fields: Vec<&str> = line.split(',').collect();
    let irradiance = |field, what| {
        let value = number(&fields, number_of_line, field, what, 0.0, 99_999.0)?;
        match value < MISSING {
            true => Ok(value),
            false => Err(WeatherError::Missing { line: number_of_line, what }),
        }
    };
    let direct = irradiance(DIRECT, "direct normal radiation")?;
    let diffuse = irradiance(DIFFUSE, "diffuse horizontal radiation")?;
    let dew_point = number(&fields, number_of_line, DEW_POINT, "dew point", -90.0, 100.0)?;
    let dew_point = Some(dew_point).filter(|&dew_point| dew_point < MISSING_DEW_POINT);
    Ok(WeatherHour { direct, diffuse, dew_point })
}

/// Reads a number of a line. `field` counts from 0.
fn number(
    fields: &[&str],
    line: usize,
    field: usize,
    what: &'static str,
    least: f64,
    most: f64,
) -> Result<f64, WeatherError> {
    let found = fields.get(field).map_or("", |text| text.trim());
    let value = found.parse::<f64>().ok().filter(|value| (least..=most).contains(value));
    let bounded = || found.chars().take(40).collect();
    value.ok_or_else(|| WeatherError::Field { line, field: field + 1, what, found: bounded() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn year(leap_field: &str, has_leap_day: bool) -> String {
        let mut text = format!(
            "LOCATION,Amsterdam,-,NLD,IWEC,062400,52.30,4.77,1.0,-2.0\r\nDESIGN CONDITIONS,0\r\n\
             HOLIDAYS/DAYLIGHT SAVINGS,{leap_field},0,0,0\r\n\
             DATA PERIODS,1,1,Data,Sunday, 1/ 1,12/31\r\n"
        );
        for (month, day) in [(2, 28), (2, 29), (6, 21)] {
            for hour in (1..=24).filter(|_| has_leap_day || day != 29) {
                let sun = if (8..=18).contains(&hour) { month * 100 + hour } else { 0 };
                let rest = "?9?9,10.0,7.5,80,101300,0,0,300,0";
                text += &format!("1987,{month},{day},{hour},60,{rest},{sun},{},0\r\n", sun / 2);
            }
        }
        text
    }

    fn at(text: String, moment: &str) -> Result<WeatherHour, WeatherError> {
        WeatherFile::new(text)?.at(&moment.parse().unwrap())
    }

    #[test]
    fn an_hour_is_that_which_contains_the_moment_on_the_clock_of_the_file() {
        let file = WeatherFile::new(year("No", false)).unwrap();
        assert_eq!((file.city.as_str(), file.zone), ("Amsterdam", 60));
        assert_eq!(file.place, GeoPlace { latitude: 52.3, longitude: 4.77 });
        // Hour 12 is from 11:00 to 12:00.
        for moment in ["2026-06-21T11:00", "2026-06-21T11:59+01:00", "2026-06-21T12:30+02:00"] {
            let hour = file.at(&moment.parse().unwrap()).unwrap();
            assert_eq!((hour.direct, hour.diffuse, hour.dew_point), (612.0, 306.0, Some(7.5)));
            assert!((hour.water() - (0.07_f64 * 7.5 - 0.075).exp()).abs() < 1e-12);
        }
        assert_eq!(file.at(&"2026-06-21T03:00".parse().unwrap()).unwrap().direct, 0.0);
    }

    #[test]
    fn a_year_without_29_february_says_so_and_one_with_it_has_it() {
        let error = at(year("No", false), "2024-02-29T12:00").unwrap_err();
        assert!(error.to_string().contains("29 February"), "{error}");
        assert_eq!(at(year("Yes", true), "2024-02-29T12:00").unwrap().direct, 213.0);
    }

    #[test]
    fn damage_is_named_by_line_and_field() {
        let message = |text: String| at(text, "2026-06-21T12:00").unwrap_err().to_string();
        assert!(message("hello".to_owned()).contains("LOCATION"));
        assert!(
            message(year("No", false).replace("52.30", "152.3")).contains("field 7 (latitude)")
        );
        let whole = year("No", false);
        let cut = &whole[..whole.find(",613,").unwrap() + 5];
        assert!(
            message(cut.to_owned()).contains("field 16 (diffuse"),
            "{}",
            message(cut.to_owned())
        );
        let broken = year("No", false).replace("1987,6,21,5,", "1987,six,21,5,");
        assert!(message(broken).contains("(month) is `six`"));
        let nan = year("No", false).replace(",613,", ",NaN,");
        assert!(message(nan).contains("direct normal radiation"));
        let missing = year("No", false).replace(",613,", ",9999,");
        assert!(message(missing).contains("missing at that hour"));
        let head: String = year("No", false).lines().take(3).collect::<Vec<_>>().join("\n");
        assert!(message(head).contains("ends before its hours"));
    }
}
