//! Options for tracing: the scene, its sections, the engine.

use std::{ffi::OsStr, os::unix::ffi::OsStrExt, path::PathBuf};

use anyhow::Result;
use clap::{
    Args,
    builder::{OsStringValueParser, PossibleValue, PossibleValuesParser, TypedValueParser},
};
use holo_proto::control::Engine;
use holodeck::config::{self, HolodeckConfig, Obstructions};

use super::light_args::LightArgs;

/// Options for the scene and its sections.
#[derive(Args, Clone, Debug, Default)]
pub struct SceneArgs {
    /// Read scene, sections, views and settings from this file; options override it
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// A section: origin, three axes and, if wanted, the grid. May be repeated [default: boxes in
    /// the scene's rooms, or a box around it if it has none or with --exterior]
    #[arg(long, value_name = "\"OX,OY,OZ AX,AY,AZ BX,BY,BZ CX,CY,CZ [NX,NY,NZ]\"", value_parser = parse_section, allow_hyphen_values = true)]
    pub section: Vec<config::SectionTable>,
    /// A simpler scene that displays use for views of a section [default: 0]. Samples that do not
    /// lie on its surfaces are not shown. May be repeated
    #[arg(long, value_name = "[SECTION=]FILE.obj", value_parser = stand_in_parser())]
    pub geometry: Vec<(usize, PathBuf)>,
    /// Invisible surfaces, such as windows and doorways, beyond which all samples of a section
    /// [default: 0] are shown. May be repeated
    #[arg(long, value_name = "[SECTION=]FILE.obj", value_parser = stand_in_parser())]
    pub portals: Vec<(usize, PathBuf)>,
    /// Make sections to look into from outside, not to look out of
    #[arg(long)]
    pub exterior: bool,
    /// If no section is stated: number of rooms that get one, the largest first [default: 8]
    #[arg(long, value_name = "N", value_parser = parse_rooms)]
    pub max_rooms: Option<usize>,
    /// If no section is stated: number of beams that all sections may have. Small rooms and then
    /// doors are left out [default: 2M]
    #[arg(long, value_name = "N", value_parser = holo_server::parse_count)]
    pub max_beams: Option<u64>,
    /// Whether objects inside sections are visible [default: auto]
    #[arg(long, value_parser = obstructions_parser())]
    pub obstructions: Option<Obstructions>,
    /// The up direction: y, z or a direction [default: as the file states, or guessed with a
    /// reason]
    #[arg(long, value_name = "y|z|X,Y,Z", allow_hyphen_values = true)]
    pub up: Option<config::Up>,
    /// The length of the scene's unit [default: as the file states, or guessed with a reason]
    #[arg(long, value_name = "mm|cm|m|in|ft|METRES")]
    pub unit: Option<config::Unit>,
    #[command(flatten)]
    pub light: LightArgs,
    /// Let lights shine from both sides
    #[arg(long)]
    pub two_sided_lights: bool,
    /// The engine: `path` (unbiased) or `gather` (paths that end in shared cells of surface light)
    /// [default: path for `render` and for direct light only, else gather]
    #[arg(long, value_parser = parse_engine)]
    pub engine: Option<Engine>,
    /// Limit indirect light to this many bounces; 0 is direct light only [default: no limit]
    #[arg(long, value_name = "N")]
    pub bounces: Option<u32>,
    /// Paths averaged into one sample [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub paths_per_sample: Option<u16>,
    /// In flat mirrors and glass, store the distance of the surfaces that they show. Reflections
    /// get sharper in motion, but their edges may break up
    #[arg(long)]
    pub virtual_distance: bool,
    /// Seed of the random numbers [default: 0]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
}

impl SceneArgs {
    /// Returns the configuration file, overridden by these options.
    ///
    /// # Errors
    /// If the file cannot be read or has an error.
    pub fn resolve(&self, scene: Option<&PathBuf>) -> Result<HolodeckConfig> {
        let mut config =
            self.config.as_deref().map(HolodeckConfig::read).transpose()?.unwrap_or_default();
        config.scene = scene.cloned().or(config.scene);
        if !self.section.is_empty() {
            config.section.clone_from(&self.section);
        }
        config.exterior = self.exterior;
        for section in &mut config.section {
            section.exterior |= self.exterior;
        }
        config.max_rooms = self.max_rooms.or(config.max_rooms);
        config.max_beams = self.max_beams.or(config.max_beams);
        config.geometry.clone_from(&self.geometry);
        config.portals.clone_from(&self.portals);
        config.up = self.up.or(config.up);
        config.unit = self.unit.or(config.unit);
        config.set_light(config.light().overridden_by(&self.light.stated()));
        config.two_sided_lights = self.two_sided_lights.then_some(true).or(config.two_sided_lights);
        config.obstructions = self.obstructions.or(config.obstructions);
        config.engine = self.engine.or(config.engine);
        config.bounces = self.bounces.or(config.bounces);
        config.paths_per_sample = self.paths_per_sample.or(config.paths_per_sample);
        config.virtual_distance = self.virtual_distance.then_some(true).or(config.virtual_distance);
        config.seed = self.seed.or(config.seed);
        Ok(config)
    }
}

/// Returns the parser of the visibility of objects, whose values have a help of their own.
pub(super) fn obstructions_parser() -> impl TypedValueParser<Value = Obstructions> {
    PossibleValuesParser::new([
        PossibleValue::new("auto").help("On for sections that have geometry inside"),
        PossibleValue::new("on").help("Rays begin at the entry wall"),
        PossibleValue::new("off").help("Rays of interior sections begin at the exit wall"),
    ])
    .map(|name| match name.as_str() {
        "on" => Obstructions::On,
        "off" => Obstructions::Off,
        _ => Obstructions::Auto,
    })
}

