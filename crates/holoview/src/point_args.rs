//! What the render cache can be told: options, and the parts of it that are switched.

use clap::{Args, ValueEnum};
use holo_display::pointimage::{EmptyPixels, PointImageParams, Smoothing, Stages};

/// Samples that a point averages while the view moves. The driver's own default is for renderers without noise; one path a sample is
/// all that some engines give.
const MOVING_MEAN: u32 = 32;

/// Threads that a frame may use at most: more do not make it faster.
const MAX_THREADS: usize = 8;

/// Of the options in help texts.
const HEADING: &str = "Render cache (--driver pointimage)";

/// What the render cache can be told.
#[derive(Args, Clone, Debug, Default)]
pub struct PointArgs {
    /// Which pixels with a sample of their own are blurred with their neighbours
    #[arg(long, value_enum, value_name = "WHERE", default_value_t, help_heading = HEADING)]
    pub smoothing: SmoothingArg,
    /// What a pixel shows that no sample is near
    #[arg(long, value_enum, value_name = "WHAT", default_value_t, help_heading = HEADING)]
    pub empty_pixels: EmptyArg,
    /// Leave out parts of the method, such as `prediction,dither`
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PART,…", help_heading = HEADING)]
    pub without: Vec<Part>,
}

/// See [`Smoothing`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SmoothingArg {
    /// All of them
    Everywhere,
    /// Those whose sample was made for another view: a picture at rest is sharp
    #[default]
    Old,
    /// None: only gaps are filled
    Gaps,
}

/// See [`EmptyPixels`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum EmptyArg {
    /// What it showed before
    #[default]
    Keep,
    /// Nothing
    Black,
}

/// A part of the render cache that can be left out; see [`Stages`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Samples grow older with every new one
    Ageing,
    /// The oldest samples leave
    Eviction,
    /// Rays for where the view is about to turn
    Prediction,
    /// Removal of samples that show through nearer surfaces
    DepthCull,
    /// Gaps filled from 7×7 pixels
    Prefilter,
    /// Gaps filled from 3×3 pixels
    Interpolation,
    /// Rays where they are wanted most
    Dither,
    /// New samples compared and averaged with the old one of their pixel
    Resampling,
}

impl Part {
    /// Where it is switched.
    pub fn of(self, stages: &mut Stages) -> &mut bool {
        match self {
            Part::Ageing => &mut stages.ageing,
            Part::Eviction => &mut stages.eviction,
            Part::Prediction => &mut stages.prediction,
            Part::DepthCull => &mut stages.depth_cull,
            Part::Prefilter => &mut stages.prefilter,
            Part::Interpolation => &mut stages.interpolation,
            Part::Dither => &mut stages.dither,
            Part::Resampling => &mut stages.resampling,
        }
    }
}

impl PointArgs {
    /// For the driver.
    pub fn params(&self) -> PointImageParams {
        let mut stages = Stages::ALL;
        self.without.iter().for_each(|part| *part.of(&mut stages) = false);
        let smoothing = match self.smoothing {
            SmoothingArg::Everywhere => Smoothing::Everywhere,
            SmoothingArg::Old => Smoothing::WhereOld,
            SmoothingArg::Gaps => Smoothing::Gaps,
        };
        let empty = match self.empty_pixels {
            EmptyArg::Keep => EmptyPixels::KeepLast,
            EmptyArg::Black => EmptyPixels::Black,
        };
        let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get().min(MAX_THREADS));
        let moving_mean = MOVING_MEAN;
        PointImageParams { stages, smoothing, empty, threads, moving_mean, ..PointImageParams::default() }
    }
}
