//! Messages between page and server: JSON texts, and frames, which are a JSON header followed by
//! encoded parts.

use holo_picture::{Exposure, Image, Legend, Look, Scale, Scaling, Tone, luminance};
use holo_section::{Section, SectionSpec};
use holo_walk::Controls;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::encode::{Coding, Rect};
use crate::args::DriverArg;
use crate::commands::{self, ACTIONS, GESTURES};
use crate::stage::{Input, Phase, Shown, State};

/// Greatest angle of one input, radians.
const MOST_ANGLE: f64 = 7.0;

/// Most steps of the wheel in one input.
const MOST_STEPS: f64 = 20.0;

/// Largest factor on a speed.
const MOST_PACE: f64 = 100.0;

/// Most stops of exposure, brighter or darker.
const MOST_STOPS: f32 = 40.0;

/// Lumens per watt of white light, as in Radiance.
const LUMENS: f32 = 179.0;

/// Number of a legend's colours that are sent. The page interpolates between them, with an error
/// that no screen shows.
const LEGEND_COLOURS: u8 = 33;

/// A message from a page.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Message {
    /// Its number. The numbers of a page's messages increase.
    pub n: u64,
    /// The content.
    pub say: Said,
}

/// The content of a page's message.
#[derive(Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Said {
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
    /// A command line, as on standard input.
    Command { line: String },
    /// See [`Input::Focus`].
    Focus { part: Option<[f64; 4]> },
    /// See [`Input::Size`].
    Size { width: u32, height: u32 },
    /// The page shows this update, and can receive the next one.
    Shown { update: u64 },
    /// The look of frames from now on.
    Display(Display),
    /// This page drives from now on.
    TakeOver {},
}

/// A page's wishes for the look of frames.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Display {
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

