//! The light that a person states: the sky, the sun by place and hour, and the factors of lamps.
//!
//! Invariant: what is stated is used, or the command ends with the option that is missing. What is
//! taken in place of a missing number is reported.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_daylight::{
    CivilTime, GeoPlace, MAX_WEATHER_BYTES, PerezWeather, SkyFormula, SkyLevel, SkyShape,
    SunPosition, WHITE_EFFICACY, WeatherFile, WeatherHour, clear_sky, intermediate_sky,
    overcast_sky, perez_sky, standard_sky, sun_position,
};
use holo_scene::{Scene, Sky, SkyAxes, SkyPicture, Sun};

use crate::value_ranges::check_sky;

/// Reflectance of the ground below the horizon, if none is stated.
const GROUND: f64 = 0.2;

/// Horizontal illuminance of an even or overcast sky of which nothing is stated, lx.
const PLAIN_ILLUMINANCE: f64 = 10_000.0;

/// Most bytes of a picture of the sky.
const MAX_PICTURE_BYTES: u64 = 1 << 30;

/// Greatest factor of a lamp.
const MAX_FACTOR: f32 = 1e6;

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

/// The light that was stated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatedLight {
    /// The sky.
    pub sky: Option<SkyChoice>,
    /// The place.
    pub place: Option<GeoPlace>,
    /// The date and hour.
    pub at: Option<CivilTime>,
    /// Irradiance by the sun on a surface that faces it, W·m⁻².
    pub direct: Option<f64>,
    /// Irradiance by the sky on a horizontal surface, W·m⁻².
    pub diffuse: Option<f64>,
    /// A weather file.
    pub weather: Option<PathBuf>,
    /// Degrees by which north is turned clockwise, seen from above.
    pub north: Option<f64>,
    /// Reflectance of the ground.
    pub ground: Option<f64>,
    /// Illuminance by the sky on a horizontal surface, lx.
    pub illuminance: Option<f64>,
    /// Factors of lamps by their names, `sun` and `sky`.
    pub lamps: Vec<(String, f32)>,
}

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

impl StatedLight {
    /// Returns the radiance of the sky if it was stated as such.
    pub fn radiance(&self) -> Option<[f32; 3]> {
        match self.sky {
            Some(SkyChoice::Radiance(radiance)) => Some(radiance),
            _ => None,
        }
    }

    /// Returns whether it says what the sky is.
    pub fn states_sky(&self) -> bool {
        self.sky.is_some() || self.weather.is_some() || (self.place.is_some() && self.at.is_some())
    }

    /// Returns the options that state it, but for a radiance of the sky. Names of files are from the
    /// root.
    ///
    /// # Errors
    /// If a file's folder is unknown.
    pub fn to_options(&self) -> Result<Vec<(String, String)>> {
        let absolute = |path: &Path| -> Result<String> {
            let path = std::path::absolute(path)?;
            let text = path.to_str().with_context(|| format!("{} is not UTF-8", path.display()))?;
            Ok(text.to_owned())
        };
        let mut options = Vec::new();
        let mut add = |name: &str, value: Option<String>| {
            options.extend(value.map(|value| (name.to_owned(), value)));
        };
        let sky = match &self.sky {
            None | Some(SkyChoice::Radiance(_)) => None,
            Some(SkyChoice::Picture(path)) => Some(absolute(path)?),
            Some(other) => Some(other.to_string()),
        };
        add("sky", sky);
        add("place", self.place.map(|place| format!("{},{}", place.latitude, place.longitude)));
        add("at", self.at.map(|at| at.to_string()));
        add("direct", self.direct.map(|value| value.to_string()));
        add("diffuse", self.diffuse.map(|value| value.to_string()));
        add("weather", self.weather.as_deref().map(absolute).transpose()?);
        add("north", self.north.map(|value| value.to_string()));
        add("ground", self.ground.map(|value| value.to_string()));
        add("illuminance", self.illuminance.map(|value| value.to_string()));
        for (name, factor) in &self.lamps {
            add("lamp", Some(format!("{name}={factor}")));
        }
        Ok(options)
    }

