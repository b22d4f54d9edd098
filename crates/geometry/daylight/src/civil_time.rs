//! CivilTimes as people write them: a date, an hour and a time zone.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// A moment of the civil calendar, with its distance from universal time if that is stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CivilTime {
    year: i32,
    month: u32,
    day: u32,
    /// Seconds since midnight.
    second: u32,
    /// Minutes that its clock is ahead of universal time.
    zone: Option<i32>,
}

/// Why a text is no moment.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CivilTimeError {
    /// It has another form.
    #[error("`{0}` is no date and hour; write it like 2026-06-21T15:30+02:00")]
    Form(String),
    /// The day is not in the calendar.
    #[error("`{text}`: there is no day {day} in month {month} of {year}")]
    Day {
        /// The text.
        text: String,
        /// Its year.
        year: i32,
        /// Its month.
        month: u32,
        /// Its day.
        day: u32,
    },
    /// The hour is not on the clock.
    #[error("`{0}`: there is no such hour; hours run from 00:00 to 23:59:59")]
    Hour(String),
    /// The zone does not exist.
    #[error("`{0}`: there is no such time zone; zones run from -12:00 to +14:00, and Z is +00:00")]
    Zone(String),
}

impl CivilTime {
    /// Returns the year.
    pub fn year(&self) -> i32 {
        self.year
    }

    /// Returns the month, 1 to 12.
    pub fn month(&self) -> u32 {
        self.month
    }

    /// Returns the day of the month, from 1.
    pub fn day(&self) -> u32 {
        self.day
    }

    /// Returns the minute since midnight.
    pub fn minute_of_day(&self) -> u32 {
        self.second / 60
    }

    /// Returns the minutes that its clock is ahead of universal time, if they are stated.
    pub fn zone(&self) -> Option<i32> {
        self.zone
    }

    /// Returns the same reading of the clock in a zone, if the moment states none.
    #[must_use]
    pub fn or_zone(self, minutes: i32) -> CivilTime {
        CivilTime { zone: self.zone.or(Some(minutes)), ..self }
    }

    /// Returns the same moment on the clock of another zone. `None` if its own zone is not stated.
    pub fn in_zone(&self, minutes: i32) -> Option<CivilTime> {
        let ahead = i64::from(minutes - self.zone?) * 60;
        let seconds = i64::from(self.second) + ahead;
        let (year, month, day) = date(self.day_number() + seconds.div_euclid(86_400));
        let second = u32::try_from(seconds.rem_euclid(86_400)).ok()?;
        Some(CivilTime { year, month, day, second, zone: Some(minutes) })
    }

    /// Returns the day of the year, from 1.
    pub fn day_of_year(&self) -> u32 {
        let first = CivilTime { month: 1, day: 1, ..*self };
        (self.day_number() - first.day_number()) as u32 + 1
    }

    /// Returns the Julian day with its fraction, in universal time. `None` if the zone is not
    /// stated.
    pub fn julian_day(&self) -> Option<f64> {
        /// Julian day of midnight before 1970-01-01.
        const EPOCH: f64 = 2_440_587.5;
        let seconds = f64::from(self.second) - 60.0 * f64::from(self.zone?);
        Some(EPOCH + self.day_number() as f64 + seconds / 86_400.0)
    }

    /// Returns the number of days since 1970-01-01.
    fn day_number(&self) -> i64 {
        // Years begin in March, so that the leap day is the last one.
        let year = i64::from(self.year) - i64::from(self.month <= 2);
        let month = i64::from((self.month + 9) % 12);
        let era = year.div_euclid(400);
        let year_of_era = year.rem_euclid(400);
        let day_of_year = (153 * month + 2) / 5 + i64::from(self.day) - 1;
        era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year
            - 719_468
    }
}

