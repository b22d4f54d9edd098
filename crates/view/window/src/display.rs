//! A person's choices for the look of frames.

use holo_picture::{Exposure, Look, Scale, ScaleError, Scaling, Tone};
use holo_stage::commands::Local;

/// Most stops above or below the automatic or locked exposure.
const MOST_STOPS: f32 = 8.0;

/// The stops of one step.
const STEP: f32 = 0.5;

/// The look of frames, as a person changes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplaySettings {
    /// Locked factor from radiance to display light; automatic exposure if absent.
    pub locked: Option<f32>,
    /// Stops brighter than that exposure.
    pub stops: f32,
    /// The other parts of the look.
    rest: Look,
}

impl DisplaySettings {
    /// Returns a display that starts with a look.
    pub fn new(look: Look) -> DisplaySettings {
        let (locked, stops) = match look.exposure {
            Exposure::Factor(factor) => (Some(factor), 0.0),
            Exposure::Stops(stops) => (None, stops),
            Exposure::Auto => (None, 0.0),
        };
        DisplaySettings { locked, stops, rest: look }
    }

    /// Returns the look.
    pub fn look(&self) -> Look {
        let exposure = match self.locked {
            Some(factor) if self.has_factor() => Exposure::Factor(factor * self.stops.exp2()),
            _ => Exposure::Stops(self.stops),
        };
        Look { exposure, ..self.rest }
    }

    /// Performs an action on the look. `exposure` is the factor of the frame on the screen. Returns
    /// whether it was done, or why it is impossible; `None` if the action does not concern the
    /// look.
    pub fn act(&mut self, local: Local, exposure: Option<f32>) -> Option<Result<(), String>> {
        let stops = |stops: f32| stops.clamp(-MOST_STOPS, MOST_STOPS);
        match local {
            Local::Brighter => self.stops = stops(self.stops + STEP),
            Local::Darker => self.stops = stops(self.stops - STEP),
            Local::Exposure if self.locked.is_some() => self.locked = None,
            Local::Exposure => match exposure {
                Some(factor) => self.locked = Some(factor / self.stops.exp2()),
                None => {
                    let reason = "Only the tones Soft and Linear have an exposure to lock.";
                    return Some(Err(reason.to_owned()));
                }
            },
            Local::NextTone => {
                self.rest.tone = match self.rest.tone {
                    Tone::Soft => Tone::Linear,
                    Tone::Linear => Tone::Camera,
                    Tone::Camera => Tone::Human,
                    Tone::Human => Tone::Soft,
                };
                self.rest.false_color = false;
            }
            Local::FalseColor => self.rest.false_color = !self.rest.false_color,
            Local::Contours => self.rest.contours = !self.rest.contours,
            Local::LogScale => match other_scale(self.rest.scaling) {
                Ok(scaling) => self.rest.scaling = scaling,
                Err(error) => return Some(Err(error.to_string())),
            },
            _ => return None,
        }
        Some(Ok(()))
    }

    /// Returns the exposure in words, and the tone mapping or what is shown instead.
    pub fn words(&self) -> (String, &'static str) {
        let stops =
            if self.stops == 0.0 { String::new() } else { format!(" {:+} stops", self.stops) };
        let locked = if self.locked.is_some() && self.has_factor() { "locked" } else { "auto" };
        let tone = match self.rest.tone {
            _ if self.rest.false_color => "false colour",
            Tone::Soft => "soft",
            Tone::Linear => "linear",
            Tone::Camera => "camera",
            Tone::Human => "human",
        };
        (format!("{locked}{stops}"), tone)
    }

    /// Returns whether the tone mapping has one factor for all radiance.
    fn has_factor(&self) -> bool {
        matches!(self.rest.tone, Tone::Soft | Tone::Linear)
    }
}

/// Switches a scale between linear and logarithmic.
fn other_scale(scaling: Scaling) -> Result<Scaling, ScaleError> {
    Ok(match scaling {
        Scaling::Auto { log } => Scaling::Auto { log: !log },
        Scaling::Fixed(scale) => {
            Scaling::Fixed(Scale::new(scale.least(), scale.most(), !scale.is_log())?)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_locked_exposure_is_the_one_on_the_screen_and_stops_go_on_from_it() {
        let mut display = DisplaySettings::new(Look::default());
        // Two half stops are exactly a factor of 2.
        (0..2).for_each(|_| display.act(Local::Brighter, None).unwrap().unwrap());
        display.act(Local::Exposure, Some(0.5)).unwrap().unwrap();
        assert_eq!(display.look().exposure, Exposure::Factor(0.5));
        (0..2).for_each(|_| display.act(Local::Darker, None).unwrap().unwrap());
        assert_eq!(display.look().exposure, Exposure::Factor(0.25));
        display.act(Local::Exposure, Some(0.5)).unwrap().unwrap();
        assert_eq!(display.look().exposure, Exposure::Stops(0.0));
    }

    #[test]
    fn a_tone_without_a_factor_cannot_be_locked_and_says_so() {
        let mut display = DisplaySettings::new(Look { tone: Tone::Camera, ..Look::default() });
        assert!(display.act(Local::Exposure, None).unwrap().is_err());
        assert_eq!(display.look().exposure, Exposure::Stops(0.0));
    }

    #[test]
    fn actions_choose_tones_and_scales_and_others_are_not_about_looks() {
        let mut display = DisplaySettings::new(Look::default());
        let before = display.look();
        for tone in [Tone::Linear, Tone::Camera, Tone::Human, Tone::Soft] {
            display.act(Local::NextTone, None);
            assert_eq!(display.look().tone, tone);
        }
        for action in [Local::FalseColor, Local::Contours, Local::LogScale] {
            display.act(action, None);
        }
        let after = display.look();
        assert!(after.false_color && after.contours);
        assert_eq!(after.scaling, Scaling::Auto { log: true });
        for action in [Local::FalseColor, Local::Contours, Local::LogScale] {
            display.act(action, None);
        }
        assert_eq!(display.look(), before);
        assert_eq!(display.act(Local::Panel, None), None);
        (0..100).for_each(|_| _ = display.act(Local::Brighter, None));
        assert_eq!(display.look().exposure, Exposure::Stops(MOST_STOPS));
    }

    #[test]
    fn a_range_that_begins_at_0_stays_linear_and_the_reason_is_given() {
        let fixed = |least, log| Scaling::Fixed(Scale::new(least, 100.0, log).unwrap());
        let mut display =
            DisplaySettings::new(Look { scaling: fixed(0.0, false), ..Look::default() });
        assert!(display.act(Local::LogScale, None).unwrap().is_err());
        assert_eq!(display.look().scaling, fixed(0.0, false));
        let mut display =
            DisplaySettings::new(Look { scaling: fixed(1.0, false), ..Look::default() });
        display.act(Local::LogScale, None).unwrap().unwrap();
        assert_eq!(display.look().scaling, fixed(1.0, true));
    }

    #[test]
    fn a_stated_look_is_kept() {
        for exposure in [Exposure::Factor(0.3), Exposure::Stops(-1.0)] {
            let look = Look { exposure, tone: Tone::Linear, contours: true, ..Look::default() };
            assert_eq!(DisplaySettings::new(look).look(), look);
        }
    }
}
