//! Constants of the engine `cached`. Measurements behind them: docs/notes/indirect-light.md.

/// Default relative error of indirect light.
pub const DEFAULT_ACCURACY: f32 = 0.03;

/// Range of relative errors that can be requested.
pub const ACCURACIES: std::ops::RangeInclusive<f32> = 0.002..=0.5;

/// Number of smooth surfaces at which both reflection and transmission are followed. Only light
/// that comes straight to an eye, to a record or to a path instead of a record is followed so. A
/// random choice would give one ray in ten the weight of ten.
pub(super) const FORKS: u32 = 2;

/// Samples of the lights at a first diffuse surface. If indirect light is clean, direct light makes
/// all of the noise.
pub(super) const LIGHT_SAMPLES: u32 = 10;

/// The kind of a record, as [`Record::flags`](holo_light::Record::flags) stores it. Also the index
/// into the pairs of constants below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(super) enum Kind {
    /// For surfaces that eyes see.
    Exact = 0,
    /// Only for rays of other records.
    Coarse = 1,
}

/// Least and greatest number of pilot rays, which determine how many rays a record needs. Fewer
/// pilot rays often miss what is bright.
pub(super) const PILOT_RAYS: [[u32; 2]; 2] = [[64, 256], [32, 128]];

/// Pilot rays over the rays that the record would need if their standard deviation was their mean.
pub(super) const PILOT_SHARE: f32 = 0.3;

/// Least rays of a record.
pub(super) const MIN_RAYS: u32 = 64;

/// Most rays of a record of grade 0.
pub(super) const MAX_RAYS: u32 = 1 << 13;

/// Standard error over the accuracy, for a record of the greatest radius.
///
/// A record of smaller radius serves less of the surface, in proportion to the square of its
/// radius. An eye sees a mean over many of them. For a given effort, the total error is least if
/// the number of rays grows in proportion to the area served (Neyman 1934, "On the Two Different
/// Aspects of the Representative Method").
///
/// No eye sees a coarse record, and thousands of rays do. But all records around a large coarse
/// record depend on that record. If light comes through a door, the few records behind the door
/// determine the brightness of the whole room.
pub(super) const ERROR: [f32; 2] = [0.5, 1.0];

/// Greatest standard error over the accuracy: even a small exact record may fill an eye's view.
pub(super) const MAX_ERROR: [f32; 2] = [1.0, 8.0];

/// Radius of a record over the harmonic mean distance of what it sees, for accuracy 1. Grows with
/// the square root of the accuracy, because the error of gradients grows with the square of the
/// distance.
pub(super) const REACH: f32 = 2.0;

/// Greatest radius over the scene's size, for accuracy 1. Grows like [`REACH`].
pub(super) const MAX_RADIUS: f32 = 0.3;

/// Greatest radius over the least. Without a least radius, edges would have countless records.
pub(super) const RADIUS_RATIO: f32 = 16.0;

/// Rays aimed at secondary sources, and rays aimed at images of lamps, over rays over the
/// hemisphere.
pub(super) const AIMED: f32 = 0.2;

/// One in this many of the rays of records that find no record makes a coarse record.
pub(super) const COARSE_PATIENCE: u32 = 8;

/// Sum of weights below which a new record is made. With 0.3, single records decide about parts of
/// surfaces, and these show their error.
pub(super) const MIN_WEIGHT: f32 = 0.6;

/// The same for a sample that must not make a record: a path is noisier than few records.
pub(super) const MIN_WEIGHT_WITHOUT_RECORD: f32 = 0.3;

/// Greatest radiance, over that of the scene's records, that a path instead of a record brings from
/// a lamp over mirrors or glass.
///
/// One such path in ten thousand is hundreds of times as bright as its surroundings, and shows
/// until hundreds of samples outweigh it. The rays of records are limited too. The limit takes 0.03
/// ± 0.01 % of the light in a cabin. In a small room with a large mirror, it takes 1.4 ± 0.2 % of
/// the light of a pixel's first four samples. From the 64th on it takes 0.09 ± 0.01 %.
pub(super) const MAX_LAMP_OVER_MEAN: f32 = 8.0;

/// Sum of weights above which no more records are looked up. More records make the light that eyes
/// see smoother, but do not improve the mean over a hemisphere.
pub(super) const ENOUGH_WEIGHT: [f32; 2] = [4.0, 1.0];

/// Part of a sample's variance that a record removes: half in the bundled interior.
pub(super) const SERVED_WORTH: f64 = 0.5;

/// Least and greatest exponent d if the share of samples that lack a record falls like rays^-d. The
/// least allows some records even where they were useless so far, so that their use can be measured
/// again.
pub(super) const DECAYS: [f64; 2] = [0.1, 2.0];

/// Time of a record's ray over that of a sample: 0.35 in the bundled interior.
pub(super) const RAY_COST: f64 = 0.4;

/// Share of samples that lack a record below which the surfaces count as covered.
pub(super) const COVERED: f64 = 1.0 / 16.0;

/// Rays of all records of a [grade](holo_light::Record::grade), over those of the one before. The
/// variance of each falls to a quarter, and the area that each serves to half.
pub(super) const GRADE_COST: f64 = 8.0;

/// Share of time for the next grade. It begins once it takes no more than this share of all time
/// until then.
///
/// Samples of a pixel and rays of records both have squared errors that fall like 1 over their
/// number. The sum of both is least if the share of time for rays is constant. In the Cornell box
/// at 256 × 256 pixels this is a tenth to a fifth.
pub(super) const REFINING: f64 = 0.25;

/// Samples after which their counts are halved, so that the share served is a recent one.
pub(super) const WINDOW: u64 = 3 << 14;

/// An effort without limit: every sample that lacks a record makes one.
pub(super) const UNLIMITED: u32 = u32::MAX;

/// An effort whose limit follows from what records achieve.
pub(super) const MEASURED: u32 = u32::MAX - 1;
