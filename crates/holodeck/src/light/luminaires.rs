//! Luminaires that a configuration hangs in a scene.
//!
//! Invariant: what is stated is used, or the command ends with the file, its line and what to do.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};
use glam::{DMat4, DVec3};
use holo_color::{TEMPERATURES, channels_of, chromaticity_of};
use holo_photometry::{MAX_PHOTOMETRY_BYTES, OpeningShape, Photometry};
use holo_scene::{
    Hanging, HungLuminaire, LuminousPart, MAX_LUMINAIRES, NamedPhotometry, Scene, SceneError,
};
use serde::{Deserialize, Serialize};

/// Most bytes of a file of positions: 200 for each luminaire.
const MAX_POSITION_BYTES: u64 = 200 * MAX_LUMINAIRES as u64;

/// Greatest dimming and flux.
const MAX_FACTOR: f64 = 1e6;
const MAX_LUMENS: f64 = 1e12;

/// Distance by which flat openings lie below their place, metres. In the plane of a ceiling, the
/// ceiling would hide them.
const BELOW: f64 = 0.001;

/// Least angle between two directions that together determine a turn, as a sine.
const LEAST_SINE: f64 = 1e-3;

/// A luminaire, or several of one type, as a configuration states them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StatedLuminaire {
    /// Its IES or EULUMDAT file, relative to the configuration.
    pub file: PathBuf,
    /// Its name, and that of its group; the file's name if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The group that it belongs to; its name if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Where it hangs: one place or several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<StatedPlaces>,
    /// A CSV file with a place on each line, relative to the configuration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub positions: Option<PathBuf>,
    /// The direction of its nadir; down if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aim: Option<[f64; 3]>,
    /// Degrees by which it is turned about its axis, counter-clockwise seen from behind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn: Option<f64>,
    /// Factor of its light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dim: Option<f64>,
    /// Its luminous flux in place of the file's, lumens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lumens: Option<f64>,
    /// The colour temperature of its light, kelvin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kelvin: Option<f64>,
    /// The chromaticity of its light, CIE 1931 x and y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chromaticity: Option<[f64; 2]>,
}

/// Places as people write them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum StatedPlaces {
    /// One place.
    One([f64; 3]),
    /// Several.
    Several(Vec<[f64; 3]>),
}

/// A place where a luminaire hangs.
#[derive(Clone, Debug, PartialEq)]
struct HangingPlace {
    at: DVec3,
    /// Degrees, on top of those of the type.
    turn: f64,
    /// Its own name.
    name: Option<String>,
}

/// The directions and the unit of a scene.
#[derive(Clone, Copy, Debug)]
struct SceneFrame {
    up: DVec3,
    /// Metres in its unit.
    unit: f64,
}

/// Photometric files that were read, by their names.
#[derive(Default)]
struct PhotometryFiles(HashMap<PathBuf, Arc<Photometry>>);

impl PhotometryFiles {
    /// Reads a file, or returns it again. New notes about it go to `said`.
    ///
    /// # Errors
    /// If it cannot be read, or is of no use.
    fn read(&mut self, path: &Path, said: &mut Vec<String>) -> Result<Arc<Photometry>> {
        if let Some(known) = self.0.get(path) {
            return Ok(Arc::clone(known));
        }
        let name = path.display();
        let photometry = Photometry::read(&read_bounded(path, MAX_PHOTOMETRY_BYTES)?)
            .with_context(|| name.to_string())?;
        let notes = photometry.notes.iter();
        said.extend(notes.map(|note| format!("light: {name}: {note}")));
        let photometry = Arc::new(photometry);
        self.0.insert(path.to_owned(), Arc::clone(&photometry));
        Ok(photometry)
    }
}

/// Reads a file of bounded length.
fn read_bounded(path: &Path, most: u64) -> Result<Vec<u8>> {
    let name = path.display();
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes));
    let count = read.with_context(|| format!("reading {name}"))? as u64;
    ensure!(count <= most, "{name} has more than the {most} bytes that are read at most");
    Ok(bytes)
}

impl StatedLuminaire {
    /// Makes the names of files relative to a folder.
    pub fn set_folder(&mut self, folder: &Path) {
        self.file = folder.join(&self.file);
        self.positions = self.positions.take().map(|positions| folder.join(positions));
    }

