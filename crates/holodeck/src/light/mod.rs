//! The light that a person states: the sky, the sun by place and hour, and the factors of lamps.
//!
//! Invariant: what is stated is used, or the command ends with the option that is missing. What is
//! taken in place of a missing number is reported.

mod lamps;
mod luminaires;
mod sky_choice;
mod sky_made;
#[cfg(test)]
mod tests;
mod values;

use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_daylight::{CivilTime, GeoPlace};
use holo_scene::Scene;
use holo_view::NONE;

pub use luminaires::{StatedLuminaire, StatedPlaces, hang};
pub use sky_choice::SkyChoice;
pub use values::{parse_ground, parse_illuminance, parse_irradiance, parse_lamp, parse_north};

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
    /// Luminaires that are hung in the scene.
    pub luminaires: Vec<StatedLuminaire>,
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

    /// Returns the options that state it, but for a radiance of the sky. Names of files are from
    /// the root.
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
        for luminaire in &self.luminaires {
            let mut luminaire = luminaire.clone();
            luminaire.set_folder(&std::env::current_dir()?);
            add("luminaire", Some(serde_json::to_string(&luminaire)?));
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

    /// Returns this light with a change of some options: `none` takes one back. Another kind of sky
    /// takes back the options that only suit the kind before.
    ///
    /// # Errors
    /// If a name or a value is none.
    pub fn changed(&self, change: &[(String, String)]) -> Result<StatedLight> {
        let (removed, stated): (Vec<_>, Vec<_>) =
            change.iter().cloned().partition(|(name, value)| name != "lamp" && value == NONE);
        let stated = StatedLight::from_options(&stated)?;
        let mut light = self.overridden_by(&stated);
        for (name, _) in removed {
            match name.as_str() {
                "sky" => light.sky = None,
                "place" => light.place = None,
                "at" => light.at = None,
                "direct" => light.direct = None,
                "diffuse" => light.diffuse = None,
                "weather" => light.weather = None,
                "north" => light.north = None,
                "ground" => light.ground = None,
                "illuminance" => light.illuminance = None,
                _ => bail!("--{name}: this version has no such option"),
            }
        }
        if stated.sky.is_some() {
            match light.sky {
                Some(SkyChoice::Perez) => light.illuminance = stated.illuminance,
                _ => (light.direct, light.diffuse) = (stated.direct, stated.diffuse),
            }
        }
        if light.place.is_some() && light.at.is_some() && stated.sky.is_none() {
            // A radiance that was stated for a preview knows no sun.
            light.sky.take_if(|sky| matches!(sky, SkyChoice::Radiance(_)));
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
            "luminaire" => {
                self.luminaires.push(serde_json::from_str(value).map_err(|e| text(&e))?);
            }
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
            luminaires: match other.luminaires.is_empty() {
                true => self.luminaires.clone(),
                false => other.luminaires.clone(),
            },
        }
    }

    /// Gives a scene with this up axis the stated sky. Returns what was made of it, for people.
    /// [`dim_lamps`](Self::dim_lamps) comes once the scene has all its light.
    ///
    /// # Errors
    /// If an option is missing or does not suit, or a file cannot be read.
    pub fn apply_sky(&self, scene: &mut Scene, up: DVec3) -> Result<Vec<String>> {
        let mut said = Vec::new();
        self.check_options()?;
        let sky = match self.kind() {
            None | Some(SkyChoice::Radiance(_)) => None,
            Some(kind) => Some(self.made_sky(&kind, up, &mut said)?),
        };
        if let Some(sky) = sky {
            scene.sky = sky;
        }
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
        if kind.is_none() {
            self.check_without_sky()?;
        }
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

    /// Ends with an error if an option needs a sky.
    fn check_without_sky(&self) -> Result<()> {
        ensure!(
            self.place.is_none(),
            "--place alone gives no sun: add --at, such as --at 2026-06-21T15:30+02:00, or a --sky"
        );
        ensure!(
            self.at.is_none(),
            "--at alone gives no sun: add --place, such as --place 52.37,4.90, or a --sky"
        );
        for (name, stated) in [("--north", self.north), ("--ground", self.ground)] {
            ensure!(stated.is_none(), "{name} turns or lights nothing without a sky: add --sky");
        }
        Ok(())
    }

    fn factor(&self, name: &str) -> f32 {
        self.lamps.iter().find(|(lamp, _)| lamp == name).map_or(1.0, |(_, factor)| *factor)
    }
}
