//! Options of two eyes.

use clap::{Args, ValueEnum};
use holo_stereo::{StereoArrangement, StereoEyes};

/// Usual distance between a person's eyes, metres.
const EYES: f64 = 0.063;
/// Largest distance between eyes, metres: that of models as large as mountains.
const MOST_EYES: f64 = 1e6;

/// Two eyes, and how a picture shows what they see.
#[derive(Args, Clone, Debug, Default)]
pub struct StereoArgs {
    /// Show what two eyes see
    #[arg(long, value_enum, value_name = "ARRANGEMENT")]
    pub stereo: Option<StereoArg>,
    /// With --stereo: distance between the eyes, metres [default: 0.063]
    #[arg(long, value_name = "METRES")]
    pub eyes: Option<f64>,
    /// With --stereo: distance at which both eyes see a thing at the same place of their pictures,
    /// so that it seems to lie on the screen, metres [default: none, the eyes look in parallel]
    #[arg(long, value_name = "METRES")]
    pub convergence: Option<f64>,
}

/// How the pictures of two eyes make one picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum StereoArg {
    /// The left eye's picture in the left half, the right eye's in the right half
    SideBySide,
    /// The left eye's picture in the upper half, the right eye's in the lower half
    OverUnder,
    /// Red of the left eye, green and blue of the right eye, for coloured glasses
    Anaglyph,
    /// Rows in turn, the first for the left eye, for polarised screens
    Interlaced,
}

impl StereoArgs {
    /// Refuses options that would have no effect, and impossible numbers.
    ///
    /// # Errors
    /// A text for the user.
    pub fn check(&self) -> Result<(), String> {
        let named = [("--eyes", self.eyes), ("--convergence", self.convergence)];
        for (name, value) in named {
            let Some(value) = value else { continue };
            if self.stereo.is_none() {
                return Err(format!("{name} is for --stereo"));
            }
            if !(value > 0.0 && value <= MOST_EYES) {
                return Err(format!("{name} takes metres above 0 and up to {MOST_EYES}"));
            }
        }
        Ok(())
    }

    /// Returns the eyes for a scene whose unit is `unit` metres; `None` for one eye.
    pub fn eyes(&self, unit: f64) -> Option<StereoEyes> {
        let arrangement = match self.stereo? {
            StereoArg::SideBySide => StereoArrangement::SideBySide,
            StereoArg::OverUnder => StereoArrangement::OverUnder,
            StereoArg::Anaglyph => StereoArrangement::Anaglyph,
            StereoArg::Interlaced => StereoArrangement::Interlaced,
        };
        let distance = self.eyes.unwrap_or(EYES) / unit;
        Some(StereoEyes { arrangement, distance, convergence: self.convergence.map(|m| m / unit) })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_metres_whatever_the_scene_s_unit() {
        let args =
            StereoArgs { stereo: Some(StereoArg::Anaglyph), eyes: None, convergence: Some(3.0) };
        let feet = args.eyes(0.3048).unwrap();
        assert!((feet.distance * 0.3048 - 0.063).abs() < 1e-12);
        assert!((feet.convergence.unwrap() * 0.3048 - 3.0).abs() < 1e-12);
        assert_eq!(StereoArgs::default().eyes(1.0), None);
    }

    #[test]
    fn options_without_effect_and_impossible_lengths_are_refused() {
        let args = |stereo, eyes| StereoArgs { stereo, eyes, convergence: None };
        assert!(args(None, Some(0.1)).check().unwrap_err().contains("--stereo"));
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = args(Some(StereoArg::Interlaced), Some(wrong)).check().unwrap_err();
            assert!(error.contains("--eyes"), "{error}");
        }
        assert!(args(Some(StereoArg::Interlaced), Some(0.1)).check().is_ok());
    }
}
