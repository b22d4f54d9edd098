//! The configuration file, `--config holodeck.toml`. Options on the command line override it.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use anyhow::{Context, Result};
use clap::ValueEnum;
use holo_proto::control::Engine;
use serde::Deserialize;

/// The description of a holodeck. Every key is optional. An unknown key is an error, because it is
/// most likely misspelt.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The scene, relative to this file.
    pub scene: Option<PathBuf>,
    /// Up axis of the scene: a direction, or "y" or "z".
    pub up: Option<Up>,
    /// The scene's unit: metres, or a name such as "mm".
    pub unit: Option<Unit>,
    /// Radiance of the sky, W·sr⁻¹·m⁻².
    pub sky: Option<[f32; 3]>,
    /// True if lights shine from both sides.
    pub two_sided_lights: Option<bool>,
    /// Sections.
    pub section: Vec<Section>,
    /// Most rooms that get a section if no section is stated.
    pub max_rooms: Option<usize>,
    /// Most beams of all sections if no section is stated.
    pub max_beams: Option<u64>,
    /// True if `--exterior` was given.
    #[serde(skip)]
    pub exterior: bool,
    /// Simpler scenes named on the command line, by section.
    #[serde(skip)]
    pub geometry: Vec<(usize, PathBuf)>,
    /// Portals named on the command line, by section.
    #[serde(skip)]
    pub portals: Vec<(usize, PathBuf)>,
    /// Views by name. A display begins with the first.
    pub view: Vec<View>,
    /// Views of an existing file, as Radiance options. They count if `view` is empty.
    #[serde(skip)]
    pub named_views: Vec<(String, String)>,
    /// `auto`, `on` or `off`.
    pub obstructions: Option<Obstructions>,
    /// True if the distances in flat mirrors and glass are those of the surfaces that they show.
    pub virtual_distance: Option<bool>,
    /// The engine that traces.
    pub engine: Option<Engine>,
    /// Limit of indirect light, in bounces.
    pub bounces: Option<u32>,
    /// Paths averaged into one sample.
    pub paths_per_sample: Option<u16>,
    /// Relative error of indirect light that the engine `cached` aims at.
    pub accuracy: Option<f32>,
    /// Threads that trace.
    pub threads: Option<u16>,
    /// Memory for beams that are kept in memory, MiB.
    pub cache: Option<u64>,
    /// Time to fill, such as "8h".
    pub time: Option<String>,
    /// Number of samples, such as "60M", after which a fill improves known samples instead of
    /// adding new ones.
    pub enough: Option<String>,
    /// Seed of the random numbers.
    pub seed: Option<u64>,
}

/// An up axis.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "UpText")]
pub struct Up(pub [f64; 3]);

/// An up axis as people write it in the file.
#[derive(Deserialize)]
#[serde(untagged)]
enum UpText {
    Direction([f64; 3]),
    Name(String),
}

impl TryFrom<UpText> for Up {
    type Error = String;

    fn try_from(up: UpText) -> Result<Up, String> {
        match up {
            UpText::Direction(up) => Ok(Up(up)),
            UpText::Name(name) => name.parse(),
        }
    }
}

impl FromStr for Up {
    type Err = String;

    fn from_str(text: &str) -> Result<Up, String> {
        match text {
            "x" => return Ok(Up([1.0, 0.0, 0.0])),
            "y" => return Ok(Up([0.0, 1.0, 0.0])),
            "z" => return Ok(Up([0.0, 0.0, 1.0])),
            _ => {}
        }
        let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
        let triple = numbers.and_then(|numbers| numbers.try_into().ok());
        triple.map(Up).ok_or_else(|| format!("`{text}` is no up axis; write y, z or X,Y,Z"))
    }
}

/// Metres in a scene's unit.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "UnitText")]
pub struct Unit(pub f64);

/// A unit as people write it in the file.
#[derive(Deserialize)]
#[serde(untagged)]
enum UnitText {
    Metres(f64),
    Name(String),
}

impl TryFrom<UnitText> for Unit {
    type Error = String;

