//! Messages from a page: JSON texts. [`parse`] checks every number, so what it returns is safe to
//! use.

use holo_picture::{Exposure, Look, Scale, Scaling, Tone};
use holo_stage::{Input, ObjectOrder, commands};
use holo_walk::Controls;
use serde::Deserialize;

/// Greatest angle of one input, radians.
const MOST_ANGLE: f64 = 7.0;

/// Most steps of the wheel in one input.
const MOST_STEPS: f64 = 20.0;

/// Largest factor on a speed.
const MOST_PACE: f64 = 100.0;

/// Most stops of exposure, brighter or darker.
const MOST_STOPS: f32 = 40.0;

/// A message from a page.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PageMessage {
    /// Its number. The numbers of a page's messages increase.
    pub n: u64,
    /// The content.
    pub say: PageInput,
}

/// The content of a page's message.
#[derive(Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum PageInput {
    /// See [`Input::Hold`].
    Hold {
        #[serde(default)]
        ahead: f64,
        #[serde(default)]
        right: f64,
        #[serde(default)]
        rise: f64,
        #[serde(default)]
        turn: f64,
        #[serde(default)]
        tilt: f64,
        #[serde(default)]
        glide: f64,
        #[serde(default)]
        around: f64,
        #[serde(default)]
        over: f64,
        #[serde(default = "one")]
        pace: f64,
    },
    /// See [`Input::Cursor`].
    Cursor { at: Option<[f64; 2]> },
    /// See [`Input::Turn`].
    Turn { right: f64, up: f64 },
    /// See [`Input::Orbit`].
    Orbit { right: f64, up: f64 },
    /// See [`Input::Slide`].
    Slide { right: f64, up: f64 },
    /// See [`Input::Wheel`].
    Wheel { steps: f64 },
    /// See [`ObjectOrder::Grab`].
    Grab { at: [f64; 2] },
    /// See [`ObjectOrder::DragTo`].
    Drag { at: [f64; 2] },
    /// See [`ObjectOrder::Spin`].
    Spin { at: [f64; 2], degrees: f64 },
    /// A model was dropped on the page: its file's name, the number of the drop, and the place.
    Drop { number: u32, name: String, at: [f64; 2] },
    /// A command line, as on standard input.
    Command { line: String },
    /// See [`Input::Focus`].
    Focus { part: Option<[f64; 4]> },
    /// See [`Input::Size`].
    Size { width: u32, height: u32 },
    /// The page shows this update, and can receive the next one.
    Shown { update: u64 },
    /// The page is hidden, and needs no frames until it is seen again.
    Hidden { hidden: bool },
    /// The look of frames from now on.
    Display(PageDisplay),
    /// This page drives from now on.
    TakeOver {},
}

/// A page's wishes for the look of frames.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PageDisplay {
    /// Locked factor from radiance to display light; automatic exposure if absent.
    locked: Option<f32>,
    /// Stops brighter than that exposure.
    stops: f32,
    #[serde(default)]
    tone: ToneName,
    #[serde(default)]
    false_color: bool,
    #[serde(default)]
    contours: bool,
    /// True if the scale of false colours and contours is logarithmic.
    #[serde(default)]
    log: bool,
    /// Ends of that scale, cd/m²; chosen from the picture if absent.
    range: Option<[f32; 2]>,
}

/// Names of tones: see [`Tone`].
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
enum ToneName {
    #[default]
    Soft,
    Linear,
    Camera,
    Human,
}

impl ToneName {
    fn tone(self) -> Tone {
        match self {
            ToneName::Soft => Tone::Soft,
            ToneName::Linear => Tone::Linear,
            ToneName::Camera => Tone::Camera,
            ToneName::Human => Tone::Human,
        }
    }
}

impl PageDisplay {
    /// Returns the look that the page asks for.
    ///
    /// # Errors
    /// A text for the user, if a number is not finite or too large, or the range is empty.
    fn look(&self) -> Result<Look, String> {
        // `contains` is also false for NaN.
        if !(-MOST_STOPS..=MOST_STOPS).contains(&self.stops) {
            return Err(format!("{} stops: at most {MOST_STOPS} are possible", self.stops));
        }
        let factor = self.locked.map(|locked| locked * self.stops.exp2());
        if let Some(factor) = factor.filter(|factor| !factor.is_normal() || *factor < 0.0) {
            return Err(format!("an exposure of {factor} is none: it must be above 0"));
        }
        let tone = self.tone.tone();
        let exposure = match factor {
            Some(factor) if matches!(tone, Tone::Soft | Tone::Linear) => Exposure::Factor(factor),
            // The other tones have no factor to lock.
            _ => Exposure::Stops(self.stops),
        };
        let scaling = match self.range {
            None => Scaling::Auto { log: self.log },
            Some([least, most]) => {
                let scale = Scale::new(least, most, self.log).map_err(|error| error.to_string())?;
                Scaling::Fixed(scale)
            }
        };
        let (false_color, contours) = (self.false_color, self.contours);
        Ok(Look { exposure, tone, false_color, contours, scaling })
    }
}