/// Returns year, month and day from the number of days since 1970-01-01.
fn date(day_number: i64) -> (i32, u32, u32) {
    let days = day_number + 719_468;
    let era = days.div_euclid(146_097);
    let of_era = days.rem_euclid(146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let day_of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    (year as i32, month as u32, day as u32)
}

/// Returns the number of days of a month.
fn days_of(year: i32, month: u32) -> u32 {
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    match month {
        2 => 28 + u32::from(is_leap),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

impl FromStr for CivilTime {
    type Err = CivilTimeError;

    /// Reads a moment such as `2026-06-21T15:30+02:00`. Seconds and zone may be missing.
    fn from_str(text: &str) -> Result<CivilTime, CivilTimeError> {
        let form = || CivilTimeError::Form(text.to_owned());
        let (date, time) = text.split_once(['T', ' ']).ok_or_else(form)?;
        let number = |word: &str| {
            let is_plain = !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
            word.parse::<u32>().ok().filter(|_| is_plain && word.len() <= 4).ok_or_else(form)
        };
        let date: Vec<u32> = date.split('-').map(number).collect::<Result<_, _>>()?;
        let [year, month, day] = date[..] else { return Err(form()) };
        let year = i32::try_from(year).map_err(|_| form())?;
        if !(1..=12).contains(&month) || !(1..=days_of(year, month)).contains(&day) {
            return Err(CivilTimeError::Day { text: text.to_owned(), year, month, day });
        }
        let (clock, zone) = split_zone(time);
        let clock: Vec<u32> = clock.split(':').map(number).collect::<Result<_, _>>()?;
        let (hour, minute, second) = match clock[..] {
            [hour, minute] => (hour, minute, 0),
            [hour, minute, second] => (hour, minute, second),
            _ => return Err(form()),
        };
        if hour > 23 || minute > 59 || second > 59 {
            return Err(CivilTimeError::Hour(text.to_owned()));
        }
        let zone = zone
            .map(|zone| zone_minutes(zone).ok_or_else(|| CivilTimeError::Zone(text.to_owned())))
            .transpose()?;
        Ok(CivilTime { year, month, day, second: hour * 3600 + minute * 60 + second, zone })
    }
}

/// Divides a time into its clock and its zone.
fn split_zone(time: &str) -> (&str, Option<&str>) {
    match time.find(['Z', '+', '-']) {
        Some(at) => (&time[..at], Some(&time[at..])),
        None => (time, None),
    }
}

/// Returns the minutes of a zone such as `Z`, `+02:00` or `-3`. `None` if there is no such zone.
fn zone_minutes(zone: &str) -> Option<i32> {
    if zone == "Z" {
        return Some(0);
    }
    let (sign, rest) = match zone.split_at_checked(1)? {
        ("+", rest) => (1, rest),
        ("-", rest) => (-1, rest),
        _ => return None,
    };
    let (hours, minutes) = rest.split_once(':').unwrap_or((rest, "0"));
    let number = |word: &str| word.parse::<u8>().ok().map(i32::from);
    let (hours, minutes) = (number(hours)?, number(minutes)?);
    let all = sign * (hours * 60 + minutes);
    (minutes < 60 && (-12 * 60..=14 * 60).contains(&all)).then_some(all)
}

impl fmt::Display for CivilTime {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let CivilTime { year, month, day, second, zone } = *self;
        let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
        write!(f, "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}")?;
        if second > 0 {
            write!(f, ":{second:02}")?;
        }
        let Some(zone) = zone else { return Ok(()) };
        let sign = if zone < 0 { '-' } else { '+' };
        write!(f, "{sign}{:02}:{:02}", zone.abs() / 60, zone.abs() % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moment(text: &str) -> CivilTime {
        text.parse().unwrap()
    }

    #[test]
    fn moments_are_written_as_they_are_read() {
        for text in ["2026-06-21T15:30+02:00", "2024-02-29T00:00-03:30", "1999-12-31T23:59:59"] {
            assert_eq!(moment(text).to_string(), text);
        }
        assert_eq!(moment("2026-06-21 15:30Z").to_string(), "2026-06-21T15:30+00:00");
    }

    #[test]
    fn days_and_hours_that_do_not_exist_are_named() {
        let error = |text: &str| text.parse::<CivilTime>().unwrap_err();
        assert!(matches!(error("2026-02-29T12:00Z"), CivilTimeError::Day { day: 29, .. }));
        assert!(matches!(error("2026-13-01T12:00Z"), CivilTimeError::Day { month: 13, .. }));
        assert!(matches!(error("2026-06-21T24:00Z"), CivilTimeError::Hour(_)));
        assert!(matches!(error("2026-06-21T12:60Z"), CivilTimeError::Hour(_)));
        assert!(matches!(error("2026-06-21T12:00+15:00"), CivilTimeError::Zone(_)));
        for bad in ["", "today", "2026-06-21", "2026-6-21T", "-2026-06-21T1:00", "2026-06-21T1"] {
            assert!(matches!(error(bad), CivilTimeError::Form(_)), "{bad}");
        }
    }

    #[test]
    fn other_zones_show_the_same_moment_on_another_day() {
        let there = moment("2024-02-28T23:30-02:00").in_zone(60).unwrap();
        assert_eq!(there.to_string(), "2024-02-29T02:30+01:00");
        assert_eq!(there.julian_day(), moment("2024-02-28T23:30-02:00").julian_day());
        assert_eq!(moment("2024-12-31T12:00Z").day_of_year(), 366);
        assert_eq!(moment("2000-01-01T12:00Z").julian_day(), Some(2_451_545.0));
    }
}