fn parse_engine(text: &str) -> Result<Engine, String> {
    match text {
        "path" => Ok(Engine::Path),
        "gather" => Ok(Engine::Gather),
        "cached" => Err("there is no engine `cached` any more; `gather` takes its place, also in \
                         files that it made"
            .to_owned()),
        "captured" => Err("`captured` traces nothing: `holodeck import` makes such files; the \
                           engines that trace are `path` and `gather`"
            .to_owned()),
        other => Err(format!("`{other}` is not an engine; there are `path` and `gather`")),
    }
}

fn parse_rooms(text: &str) -> Result<usize, String> {
    let rooms = text.parse().ok().filter(|rooms| *rooms > 0);
    rooms.ok_or_else(|| "a number of rooms is at least 1".to_owned())
}

/// Returns the parser of stand-ins. Names of files need not be UTF-8.
fn stand_in_parser() -> impl TypedValueParser<Value = (usize, PathBuf)> {
    OsStringValueParser::new().try_map(|text| parse_stand_in(&text))
}

fn parse_stand_in(text: &OsStr) -> Result<(usize, PathBuf), String> {
    // Only a number before the sign counts, because names of files may have signs too.
    let bytes = text.as_bytes();
    let sign = bytes.iter().position(|byte| *byte == b'=');
    let numbered = sign.and_then(|at| {
        let section = std::str::from_utf8(&bytes[..at]).ok()?.trim().parse().ok()?;
        Some((section, OsStr::from_bytes(&bytes[at + 1..])))
    });
    let (section, file) = numbered.unwrap_or((0, text));
    if file.is_empty() {
        Err(format!("`{}` names no file", text.display()))
    } else {
        Ok((section, PathBuf::from(file)))
    }
}

pub(super) fn parse_numbers(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|word| word.trim().parse().ok()).collect();
    let finite = numbers.iter().all(|number: &f64| number.is_finite());
    let triple: Option<[f64; 3]> =
        numbers.try_into().ok().filter(|_| finite && text.split(',').count() == 3);
    triple.ok_or_else(|| format!("`{text}` is not three numbers with commas between"))
}

pub(super) fn parse_section(text: &str) -> Result<config::SectionTable, String> {
    let parts: Vec<[f64; 3]> =
        text.split_whitespace().map(parse_numbers).collect::<Result<_, _>>()?;
    let (origin, axes, grid) = match parts[..] {
        [origin, a, b, c] => (origin, [a, b, c], None),
        [origin, a, b, c, grid] => (origin, [a, b, c], Some(grid)),
        _ => {
            return Err(format!(
                "`{text}` has {} groups; a section is an origin, three axes and perhaps a grid",
                parts.len()
            ));
        }
    };
    let grid = grid.map(|grid| {
        let whole = grid.iter().all(|n| n.fract() == 0.0 && (1.0..=1e6).contains(n));
        whole
            .then(|| grid.map(|n| n as u32))
            .ok_or_else(|| format!("the grid in `{text}` is not three counts"))
    });
    Ok(config::SectionTable {
        name: None,
        origin,
        axes,
        grid: grid.transpose()?,
        exterior: false,
        geometry: None,
        portals: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_read_as_the_manual_words_them() {
        let section = parse_section("0.6,0.6,-4 4.3,0,0 0,4.2,0 0,0,5 8,9,10").unwrap();
        assert_eq!(section.origin, [0.6, 0.6, -4.0]);
        assert_eq!(section.axes, [[4.3, 0.0, 0.0], [0.0, 4.2, 0.0], [0.0, 0.0, 5.0]]);
        assert_eq!(section.grid, Some([8, 9, 10]));
        assert_eq!(parse_section("0,0,0 1,0,0 0,1,0 0,0,1").unwrap().grid, None);
        for bad in [
            "",
            "1,2,3",
            "0,0,0 1,0,0 0,1,0 0,0,x",
            "0,0,0 1,0,0 0,1,0 0,0,1 8,8,0.5",
            "0,0,0 1,0 0,1,0 0,0,1",
        ] {
            assert!(parse_section(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn stand_ins_are_of_the_section_that_they_name() {
        let parse = |bytes: &[u8]| parse_stand_in(OsStr::from_bytes(bytes));
        assert_eq!(parse(b"2=a.obj"), Ok((2, PathBuf::from("a.obj"))));
        assert_eq!(parse(b"a=b.obj"), Ok((0, PathBuf::from("a=b.obj"))));
        let latin = PathBuf::from(OsStr::from_bytes(b"k\xfcche.obj"));
        assert_eq!(parse(b"3=k\xfcche.obj"), Ok((3, latin.clone())));
        assert_eq!(parse(b"k\xfcche.obj"), Ok((0, latin)));
        assert!(parse(b"2=").is_err());
    }

    #[test]
    fn options_override_the_configuration() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("holodeck.toml");
        std::fs::write(&path, "scene = \"a b.obj\"\nbounces = 3\nsky = [1, 2, 3]\n[[section]]\norigin = [0, 0, 0]\naxes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n").unwrap();
        let args = SceneArgs {
            config: Some(path.clone()),
            bounces: Some(0),
            exterior: true,
            ..SceneArgs::default()
        };
        let config = args.resolve(None).unwrap();
        assert_eq!(
            config.scene,
            Some(folder.path().join("a b.obj")),
            "relative to the configuration"
        );
        assert_eq!((config.bounces, config.light().radiance()), (Some(0), Some([1.0, 2.0, 3.0])));
        assert!(config.section[0].exterior);
        std::fs::write(&path, "bouncs = 3\n").unwrap();
        let error = format!("{:#}", args.resolve(None).unwrap_err());
        assert!(error.contains("holodeck.toml") && error.contains("bouncs"), "{error}");
    }
}
