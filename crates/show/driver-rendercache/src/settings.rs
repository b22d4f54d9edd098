//! The numbers of [`PointImageParams`] by name, with the range of each.
//!
//! Invariant: a cache can be made from any [`PointImageParams`] whose numbers pass these checks.

use crate::params::{PointImageError, PointImageParams};

/// A number of [`PointImageParams`] that can be set by name.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// The name of the field.
    pub name: &'static str,
    /// The meaning of the number, in a few words.
    pub meaning: &'static str,
    /// The range of the number, in words.
    pub allowed: &'static str,
    is_allowed: fn(f64) -> bool,
    get: fn(&PointImageParams) -> f64,
    put: fn(&mut PointImageParams, f64),
}

impl Setting {
    /// Returns the number.
    pub fn value(&self, params: &PointImageParams) -> f64 {
        (self.get)(params)
    }

    /// Sets the number.
    pub(crate) fn put(
        &self,
        params: &mut PointImageParams,
        value: f64,
    ) -> Result<(), PointImageError> {
        self.check(value)?;
        (self.put)(params, value);
        Ok(())
    }

    pub(crate) fn check(&self, value: f64) -> Result<(), PointImageError> {
        let Self { name, allowed: wanted, .. } = *self;
        if (self.is_allowed)(value) {
            Ok(())
        } else {
            Err(PointImageError::Parameter { name, value, wanted })
        }
    }
}

impl PointImageParams {
    /// Changes a number by its name in [`SETTINGS`]; `-` stands for `_` too.
    ///
    /// # Errors
    /// If no number has this name, or if it is outside its range.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), PointImageError> {
        let wanted = name.replace('-', "_");
        let Some(setting) = SETTINGS.iter().find(|setting| setting.name == wanted) else {
            let known: Vec<_> = SETTINGS.iter().map(|setting| setting.name).collect();
            let known = known.join(", ");
            return Err(PointImageError::Unknown { name: name.to_owned(), known });
        };
        setting.put(self, value)
    }

    pub(crate) fn check(&self) -> Result<(), PointImageError> {
        SETTINGS.iter().try_for_each(|setting| setting.check(setting.value(self)))
    }
}

/// Returns whether a number is whole and between `least` and `most`.
fn is_whole(value: f64, least: f64, most: f64) -> bool {
    (least..=most).contains(&value) && value.fract() == 0.0
}

macro_rules! setting {
    ($field:ident: $type:ty, $allowed:literal, $is_allowed:expr, $meaning:literal) => {
        Setting {
            name: stringify!($field),
            meaning: $meaning,
            allowed: $allowed,
            is_allowed: $is_allowed,
            get: |params| params.$field as f64,
            put: |params, value| params.$field = value as $type,
        }
    };
}

const LARGEST: f64 = f32::MAX as f64;
const COUNT: f64 = u32::MAX as f64;

/// All numbers that can be set by name, in the order of the papers.
#[rustfmt::skip] // A line or two each.
pub const SETTINGS: &[Setting] = &[
    setting!(points_per_pixel: f64, "1 to 8", |x| (1.0..=8.0).contains(&x),
        "points kept for each pixel"),
    setting!(group: u32, "1, 2, 4, 8, 16, 32 or 64",
        |x| is_whole(x, 1.0, 64.0) && (x as u32).is_power_of_two(),
        "a new point takes the oldest of so many places"),
    setting!(mean_last_age: f64, "1 to 254", |x| (1.0..=254.0).contains(&x),
        "age at which points are overwritten on average"),
    setting!(eviction_age: u8, "a whole number from 1 to 255", |x| is_whole(x, 1.0, 255.0),
        "age at which points leave"),
    setting!(cull_threshold: f32, "above 0 and finite", |x| x > 0.0 && x <= LARGEST,
        "points deeper than their neighbours' mean by more than this share are not shown"),
    setting!(centre_weight: u8, "a whole number from 1 to 8", |x| is_whole(x, 1.0, 8.0),
        "square root of the weight of the middle one of 3×3 pixels"),
    setting!(prefilter_window: u32, "3, 5, 7 or 9", |x| is_whole(x, 3.0, 9.0) && x % 2.0 == 1.0,
        "pixels along the side of the wide filter"),
    setting!(pyramid_weight: f32, "above 0, at most 1000", |x| x > 0.0 && x <= 1000.0,
        "points that wider windows count as where points are few"),
    setting!(noisy_pyramid_weight: f32, "0 to 1000", |x| (0.0..=1000.0).contains(&x),
        "points that are added to these where samples are noisy"),
    setting!(gap_priority: u8, "a whole number from 0 to 255", |x| is_whole(x, 0.0, 255.0),
        "priority of an empty pixel among eight that are not"),
    setting!(predicted_block: u32, "a whole number from 1 to 16", |x| is_whole(x, 1.0, 16.0),
        "pixels along the side of a pixel of the predicted view"),
    setting!(predicted_share: f64, "0 to 1", |x| (0.0..=1.0).contains(&x),
        "share of the wanted rays for the predicted view"),
    setting!(change_threshold: f32, "above 0 and finite", |x| x > 0.0 && x <= LARGEST,
        "share by which a colour has to differ to have changed"),
    setting!(noise_deviations: f32, "at least 0 and finite", |x| (0.0..=LARGEST).contains(&x),
        "standard deviations of noise that are not yet a change"),
    setting!(move_threshold: f64, "above 0 and below 1", |x| x > 0.0 && x < 1.0,
        "share by which a depth has to differ to be another surface's"),
    setting!(change_ageing: u8, "a whole number from 0 to 255", |x| is_whole(x, 0.0, 255.0),
        "age that points next to a changed one gain"),
    setting!(change_reach: u32, "a whole number from 0 to 8", |x| is_whole(x, 0.0, 8.0),
        "pixels from a changed point to the farthest that gain age"),
    setting!(hidden_ageing: u8, "a whole number from 1 to 16", |x| is_whole(x, 1.0, 16.0),
        "how many times as fast hidden points age"),
    setting!(hint_ageing: u8, "a whole number from 1 to 16", |x| is_whole(x, 1.0, 16.0),
        "how many times as fast points age that are likely to change"),
    setting!(noise_smoothing: f32, "at least 0 and finite", |x| (0.0..=LARGEST).contains(&x),
        "weight of the wide filter where samples are noisy"),
    setting!(moving_mean: u32, "a whole number, at least 1", |x| is_whole(x, 1.0, COUNT),
        "samples that a point averages at most while the view moves"),
    setting!(resting_mean: u32, "a whole number, at least 1", |x| is_whole(x, 1.0, COUNT),
        "samples that a pixel averages at most at rest"),
    setting!(check_every: u32, "a whole number, at least 2", |x| is_whole(x, 2.0, COUNT),
        "one in so many rays at rest looks whether a point has changed"),
];