/// The request in a message, with all numbers checked.
#[derive(Debug, PartialEq)]
pub enum PageRequest {
    /// An input to the stage.
    Input(Input),
    /// The page shows this update; the next one may be sent.
    Shown(u64),
    /// The page is hidden, or seen again.
    Hidden(bool),
    /// Frames are to have this look.
    Look(Look),
    /// This file of the client's drop is a model, to be put at this place of the picture.
    Drop(u32, String, [f64; 2]),
    /// The page drives from now on.
    TakeOver,
}

fn one() -> f64 {
    1.0
}

/// Parses a page's message.
///
/// # Errors
/// A text for the user, if the message is malformed.
pub fn parse(text: &str) -> Result<(u64, PageRequest), String> {
    let message: PageMessage = serde_json::from_str(text).map_err(|error| error.to_string())?;
    Ok((message.n, request(message.say)?))
}

fn request(input: PageInput) -> Result<PageRequest, String> {
    let angle = |angle: f64| angle.clamp(-MOST_ANGLE, MOST_ANGLE);
    let part = |part: f64| part.clamp(-1.0, 1.0);
    let share = |share: f64| share.clamp(0.0, 1.0);
    Ok(PageRequest::Input(match input {
        PageInput::Hold { ahead, right, rise, turn, tilt, glide, around, over, pace } => {
            let [ahead, right, rise, turn] = [ahead, right, rise, turn].map(part);
            let [tilt, glide, around, over] = [tilt, glide, around, over].map(part);
            let pace = pace.clamp(1.0 / MOST_PACE, MOST_PACE);
            Input::Hold(Controls { ahead, right, rise, turn, tilt, glide, around, over, pace })
        }
        PageInput::Cursor { at } => {
            let inside = |at: &[f64; 2]| at.iter().all(|share| (0.0..=1.0).contains(share));
            Input::Cursor(at.filter(inside).map(|[x, y]| (x, y)))
        }
        PageInput::Turn { right, up } => Input::Turn(angle(right), angle(up)),
        PageInput::Orbit { right, up } => Input::Orbit(angle(right), angle(up)),
        PageInput::Slide { right, up } => Input::Slide(part(right), part(up)),
        PageInput::Wheel { steps } => Input::Wheel(steps.clamp(-MOST_STEPS, MOST_STEPS)),
        PageInput::Grab { at } => Input::Object(ObjectOrder::Grab(at.map(share))),
        PageInput::Drag { at } => Input::Object(ObjectOrder::DragTo(at.map(share))),
        PageInput::Spin { at, degrees } => {
            Input::Object(ObjectOrder::Spin(at.map(share), degrees.clamp(-360.0, 360.0)))
        }
        PageInput::Command { line } => commands::parse(&line).and_then(for_pages)?,
        PageInput::Focus { part } => {
            let inside = |part: &[f64; 4]| part.iter().all(|share| (0.0..=1.0).contains(share));
            let is_whole = |[left, top, right, bottom]: &[f64; 4]| left < right && top < bottom;
            Input::Focus(part.filter(inside).filter(is_whole))
        }
        PageInput::Size { width, height } => Input::Size(width, height),
        PageInput::Drop { number, name, at } => {
            return Ok(PageRequest::Drop(number, name, at.map(share)));
        }
        PageInput::Shown { update } => return Ok(PageRequest::Shown(update)),
        PageInput::Hidden { hidden } => return Ok(PageRequest::Hidden(hidden)),
        PageInput::TakeOver {} => return Ok(PageRequest::TakeOver),
        PageInput::Display(display) => return Ok(PageRequest::Look(display.look()?)),
    }))
}

