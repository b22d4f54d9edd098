//! The settings of a render cache: its stages, the papers' numbers, and what pixels show.

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
    /// A motion of an object changes lengths, mirrors, or is not finite.
    #[error("an object moves by rotations and translations only")]
    NotRigid,
    /// No number has this name.
    #[error("there is no setting {name}: there are {known}")]
    Unknown {
        /// The name given.
        name: String,
        /// All names.
        known: String,
    },
}

/// The content of a pixel without a point nearby.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmptyPixels {
    /// The pixel shows what it showed before.
    KeepLast,
    /// The pixel is 0.
    Black,
}

/// Where the 3×3 filter blurs a pixel that has a point of its own (1999, §3.1, footnote 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Smoothing {
    /// In every pixel, as in the papers.
    Everywhere,
    /// Only where the point is not a sample of the current view: a picture at rest becomes sharp.
    WhereOld,
    /// In no pixel: the filter only fills gaps.
    Gaps,
}

/// Settings of a [`PointImage`](crate::PointImage): the numbers of the two papers. The defaults are
/// the papers' values unless a field says otherwise. [`set`](Self::set) changes a number by its
/// name in [`SETTINGS`](crate::SETTINGS).
///
/// These numbers of the papers are fixed:
/// - The depth cull compares depths over 3×3 pixels (1999, §3.1). In a wider window, depths of a
///   slanted surface would differ by more than any threshold.
/// - The dither passes half of the remaining priority to the next pixel and half to the one below
///   (1999, §4).
/// - Ages are bytes (2002, §3.4).
/// - The size of tiles (2002, §3.2) changes no picture. It follows from processors' caches.
#[derive(Clone, Debug, PartialEq)]
pub struct PointImageParams {
    /// The stages that run.
    pub stages: Stages,
    /// Points per pixel: 1 to 8. The papers keep "slightly more" than one (1999, §4.3).
    pub points_per_pixel: f64,
    /// The content of pixels without points nearby.
    pub empty: EmptyPixels,
    /// Where pixels with a point are smoothed.
    pub smoothing: Smoothing,
    /// A new point takes the oldest of this many slots (1999, §4.3): 1, 2, 4 and so on to 64.
    pub group: u32,
    /// Mean age at which points are overwritten (2002, §3.4): 1 to 254. It sets the pace of ageing.
    pub mean_last_age: f64,
    /// Age at which points are removed even if nothing overwrites them (2002, §3.4): 1 to 255.
    pub eviction_age: u8,
    /// A point is culled if its depth is above 1 + this times the mean depth of 3×3 pixels (1999,
    /// §3.1): above 0.
    pub cull_threshold: f32,
    /// Weight of the middle of three pixels if the other two have weight 1 (1999, §3.1): 1 to 8.
    /// The weights over 3×3 pixels are its square, itself and 1. With 2 they are 4-2-1.
    pub centre_weight: u8,
    /// Pixels along the side of the wide filter's window (2002, §3.3): 3, 5, 7 or 9.
    pub prefilter_window: u32,
    /// Number of points that the pyramid's colour counts as where points are few: above 0, to
    /// 1000.
    pub pyramid_weight: f32,
    /// Points that are added to that number if the noise of samples is unknown, or as large as
    /// their light: 0 to 1000. Below, they fall with the variance.
    pub noisy_pyramid_weight: f32,
    /// Priority of a pixel without a point if all eight pixels around it have one (1999, §4): 0 to
    /// 255. If none of them has one, the priority is 255.
    pub gap_priority: u8,
    /// Pixels along the side of a pixel of the predicted view (2002, §3.1): 1 to 16.
    pub predicted_block: u32,
    /// Largest share of a frame's requests for the predicted view (2002, §3.1): 0 to 1.
    pub predicted_share: f64,
    /// Least difference of a resampled colour that is a change (1999, §4.1 and §4.2): above 0. It
    /// is a share of the largest channel of both colours. The allowance for noise is added to it.
    pub change_threshold: f32,
    /// The allowance for noise, in standard deviations (1999, §4.2): at least 0.
    pub noise_deviations: f32,
    /// A resampled ray has hit another surface if its depth differs by more than this share of the
    /// old point's depth: above 0, below 1.
    pub move_threshold: f64,
    /// Units of age that are added to the points around a changed one (1999, §4.1): 0 to 255.
    pub change_ageing: u8,
    /// Largest distance of those points from the changed one, pixels: 0 to 8.
    pub change_reach: u32,
    /// Factor of ageing for points that no pixel shows (1999, §4.1): 1 to 16.
    pub hidden_ageing: u8,
    /// Factor of ageing for points that are likely to change (1999, §4.2): 1 to 16.
    pub hint_ageing: u8,
    /// Weight of the prefilter's mean beside the 3×3 filter, whose weights sum to at most 16: at
    /// least 0. In the papers it is 0.
    ///
    /// The weight counts in full if the noise of samples is unknown, or a tenth of their light or
    /// more. Below a tenth it falls in proportion. At rest it falls as a pixel's samples grow.
    pub noise_smoothing: f32,
    /// Largest number of samples in a point's mean while the view moves: at least 1. A larger
    /// number is smoother and follows changes more slowly.
    pub moving_mean: u32,
    /// Largest number of samples in a pixel's mean at rest: at least 1.
    pub resting_mean: u32,
    /// At rest, one request in this many goes through the old point to test whether it has changed:
    /// at least 2. The others go anywhere in the pixel.
    pub check_every: u32,
    /// Seed of the jitter and of the dither.
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
            pyramid_weight: 0.5,
            noisy_pyramid_weight: 4.0,
            gap_priority: 135,
            predicted_block: 4,
            predicted_share: 0.5,
            change_threshold: 0.1,
            noise_deviations: 3.0,
            move_threshold: 0.1,
            change_ageing: 64,
            change_reach: 1,
            hidden_ageing: 3,
            hint_ageing: 4,
            noise_smoothing: 8.0,
            moving_mean: 8,
            resting_mean: u32::MAX,
            check_every: 8,
            seed: 0,
        }
    }
}