    /// Checks the numbers, as far as that needs no file.
    ///
    /// # Errors
    /// If one is out of range.
    pub fn check(&self) -> Result<(), String> {
        let within = |what: &str, number: Option<f64>, least: f64, most: f64| match number {
            Some(number) if !(least..=most).contains(&number) => {
                Err(format!("`{what}` is {number}, but must lie between {least} and {most}"))
            }
            _ => Ok(()),
        };
        if self.file.as_os_str().is_empty() {
            return Err("`file` is missing: the IES or EULUMDAT file of the luminaire".to_owned());
        }
        if self.at.is_none() == self.positions.is_none() {
            return Err("either `at` or `positions` must say where it hangs".to_owned());
        }
        within("dim", self.dim, 0.0, MAX_FACTOR)?;
        within("lumens", self.lumens, 0.0, MAX_LUMENS)?;
        within("turn", self.turn, -360.0, 360.0)?;
        within("kelvin", self.kelvin, *TEMPERATURES.start(), *TEMPERATURES.end())?;
        if self.kelvin.is_some() && self.chromaticity.is_some() {
            return Err("only one of `kelvin` and `chromaticity` can be the colour".to_owned());
        }
        let is_far = |place: &[f64; 3]| !place.iter().all(|c| c.abs() <= 1e12);
        if let Some(bad) = self.stated_places().iter().find(|place| is_far(place)) {
            return Err(format!("`at` has the place {bad:?}, which is not within 1e12"));
        }
        if self.aim.is_some_and(|aim| !(1e-6..=1e6).contains(&DVec3::from(aim).length())) {
            return Err("`aim` is no direction".to_owned());
        }
        match self.chromaticity {
            Some(xy) if channels_of(xy).is_none() => Err(format!("there is no colour {xy:?}")),
            _ => Ok(()),
        }
    }

    fn stated_places(&self) -> &[[f64; 3]] {
        match &self.at {
            None => &[],
            Some(StatedPlaces::One(place)) => std::slice::from_ref(place),
            Some(StatedPlaces::Several(places)) => places,
        }
    }

    /// Returns its name.
    fn type_name(&self) -> String {
        let stem = || self.file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        self.name.clone().or_else(stem).unwrap_or_default()
    }

    /// Returns where it hangs.
    fn places(&self) -> Result<Vec<HangingPlace>> {
        let mut places = match &self.positions {
            Some(path) => {
                let text = read_bounded(path, MAX_POSITION_BYTES)?;
                positions(&String::from_utf8_lossy(&text))
                    .map_err(|error| anyhow::anyhow!("{}:{error}", path.display()))?
            }
            None => {
                let place =
                    |at: &[f64; 3]| HangingPlace { at: (*at).into(), turn: 0.0, name: None };
                self.stated_places().iter().map(place).collect()
            }
        };
        ensure!(
            places.len() <= MAX_LUMINAIRES,
            "luminaire {}: {} places; a scene has at most {MAX_LUMINAIRES} luminaires",
            self.type_name(),
            places.len()
        );
        if let [place] = &mut places[..] {
            place.name.get_or_insert(self.type_name());
        }
        for (number, place) in places.iter_mut().enumerate() {
            place.name.get_or_insert_with(|| format!("{} {}", self.type_name(), number + 1));
        }
        Ok(places)
    }

    /// Returns the luminaires of this type, and adds words about them.
    ///
    /// # Errors
    /// If a number, its file or a place is of no use.
    fn hung(
        &self,
        frame: SceneFrame,
        files: &mut PhotometryFiles,
        said: &mut Vec<String>,
    ) -> Result<Vec<HungLuminaire>> {
        let name = self.type_name();
        self.check().map_err(|problem| anyhow::anyhow!("luminaire {name}: {problem}"))?;
        let photometry = files.read(&self.file, said)?;
        let places = self.places().with_context(|| format!("luminaire {name}"))?;
        let group = self.group.clone().unwrap_or_else(|| name.clone());
        let aim = self.aim.map_or(-frame.up, |aim| DVec3::from(aim).normalize_or(-frame.up));
        let colour = self.colour(&name, said)?;
        let tilt = aim.dot(-frame.up).clamp(-1.0, 1.0).acos().to_degrees();
        let factor = photometry.tilt.as_ref().map_or(1.0, |table| table.factor(tilt));
        let of_file = photometry.web.flux() * factor;
        let flux = self.dim.unwrap_or(1.0) * self.lumens.unwrap_or(of_file);
        ensure!(
            flux == 0.0 || of_file > 0.0,
            "luminaire {name}: {} has no light, so no factor gives {flux} lm",
            self.file.display()
        );
        let scale = if of_file > 0.0 { factor * flux / of_file } else { 0.0 };
        let web = Arc::new(photometry.web.clone().scaled(scale as f32));
        let mesh = Arc::new(photometry.opening.mesh(photometry.web.halves()));
        said.push(format!(
            "light: luminaire {name}: {} of {flux:.0} lm ({})",
            counted(places.len()),
            self.file.display()
        ));
        let is_flat =
            matches!(photometry.opening.shape, OpeningShape::Rectangle | OpeningShape::Ellipse);
        let lower = if is_flat { aim * (BELOW / frame.unit) } else { DVec3::ZERO };
        let hang = |place: HangingPlace| HungLuminaire {
            name: place.name.unwrap_or_default(),
            group: group.clone(),
            place: place.at + lower,
            axes: axes(aim, frame.up, self.turn.unwrap_or(0.0) + place.turn),
            web: Arc::clone(&web),
            mesh: Arc::clone(&mesh),
            colour,
        };
        Ok(places.into_iter().map(hang).collect())
    }

