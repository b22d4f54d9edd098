//! The configuration file, `--config holodeck.toml`. Options on the command line override it.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use anyhow::{Context, Result};
use glam::DVec3;
use holo_daylight::{CivilTime, GeoPlace};
use holo_picture::{ViewError, ViewSpec};
use holo_proto::control::Engine;
use serde::Deserialize;

use crate::light::{SkyChoice, StatedLight, StatedLuminaire};
use crate::objects::SceneObjects;

/// The description of a holodeck. Every key is optional. An unknown key is an error, because it is
/// most likely misspelt.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HolodeckConfig {
    /// The scene, relative to this file.
    pub scene: Option<PathBuf>,
    /// Up axis of the scene: a direction, or "y" or "z".
    pub up: Option<Up>,
    /// The scene's unit: metres, or a name such as "mm".
    pub unit: Option<Unit>,
    /// The sky: a radiance, a name or a picture relative to this file.
    #[serde(deserialize_with = "light_keys::parsed")]
    pub sky: Option<SkyChoice>,
    /// The place: degrees north and east.
    #[serde(deserialize_with = "light_keys::parsed")]
    pub place: Option<GeoPlace>,
    /// The date and hour.
    #[serde(deserialize_with = "light_keys::parsed")]
    pub at: Option<CivilTime>,
    /// Irradiance by the sun on a surface that faces it, W·m⁻².
    #[serde(deserialize_with = "light_keys::irradiance")]
    pub direct: Option<f64>,
    /// Irradiance by the sky on a horizontal surface, W·m⁻².
    #[serde(deserialize_with = "light_keys::irradiance")]
    pub diffuse: Option<f64>,
    /// A weather file, relative to this file.
    pub weather: Option<PathBuf>,
    /// Degrees by which north is turned clockwise, seen from above.
    #[serde(deserialize_with = "light_keys::north")]
    pub north: Option<f64>,
    /// Reflectance of the ground beyond the scene.
    #[serde(deserialize_with = "light_keys::ground")]
    pub ground: Option<f64>,
    /// Illuminance by the sky on a horizontal surface, lx.
    #[serde(deserialize_with = "light_keys::illuminance")]
    pub illuminance: Option<f64>,
    /// Factors of lamps by their names.
    #[serde(deserialize_with = "light_keys::lamps")]
    pub lamp: Vec<(String, f32)>,
    /// Luminaires that are hung in the scene.
    pub luminaire: Vec<StatedLuminaire>,
    /// True if lights shine from both sides.
    pub two_sided_lights: Option<bool>,
    /// Sections.
    pub section: Vec<SectionTable>,
    /// Most rooms that get a section if no section is stated.
    #[serde(deserialize_with = "ranges::rooms")]
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
    pub view: Vec<ViewTable>,
    /// Views of an existing file, as Radiance options. They count if `view` is empty.
    #[serde(skip)]
    pub named_views: Vec<(String, String)>,
    /// Objects of an existing file that are part of its scene.
    #[serde(skip)]
    pub objects: SceneObjects,
    /// `auto`, `on` or `off`.
    pub obstructions: Option<Obstructions>,
    /// True if the distances in flat mirrors and glass are those of the surfaces that they show.
    pub virtual_distance: Option<bool>,
    /// The engine that traces.
    #[serde(deserialize_with = "ranges::engine")]
    pub engine: Option<Engine>,
    /// Limit of indirect light, in bounces.
    pub bounces: Option<u32>,
    /// Paths averaged into one sample.
    #[serde(deserialize_with = "ranges::paths")]
    pub paths_per_sample: Option<u16>,
    /// Threads that trace.
    pub threads: Option<u16>,
    /// Memory for beams that are kept in memory, MiB.
    #[serde(deserialize_with = "ranges::cache")]
    pub cache: Option<u64>,
    /// Time to fill, such as "8h".
    #[serde(deserialize_with = "ranges::time")]
    pub time: Option<String>,
    /// Number of samples, such as "60M", after which a fill improves known samples instead of
    /// adding new ones.
    #[serde(deserialize_with = "ranges::enough")]
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
            UpText::Direction(up) => Up(up).checked(),
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
        let up = triple.map(Up);
        up.ok_or_else(|| format!("`{text}` is no up axis; write y, z or X,Y,Z"))?.checked()
    }
}