    fn try_from(unit: UnitText) -> Result<Unit, String> {
        match unit {
            UnitText::Metres(metres) => Ok(Unit(metres)),
            UnitText::Name(name) => name.parse(),
        }
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Unit, String> {
        let metres = match text {
            "mm" => Some(0.001),
            "cm" => Some(0.01),
            "m" => Some(1.0),
            "in" => Some(0.0254),
            "ft" => Some(0.3048),
            _ => text.parse().ok(),
        };
        metres.map(Unit).ok_or_else(|| {
            format!("`{text}` is no unit; write mm, cm, m, in, ft or a number of metres")
        })
    }
}

/// One section.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Section {
    /// Its name, for people.
    #[serde(default)]
    pub name: Option<String>,
    /// One corner.
    pub origin: [f64; 3],
    /// The three edges from that corner.
    pub axes: [[f64; 3]; 3],
    /// Cells along each axis.
    pub grid: Option<[u32; 3]>,
    /// True if views look into the section from outside.
    #[serde(default)]
    pub exterior: bool,
    /// A simpler scene that displays use for this section's views, relative to this file.
    pub geometry: Option<PathBuf>,
    /// Invisible surfaces beyond which all samples are shown, relative to this file.
    pub portals: Option<PathBuf>,
}

impl Section {
    /// Returns the section as the value of `--section`.
    pub fn to_option(&self) -> String {
        let triple = |v: [f64; 3]| format!("{},{},{}", v[0], v[1], v[2]);
        let mut groups = vec![triple(self.origin)];
        groups.extend(self.axes.map(triple));
        groups.extend(self.grid.map(|[w, d, h]| format!("{w},{d},{h}")));
        groups.join(" ")
    }
}

/// Visibility of objects inside a section, which determines where rays begin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Obstructions {
    /// On for sections that have geometry inside
    #[default]
    Auto,
    /// Rays begin at the entry wall
    On,
    /// Rays of interior sections begin at the exit wall
    Off,
}

/// One view.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// The name that `--view` takes.
    pub name: String,
    /// Type: `v`, `l`, `c`, `a` or `h`.
    pub vt: Option<char>,
    /// Eye.
    pub vp: [f64; 3],
    /// Direction.
    pub vd: [f64; 3],
    /// Up in the picture.
    pub vu: Option<[f64; 3]>,
    /// Horizontal angle, degrees; for a parallel view its width, scene units.
    pub vh: Option<f64>,
    /// Vertical angle, degrees; for a parallel view its height, scene units.
    pub vv: Option<f64>,
    /// Shift to the right, in widths of the picture.
    pub vs: Option<f64>,
    /// Lift, in heights of the picture.
    pub vl: Option<f64>,
    /// Fore clipping distance, scene units.
    pub vo: Option<f64>,
    /// Aft clipping distance, scene units.
    pub va: Option<f64>,
}

impl View {
    /// Returns the view as Radiance options.
    pub fn to_options(&self) -> String {
        let triple = |name: &str, v: [f64; 3]| format!("-{name} {} {} {}", v[0], v[1], v[2]);
        let kind = format!("-vt{}", self.vt.unwrap_or('v'));
        let mut words = vec![kind, triple("vp", self.vp), triple("vd", self.vd)];
        words.extend(self.vu.map(|vu| triple("vu", vu)));
        let clips = [("vo", self.vo), ("va", self.va)];
        for (name, value) in [("vh", self.vh), ("vv", self.vv), ("vs", self.vs), ("vl", self.vl)]
            .into_iter()
            .chain(clips)
        {
            words.extend(value.map(|value| format!("-{name} {value}")));
        }
        words.join(" ")
    }
}

impl Config {
    /// Returns the views by name, as Radiance options.
    pub fn views(&self) -> Vec<(String, String)> {
        match self.view.is_empty() {
            true => self.named_views.clone(),
            false => self.view.iter().map(|view| (view.name.clone(), view.to_options())).collect(),
        }
    }

    /// Reads a configuration. Paths in it are relative to its folder.
    ///
    /// # Errors
    /// If the file cannot be read, or a key is unknown or has the wrong type. The error names the
    /// file and the line.
    pub fn read(path: &Path) -> Result<Config> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        let mut config: Config =
            toml::from_str(&text).with_context(|| path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        config.scene = config.scene.map(|scene| folder.join(scene));
        for path in config
            .section
            .iter_mut()
            .flat_map(|section| [&mut section.geometry, &mut section.portals])
            .flatten()
        {
            *path = folder.join(&*path);
        }
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_and_unit_are_numbers_or_names() {
        let read = |text: &str| toml::from_str::<Config>(text);
        let config = read("up = [0, 1, 0]\nunit = 0.3").unwrap();
        assert_eq!((config.up, config.unit), (Some(Up([0.0, 1.0, 0.0])), Some(Unit(0.3))));
        let config = read("up = \"z\"\nunit = \"in\"").unwrap();
        assert_eq!((config.up, config.unit), (Some(Up([0.0, 0.0, 1.0])), Some(Unit(0.0254))));
        assert!(read("up = \"north\"").unwrap_err().to_string().contains("y, z or X,Y,Z"));
        assert!(read("unit = \"ell\"").unwrap_err().to_string().contains("mm, cm, m"));
    }
}
