//! What can be chosen: stages on and off, the papers' constants, memory and processor.

use super::settings::SETTINGS;
use glam::DVec3;
use holo_cpu::{Instructions, Isa};
use holo_picture::PictureError;

/// Why a [`PointImage`](super::PointImage) cannot be made or changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PointImageError {
    /// The size of the picture is outside the limits.
    #[error(transparent)]
    Size(#[from] PictureError),
    /// A parameter that makes no sense.
    #[error("{name} is {value}: it must be {wanted}")]
    Parameter {
        /// The field of [`PointImageParams`].
        name: &'static str,
        /// What it is.
        value: f64,
        /// What it must be.
        wanted: &'static str,
    },
    /// A name that is no number's.
    #[error("there is no setting {name}: there are {known}")]
    Unknown {
        /// What was given.
        name: String,
        /// What there is.
        known: String,
    },
    /// Instructions that this processor lacks.
    #[error("this processor has no {0:?} instructions")]
    Instructions(Instructions),
}

/// The stages of a frame, in their order (Walter et al. 2002, Figure 1 and Table 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Ages all points, evicts the oldest, takes new samples in.
    UpdatePoints,
    /// Where points fall in the predicted view, at a quarter of the resolution (§3.1).
    PredictedProjection,
    /// Requests for the empty parts of the predicted view (§3.1).
    PredictedSampling,
    /// Points to pixels, in buckets by tile (§3.2).
    ProjectAndTileSort,
    /// Nearest point of each pixel, tile by tile (§3.2).
    ZBufferTiles,
    /// Removes points that show through nearer surfaces (1999, §3.1).
    DepthCull,
    /// Means over 7×7 pixels (§3.3).
    Prefilter,
    /// Means over 3×3 pixels weighted 4-2-1 where there are points, and the priority of each pixel (1999, §3.1 and §4).
    Interpolate,
    /// Error-diffusion dither of the priorities into requests (1999, §4).
    Sampling,
}

impl Stage {
    /// All, in their order.
    pub const ALL: [Self; 9] = [
        Self::UpdatePoints,
        Self::PredictedProjection,
        Self::PredictedSampling,
        Self::ProjectAndTileSort,
        Self::ZBufferTiles,
        Self::DepthCull,
        Self::Prefilter,
        Self::Interpolate,
        Self::Sampling,
    ];

    /// As in the paper's table.
    pub fn name(self) -> &'static str {
        match self {
            Self::UpdatePoints => "Update Points",
            Self::PredictedProjection => "Predicted Projection",
            Self::PredictedSampling => "Predicted Sampling",
            Self::ProjectAndTileSort => "Project and Tile Sort",
            Self::ZBufferTiles => "Z-Buffer Tiles",
            Self::DepthCull => "Depth Cull",
            Self::Prefilter => "Prefilter",
            Self::Interpolate => "Interpolate / Smooth",
            Self::Sampling => "Sampling",
        }
    }
}

/// Which stages run; may change between any two frames. Projection and z-buffer always do: they are the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stages {
    /// Points grow older each frame. Off, they still get old by hints and by changes of colour.
    pub ageing: bool,
    /// Points of age 255 leave (2002, §3.4). Off, they stay until they are overwritten.
    pub eviction: bool,
    /// Predicted projection and sampling (2002, §3.1).
    pub prediction: bool,
    /// Depth cull.
    pub depth_cull: bool,
    /// The 7×7 filter (2002, §3.3).
    pub prefilter: bool,
    /// The 3×3 filter. Off, pixels show their points alone.
    pub interpolation: bool,
    /// Requests where priority is high. Off, they fall anywhere with equal chance.
    pub dither: bool,
    /// Requests go through the old point, which is kept if its colour has not changed (1999, §4.1). Off, they go anywhere in the
    /// pixel, and each brings a new point.
    pub resampling: bool,
}

impl Stages {
    /// Everything in the two papers.
    pub const ALL: Self = Self {
        ageing: true,
        eviction: true,
        prediction: true,
        depth_cull: true,
        prefilter: true,
        interpolation: true,
        dither: true,
        resampling: true,
    };
    /// The names of the parts, as [`switch`](Self::switch) takes them.
    pub const NAMES: [&str; 8] = [
        "ageing",
        "eviction",
        "prediction",
        "depth-cull",
        "prefilter",
        "interpolation",
        "dither",
        "resampling",
    ];