    /// Reads the options that [`to_options`](Self::to_options) returns.
    ///
    /// # Errors
    /// If a name or a value is another one.
    pub fn from_options(options: &[(String, String)]) -> Result<StatedLight> {
        let mut light = StatedLight::default();
        for (name, value) in options {
            let read = light.read_option(name, value);
            read.map_err(|error| anyhow::anyhow!("--{name}: {error}"))?;
        }
        Ok(light)
    }

    fn read_option(&mut self, name: &str, value: &str) -> Result<(), String> {
        let text = |error: &dyn fmt::Display| error.to_string();
        match name {
            "sky" => self.sky = Some(value.parse()?),
            "place" => self.place = Some(value.parse().map_err(|e| text(&e))?),
            "at" => self.at = Some(value.parse().map_err(|e| text(&e))?),
            "direct" => self.direct = Some(parse_irradiance(value)?),
            "diffuse" => self.diffuse = Some(parse_irradiance(value)?),
            "weather" => self.weather = Some(PathBuf::from(value)),
            "north" => self.north = Some(parse_north(value)?),
            "ground" => self.ground = Some(parse_ground(value)?),
            "illuminance" => self.illuminance = Some(parse_illuminance(value)?),
            "lamp" => self.lamps.push(parse_lamp(value)?),
            _ => return Err("this version has no such option".to_owned()),
        }
        Ok(())
    }

    /// Returns this light, with what `other` states in place of its own.
    #[must_use]
    pub fn overridden_by(&self, other: &StatedLight) -> StatedLight {
        let mut lamps = self.lamps.clone();
        lamps.retain(|(name, _)| other.lamps.iter().all(|(replaced, _)| replaced != name));
        lamps.extend(other.lamps.iter().cloned());
        StatedLight {
            sky: other.sky.clone().or_else(|| self.sky.clone()),
            place: other.place.or(self.place),
            at: other.at.or(self.at),
            direct: other.direct.or(self.direct),
            diffuse: other.diffuse.or(self.diffuse),
            weather: other.weather.clone().or_else(|| self.weather.clone()),
            north: other.north.or(self.north),
            ground: other.ground.or(self.ground),
            illuminance: other.illuminance.or(self.illuminance),
            lamps,
        }
    }

    /// Gives a scene with this up axis the stated light. Returns what was made of it, for people.
    ///
    /// # Errors
    /// If an option is missing or does not suit, a file cannot be read, or there is no such lamp.
    pub fn apply(&self, scene: &mut Scene, up: DVec3) -> Result<Vec<String>> {
        let mut said = Vec::new();
        self.check_options()?;
        let sky = match self.kind() {
            None | Some(SkyChoice::Radiance(_)) => None,
            Some(kind) => Some(self.made_sky(&kind, up, &mut said)?),
        };
        if let Some(sky) = sky {
            scene.sky = sky;
        }
        self.apply_lamps(scene, &mut said)?;
        Ok(said)
    }

    /// Returns the sky, stated or following from the other options.
    fn kind(&self) -> Option<SkyChoice> {
        let follows = || match (self.states_sky(), self.diffuse.is_some() || self.weather.is_some())
        {
            (false, _) => None,
            (true, true) => Some(SkyChoice::Perez),
            (true, false) => Some(SkyChoice::Clear),
        };
        self.sky.clone().or_else(follows)
    }

    /// Ends with an error if an option would have no effect.
    fn check_options(&self) -> Result<()> {
        let kind = self.kind();
        let is_perez = kind == Some(SkyChoice::Perez);
        for (name, is_stated) in [("--direct", self.direct), ("--diffuse", self.diffuse)] {
            ensure!(is_stated.is_none() || is_perez, "{name} needs --sky perez");
        }
        let is_scaled = !matches!(kind, None | Some(SkyChoice::Radiance(_) | SkyChoice::Perez));
        ensure!(
            self.illuminance.is_none() || is_scaled,
            "--illuminance needs another --sky: overcast, clear, intermediate, uniform, cie:N or a \
             picture"
        );
        Ok(())
    }

    fn factor(&self, name: &str) -> f32 {
        self.lamps.iter().find(|(lamp, _)| lamp == name).map_or(1.0, |(_, factor)| *factor)
    }

