//! Options that choose a driver.

use std::{ffi::OsString, path::PathBuf, sync::Arc};

use clap::{Args, ValueEnum};
use holo_denoise::{DenoiseError, Denoiser, Quality};
use holo_driver_splats::SplatShape;
use holo_session::{DriverArg, HazeOption};
use holo_splats::{SplatError, SplatFile};

use crate::{StereoArgs, WallArgs};

/// The driver and its options.
#[derive(Args, Clone, Debug, Default)]
pub struct DriverArgs {
    /// The driver: the method that turns samples into a picture
    #[arg(long, value_enum, default_value_t)]
    pub driver: DriverArg,
    /// Draw cells from samples only, even if there is a scene
    #[arg(long, value_enum, value_name = "FILLING")]
    pub cells: Option<CellsArg>,
    /// With the driver `surfaces`: denoise the light of views at rest with Open Image Denoise.
    /// `auto`: if it is installed; `off`: never; FILE: with this library
    #[arg(long, value_name = "auto|off|FILE", default_value = "auto")]
    pub denoise: DenoiseArg,
    /// Add haze that is equally dense everywhere: the distance after which 37 % of the light is
    /// left, and its radiance [default radiance: the mean of the sky]
    #[arg(long, value_name = "METRES[,R,G,B]")]
    pub fog: Option<HazeOption>,
    /// Two eyes.
    #[command(flatten)]
    pub stereo: StereoArgs,
    /// The screens of a wall.
    #[command(flatten)]
    pub wall: WallArgs,
    /// With the driver `splats`: what `holodeck splats` has made [default: the holodeck's name with
    /// .splats]
    #[arg(long, value_name = "FILE.splats")]
    pub splats: Option<PathBuf>,
    /// With the driver `splats`: the shape of splats
    #[arg(long, value_enum, value_name = "SHAPE", default_value_t)]
    pub splat_shape: SplatShapeArg,
}

/// See [`SplatShape`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SplatShapeArg {
    /// Squares that face the eye: the fastest
    Square,
    /// Circles that face the eye
    Circle,
    /// Discs on the surfaces
    Ellipse,
    /// Discs that fade towards their edges and blend
    #[default]
    Fuzzy,
}

impl SplatShapeArg {
    /// Returns the shape.
    pub fn shape(self) -> SplatShape {
        match self {
            Self::Square => SplatShape::Square,
            Self::Circle => SplatShape::Circle,
            Self::Ellipse => SplatShape::Ellipse,
            Self::Fuzzy => SplatShape::Fuzzy,
        }
    }
}

/// The choice of a denoiser.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DenoiseArg {
    /// Denoise with Open Image Denoise if it is installed.
    #[default]
    Auto,
    /// Do not denoise.
    Off,
    /// Denoise with this library.
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
    /// Loads the denoiser. Returns `None` if it is switched off, or `Auto` and not installed.
    ///
    /// # Errors
    /// If a library was named and cannot be loaded.
    pub fn load(&self, quality: Quality) -> Result<Option<Denoiser>, DenoiseError> {
        match self {
            Self::Auto => Ok(Denoiser::load(None, quality).ok()),
            Self::Off => Ok(None),
            Self::Library(path) => Denoiser::load(Some(path), quality).map(Some),
        }
    }
}

impl DriverArgs {
    /// Returns a line that names the filter of views at rest. `None` if the driver has none.
    pub fn filter_note(&self) -> Option<String> {
        if !matches!(self.driver, DriverArg::Surfaces | DriverArg::Auto) || self.cells.is_some() {
            return None;
        }
        let library = match &self.denoise {
            DenoiseArg::Off => None,
            DenoiseArg::Auto => holo_denoise::installed(),
            DenoiseArg::Library(path) => Some(path.clone()),
        };
        Some(match library {
            Some(path) => format!("filter: Open Image Denoise ({})", path.display()),
            None if self.denoise == DenoiseArg::Off => "filter: Holodeck's own".to_owned(),
            None => "filter: Holodeck's own. Open Image Denoise shows less noise and is used once \
                     it is installed, for example by `pip install pyoidn`"
                .to_owned(),
        })
    }

    /// Opens the splats that were named.
    ///
    /// # Errors
    /// If they cannot be used, or the driver needs some and none were named.
    pub fn open_splats(&self) -> Result<Option<Arc<SplatFile>>, String> {
        let Some(path) = &self.splats else {
            return match self.driver {
                DriverArg::Splats => Err("--driver splats needs --splats FILE".to_owned()),
                _ => Ok(None),
            };
        };
        let opened = SplatFile::open(path);
        opened.map(|file| Some(Arc::new(file))).map_err(|error| match error {
            SplatError::Io { .. } => error.to_string(),
            _ => format!("{}: {error}", path.display()),
        })
    }

    /// Refuses options that would have no effect, and a denoiser that cannot be loaded.
    ///
    /// # Errors
    /// A text for the user.
    pub fn check(&self) -> Result<(), String> {
        if let DenoiseArg::Library(_) = self.denoise {
            if !matches!(self.driver, DriverArg::Surfaces | DriverArg::Auto) {
                return Err("--denoise is for --driver surfaces".to_owned());
            }
            self.denoise.load(Quality::Balanced).map_err(|error| error.to_string())?;
        }
        self.stereo.check()?;
        self.wall.check()?;
        if self.stereo.stereo.is_some() && !self.wall.screens.is_empty() {
            return Err("--stereo shows no --screen: leave out one of them".to_owned());
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
    /// Colours are interpolated between samples of one surface, and averaged if a pixel has many
    /// [the default without a scene]
    Smooth,
    /// Each cell has the colour of its sample, as in the paper (Larson & Simmons 1999)
    Constant,
}
