//! The sky that follows from stated light.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_daylight::{
    MAX_WEATHER_BYTES, PerezWeather, SkyFormula, SkyLevel, SkyShape, SunPosition, WHITE_EFFICACY,
    WeatherFile, WeatherHour, clear_sky, intermediate_sky, overcast_sky, perez_sky, standard_sky,
    sun_position,
};
use holo_scene::{Sky, SkyAxes, SkyPicture, Sun};

use super::{SkyChoice, StatedLight};

/// Reflectance of the ground below the horizon, if none is stated.
const GROUND: f64 = 0.2;

/// Horizontal illuminance of an even or overcast sky of which nothing is stated, lx.
const PLAIN_ILLUMINANCE: f64 = 10_000.0;

/// Most bytes of a picture of the sky.
const MAX_PICTURE_BYTES: u64 = 1 << 30;

impl StatedLight {
    /// Returns the sky of this kind. Adds to `said` what was made of the options, for people.
    pub(super) fn made_sky(
        &self,
        kind: &SkyChoice,
        up: DVec3,
        said: &mut Vec<String>,
    ) -> Result<Sky> {
        let axes = SkyAxes::new(up, self.north.unwrap_or(0.0));
        if let SkyChoice::Picture(path) = kind {
            return self.pictured(path, axes, said);
        }
        let weather = self.weather.as_deref().map(read_weather).transpose()?;
        let sun = self.sun(weather.as_ref())?;
        let (formula, direct, words) = match kind {
            SkyChoice::Perez => self.perez(weather.as_ref(), sun, said)?,
            _ => self.level(kind, sun, said)?,
        };
        let (of_sky, of_sun) = (f64::from(self.factor("sky")), f64::from(self.factor("sun")));
        let formula = SkyFormula { scale: formula.scale * of_sky, ..formula };
        let direct = direct * of_sun;
        let towards = sun.map_or(DVec3::Z, |sun| sun.direction());
        let on_ground = formula.horizontal() + direct * towards.z.max(0.0);
        let ground = self.ground.unwrap_or(GROUND) * on_ground / std::f64::consts::PI;
        let lux = |irradiance: f64| (irradiance * WHITE_EFFICACY).round();
        said.push(format!(
            "light: {words}; {} lx by the sky on horizontal ground, {} lx by the sun on what faces \
             it, ground of reflectance {}",
            lux(formula.horizontal()),
            lux(direct),
            self.ground.unwrap_or(GROUND)
        ));
        let sun = (direct > 0.0).then(|| Sun {
            towards: axes.to_scene(towards).as_vec3().to_array(),
            irradiance: [direct as f32; 3],
        });
        Ok(Sky::of_formula(formula, ground as f32, axes).with_sun(sun))
    }

    /// Returns the position of the sun, if place and hour are stated.
    fn sun(&self, weather: Option<&WeatherFile>) -> Result<Option<SunPosition>> {
        let place = self.place.or(weather.map(|file| file.place));
        let at = match (self.at, weather) {
            (Some(at), Some(file)) => Some(at.or_zone(file.zone)),
            (at, _) => at,
        };
        match (place, at) {
            (Some(place), Some(at)) => {
                let sun = sun_position(place, &at).with_context(|| format!("--at {at}"))?;
                Ok(Some(sun))
            }
            (Some(_), None) => bail!(
                "the sun's position needs a date and hour: add --at, such as \
                                      --at 2026-06-21T15:30+02:00"
            ),
            (None, Some(_)) => bail!(
                "the sun's position needs a place: add --place, such as --place \
                                      52.37,4.90, or --weather FILE.epw"
            ),
            (None, None) => Ok(None),
        }
    }

    /// Returns a sky of Perez, the irradiance by the sun, and words for people.
    fn perez(
        &self,
        weather: Option<&WeatherFile>,
        sun: Option<SunPosition>,
        said: &mut Vec<String>,
    ) -> Result<(SkyFormula, f64, String)> {
        let (Some(sun), Some(at)) = (sun, self.at) else {
            bail!(
                "--sky perez needs the sun and the day: add --place LAT,LON and --at, such as \
                   --at 2026-06-21T15:30+02:00"
            );
        };
        let hour = match (weather, self.weather.as_deref()) {
            (Some(file), Some(path)) => {
                let hour = file.at(&at).with_context(|| path.display().to_string())?;
                said.push(format!(
                    "light: the weather of {} ({}): {} W/m² by the sun, {} W/m² by the sky",
                    file.city,
                    path.display(),
                    hour.direct,
                    hour.diffuse
                ));
                Some(hour)
            }
            _ => None,
        };
        let stated = |stated: Option<f64>, of_hour: fn(&WeatherHour) -> f64| {
            stated.or(hour.as_ref().map(of_hour))
        };
        let direct = stated(self.direct, |hour| hour.direct);
        let diffuse = stated(self.diffuse, |hour| hour.diffuse);
        let (Some(direct), Some(diffuse)) = (direct, diffuse) else {
            bail!(
                "--sky perez needs measured irradiances: add --direct and --diffuse in W/m², or \
                   --weather FILE.epw"
            );
        };
        let water = hour.map_or(2.0, |hour| hour.water());
        let weather = PerezWeather { direct, diffuse, water, day_of_year: at.day_of_year() };
        let made = perez_sky(sun.direction(), &weather);
        said.extend(made.is_lowered.then(lowered_words));
        let words = format!(
            "a sky of Perez, {at}, {}, clearness {:.2}, brightness {:.3}",
            sun_words(sun),
            made.clearness,
            made.brightness
        );
        Ok((made.sky, made.sun, words))
    }