impl Display {
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
pub enum Asked {
    /// An input to the stage.
    Input(Input),
    /// The page shows this update; the next one may be sent.
    Shown(u64),
    /// Frames are to have this look.
    Look(Look),
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
pub fn parse(text: &str) -> Result<(u64, Asked), String> {
    let message: Message = serde_json::from_str(text).map_err(|error| error.to_string())?;
    Ok((message.n, asked(message.say)?))
}

fn asked(said: Said) -> Result<Asked, String> {
    let angle = |angle: f64| angle.clamp(-MOST_ANGLE, MOST_ANGLE);
    let part = |part: f64| part.clamp(-1.0, 1.0);
    Ok(Asked::Input(match said {
        Said::Hold { ahead, right, rise, turn, tilt, glide, around, over, pace } => {
            let [ahead, right, rise, turn] = [ahead, right, rise, turn].map(part);
            let [tilt, glide, around, over] = [tilt, glide, around, over].map(part);
            let pace = pace.clamp(1.0 / MOST_PACE, MOST_PACE);
            Input::Hold(Controls { ahead, right, rise, turn, tilt, glide, around, over, pace })
        }
        Said::Cursor { at } => {
            let inside = |at: &[f64; 2]| at.iter().all(|share| (0.0..=1.0).contains(share));
            Input::Cursor(at.filter(inside).map(|[x, y]| (x, y)))
        }
        Said::Turn { right, up } => Input::Turn(angle(right), angle(up)),
        Said::Orbit { right, up } => Input::Orbit(angle(right), angle(up)),
        Said::Slide { right, up } => Input::Slide(part(right), part(up)),
        Said::Wheel { steps } => Input::Wheel(steps.clamp(-MOST_STEPS, MOST_STEPS)),
        Said::Command { line } => commands::parse(&line).and_then(for_pages)?,
        Said::Focus { part } => {
            let inside = |part: &[f64; 4]| part.iter().all(|share| (0.0..=1.0).contains(share));
            let is_whole = |[left, top, right, bottom]: &[f64; 4]| left < right && top < bottom;
            Input::Focus(part.filter(inside).filter(is_whole))
        }
        Said::Size { width, height } => Input::Size(width, height),
        Said::Shown { update } => return Ok(Asked::Shown(update)),
        Said::TakeOver {} => return Ok(Asked::TakeOver),
        Said::Display(display) => return Ok(Asked::Look(display.look()?)),
    }))
}

/// Refuses inputs that only a person at this machine may give.
fn for_pages(input: Input) -> Result<Input, String> {
    match input {
        // A page saves the pictures that it has received; it never names a file of this machine.
        Input::Picture(..) => Err("a page saves pictures by its own links".to_owned()),
        input => Ok(input),
    }
}

/// Returns what is under a cursor.
fn under(shown: &Shown, (x, y): (f64, f64)) -> Option<Value> {
    let (radiance, distance) = shown.radiance_at(x, y)?;
    let certainty = shown.certainty_at(x, y);
    let error = certainty.map(|certainty| LUMENS * certainty.error);
    Some(json!({
        // Some drivers know neither number, and none does while the eye moves.
        "error": error.filter(|error| error.is_finite()),
        "samples": certainty.map(|certainty| certainty.samples),
        "radiance": radiance,
        "luminance": luminance(radiance),
        // JSON has no infinity. The distance is null both if nothing is known and if the ray hits
        // nothing; `hits` separates the two.
        "distance": Some(distance).filter(|distance| distance.is_finite() && *distance > 0.0),
        "hits": distance.is_finite(),
    }))
}

/// Returns a legend: its colours from the low end of the scale to the high end, and its ticks.
fn legend(legend: &Legend) -> Value {
    let colour = |index| {
        let [red, green, blue] = legend.color(f32::from(index) / f32::from(LEGEND_COLOURS - 1));
        format!("#{red:02x}{green:02x}{blue:02x}")
    };
    let colours: Vec<String> = (0..LEGEND_COLOURS).map(colour).collect();
    let ticks: Vec<Value> = legend
        .ticks
        .iter()
        .map(|tick| json!({ "place": tick.place, "label": tick.label }))
        .collect();
    let scale = legend.scale;
    json!({
        "unit": legend.unit, "range": [scale.least(), scale.most()], "log": scale.is_log(),
        "ticks": ticks, "colours": colours,
    })
}

/// A frame for a client.
pub struct Framed<'a> {
    /// The frame.
    pub shown: &'a Shown,
    /// Number of the update. The client answers with it once the update is shown.
    pub update: u64,
    /// The client that receives the frame.
    pub client: u32,
    /// Position of that client's cursor.
    pub cursor: Option<(f64, f64)>,
    /// The image that the client sees.
    pub image: &'a Image,
    /// True if, with this update, the screen shows exactly the frame's colours.
    pub is_exact: bool,
    /// How the parts are encoded.
    pub coding: Coding,
    /// Durations of the frame's stages.
    pub times: Times,
}

/// Durations of a frame's stages, milliseconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Times {
    /// Preparing the view.
    pub look: f64,
    /// Drawing it.
    pub draw: f64,
    /// Waiting until the client had received the previous frame.
    pub wait: f64,
    /// Turning radiance into colours.
    pub tone: f64,
    /// Encoding the colours.
    pub encode: f64,
}

impl Framed<'_> {
    /// Returns the message: the header's length in four bytes, the header, and the parts.
    pub fn message(&self, parts: &[(Rect, impl AsRef<[u8]>)]) -> Vec<u8> {
        let shown = self.shown;
        let (client, number) = shown.input;
        let (view, frame) = (&shown.view, &shown.frame);
        let (across, along) = view.extent();
        let kind = if self.coding == Coding::Png { "image/png" } else { "image/jpeg" };
        let places: Vec<Value> = parts
            .iter()
            .map(|(rect, bytes)| {
                json!([rect.x, rect.y, rect.width, rect.height, bytes.as_ref().len()])
            })
            .collect();
        let pixels = f64::from(frame.picture.width) * f64::from(frame.picture.height);
        let header = json!({
            "update": self.update,
            "frame": shown.number,
            "input": if client == self.client { number } else { 0 },
            "size": frame.picture.size(),
            "type": kind,
            "parts": places,
            "rest": shown.is_at_rest,
            "exact": self.is_exact,
            "options": shown.options,
            "view": {
                "kind": view.kind.letter().to_string(),
                "eye": view.eye().to_array(),
                "right": view.right().to_array(),
                "up": view.up().to_array(),
                "direction": view.vd.to_array(),
                "extent": [across, along],
                "shift": [view.vs, view.vl],
            },
            // Absent if the look has no such factor.
            "exposure": self.image.exposure,
            "legend": self.image.legend.as_ref().map(legend),
            "times": self.times,
            "unknown": frame.empty_pixels as f64 / pixels.max(1.0),
            "under": self.cursor.and_then(|cursor| under(shown, cursor)),
        });
        let header = header.to_string().into_bytes();
        let mut message = (header.len() as u32).to_le_bytes().to_vec();
        message.extend_from_slice(&header);
        parts.iter().for_each(|(_, bytes)| message.extend_from_slice(bytes.as_ref()));
        message
    }
}

