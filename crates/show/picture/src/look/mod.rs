//! Radiance as a display shows it: exposure, tones, false colours and contours.
//!
//! - [`Look`]: a person's choices. [`Look::show`] makes an [`Image`] of a single picture.
//! - [`Adaptation`]: a session's state from frame to frame, so that exposure, tone curve and scale
//!   of colours change smoothly. [`Look::follow`] uses it.
//! - [`Legend`]: the meaning of colours, as data or drawn beside the picture.
//!
//! Invariants: an image depends neither on the number of threads nor on the order of work. More
//! light never gives a smaller byte with the tones `linear`, `soft` and `camera`. Radiance that is
//! negative or NaN is black, and infinite radiance is white.

mod bands;
mod bytes;
mod colors;
mod contours;
mod curve;
mod eye;
mod fovea;
mod glyphs;
mod histogram;
mod image;
mod legend;
mod raster;
mod scale;

use glam::Vec3;
use rayon::prelude::*;

use crate::picture::Picture;
use bytes::Bytes;
use curve::{Curve, KEY};
use eye::SEEN_STEP;
use fovea::{Blur, Gaze, fovea, under};
use histogram::{CHUNK, Histogram};
use holo_color::luminance;

pub use bands::Bands;
pub use image::Image;
pub use legend::{Legend, Tick};
pub use scale::{Scale, ScaleError, Scaling};

/// Seconds after which an adaptation has followed 63 % of a change of light. An eye takes minutes
/// in the dark, but a designer does not want to wait.
const ADAPTATION_SECONDS: f32 = 0.4;

/// The brightness of a picture on the display.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// Automatic, by the tone. With `linear` and `soft`, the log-average luminance is shown as a
    /// grey card of 18 %.
    #[default]
    Auto,
    /// Stops brighter than [`Auto`](Exposure::Auto); 1 doubles the light of the display.
    Stops(f32),
    /// Locked: radiance times this factor, for the tones `linear` and `soft`. Other tones have no
    /// factor and use [`Auto`](Exposure::Auto).
    Factor(f32),
}

/// How radiance becomes display light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// Proportional, with a soft shoulder from 60 % of white on.
    #[default]
    Soft,
    /// Proportional, clipped at white.
    Linear,
    /// Histogram adjustment: light and dark parts share the display's range by their size. No
    /// contrast is greater than in the scene.
    Camera,
    /// Histogram adjustment that shows what an eye in the scene would see: contrast, glare, loss of
    /// detail and of colour in the dark.
    Human,
}

/// A person's choices for the look of pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Brightness of tones.
    pub exposure: Exposure,
    /// Conversion of radiance to tones.
    pub tone: Tone,
    /// True if false colours show luminance instead of tones.
    pub false_color: bool,
    /// True if lines of equal luminance are drawn.
    pub contours: bool,
    /// The scale of false colours and contours.
    pub scaling: Scaling,
}

impl Default for Look {
    fn default() -> Look {
        Look {
            exposure: Exposure::Auto,
            tone: Tone::Soft,
            false_color: false,
            contours: false,
            scaling: Scaling::Auto { log: false },
        }
    }
}

/// The light that a look has adapted to. It belongs to one sequence of frames.
#[derive(Clone, Debug, Default)]
pub struct Adaptation {
    /// Binary logarithm of the automatic exposure.
    exposure: Option<f32>,
    curve: Option<(Tone, Curve)>,
    scale: Option<Scale>,
}

/// Returns the factor that makes the log-average luminance of a picture a grey card of 18 %. Only
/// pixels above 0 count. 1 for a black picture.
#[must_use]
pub fn auto_exposure(picture: &Picture) -> f32 {
    exposure_log(&Histogram::new(&picture.pixels)).exp2()
}

/// Returns the binary logarithm of the automatic exposure.
fn exposure_log(seen: &Histogram) -> f32 {
    // Grey of radiance 1 has luminance 179. The factor of any lit picture must be finite.
    let log = seen
        .log_average()
        .map_or(0.0, |average| (KEY * f64::from(holo_color::EFFICACY)).log2() - average);
    log.clamp(-126.0, 126.0) as f32
}

impl Look {
    /// Returns the image of a single picture.
    #[must_use]
    pub fn show(&self, picture: &Picture) -> Image {
        self.follow(picture, &mut Adaptation::default(), 0.0)
    }

    /// Returns the image of a frame of a session, `seconds` after the frame before. Automatic
    /// values adapt for this time; 0 locks them. The first frame that needs a value sets it.
    #[must_use]
    pub fn follow(&self, picture: &Picture, state: &mut Adaptation, seconds: f32) -> Image {
        let share = 1.0 - (-seconds.max(0.0) / ADAPTATION_SECONDS).exp();
        let mut image = Image {
            width: picture.width,
            height: picture.height,
            rgb: vec![0; picture.pixels.len() * 3],
            legend: None,
            exposure: None,
        };
        let legend = (self.false_color || self.contours)
            .then(|| Legend::new(self.scale(picture, state, share)));
        match legend.as_ref().filter(|_| self.false_color) {
            Some(legend) => {
                let scale = legend.scale;
                map(picture, &mut image, |rgb| colors::color(scale.place(luminance(rgb))));
            }
            None => self.tones(picture, state, share, &mut image),
        }
        if let Some(legend) = legend.as_ref().filter(|_| self.contours) {
            contours::draw(picture, legend, self.false_color, &mut image.rgb);
        }
        Image { legend, ..image }
    }