impl Up {
    fn checked(self) -> Result<Up, String> {
        let is_direction = self.0.iter().all(|x| x.is_finite()) && self.0.iter().any(|&x| x != 0.0);
        is_direction.then_some(self).ok_or_else(|| {
            let [x, y, z] = self.0;
            format!("an up axis must be a direction, not {x},{y},{z}")
        })
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
            UnitText::Metres(metres) => Unit(metres).checked(),
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
        let unit = metres.map(Unit).ok_or_else(|| {
            format!("`{text}` is no unit; write mm, cm, m, in, ft or a number of metres")
        });
        unit?.checked()
    }
}

impl Unit {
    fn checked(self) -> Result<Unit, String> {
        (self.0.is_finite() && self.0 > 0.0)
            .then_some(self)
            .ok_or_else(|| format!("a unit must be a positive number of metres, not {}", self.0))
    }
}

/// Keys with the ranges of the options of the same names.
mod ranges {
    use holo_proto::control::Engine;
    use serde::{Deserialize, Deserializer, de::Error};

    /// Reads a value, and checks it.
    fn checked<'a, D, T, E>(
        deserializer: D,
        check: impl FnOnce(&T) -> Result<E, String>,
    ) -> Result<Option<T>, D::Error>
    where
        D: Deserializer<'a>,
        T: Deserialize<'a>,
    {
        let value = T::deserialize(deserializer)?;
        check(&value).map(|_| Some(value)).map_err(D::Error::custom)
    }

    fn at_least_one(is_one: bool) -> Result<(), String> {
        if is_one { Ok(()) } else { Err("it must be at least 1".to_owned()) }
    }

    pub fn rooms<'a, D: Deserializer<'a>>(from: D) -> Result<Option<usize>, D::Error> {
        checked(from, |rooms| at_least_one(*rooms > 0))
    }

    pub fn paths<'a, D: Deserializer<'a>>(from: D) -> Result<Option<u16>, D::Error> {
        checked(from, |paths| at_least_one(*paths > 0))
    }

    pub fn engine<'a, D: Deserializer<'a>>(from: D) -> Result<Option<Engine>, D::Error> {
        checked(from, |engine| {
            match engine {
                Engine::Captured => Err("`captured` traces nothing: there are `path` and `gather`"),
                Engine::Path | Engine::Gather => Ok(()),
            }
            .map_err(str::to_owned)
        })
    }

    pub fn cache<'a, D: Deserializer<'a>>(from: D) -> Result<Option<u64>, D::Error> {
        checked(from, |cache: &u64| holo_server::parse_memory(&cache.to_string()))
    }

    pub fn time<'a, D: Deserializer<'a>>(from: D) -> Result<Option<String>, D::Error> {
        checked(from, |time: &String| holo_server::parse_time(time))
    }

    pub fn enough<'a, D: Deserializer<'a>>(from: D) -> Result<Option<String>, D::Error> {
        checked(from, |enough: &String| holo_server::parse_count(enough))
    }
}

/// Keys of light, written as the options of the same names, or as numbers and dates.
mod light_keys {
    use std::collections::BTreeMap;
    use std::fmt;
    use std::str::FromStr;

    use serde::{Deserialize, Deserializer, de::Error};

    use crate::light;

    /// A value as people write it.
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum KeyText {
        Text(String),
        Number(f64),
        Numbers(Vec<f64>),
        Date(toml::value::Datetime),
    }