/// Refuses inputs that only a person at this machine may give.
fn for_pages(input: Input) -> Result<Input, String> {
    match input {
        // A page saves the pictures that it has received; it never names a file of this machine.
        Input::Picture(..) => Err("a page saves pictures by its own links".to_owned()),
        Input::Object(order) if !order.names_plain_file() => Err(
            "a page takes models from the folder in which the viewer was started: name the file \
             alone"
                .to_owned(),
        ),
        Input::Light(change) if change.names_file() => Err(
            "a page names no files of this machine: type the line in the terminal, or state the \
             file when you start the session"
                .to_owned(),
        ),
        input => Ok(input),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_messages_are_bounded() {
        let turn = parse(r#"{"n": 3, "say": {"do": "turn", "right": 1e300, "up": 0}}"#).unwrap();
        assert_eq!(turn, (3, PageRequest::Input(Input::Turn(MOST_ANGLE, 0.0))));
        let hold = parse(r#"{"n": 4, "say": {"do": "hold", "ahead": 5}}"#).unwrap().1;
        let controls = Controls { ahead: 1.0, ..Controls::default() };
        assert_eq!(hold, PageRequest::Input(Input::Hold(controls)));
        let cursor = parse(r#"{"n": 5, "say": {"do": "cursor", "at": [2, 0]}}"#).unwrap().1;
        assert_eq!(cursor, PageRequest::Input(Input::Cursor(None)));
        for (part, focus) in [
            ("[0.1, 0.2, 0.5, 0.6]", Some([0.1, 0.2, 0.5, 0.6])),
            ("[0.5, 0.2, 0.1, 0.6]", None),
            ("[0.1, 0.2, 0.5, 7]", None),
        ] {
            let text = format!(r#"{{"n": 6, "say": {{"do": "focus", "part": {part}}}}}"#);
            assert_eq!(parse(&text).unwrap().1, PageRequest::Input(Input::Focus(focus)), "{part}");
        }
    }

    #[test]
    fn a_look_that_no_screen_can_show_is_refused() {
        let look = |fields: &str| {
            parse(&format!(r#"{{"n": 1, "say": {{"do": "display", {fields}}}}}"#))
                .map(|(_, asked)| asked)
        };
        let all = r#""locked": 0.5, "stops": 1, "tone": "linear", "false_color": true,
            "contours": true, "log": true, "range": [1, 100]"#;
        let scaling = Scaling::Fixed(Scale::new(1.0, 100.0, true).unwrap());
        let exposure = Exposure::Factor(1.0);
        let (tone, false_color, contours) = (Tone::Linear, true, true);
        let wanted = Look { exposure, tone, false_color, contours, scaling };
        assert_eq!(look(all), Ok(PageRequest::Look(wanted)));
        for (fields, reason) in [
            (r#""stops": 41"#, "stops"),
            (r#""stops": -1e300"#, "stops"),
            (r#""stops": 1e999"#, "number out of range"),
            (r#""stops": null"#, "invalid type"),
            (r#""stops": 0, "locked": 0"#, "exposure"),
            (r#""stops": 0, "locked": -1"#, "exposure"),
            (r#""stops": 0, "locked": 1e300"#, "exposure"),
            (r#""stops": 40, "locked": 1e38"#, "exposure"),
            (r#""stops": 0, "tone": "loud""#, "unknown variant"),
            (r#""stops": 0, "range": [5, 5]"#, "no range"),
            (r#""stops": 0, "range": [-1, 5]"#, "no range"),
            (r#""stops": 0, "range": [0, 1e300]"#, "no range"),
            (r#""stops": 0, "range": [0, 5], "log": true"#, "logarithmic"),
            (r#""stops": 0, "range": [1]"#, "invalid length"),
            (r#""stops": 0, "colour": true"#, "unknown field"),
        ] {
            let error = look(fields).unwrap_err();
            assert!(error.contains(reason), "{fields}: {error}");
        }
    }

    #[test]
    fn malformed_messages_are_refused_with_a_reason() {
        for (text, reason) in [
            ("", "EOF"),
            ("{}", "missing field"),
            (r#"{"n": 1, "say": {"do": "fly"}}"#, "unknown variant"),
            (r#"{"n": -1, "say": {"do": "take_over"}}"#, "invalid value"),
            (r#"{"n": 1, "say": {"do": "take_over", "now": 1}}"#, "unknown field"),
            (r#"{"n": 1, "say": {"do": "command", "line": "fly"}}"#, "no command"),
            (r#"{"n": 1, "say": {"do": "command", "line": "view -vp 1 2"}}"#, "-vp"),
            (r#"{"n": 1, "say": {"do": "command", "line": "picture /a.png"}}"#, "own links"),
            (r#"{"n": 1, "say": {"do": "command", "line": "sky /a.hdr"}}"#, "names no files"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