    fn scale(&self, picture: &Picture, state: &mut Adaptation, share: f32) -> Scale {
        let log = match self.scaling {
            Scaling::Fixed(scale) => return scale,
            Scaling::Auto { log } => log,
        };
        let before = state.scale.filter(|scale| scale.is_log() == log);
        let scale = match before.filter(|_| share == 0.0) {
            Some(locked) => locked,
            None => Scale::fitting(&Histogram::new(&picture.pixels), log, before),
        };
        *state.scale.insert(scale)
    }

    fn tones(&self, picture: &Picture, state: &mut Adaptation, share: f32, image: &mut Image) {
        match self.tone {
            Tone::Linear => self.proportional(picture, state, share, &bytes::CLIPPED, image),
            Tone::Soft => self.proportional(picture, state, share, &bytes::SOFT, image),
            Tone::Camera => {
                let target = || Curve::camera(&seen(&fovea(picture).values));
                let table = state.curve(Tone::Camera, target, share).table(self.gain());
                let bytes = &*bytes::CLIPPED;
                map(picture, image, |rgb| bytes.color(table.color(rgb)));
            }
            Tone::Human => self.as_seen(picture, state, share, image),
        }
    }

    fn proportional(
        &self,
        picture: &Picture,
        state: &mut Adaptation,
        share: f32,
        bytes: &Bytes,
        image: &mut Image,
    ) {
        let factor = match self.exposure {
            Exposure::Factor(factor) if factor.is_finite() && factor > 0.0 => factor,
            _ => state.exposure(picture, share) * self.gain(),
        };
        image.exposure = Some(factor);
        map(picture, image, |rgb| bytes.color(rgb.map(|value| value * factor)));
    }

    /// Returns the image that shows what an eye in the scene would see.
    fn as_seen(&self, picture: &Picture, state: &mut Adaptation, share: f32, image: &mut Image) {
        let cells = fovea(picture);
        let gaze = Gaze::new(picture, &cells);
        let (veil, details) = (gaze.veil(&cells), gaze.details(&cells));
        let veiled = cells.values.iter().zip(&veil.values);
        let veiled: Vec<Vec3> = veiled.map(|(&light, &veil)| under(veil, light)).collect();
        let curve = state.curve(Tone::Human, || Curve::human(&seen(&veiled)), share);
        let table = curve.table(self.gain());
        let blur = Blur::new(picture, details.values.iter().copied().fold(1.0, f32::max));
        let bytes = &*bytes::CLIPPED;
        let (width, height) = (picture.width as usize, picture.height as f32);
        let rows = image.rgb.par_chunks_exact_mut(width * 3).enumerate();
        rows.for_each(|(row, shown)| {
            let y = (row as f32 + 0.5) / height;
            for (column, shown) in shown.chunks_exact_mut(3).enumerate() {
                let x = (column as f32 + 0.5) / width as f32;
                let light = under(veil.at(x, y), blur.at(x, y, details.at(x, y)));
                let color = eye::seen_color(light.to_array());
                shown.copy_from_slice(&bytes.color(table.color(color)));
            }
        });
    }

    /// Returns the ratio of display light to the automatic one.
    fn gain(&self) -> f32 {
        match self.exposure {
            Exposure::Stops(stops) if stops.is_finite() => stops.clamp(-60.0, 60.0).exp2(),
            _ => 1.0,
        }
    }
}

impl Adaptation {
    /// Adapts the automatic exposure, and returns it as a factor.
    fn exposure(&mut self, picture: &Picture, share: f32) -> f32 {
        let log = match self.exposure {
            Some(locked) if share == 0.0 => locked,
            before => {
                let target = exposure_log(&Histogram::new(&picture.pixels));
                before.map_or(target, |before| match (target - before).abs() < SEEN_STEP {
                    true => before,
                    false => before + share * (target - before),
                })
            }
        };
        self.exposure.insert(log).exp2()
    }

    /// Adapts the curve of a tone.
    fn curve(&mut self, tone: Tone, target: impl FnOnce() -> Curve, share: f32) -> &Curve {
        let curve = match self.curve.take() {
            Some((own, curve)) if own == tone && share == 0.0 => curve,
            Some((own, mut curve)) if own == tone => {
                curve.approach(&target(), share);
                curve
            }
            _ => target(),
        };
        &self.curve.insert((tone, curve)).1
    }
}

fn seen(cells: &[Vec3]) -> Histogram {
    let cells: Vec<[f32; 3]> = cells.iter().map(Vec3::to_array).collect();
    Histogram::new(&cells)
}

/// Sets every pixel of an image by the picture's pixel, on all cores.
fn map(picture: &Picture, image: &mut Image, show: impl Fn([f32; 3]) -> [u8; 3] + Sync) {
    let chunks = image.rgb.par_chunks_mut(3 * CHUNK).zip(picture.pixels.par_chunks(CHUNK));
    chunks.for_each(|(shown, pixels)| {
        for (shown, &rgb) in shown.as_chunks_mut::<3>().0.iter_mut().zip(pixels) {
            *shown = show(rgb);
        }
    });
}
