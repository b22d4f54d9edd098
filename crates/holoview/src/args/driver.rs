//! Options that choose a driver.

use std::{ffi::OsString, path::PathBuf};

use clap::{Args, ValueEnum};
use holo_denoise::{DenoiseError, Denoiser, Quality};

/// What turns samples into a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum DriverArg {
    /// `surfaces`; for a scene that cannot be read, cells of the samples (`--cells`)
    #[default]
    Auto,
    /// Light kept on the scene's surfaces for the whole session: shows all that is known of a new
    /// view at once
    Surfaces,
    /// Means over the leaves of a quadtree, as large as noise asks; needs no scene
    Quadtree,
    /// The render cache: what is known is projected into every view, gaps are filled; needs no scene
    Pointimage,
    /// Each pixel shows its newest rays; needs no scene
    Frameless,
}

impl DriverArg {
    /// Returns the drivers' names, without `auto`, which is one of the others.
    pub fn names() -> Vec<&'static str> {
        let named = DriverArg::value_variants().iter().filter(|driver| **driver != Self::Auto);
        named.map(|driver| driver.name()).collect()
    }

    /// Returns the driver's name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Surfaces => "surfaces",
            Self::Quadtree => "quadtree",
            Self::Pointimage => "pointimage",
            Self::Frameless => "frameless",
        }
    }
}

/// Which driver, and what it is told.
#[derive(Args, Clone, Debug, Default)]
pub struct DriverArgs {
    /// What turns samples into a picture
    #[arg(long, value_enum, default_value_t)]
    pub driver: DriverArg,
    /// Draw cells of samples alone, even where there is a scene
    #[arg(long, value_enum, value_name = "FILLING")]
    pub cells: Option<CellsArg>,
    /// Of the driver `surfaces`: denoise the light of views at rest by Open Image Denoise. `auto`:
    /// if it is installed; `off`; or the file of its library
    #[arg(long, value_name = "auto|off|FILE", default_value = "auto")]
    pub denoise: DenoiseArg,
    /// Whether somebody walks, who may change to a driver that draws from the scene.
    #[arg(skip)]
    pub walks: bool,
}

/// Whether light is denoised by Open Image Denoise.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DenoiseArg {
    /// If it is installed.
    #[default]
    Auto,
    /// Never.
    Off,
    /// By this library.
    Library(PathBuf),
}

impl From<OsString> for DenoiseArg {
    fn from(text: OsString) -> Self {
        match text.to_str() {
            Some("auto") => Self::Auto,
            Some("off") => Self::Off,
            _ => Self::Library(text.into()),
        }
    }
}

impl DenoiseArg {
    /// Loads the denoiser; `None` if there is none or none is wanted.
    ///
    /// # Errors
    /// If a library was named, and cannot be loaded.
    pub fn load(&self, quality: Quality) -> Result<Option<Denoiser>, DenoiseError> {
        match self {
            Self::Auto => Ok(Denoiser::load(None, quality).ok()),
            Self::Off => Ok(None),
            Self::Library(path) => Denoiser::load(Some(path), quality).map(Some),
        }
    }
}

impl DriverArgs {
    /// Refuses what would do nothing, and a denoiser that cannot be loaded.
    ///
    /// # Errors
    /// A text for people.
    pub fn check(&self) -> Result<(), String> {
        if let DenoiseArg::Library(_) = self.denoise {
            if !matches!(self.driver, DriverArg::Surfaces | DriverArg::Auto) {
                return Err("--denoise is for --driver surfaces".to_owned());
            }
            self.denoise.load(Quality::Balanced).map_err(|error| error.to_string())?;
        }
        match (self.driver, self.cells) {
            (DriverArg::Auto, _) | (_, None) => Ok(()),
            (driver, Some(_)) => {
                let name = driver.name();
                Err(format!("{name} has no cells: leave out --driver {name} or --cells"))
            }
        }
    }
}

/// What cells show: see [`holo_driver_quadtree::Filling`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CellsArg {
    /// Colours that go from sample to sample of a surface; means where a pixel has many [what is used where there is no scene]
    Smooth,
    /// Each the colour of its sample, as in the paper (Larson & Simmons 1999)
    Constant,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drivers_have_the_names_of_the_command_line() {
        for name in DriverArg::names() {
            assert_eq!(DriverArg::from_str(name, false).map(DriverArg::name), Ok(name));
        }
        assert_eq!(DriverArg::names().len() + 1, DriverArg::value_variants().len());
    }
}
