//! What can be chosen: the stages that run, the papers' numbers, and what pixels show.

use holo_picture::PictureError;

use crate::stage::Stages;

/// The reason why a [`PointImage`](crate::PointImage) cannot be made or changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PointImageError {
    /// The size of the picture is outside the limits.
    #[error(transparent)]
    Size(#[from] PictureError),
    /// A number is outside its range.
    #[error("{name} is {value}: it must be {wanted}")]
    Parameter {
        /// The field of [`PointImageParams`].
        name: &'static str,
        /// The number given.
        value: f64,
        /// What it may be.
        wanted: &'static str,
    },
    /// No number has this name.
    #[error("there is no setting {name}: there are {known}")]
    Unknown {
        /// The name given.
        name: String,
        /// All names.
        known: String,
    },
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

/// Settings of a [`PointImage`](crate::PointImage): every number of the two papers, theirs being
/// the default. [`set`](Self::set) changes a number by its name in [`SETTINGS`](crate::SETTINGS).
///
/// Some of the papers' numbers are the method itself, and fixed:
/// - Depths are compared with those of 3×3 pixels (1999, §3.1). Farther off there are other
///   surfaces, and depths near slanted ones would differ by more than any threshold.
/// - What is left of a pixel's priority goes in halves to the next pixel and to the one below (§4).
/// - Ages are bytes (2002, §3.4).
/// - The size of tiles (2002, §3.2) changes no picture, and follows from processors' caches.
#[derive(Clone, Debug, PartialEq)]
pub struct PointImageParams {
    /// The stages that run.
    pub stages: Stages,
    /// Points per pixel: 1 to 8. The papers keep "slightly more" than one (1999, §4.3).
    pub points_per_pixel: f64,
    /// What pixels without points nearby show.
    pub empty: EmptyPixels,
    /// Where pixels with a point are smoothed.
    pub smoothing: Smoothing,
    /// New points take the oldest of this many slots (1999, §4.3): 1, 2, 4 and so on to 64.
    pub group: u32,
    /// Age at which points are overwritten on average if nothing makes them older. It sets the pace
    /// of ageing (2002, §3.4). 1 to 254.
    pub mean_last_age: f64,
    /// Age at which points leave even if nothing overwrites them (2002, §3.4): 1 to 255.
    pub eviction_age: u8,
    /// A point is culled if it is deeper than 1 + this times its neighbourhood's mean (1999, §3.1):
    /// above 0.
    pub cull_threshold: f32,
    /// Weight of the middle one of three pixels, those beside it counting 1 (1999, §3.1): 1 to 8.
    /// The 3×3 weights are its square, itself and 1: 4-2-1 by 2.
    pub centre_weight: u8,
    /// Pixels along the side of the wide filter's window (2002, §3.3): 3, 5, 7 or 9.
    pub prefilter_window: u32,
    /// Priority of a pixel without a point if all eight around it have one, of 255 if none has
    /// (1999, §4): 0 to 255.
    pub gap_priority: u8,
    /// Pixels along the side of a pixel of the predicted view (2002, §3.1): 1 to 16.
    pub predicted_block: u32,
    /// Share of a frame's requests that prediction may take at most (2002, §3.1): 0 to 1.
    pub predicted_share: f64,
    /// A resampled colour has changed if a channel differs by more than this share of the larger
    /// colour's largest channel, beyond what noise explains (1999, §4.1 and §4.2): above 0.
    pub change_threshold: f32,
    /// Standard deviations of stated noise that are not yet a change (1999, §4.2): at least 0.
    pub noise_deviations: f32,
    /// A resampled ray has met something else if its depth differs by more than this share of the
    /// old point's: above 0, below 1.
    pub move_threshold: f64,
    /// Units of age that points next to a changed one gain (1999, §4.1): 0 to 255.
    pub change_ageing: u8,
    /// Pixels from a changed one that are next to it: 0 to 8.
    pub change_reach: u32,
    /// How many times as fast points age that no pixel shows (1999, §4.1): 1 to 16.
    pub hidden_ageing: u8,
    /// Weight of the prefilter's mean beside the 3×3 filter, whose own is up to 16: at least 0, and
    /// 0 in the papers.
    ///
    /// It counts in full if samples state a noise of a tenth of their light or more, or unknown
    /// noise, and in proportion below. At rest it fades as the samples of a pixel grow.
    pub noise_smoothing: f32,
    /// Samples that a point's colour averages at most while the view moves: at least 1. More is
    /// smoother and follows changes of view more slowly.
    pub moving_mean: u32,
    /// Samples that a pixel's colour averages at most at rest: at least 1.
    pub resting_mean: u32,
    /// At rest, one request in this many goes through the old point to see whether it has changed:
    /// at least 2. The others go anywhere in the pixel.
    pub check_every: u32,
    /// Chooses the jitter.
    pub seed: u32,
}

impl Default for PointImageParams {
    fn default() -> Self {
        Self {
            stages: Stages::ALL,
            points_per_pixel: 1.125,
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
            noise_smoothing: 8.0,
            moving_mean: 8,
            resting_mean: u32::MAX,
            check_every: 8,
            seed: 0,
        }
    }
}
