//! Options that choose how pictures look as `.png`.

use std::path::Path;

use anyhow::Result;
use clap::{Args, ValueEnum};
use holo_picture::{Exposure, Format, Look, Picture, Scale, Scaling, Tone};

/// The look of pictures for people. They never change pictures of radiance (.exr .hdr .pfm).
#[derive(Args, Clone, Copy, Debug, Default, PartialEq)]
pub struct LookArgs {
    /// Brightness: `auto`; stops relative to it, such as +1 or -0.5; or =FACTOR, such as =0.03,
    /// which multiplies radiance [default: auto; for `picture`, what the holodeck stores]
    #[arg(long, value_name = "auto|STOPS|=FACTOR", value_parser = parse_exposure, allow_hyphen_values = true)]
    pub exposure: Option<Exposure>,
    /// How radiance is mapped to display tones [default: soft]
    #[arg(long, value_enum)]
    pub tone: Option<ToneArg>,
    /// Show luminance as colours, from MIN to MAX cd/m² [default: 0 to the 99th percentile, rounded
    /// up; with --log from the 1st percentile]
    #[arg(long, value_name = "MIN:MAX", num_args = 0..=1, require_equals = true, value_parser = parse_range)]
    pub falsecolor: Option<Option<Range>>,
    /// Draw lines of equal luminance; the range is as for --falsecolor
    #[arg(long, value_name = "MIN:MAX", num_args = 0..=1, require_equals = true, value_parser = parse_range)]
    pub contours: Option<Option<Range>>,
    /// A logarithmic scale for --falsecolor and --contours
    #[arg(long)]
    pub log: bool,
    /// Leave out the legend of --falsecolor and --contours, which makes pictures wider
    #[arg(long)]
    pub no_legend: bool,
}

/// Names of tones: see [`Tone`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ToneArg {
    /// Proportional to light, with a soft shoulder below white
    Soft,
    /// Proportional to light, clipped at white
    Linear,
    /// Dark and bright parts at once, without exaggerating contrast
    Camera,
    /// Simulates an eye at the place: contrast, glare, and less detail and colour in the dark
    Human,
}

/// A stated range of luminances, in cd/m².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    least: f32,
    most: f32,
}

impl LookArgs {
    /// Returns the look that the options describe.
    ///
    /// # Errors
    /// A text for the user, if options contradict each other or would have no effect.
    pub fn look(&self) -> Result<Look, String> {
        let (false_color, contours) = (self.falsecolor.is_some(), self.contours.is_some());
        let tone = match self.tone.unwrap_or(ToneArg::Soft) {
            ToneArg::Soft => Tone::Soft,
            ToneArg::Linear => Tone::Linear,
            ToneArg::Camera => Tone::Camera,
            ToneArg::Human => Tone::Human,
        };
        if false_color && (self.tone.is_some() || self.exposure.is_some()) {
            return Err("--falsecolor shows no tones: leave out --tone and --exposure".into());
        }
        if matches!(self.exposure, Some(Exposure::Factor(_)))
            && matches!(tone, Tone::Camera | Tone::Human)
        {
            return Err("--exposure =FACTOR is for --tone soft and linear; give stops, such as \
                        --exposure +1"
                .into());
        }
        if !false_color && !contours && (self.log || self.no_legend) {
            let option = if self.log { "--log" } else { "--no-legend" };
            return Err(format!("{option} needs --falsecolor or --contours"));
        }
        let range = match (self.falsecolor.flatten(), self.contours.flatten()) {
            (Some(colors), Some(lines)) if colors != lines => {
                return Err("--falsecolor and --contours share one range: state it once".into());
            }
            (colors, lines) => colors.or(lines),
        };
        let scaling = match range {
            Some(range) => Scaling::Fixed(
                Scale::new(range.least, range.most, self.log).map_err(|error| error.to_string())?,
            ),
            None => Scaling::Auto { log: self.log },
        };
        let exposure = self.exposure.unwrap_or_default();
        Ok(Look { exposure, tone, false_color, contours, scaling })
    }

    /// Returns the same options with the exposure that the holodeck stores, unless an exposure was
    /// given. Stops are relative to the stored exposure. Tones without an exposure, and false
    /// colours, stay as they are.
    #[must_use]
    pub fn with_kept_exposure(self, kept: Option<f32>) -> LookArgs {
        let has_factor = matches!(self.tone, None | Some(ToneArg::Soft | ToneArg::Linear));
        let Some(kept) = kept.filter(|_| has_factor && self.falsecolor.is_none()) else {
            return self;
        };
        let exposure = match self.exposure {
            None => Exposure::Factor(kept),
            Some(Exposure::Stops(stops)) => Exposure::Factor(kept * stops.exp2()),
            Some(other) => other,
        };
        LookArgs { exposure: Some(exposure), ..self }
    }

    /// Writes a picture: with this look if the file is a `.png`, as radiance otherwise. Returns the
    /// factor from radiance to display light, if there is one.
    ///
    /// # Errors
    /// The errors of [`look`](Self::look), or the file cannot be written.
    pub fn write(&self, picture: &Picture, path: &Path) -> Result<Option<f32>> {
        if Format::of_path(path) != Some(Format::Png) {
            picture.write(path)?;
            return Ok(None);
        }
        let image = self.look().map_err(anyhow::Error::msg)?.show(picture);
        let image = if self.no_legend { image } else { image.with_legend() };
        image.write(path)?;
        Ok(image.exposure)
    }