    impl fmt::Display for KeyText {
        fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
            match self {
                KeyText::Text(text) => f.write_str(text),
                KeyText::Number(number) => write!(f, "{number}"),
                KeyText::Date(date) => write!(f, "{date}"),
                KeyText::Numbers(numbers) => {
                    let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
                    f.write_str(&words.join(","))
                }
            }
        }
    }

    fn read<'a, D: Deserializer<'a>, T, E: fmt::Display>(
        from: D,
        parse: impl FnOnce(&str) -> Result<T, E>,
    ) -> Result<Option<T>, D::Error> {
        let text = KeyText::deserialize(from)?.to_string();
        parse(&text).map(Some).map_err(D::Error::custom)
    }

    pub fn parsed<'a, D: Deserializer<'a>, T: FromStr>(from: D) -> Result<Option<T>, D::Error>
    where
        T::Err: fmt::Display,
    {
        read(from, str::parse::<T>)
    }

    pub fn irradiance<'a, D: Deserializer<'a>>(from: D) -> Result<Option<f64>, D::Error> {
        read(from, light::parse_irradiance)
    }

    pub fn north<'a, D: Deserializer<'a>>(from: D) -> Result<Option<f64>, D::Error> {
        read(from, light::parse_north)
    }

    pub fn ground<'a, D: Deserializer<'a>>(from: D) -> Result<Option<f64>, D::Error> {
        read(from, light::parse_ground)
    }

    pub fn illuminance<'a, D: Deserializer<'a>>(from: D) -> Result<Option<f64>, D::Error> {
        read(from, light::parse_illuminance)
    }

    pub fn lamps<'a, D: Deserializer<'a>>(from: D) -> Result<Vec<(String, f32)>, D::Error> {
        let factors = BTreeMap::<String, f64>::deserialize(from)?;
        let lamp = |(name, factor)| light::parse_lamp(&format!("{name}={factor}"));
        factors.into_iter().map(lamp).collect::<Result<_, _>>().map_err(D::Error::custom)
    }
}

/// One section. Its shape is checked against the scene later.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SectionTable {
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

impl SectionTable {
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Obstructions {
    /// On for sections that have geometry inside.
    #[default]
    Auto,
    /// Rays begin at the entry wall.
    On,
    /// Rays of interior sections begin at the exit wall.
    Off,
}

/// One view.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewTable {
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

impl ViewTable {
    /// Checks that the view can be shown, as far as that is known without the scene's up axis.
    fn check(&self) -> Result<(), ViewError> {
        let mut spec = ViewSpec::default();
        spec.apply_line(&self.to_options())?;
        // Any up axis will do that is not along the view.
        let [x, y, z] = self.vd.map(f64::abs);
        let up = if z > x.max(y) { DVec3::Y } else { DVec3::Z };
        spec.vu = spec.vu.or(Some(up));
        spec.resolve((640, 480)).map(|_| ())
    }

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

impl HolodeckConfig {
    /// Returns the light that is stated.
    pub fn light(&self) -> StatedLight {
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
            luminaires: self.luminaire.clone(),
        }
    }

