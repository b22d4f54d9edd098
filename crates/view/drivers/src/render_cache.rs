//! Options of the render cache, and its parts that can be switched off.

use clap::{Args, ValueEnum, builder::PossibleValuesParser};
use holo_driver_rendercache::{EmptyPixels, PointImageParams, SETTINGS, Smoothing, Stages};

/// Number of samples that a point averages while the view moves. The driver's own default suits
/// renderers without noise. Here a sample may be one noisy path.
const MOVING_MEAN: u32 = 32;

/// Heading of these options in help texts.
const HEADING: &str = "Render cache (--driver pointimage)";

/// Options of the render cache.
#[derive(Args, Clone, Debug, Default)]
pub struct PointArgs {
    /// Which pixels with a sample of their own are blurred with their neighbours
    #[arg(long, value_enum, value_name = "WHERE", default_value_t, help_heading = HEADING)]
    pub smoothing: SmoothingArg,
    /// What a pixel without a nearby sample shows
    #[arg(long, value_enum, value_name = "WHAT", default_value_t, help_heading = HEADING)]
    pub empty_pixels: EmptyArg,
    /// Leave out parts of the method, such as `prediction,dither`
    #[arg(long, value_delimiter = ',', value_name = "PART,…", help_heading = HEADING,
        value_parser = PossibleValuesParser::new(Stages::NAMES))]
    pub without: Vec<String>,
    /// Set numbers of the method, such as `prefilter-window=9,cull-threshold=0.2`
    #[arg(long, value_name = "NAME=NUMBER,…", value_delimiter = ',', value_parser = parse_number, help_heading = HEADING,
        long_help = numbers_help())]
    pub numbers: Vec<(String, f64)>,
}

/// Parses a number of the method with its name. Fails if the name is unknown or the number is out
/// of range.
fn parse_number(said: &str) -> Result<(String, f64), String> {
    let (name, value) = said.split_once('=').ok_or("write NAME=NUMBER")?;
    let value = value.trim().parse().map_err(|_| format!("{value} is no number"))?;
    PointImageParams::default().set(name.trim(), value).map_err(|error| error.to_string())?;
    Ok((name.trim().to_owned(), value))
}

/// Returns the help text, which lists all numbers.
fn numbers_help() -> String {
    let mut help =
        "Set numbers of the method, such as `prefilter-window=9,cull-threshold=0.2`:\n".to_owned();
    let usual = usual();
    for setting in SETTINGS {
        let name = setting.name.replace('_', "-");
        let value = setting.value(&usual);
        // Values are `f32`; printed as `f64` they would have false digits.
        let value =
            if value.fract() == 0.0 { value.to_string() } else { (value as f32).to_string() };
        help += &format!("\n  {name}: {} ({}; {value})", setting.meaning, setting.allowed);
    }
    help
}

/// The parameters that hold if no option is given.
fn usual() -> PointImageParams {
    PointImageParams { moving_mean: MOVING_MEAN, ..PointImageParams::default() }
}

/// See [`Smoothing`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SmoothingArg {
    /// All of them
    Everywhere,
    /// Those whose sample was made for another view, so that a picture at rest is sharp
    #[default]
    Old,
    /// None: only gaps are filled
    Gaps,
}

/// See [`EmptyPixels`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum EmptyArg {
    /// Its colour in the last picture
    #[default]
    Keep,
    /// Black
    Black,
}

impl PointArgs {
    /// Switches a part on or off for drivers that are made from now on.
    pub fn switch(&mut self, part: &str, on: bool) {
        self.without.retain(|without| without != part);
        if !on {
            self.without.push(part.to_owned());
        }
    }

    /// Returns the driver's parameters.
    pub fn params(&self) -> PointImageParams {
        let mut stages = Stages::ALL;
        for part in &self.without {
            // The parser accepts no other names.
            stages.switch(part, false);
        }
        let smoothing = match self.smoothing {
            SmoothingArg::Everywhere => Smoothing::Everywhere,
            SmoothingArg::Old => Smoothing::WhereOld,
            SmoothingArg::Gaps => Smoothing::Gaps,
        };
        let empty = match self.empty_pixels {
            EmptyArg::Keep => EmptyPixels::KeepLast,
            EmptyArg::Black => EmptyPixels::Black,
        };
        let mut params = PointImageParams { stages, smoothing, empty, ..usual() };
        for (name, value) in &self.numbers {
            // The parser has checked them, so this cannot fail.
            let _ = params.set(name, *value);
        }
        params
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        points: PointArgs,
    }

    fn parsed(numbers: &str) -> Result<PointImageParams, String> {
        let command = Command::try_parse_from(["holoview", "--numbers", numbers]);
        command.map(|command| command.points.params()).map_err(|error| error.to_string())
    }

    #[test]
    fn numbers_of_the_method_are_set_by_name() {
        let params = parsed("prefilter-window=9,cull_threshold=0.25,group=16").unwrap();
        assert_eq!((params.prefilter_window, params.cull_threshold, params.group), (9, 0.25, 16));
        assert_eq!(
            PointImageParams { prefilter_window: 7, cull_threshold: 0.1, group: 8, ..params },
            usual()
        );
    }

    #[test]
    fn the_help_has_every_number_and_what_it_is() {
        let help = numbers_help();
        for setting in SETTINGS {
            let name = setting.name.replace('_', "-");
            let line = help
                .lines()
                .find(|line| line.trim_start().starts_with(&format!("{name}: ")))
                .unwrap();
            // Setting a number to its printed value changes nothing.
            let value = line.rsplit(' ').next().unwrap().trim_end_matches(')');
            let params = parsed(&format!("{name}={value}")).unwrap();
            assert_eq!(
                (setting.value(&params) as f32).to_bits(),
                (setting.value(&usual()) as f32).to_bits(),
                "{line}"
            );
        }
    }

    #[test]
    fn wrong_numbers_are_refused_with_a_list_of_what_is_allowed() {
        assert!(
            parsed("prefilter-window=8")
                .unwrap_err()
                .contains("prefilter_window is 8: it must be 3, 5, 7 or 9")
        );
        assert!(
            parsed("window=7")
                .unwrap_err()
                .contains("there is no setting window: there are points_per_pixel,")
        );
        assert!(parsed("group=x").unwrap_err().contains("x is no number"));
        assert!(parsed("group").unwrap_err().contains("write NAME=NUMBER"));
    }
}
