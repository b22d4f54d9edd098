//! Legends: what false colours and contours mean.

use super::colors;
use super::scale::{Scale, label};

/// The meaning of a picture's colours, as data. [`Image::with_legend`](crate::Image::with_legend)
/// draws it.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// The unit of all luminances: `cd/m²`.
    pub unit: &'static str,
    /// The scale of the colours.
    pub scale: Scale,
    /// Round luminances, in order. Contours are drawn at these.
    pub ticks: Vec<Tick>,
}

/// A luminance that a legend names.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// The luminance in cd/m².
    pub luminance: f32,
    /// Its place on the scale: 0 at the low end, 1 at the high one.
    pub place: f32,
    /// The luminance as text.
    pub label: String,
}

impl Legend {
    pub(super) fn new(scale: Scale) -> Legend {
        let tick =
            |luminance| Tick { luminance, place: scale.place(luminance), label: label(luminance) };
        Legend { unit: "cd/m²", scale, ticks: scale.ticks().into_iter().map(tick).collect() }
    }

    /// Returns the colour of a place on the scale, from 0 to 1, as sRGB.
    pub fn color(&self, place: f32) -> [u8; 3] {
        colors::color(place.clamp(0.0, 1.0))
    }
}