    /// States this light, and no other.
    pub fn set_light(&mut self, light: StatedLight) {
        let StatedLight { sky, place, at, direct, diffuse, weather, north, ground, .. } = light;
        (self.sky, self.place, self.at, self.direct) = (sky, place, at, direct);
        (self.diffuse, self.weather, self.north, self.ground) = (diffuse, weather, north, ground);
        (self.illuminance, self.lamp) = (light.illuminance, light.lamps);
        self.luminaire = light.luminaires;
    }

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
    pub fn read(path: &Path) -> Result<HolodeckConfig> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        let mut config: HolodeckConfig =
            toml::from_str(&text).with_context(|| path.display().to_string())?;
        for (index, view) in config.view.iter().enumerate() {
            let place = || {
                let line = line_of_table(&text, |tables| tables.view, index)
                    .map(|line| format!(" line {line}:"));
                let (path, line) = (path.display(), line.unwrap_or_default());
                format!("{path}:{line} view `{}`", view.name)
            };
            view.check().with_context(place)?;
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        config.scene = config.scene.map(|scene| folder.join(scene));
        for (index, luminaire) in config.luminaire.iter_mut().enumerate() {
            luminaire.check().map_err(|problem| {
                let line = line_of_table(&text, |tables| tables.luminaire, index);
                let line = line.map(|line| format!(" line {line}:")).unwrap_or_default();
                anyhow::anyhow!("{}:{line} luminaire: {problem}", path.display())
            })?;
            luminaire.set_folder(folder);
        }
        config.weather = config.weather.map(|weather| folder.join(weather));
        if let Some(SkyChoice::Picture(picture)) = &mut config.sky {
            *picture = folder.join(&*picture);
        }
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

/// The tables of which a fault names the line.
#[derive(Deserialize)]
struct TableSpans {
    #[serde(default)]
    view: Vec<toml::Spanned<toml::Table>>,
    #[serde(default)]
    luminaire: Vec<toml::Spanned<toml::Table>>,
}

/// Returns the line at which a table begins, from 1.
fn line_of_table(
    text: &str,
    tables: fn(TableSpans) -> Vec<toml::Spanned<toml::Table>>,
    index: usize,
) -> Option<usize> {
    let start = tables(toml::from_str(text).ok()?).get(index)?.span().start;
    Some(text.get(..start)?.lines().count() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_and_unit_are_numbers_or_names() {
        let read = |text: &str| toml::from_str::<HolodeckConfig>(text);
        let config = read("up = [0, 1, 0]\nunit = 0.3").unwrap();
        assert_eq!((config.up, config.unit), (Some(Up([0.0, 1.0, 0.0])), Some(Unit(0.3))));
        let config = read("up = \"z\"\nunit = \"in\"").unwrap();
        assert_eq!((config.up, config.unit), (Some(Up([0.0, 0.0, 1.0])), Some(Unit(0.0254))));
        assert!(read("up = \"north\"").unwrap_err().to_string().contains("y, z or X,Y,Z"));
        assert!(read("unit = \"ell\"").unwrap_err().to_string().contains("mm, cm, m"));
    }

    #[test]
    fn values_have_the_ranges_of_their_options_and_errors_name_file_and_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ten views.toml");
        let view = |name: &str, rest: &str| {
            format!("[[view]]\nname = \"{name}\"\nvp = [0, 0, 0]\n{rest}\n")
        };
        let views = view("left", "vd = [0, 1, 0]") + &view("up", "vd = [0, 0, 1]");
        let error = |text: &str| {
            std::fs::write(&path, text).unwrap();
            format!("{:#}", HolodeckConfig::read(&path).unwrap_err())
        };
        std::fs::write(&path, "sky = [0, 1, 2]\ncache = 9\n".to_owned() + &views).unwrap();
        assert_eq!(HolodeckConfig::read(&path).unwrap().views().len(), 2);
        for (line, words) in [
            ("sky = [1, -1, 1]", "negative"),
            ("sky = [1, inf, 1]", "infinite"),
            ("max_rooms = 0", "at least 1"),
            ("paths_per_sample = 0", "at least 1"),
            ("paths_per_sample = 4000000000", "4000000000"),
            ("cache = 99999999999999", "at most 16TiB"),
            ("time = \"soon\"", "is not a time"),
            ("time = \"-3s\"", "is not a time"),
            ("enough = \"many\"", "is not a count"),
            ("unit = 0", "positive"),
            ("unit = nan", "positive"),
            ("up = [0, 0, 0]", "direction"),
            ("bounces = -1", "-1"),
            ("engine = \"captured\"", "traces nothing"),
        ] {
            let said = error(&format!("scene = \"a.obj\"\n{line}\n{views}"));
            assert!(said.contains("ten views.toml") && said.contains("line 2"), "{line}: {said}");
            assert!(said.contains(words), "{line}: {said}");
        }
        for (rest, words) in [
            ("vd = [0, 0, 0]", "-vd has length zero"),
            ("vd = [0, 1, nan]", "finite"),
            ("vd = [0, 1, 0]\nvh = 180", "-vh 180"),
            ("vd = [0, 1, 0]\nvu = [0, 2, 0]", "parallel"),
            ("vd = [0, 1, 0]\nvt = \"s\"", "-vts"),
        ] {
            let said =
                error(&(views.clone() + &view("bad one", rest) + &view("last", "vd = [1, 0, 0]")));
            assert!(said.contains("ten views.toml") && said.contains("line 9"), "{rest}: {said}");
            assert!(said.contains("view `bad one`") && said.contains(words), "{rest}: {said}");
        }
    }
}