    /// Refuses options that contradict each other, or that would not change the file.
    ///
    /// # Errors
    /// A text for the user.
    pub fn check(&self, path: &Path) -> Result<(), String> {
        if *self != LookArgs::default() && Format::of_path(path) != Some(Format::Png) {
            return Err(format!(
                "--exposure, --tone, --falsecolor and --contours change .png pictures only: {} \
                 holds radiance",
                path.display()
            ));
        }
        self.look().map(drop)
    }
}

fn parse_exposure(text: &str) -> Result<Exposure, String> {
    let number = |text: &str| text.parse::<f32>().ok().filter(|number| number.is_finite());
    let exposure = match text.strip_prefix('=') {
        _ if text == "auto" => Some(Exposure::Auto),
        Some(factor) => number(factor).filter(|factor| *factor > 0.0).map(Exposure::Factor),
        None => number(text).filter(|stops| stops.abs() <= 60.0).map(Exposure::Stops),
    };
    exposure.ok_or_else(|| {
        "write auto, stops from -60 to 60 such as +1, or a factor above 0 such as =0.03".into()
    })
}

fn parse_range(text: &str) -> Result<Range, String> {
    let ends = text.split_once(':').and_then(|(least, most)| {
        Some(Range { least: least.trim().parse().ok()?, most: most.trim().parse().ok()? })
    });
    let range = ends.ok_or("write MIN:MAX in cd/m², such as 10:1000")?;
    Scale::new(range.least, range.most, false).map_err(|error| error.to_string())?;
    Ok(range)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        look: LookArgs,
        file: Option<String>,
    }

    fn look(line: &str) -> Result<Look, String> {
        let words = std::iter::once("p").chain(line.split_whitespace());
        let program = Program::try_parse_from(words).map_err(|error| error.to_string())?;
        program.look.look()
    }

    #[test]
    fn options_choose_the_look() {
        let plain = Look::default();
        assert_eq!(look("").unwrap(), plain);
        assert_eq!(look("--exposure auto --tone soft").unwrap(), plain);
        for (text, exposure) in [
            ("-1.5", Exposure::Stops(-1.5)),
            ("+1", Exposure::Stops(1.0)),
            ("=0.03", Exposure::Factor(0.03)),
        ] {
            let tone = Tone::Linear;
            let line = format!("--exposure {text} --tone linear");
            assert_eq!(look(&line).unwrap(), Look { exposure, tone, ..plain });
        }
        let scaling = Scaling::Auto { log: true };
        let expected = Look { contours: true, tone: Tone::Human, scaling, ..plain };
        assert_eq!(look("--contours --log --tone human").unwrap(), expected);
        let scaling = Scaling::Fixed(Scale::new(10.0, 1000.0, true).unwrap());
        let expected = Look { false_color: true, scaling, ..plain };
        assert_eq!(look("--falsecolor=10:1000 --log --no-legend").unwrap(), expected);
        let both = Look { contours: true, ..expected };
        assert_eq!(look("--falsecolor --contours=10:1000 --log").unwrap(), both);
    }

    #[test]
    fn pictures_have_the_stored_exposure_unless_another_is_given() {
        let kept = |line: &str| {
            let words = std::iter::once("p").chain(line.split_whitespace());
            let look = Program::try_parse_from(words).unwrap().look;
            look.with_kept_exposure(Some(0.25)).look().unwrap().exposure
        };
        assert_eq!(kept(""), Exposure::Factor(0.25));
        assert_eq!(kept("--tone linear --exposure +1"), Exposure::Factor(0.5));
        assert_eq!(kept("--exposure auto"), Exposure::Auto);
        assert_eq!(kept("--exposure =3"), Exposure::Factor(3.0));
        assert_eq!(kept("--tone human --exposure +1"), Exposure::Stops(1.0));
        assert_eq!(kept("--falsecolor"), Exposure::Auto);
        let plain = LookArgs::default();
        assert_eq!(plain.with_kept_exposure(None), plain);
    }

    #[test]
    fn a_range_is_never_mistaken_for_a_file_nor_a_file_for_a_range() {
        let program = Program::try_parse_from(["p", "--falsecolor", "room.holo"]).unwrap();
        assert_eq!(program.file.as_deref(), Some("room.holo"));
        assert_eq!(program.look.falsecolor, Some(None));
    }

    #[test]
    fn wrong_options_are_explained() {
        for (line, part) in [
            ("--exposure bright", "write auto"),
            ("--exposure =0", "above 0"),
            ("--exposure =-3", "above 0"),
            ("--exposure nan", "write auto"),
            ("--tone camera --exposure =2", "give stops"),
            ("--falsecolor=3", "write MIN:MAX"),
            ("--falsecolor=3:1", "3 to 1 cd/m² is no range"),
            ("--falsecolor=0:100 --log", "cannot begin at 0"),
            ("--falsecolor --tone human", "leave out --tone"),
            ("--falsecolor=1:2 --contours=1:3", "state it once"),
            ("--log", "--log needs"),
            ("--no-legend", "--no-legend needs"),
            ("--tone film", "camera"),
        ] {
            let error = look(line).unwrap_err();
            assert!(error.contains(part), "{line}: {error}");
        }
    }
}