    /// Switches the part of a name in [`NAMES`](Self::NAMES) on or off. Returns whether there is
    /// such a part.
    pub fn switch(&mut self, name: &str, on: bool) -> bool {
        let part = match name {
            "ageing" => &mut self.ageing,
            "eviction" => &mut self.eviction,
            "prediction" => &mut self.prediction,
            "depth-cull" => &mut self.depth_cull,
            "prefilter" => &mut self.prefilter,
            "interpolation" => &mut self.interpolation,
            "dither" => &mut self.dither,
            "resampling" => &mut self.resampling,
            _ => return false,
        };
        *part = on;
        true
    }

    /// What the first paper had (1999): no eviction, prediction or prefilter.
    pub const OF_1999: Self =
        Self { eviction: false, prediction: false, prefilter: false, ..Self::ALL };
}

/// What a pixel shows that no point is near.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmptyPixels {
    /// What it showed before.
    KeepLast,
    /// 0.
    Black,
}

/// Where the 3×3 filter blurs a pixel that has a point of its own (1999, §3.1, footnote 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Smoothing {
    /// Everywhere, as in the papers.
    Everywhere,
    /// Only where the point is not a sample of this very view: a picture at rest becomes sharp.
    WhereOld,
    /// Nowhere: the filter only fills gaps.
    Gaps,
}

/// Settings of a [`PointImage`](super::PointImage): every number of the two papers, theirs being the default. Numbers also go by their
/// names ([`set`](Self::set), [`SETTINGS`]).
///
/// Some of the papers' numbers are the method itself, and fixed. Depths are compared with those of 3×3 pixels (1999, §3.1): farther off
/// there are other surfaces, and near slanted ones they would differ by more than any threshold. What is left of a pixel's priority
/// goes in halves to the next pixel and to the one below (§4): in whole numbers halves lose nothing, and so the choice is the same on any
/// processor. Ages are bytes (2002, §3.4). How large tiles are (2002, §3.2) changes no picture, and follows from the caches.
#[derive(Clone, Debug, PartialEq)]
pub struct PointImageParams {
    /// Which stages run.
    pub stages: Stages,
    /// Points per pixel: 1 to 8. The papers keep "slightly more" than one (1999, §4.3).
    pub points_per_pixel: f64,
    /// Positions are kept in f32 from here: a point of the scene near where eyes go. None: the first frame's eye.
    pub origin: Option<DVec3>,
    /// What pixels without points nearby show.
    pub empty: EmptyPixels,
    /// Where pixels with a point are smoothed.
    pub smoothing: Smoothing,
    /// New points take the oldest of this many slots (1999, §4.3): 1, 2, 4 and so on to 64.
    pub group: u32,
    /// Age at which points are overwritten on average if nothing makes them older: ageing is set by that (2002, §3.4). 1 to 254.
    pub mean_last_age: f64,
    /// Age at which points leave even if nothing overwrites them (2002, §3.4): 1 to 255.
    pub eviction_age: u8,
    /// A point is culled if it is deeper than 1 + this times its neighbourhood's mean (1999, §3.1): above 0.
    pub cull_threshold: f32,
    /// Weight of the middle one of three pixels, those beside it counting 1: its square, itself and 1 are the 3×3 filter's (4-2-1 by 2;
    /// 1999, §3.1). 1 to 8.
    pub centre_weight: u8,
    /// Pixels along the side of the wide filter's window (2002, §3.3): 3, 5, 7 or 9.
    pub prefilter_window: u32,
    /// Priority of a pixel without a point if all eight around it have one, of 255 if none has (1999, §4). 0 to 255.
    pub gap_priority: u8,
    /// Pixels along the side of a pixel of the predicted view (2002, §3.1): 1 to 16.
    pub predicted_block: u32,
    /// Share of a frame's requests that prediction may take at most (2002, §3.1): 0 to 1.
    pub predicted_share: f64,
    /// A resampled colour has changed if a channel differs by more than this share of the larger colour's largest
    /// channel, and by more than the noise may be (1999, §4.1 and §4.2): above 0.
    pub change_threshold: f32,
    /// Standard deviations of the noise that the engine stated that are not yet a change (1999, §4.2): at least 0.
    pub noise_deviations: f32,
    /// A resampled ray has met something else if its depth differs by more than this share of the old point's: above 0, below 1.
    pub move_threshold: f64,
    /// Units of age by which points next to a changed one grow older (1999, §4.1): 0 to 255.
    pub change_ageing: u8,
    /// How many pixels from a changed one are next to it: 0 to 8.
    pub change_reach: u32,
    /// How many times as fast points age that are not visible (1999, §4.1): 1 to 16.
    pub hidden_ageing: u8,
    /// How many times as fast points age that the engine says are likely to change, such as highlights (1999, §4.2): 1 to 16.
    pub highlight_ageing: u8,
    /// Weight of the mean over 7×7 pixels ([`prefilter_window`](Self::prefilter_window)) beside the 3×3 filter, whose own is up to 16, where samples state a noise of a tenth of
    /// themselves or more, or do not know it; in proportion below. 0: as in the papers. At rest it fades as samples of a pixel
    /// grow. At least 0.
    pub noise_smoothing: f32,
    /// Samples that a point's colour averages at most while the view moves: at least 1. More is smoother and follows
    /// changes of view more slowly.
    pub moving_mean: u32,
    /// Samples that a pixel's colour averages at most at rest: at least 1.
    pub resting_mean: u32,
    /// At rest, one request in this many goes through the old point to see whether it has changed: at least 2; the
    /// others go anywhere in the pixel.
    pub check_every: u32,
    /// Threads that a frame may use: 1 to 64. The picture does not depend on it.
    pub threads: usize,
    /// Instructions to use. The picture does not depend on it.
    pub instructions: Instructions,
    /// Chooses the jitter.
    pub seed: u32,
}