    /// Returns a sky whose brightness follows from the sun's altitude, or as stated; the irradiance
    /// by the sun, and words for people.
    fn level(
        &self,
        kind: &SkyChoice,
        sun: Option<SunPosition>,
        said: &mut Vec<String>,
    ) -> Result<(SkyFormula, f64, String)> {
        let needs_sun = !matches!(kind, SkyChoice::Uniform | SkyChoice::Overcast);
        if needs_sun && sun.is_none() {
            bail!(
                "--sky {kind} needs the sun: add --place LAT,LON and --at, such as --at \
                   2026-06-21T15:30+02:00"
            );
        }
        let towards = sun.map_or(DVec3::Z, |sun| sun.direction());
        let level = match kind {
            SkyChoice::Clear => clear_sky(towards),
            SkyChoice::Intermediate => intermediate_sky(towards),
            SkyChoice::Standard(number) => {
                standard_sky(*number, towards).context("there is no such sky")?
            }
            SkyChoice::Uniform => {
                let overcast = overcast_sky(towards);
                let zenith = overcast.sky.radiance(DVec3::Z);
                let sky = SkyFormula::with_zenith(SkyShape::Even, towards, zenith);
                SkyLevel { sky, ..overcast }
            }
            _ => overcast_sky(towards),
        };
        said.extend(level.is_lowered.then(lowered_words));
        let stated = self.illuminance.or(sun.is_none().then_some(PLAIN_ILLUMINANCE));
        let sky = match stated {
            None => level.sky,
            Some(lux) => {
                let is_dark = level.sky.scale <= 0.0;
                let scale = if is_dark { 1.0 } else { level.sky.scale };
                let sky = SkyFormula { scale, ..level.sky };
                SkyFormula { scale: scale * lux / WHITE_EFFICACY / sky.horizontal(), ..sky }
            }
        };
        let when = match (self.at, sun) {
            (Some(at), Some(sun)) => format!(", {at}, {}", sun_words(sun)),
            _ if self.illuminance.is_none() => " (--illuminance, or --place and --at)".to_owned(),
            _ => String::new(),
        };
        Ok((sky, level.sun, format!("{} sky{when}", kind_words(kind))))
    }

    /// Returns a sky that is a picture.
    fn pictured(&self, path: &Path, axes: SkyAxes, said: &mut Vec<String>) -> Result<Sky> {
        let name = path.display();
        let bytes = std::fs::metadata(path).with_context(|| format!("reading {name}"))?.len();
        ensure!(
            bytes <= MAX_PICTURE_BYTES,
            "{name} has {bytes} bytes; pictures of the sky have at most {MAX_PICTURE_BYTES}"
        );
        let encoded = std::fs::read(path).with_context(|| format!("reading {name}"))?;
        let picture =
            SkyPicture::decode(&encoded).map_err(|error| anyhow::anyhow!("{name}: {error}"))?;
        let sky = Sky::of_picture(picture, 1.0, axes);
        let lux = |sky: &Sky| holo_color::luminance(sky.horizontal());
        let factor = match self.illuminance {
            None => 1.0,
            Some(stated) => {
                let now = lux(&sky);
                ensure!(
                    now > 0.0,
                    "{name} is black above the horizon, so no factor gives {stated} lx"
                );
                stated as f32 / now
            }
        };
        let sky = sky.dimmed(factor * self.factor("sky"), 1.0);
        let level = lux(&sky).round();
        said.push(format!(
            "light: the picture {name}, {level} lx on horizontal ground (--illuminance)"
        ));
        Ok(sky)
    }
}

fn read_weather(path: &Path) -> Result<WeatherFile> {
    let name = path.display();
    let bytes = std::fs::metadata(path).with_context(|| format!("reading {name}"))?.len();
    ensure!(
        bytes <= MAX_WEATHER_BYTES,
        "{name} has {bytes} bytes; weather files have at most {MAX_WEATHER_BYTES}"
    );
    let text = std::fs::read(path).with_context(|| format!("reading {name}"))?;
    // Names of cities are not always UTF-8.
    let text = String::from_utf8_lossy(&text).into_owned();
    WeatherFile::new(text).with_context(|| name.to_string())
}

fn sun_words(sun: SunPosition) -> String {
    format!("sun {:.2}° high, {:.2}° from north by east", sun.altitude, sun.azimuth)
}

fn lowered_words() -> String {
    "light: the sky is that of a sun 87° high, because its formula ends there".to_owned()
}

fn kind_words(kind: &SkyChoice) -> String {
    match kind {
        SkyChoice::Standard(number) => format!("the CIE's general {number}"),
        SkyChoice::Clear => "the CIE's clear".to_owned(),
        SkyChoice::Intermediate => "the CIE's intermediate".to_owned(),
        SkyChoice::Overcast => "the CIE's overcast".to_owned(),
        other => format!("a {other}"),
    }
}