    fn made_sky(&self, kind: &SkyChoice, up: DVec3, said: &mut Vec<String>) -> Result<Sky> {
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

    /// Multiplies lamps by their factors.
    fn apply_lamps(&self, scene: &mut Scene, said: &mut Vec<String>) -> Result<()> {
        let is_made = !matches!(self.kind(), None | Some(SkyChoice::Radiance(_)));
        for (name, factor) in &self.lamps {
            let count = dim(scene, name, *factor, is_made);
            if count == 0 {
                bail!("--lamp {name}={factor}: there is no such lamp; there are {}", groups(scene));
            }
            said.push(format!("light: {name} times {factor} (--lamp)"));
        }
        Ok(())
    }
}

/// Multiplies the lamps of a group by a factor, and returns their number. The sky and its sun are
/// left as they are if they were `made` with it.
fn dim(scene: &mut Scene, name: &str, factor: f32, is_made: bool) -> usize {
    let scale = |radiance: [f32; 3]| radiance.map(|channel| channel * factor);
    let mut count = 0;
    for material in scene.materials.iter_mut().filter(|m| m.name == name && m.emits()) {
        material.emission = scale(material.emission);
        count += 1;
    }
    for light in scene.punctual_lights.iter_mut().filter(|l| l.name == name || l.group == name) {
        light.intensity = scale(light.intensity);
        count += 1;
    }
    if name == "sun" {
        count += scene.suns.len() + usize::from(is_made);
        scene.suns.iter_mut().for_each(|sun| sun.irradiance = scale(sun.irradiance));
    }
    if name == "sky" {
        count += usize::from(is_made || scene.sky.shines());
        if !is_made {
            scene.sky = std::mem::take(&mut scene.sky).dimmed(factor, 1.0);
        }
    }
    if factor == 0.0 {
        scene.punctual_lights.retain(|light| light.intensity != [0.0; 3]);
        scene.suns.retain(|sun| sun.irradiance != [0.0; 3]);
    }
    count
}

/// Returns the names of a scene's lamps, for people.
fn groups(scene: &Scene) -> String {
    const MOST: usize = 12;
    let used = scene.emitters().map(|triangle| scene.material(triangle).name.as_str());
    let points = scene.punctual_lights.iter().flat_map(|light| [&*light.group, &*light.name]);
    let mut names: Vec<&str> = used.chain(points).filter(|name| !name.is_empty()).collect();
    names.sort_unstable();
    names.dedup();
    let more = names.len().saturating_sub(MOST);
    names.truncate(MOST);
    if scene.all_suns().next().is_some() {
        names.push("sun");
    }
    if scene.sky.shines() {
        names.push("sky");
    }
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    if names.is_empty() { "none".to_owned() } else { names.join(", ") + &more }
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

#[cfg(test)]
mod tests {
    use super::*;
    use holo_scene::{Bsdf, Material};

    fn scene() -> Scene {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let lamp = Material {
            emission: [4.0; 3],
            bsdf: Bsdf::Diffuse { kd: [0.0; 3] },
            ..Material::grey("ceiling")
        };
        Scene::from_world(&corners, &[[0, 1, 2]], &[0], vec![lamp], [1.0; 3]).unwrap().0
    }

    fn stated(options: &[(&str, &str)]) -> StatedLight {
        let own = |(name, value): &(&str, &str)| ((*name).to_owned(), (*value).to_owned());
        StatedLight::from_options(&options.iter().map(own).collect::<Vec<_>>()).unwrap()
    }

    fn applied(options: &[(&str, &str)]) -> Result<Scene> {
        let mut scene = scene();
        stated(options).apply(&mut scene, DVec3::Z)?;
        scene.clone().with_suns(scene.suns.clone()).map_err(Into::into)
    }

    const NOON: [(&str, &str); 2] = [("place", "52.37,4.9"), ("at", "2026-06-21T13:42+02:00")];

    #[test]
    fn stated_light_is_stored_as_options_and_read_again() {
        let light = stated(&[
            ("sky", "cie:12"),
            ("place", "52.37,-4.9"),
            ("at", "2026-06-21T15:30+02:00"),
            ("north", "-30"),
            ("ground", "0.1"),
            ("illuminance", "12000"),
            ("lamp", "a=b=0.5"),
            ("lamp", "sun=0"),
        ]);
        assert_eq!(StatedLight::from_options(&light.to_options().unwrap()).unwrap(), light);
        let words = StatedLight { sky: Some(SkyChoice::Radiance([1.0; 3])), ..light };
        assert_eq!(words.to_options().unwrap().len(), 7, "a radiance has a place of its own");
        let error = StatedLight::from_options(&[("moon".into(), "1".into())]).unwrap_err();
        assert!(error.to_string().contains("--moon"), "{error}");
    }

    #[test]
    fn place_and_hour_give_a_clear_sky_whose_sun_stands_in_the_south() {
        let scene = applied(&NOON).unwrap();
        let sun = scene.sky.sun().unwrap();
        assert!(sun.towards[1] < -0.4 && sun.towards[2] > 0.85, "{sun:?}");
        assert!(scene.sky.horizontal()[0] * 179.0 > 5000.0);
        let dark = applied(&[NOON[0], NOON[1], ("lamp", "sun=0")]).unwrap();
        assert_eq!(dark.sky.sun(), None);
        let below = DVec3::NEG_Z;
        assert!(dark.sky.radiance(below)[0] < 0.5 * scene.sky.radiance(below)[0], "the ground");
    }

    #[test]
    fn skies_bring_the_stated_illuminance() {
        for sky in ["overcast", "uniform"] {
            let scene = applied(&[("sky", sky), ("illuminance", "12000")]).unwrap();
            let found = holo_color::luminance(scene.sky.horizontal());
            assert!((found / 12_000.0 - 1.0).abs() < 5e-3, "{sky}: {found}");
        }
        let measured = [NOON[0], NOON[1], ("sky", "perez"), ("direct", "0"), ("diffuse", "5")];
        let scene = applied(&measured).unwrap();
        assert_eq!(scene.sky.sun(), None);
        let found = holo_color::luminance(scene.sky.horizontal());
        assert!((400.0..900.0).contains(&found), "{found}");
    }

    #[test]
    fn missing_and_useless_options_are_named() {
        let error = |options: &[(&str, &str)]| format!("{:#}", applied(options).unwrap_err());
        assert!(error(&[("sky", "clear")]).contains("--place"));
        assert!(error(&[("sky", "perez"), NOON[0]]).contains("--at"));
        assert!(error(&[("sky", "perez"), NOON[1]]).contains("--place"));
        assert!(error(&[("sky", "perez"), NOON[0], NOON[1]]).contains("--diffuse"));
        assert!(error(&[("direct", "100")]).contains("--sky perez"));
        assert!(error(&[("illuminance", "100")]).contains("--illuminance"));
        let zoneless = [NOON[0], ("at", "2026-06-21T13:42")];
        assert!(error(&zoneless).contains("+02:00"), "{}", error(&zoneless));
        assert!(error(&[("sky", "missing.hdr")]).contains("missing.hdr"));
        assert!(error(&[("weather", "missing.epw"), NOON[1]]).contains("missing.epw"));
        for bad in ["cie:16", "cloudy", "1,2", "1,-1,1", "sky.png"] {
            assert!(bad.parse::<SkyChoice>().is_err(), "{bad}");
        }
        assert!("cloudy".parse::<SkyChoice>().unwrap_err().contains("overcast"));
    }

    #[test]
    fn lamps_are_dimmed_by_name_and_unknown_names_list_the_others() {
        let scene = applied(&[("lamp", "ceiling=0.25"), ("lamp", "sky=2")]).unwrap();
        assert_eq!(scene.materials[0].emission, [1.0; 3]);
        assert_eq!(scene.sky.as_even(), Some([2.0; 3]));
        let error = applied(&[("lamp", "lantern=0")]).unwrap_err().to_string();
        assert!(error.contains("lantern") && error.contains("ceiling, sky"), "{error}");
        for bad in ["ceiling", "ceiling=-1", "ceiling=nan", "ceiling=1e9"] {
            assert!(parse_lamp(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_lamp("a=b=0.5"), Ok(("a=b".to_owned(), 0.5)));
    }

    #[test]
    fn later_light_overrides_earlier_light_option_by_option() {
        let file = stated(&[("sky", "clear"), NOON[0], ("lamp", "sun=0"), ("lamp", "a=1")]);
        let now = stated(&[("sky", "overcast"), ("lamp", "sun=0.5")]);
        let both = file.overridden_by(&now);
        assert_eq!((both.sky, both.place), (Some(SkyChoice::Overcast), file.place));
        assert_eq!(both.lamps, [("a".to_owned(), 1.0), ("sun".to_owned(), 0.5)]);
    }
}