impl Default for PointImageParams {
    fn default() -> Self {
        Self {
            stages: Stages::ALL,
            points_per_pixel: 1.125,
            origin: None,
            empty: EmptyPixels::KeepLast,
            smoothing: Smoothing::WhereOld,
            group: 8,
            mean_last_age: 128.0,
            eviction_age: 255,
            cull_threshold: 0.1,
            centre_weight: 2,
            prefilter_window: 7,
            gap_priority: 135,
            predicted_block: 4,
            predicted_share: 0.5,
            change_threshold: 0.1,
            noise_deviations: 3.0,
            move_threshold: 0.1,
            change_ageing: 64,
            change_reach: 1,
            hidden_ageing: 3,
            highlight_ageing: 3,
            noise_smoothing: 8.0,
            moving_mean: 8,
            resting_mean: u32::MAX,
            check_every: 8,
            threads: 1,
            instructions: Instructions::best(),
            seed: 0,
        }
    }
}

impl PointImageParams {
    /// Changes a number by its name in [`SETTINGS`] (`-` is `_` too).
    ///
    /// # Errors
    /// No such name, a number that it may not be.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), PointImageError> {
        let wanted = name.replace('-', "_");
        let Some(setting) = SETTINGS.iter().find(|setting| setting.name == wanted) else {
            let known: Vec<_> = SETTINGS.iter().map(|setting| setting.name).collect();
            return Err(PointImageError::Unknown {
                name: name.to_owned(),
                known: known.join(", "),
            });
        };
        setting.put(self, value)
    }

    pub(super) fn check(&self) -> Result<Isa, PointImageError> {
        SETTINGS.iter().try_for_each(|setting| setting.check(setting.value(self)))?;
        if !(1..=64).contains(&self.threads) {
            let value = self.threads as f64;
            return Err(PointImageError::Parameter { name: "threads", value, wanted: "1 to 64" });
        }
        if let Some(origin) = self.origin.filter(|origin| !origin.is_finite()) {
            let value = origin.x + origin.y + origin.z;
            return Err(PointImageError::Parameter { name: "origin", value, wanted: "finite" });
        }
        Isa::new(self.instructions).ok_or(PointImageError::Instructions(self.instructions))
    }
}