    /// Returns the colour of its light, whose luminance is 1.
    fn colour(&self, name: &str, said: &mut Vec<String>) -> Result<[f32; 3]> {
        let chromaticity = self.chromaticity.or(self.kelvin.map(chromaticity_of));
        let Some(chromaticity) = chromaticity else { return Ok([1.0; 3]) };
        let Some((channels, is_outside)) = channels_of(chromaticity) else {
            bail!("luminaire {name}: there is no colour {chromaticity:?}")
        };
        if is_outside {
            said.push(format!(
                "light: the colour of {name} lies outside of Rec. 709: the nearest one is taken"
            ));
        }
        Ok(channels)
    }
}

fn counted(count: usize) -> String {
    if count == 1 { "one".to_owned() } else { format!("{count}, each") }
}

/// Returns the axes of a luminaire's frame in a scene: x (C0), y (C90), and -nadir. An upright one
/// has x in the east of the scene. One that leans has x upwards in the plane of its lean.
fn axes(aim: DVec3, up: DVec3, turn: f64) -> [DVec3; 3] {
    let up = up.normalize_or(DVec3::Z);
    let z = -aim.normalize_or(-up);
    let lean = up - z * up.dot(z);
    let x = match lean.length() > LEAST_SINE {
        true => lean.normalize(),
        false => {
            let first = if z.x.abs() > 0.9 { DVec3::Y } else { DVec3::X };
            (first - z * first.dot(z)).normalize_or(DVec3::X)
        }
    };
    let y = z.cross(x);
    let (sin, cos) = turn.to_radians().sin_cos();
    [x * cos + y * sin, y * cos - x * sin, z]
}

/// Reads places: x, y, z, and perhaps a turn in degrees and a name on each line.
fn positions(text: &str) -> Result<Vec<HangingPlace>, String> {
    let mut places = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let separator = [';', '\t'].into_iter().find(|&c| line.contains(c)).unwrap_or(',');
        let fields: Vec<&str> = line.split(separator).map(str::trim).collect();
        let finite = |text: &&str| text.parse().ok().filter(|n: &f64| n.abs() <= 1e12);
        let numbers: Vec<Option<f64>> = fields.iter().take(4).map(finite).collect();
        let [Some(x), Some(y), Some(z), ref rest @ ..] = numbers[..] else {
            // The first line may name the columns.
            if places.is_empty() && numbers.iter().all(Option::is_none) {
                continue;
            }
            return Err(format!(
                "{}: `{}` is no place; write x,y,z, or x,y,z,turn,name",
                number + 1,
                line.chars().take(60).collect::<String>()
            ));
        };
        let turn = match (rest, fields.get(3)) {
            ([], _) | (_, None | Some(&"")) => 0.0,
            ([Some(turn), ..], _) => *turn,
            (_, Some(text)) => {
                return Err(format!("{}: `{text}` is no turn in degrees", number + 1));
            }
        };
        let name = fields.get(4).filter(|name| !name.is_empty()).map(|name| (*name).to_owned());
        places.push(HangingPlace { at: DVec3::new(x, y, z), turn, name });
    }
    if places.is_empty() {
        return Err("1: there is no place in it; write x,y,z on each line".to_owned());
    }
    Ok(places)
}

/// Hangs the stated luminaires and those that the model names. `unit` is the scene's unit in
/// metres, if it is stated. Returns words about them.
///
/// # Errors
/// If the unit is missing, a file cannot be read or is of no use, or a luminaire is not possible.
pub fn hang(
    stated: &[StatedLuminaire],
    named: &[NamedPhotometry],
    scene: Scene,
    up: DVec3,
    unit: Option<f64>,
) -> Result<(Scene, Vec<String>)> {
    if stated.is_empty() && named.is_empty() {
        return Ok((scene, Vec::new()));
    }
    let unit = unit.context(
        "luminaires have a real size, so the scene's unit must be known: add --unit mm|cm|m|in|ft",
    )?;
    let frame = SceneFrame { up, unit };
    let (mut files, mut hung, mut said) = (PhotometryFiles::default(), Vec::new(), Vec::new());
    for luminaire in stated {
        hung.extend(luminaire.hung(frame, &mut files, &mut said)?);
    }
    let mut scene = scene;
    for NamedPhotometry { path, part } in named {
        let photometry = files.read(path, &mut said)?;
        let of_file = || format!("{:.0} lm ({})", photometry.web.flux(), path.display());
        match part {
            LuminousPart::Material { id, turn } => {
                let name = scene.materials[*id as usize].name.clone();
                let hanging = Hanging { up, unit, turn: *turn };
                let (lit, count) =
                    scene.with_luminous_material(*id, &photometry, [1.0; 3], hanging)?;
                scene = lit;
                said.push(format!("light: material {name}: {} of {}", counted(count), of_file()));
            }
            LuminousPart::Node { name, matrix } => {
                hung.push(of_node(name, *matrix, path, &photometry));
                said.push(format!("light: node {name}: one of {}", of_file()));
            }
        }
    }
    let names = |at: usize| hung.get(at).map_or_else(String::new, |one| one.name.clone());
    let scene = scene.with_luminaires_hung(&hung, unit).map_err(|error| match error {
        SceneError::Luminaire(at) => {
            anyhow::Error::from(error).context(format!("luminaire {}", names(at)))
        }
        other => other.into(),
    })?;
    Ok((scene, said))
}