/// Returns the message that greets a client.
pub fn hello(client: u32) -> String {
    json!({
        "is": "hello", "client": client, "actions": ACTIONS, "gestures": GESTURES,
        "drivers": DriverArg::names(),
    })
    .to_string()
}

/// Returns the message that says who drives.
pub fn roles(drives: bool, clients: usize) -> String {
    json!({ "is": "roles", "drives": drives, "clients": clients }).to_string()
}

/// Returns the message that says what is under a client's cursor.
pub fn under_cursor(shown: &Shown, cursor: (f64, f64)) -> Option<String> {
    under(shown, cursor).map(|under| json!({ "is": "under", "under": under }).to_string())
}

/// Returns the message for an error.
pub fn error(text: &str) -> String {
    json!({ "is": "error", "text": text }).to_string()
}

/// Returns the message for the session's state.
pub fn state(state: &State) -> String {
    let (phase, text) = match &state.phase {
        Phase::Connecting => ("loading", "connecting to the server"),
        Phase::Loading(text) => ("loading", text.as_str()),
        Phase::Running => ("running", ""),
        Phase::Ended(text) => ("ended", text.as_str()),
    };
    json!({
        "is": "state",
        "phase": phase,
        "text": text,
        "uncovered": state.is_uncovered,
        "trouble": state.trouble,
        "question": state.question,
        "answer": state.answer,
        "crew": state.has_crew,
        "views": *state.views,
        "options": state.options,
        "pose": state.pose,
        "locked": state.height_is_locked,
        "paused": state.is_paused,
        "focus": state.focus,
        "traces": state.traces,
        "view_samples": state.view_samples,
        "samples": state.samples,
        "samples_per_second": state.samples_per_second.round(),
        "workers": state.workers,
        "driver": state.driver,
        "memory": memory(),
    })
    .to_string()
}

/// Returns the message for the session's constants: sections and the up axis.
pub fn facts(state: &State) -> String {
    let sections: Vec<Value> = state.sections.iter().map(section).collect();
    json!({ "is": "facts", "sections": sections, "up": state.up }).to_string()
}

fn section(spec: &SectionSpec) -> Value {
    let is_interior = matches!(spec.class, holo_section::ViewClass::Interior);
    json!({
        "origin": spec.origin, "axes": spec.axes, "grid": spec.grid, "interior": is_interior,
        "valid": Section::new(spec.clone()).is_ok(),
    })
}

/// Returns this process's memory, bytes, if the system reports it.
fn memory() -> Option<u64> {
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = pages.split(' ').nth(1)?.parse().ok()?;
    Some(pages * 4096)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_messages_are_bounded() {
        let turn = parse(r#"{"n": 3, "say": {"do": "turn", "right": 1e300, "up": 0}}"#).unwrap();
        assert_eq!(turn, (3, Asked::Input(Input::Turn(MOST_ANGLE, 0.0))));
        let hold = parse(r#"{"n": 4, "say": {"do": "hold", "ahead": 5}}"#).unwrap().1;
        let controls = Controls { ahead: 1.0, ..Controls::default() };
        assert_eq!(hold, Asked::Input(Input::Hold(controls)));
        let cursor = parse(r#"{"n": 5, "say": {"do": "cursor", "at": [2, 0]}}"#).unwrap().1;
        assert_eq!(cursor, Asked::Input(Input::Cursor(None)));
        for (part, focus) in [
            ("[0.1, 0.2, 0.5, 0.6]", Some([0.1, 0.2, 0.5, 0.6])),
            ("[0.5, 0.2, 0.1, 0.6]", None),
            ("[0.1, 0.2, 0.5, 7]", None),
        ] {
            let text = format!(r#"{{"n": 6, "say": {{"do": "focus", "part": {part}}}}}"#);
            assert_eq!(parse(&text).unwrap().1, Asked::Input(Input::Focus(focus)), "{part}");
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
        assert_eq!(look(all), Ok(Asked::Look(wanted)));
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
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