/// Returns the luminaire of a model's node. Its group is named for its file.
fn of_node(name: &str, matrix: DMat4, path: &Path, photometry: &Photometry) -> HungLuminaire {
    let direction = |axis: DVec3| matrix.transform_vector3(axis).normalize_or_zero();
    let (z, x) = (direction(DVec3::Y), direction(DVec3::X));
    let y = z.cross(x).normalize_or_zero();
    let group = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    HungLuminaire {
        name: name.to_owned(),
        group: group.unwrap_or_default(),
        place: matrix.transform_point3(DVec3::ZERO),
        axes: [y.cross(z), y, z],
        web: Arc::new(photometry.web.clone()),
        mesh: Arc::new(photometry.opening.mesh(photometry.web.halves())),
        colour: [1.0; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_with_turns_and_names_and_faults_name_their_line() {
        let read = positions("x,y,z,turn,name\n# a row\n1,2,3\n 4 , 5 , 6 , 90 , desk \n").unwrap();
        assert_eq!(read[0], HangingPlace { at: DVec3::new(1.0, 2.0, 3.0), turn: 0.0, name: None });
        assert_eq!((read[1].turn, read[1].name.as_deref()), (90.0, Some("desk")));
        assert_eq!(positions("1;2;3;;\n").unwrap().len(), 1);
        for (text, line) in
            [("1,2\n", "1:"), ("1,2,3\n1,x,3\n", "2:"), ("1,2,3,east", "1:"), ("", "1:")]
        {
            let error = positions(text).unwrap_err();
            assert!(error.starts_with(line), "{text}: {error}");
        }
    }

    #[test]
    fn upright_luminaires_lie_along_the_scene_s_first_axis_and_turn_counter_clockwise() {
        for up in [DVec3::Z, DVec3::Y] {
            let [x, y, z] = axes(-up, up, 0.0);
            assert_eq!((x, z), (DVec3::X, up));
            assert_eq!(y, up.cross(DVec3::X));
            let turned = axes(-up, up, 90.0);
            assert!(turned[0].distance(y) < 1e-9);
        }
        let [x, y, z] = axes(DVec3::X, DVec3::Z, 0.0);
        assert_eq!((x, y, z), (DVec3::Z, DVec3::Y, -DVec3::X));
        let level = axes(DVec3::new(1.0, 1.0, -1.0), DVec3::Z, 0.0);
        assert!(level[1].z.abs() < 1e-9 && level[0].z > 0.0);
    }

    #[test]
    fn impossible_values_are_named() {
        let good = StatedLuminaire {
            file: "a.ies".into(),
            at: Some(StatedPlaces::One([0.0; 3])),
            ..StatedLuminaire::default()
        };
        assert_eq!(good.check(), Ok(()));
        let bad = |change: &dyn Fn(&mut StatedLuminaire)| {
            let mut luminaire = good.clone();
            change(&mut luminaire);
            luminaire.check().unwrap_err()
        };
        assert!(bad(&|l| l.file = PathBuf::new()).contains("file"));
        assert!(bad(&|l| l.at = None).contains("positions"));
        assert!(bad(&|l| l.dim = Some(f64::NAN)).contains("dim"));
        assert!(bad(&|l| l.lumens = Some(-1.0)).contains("lumens"));
        assert!(bad(&|l| l.kelvin = Some(10.0)).contains("kelvin"));
        assert!(bad(&|l| l.aim = Some([0.0; 3])).contains("aim"));
        assert!(bad(&|l| l.chromaticity = Some([0.9, 0.9])).contains("colour"));
        assert!(bad(&|l| l.at = Some(StatedPlaces::One([f64::NAN; 3]))).contains("1e12"));
    }
}
