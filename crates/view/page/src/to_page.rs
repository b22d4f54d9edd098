//! Messages to a page: JSON texts, and frames, which are a JSON header followed by encoded parts.

use holo_display::DriverPart;
use holo_picture::{EFFICACY, Image, Legend, MAX_PIXELS, MAX_SIDE, luminance};
use holo_section::{Section, SectionSpec};
use holo_stage::{
    DriverArg, PublishedFrame, SceneLight, StagePhase, State, StoreyWalls, WallPlan,
    commands::{ACTIONS, GESTURES},
};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::encode::{Coding, PictureRect};

/// Number of a legend's colours that are sent. The page interpolates between them, with an error
/// that no screen shows.
const LEGEND_COLOURS: u8 = 33;

/// Returns what is under a cursor.
fn under(shown: &PublishedFrame, (x, y): (f64, f64)) -> Option<Value> {
    let (radiance, distance) = shown.radiance_at(x, y)?;
    let certainty = shown.certainty_at(x, y);
    let error = certainty.map(|certainty| EFFICACY * certainty.error);
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
    pub shown: &'a PublishedFrame,
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
    pub times: StageTimes,
}

/// Durations of a frame's stages, milliseconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct StageTimes {
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
    pub fn message(&self, parts: &[(PictureRect, impl AsRef<[u8]>)]) -> Vec<u8> {
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
            "guessed": frame.guessed_pixels as f64 / pixels.max(1.0),
            "uncovered": frame.uncovered_pixels as f64 / pixels.max(1.0),
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
///
/// `session` differs between sessions, so that a page knows when another one has begun. `key`
/// proves that a request comes from this client. `screens` are the names of a wall's screens.
pub fn hello(client: u32, key: &str, session: &str, screens: &[String]) -> String {
    json!({
        "is": "hello", "client": client, "key": key, "session": session, "screens": screens,
        "actions": ACTIONS, "gestures": GESTURES, "drivers": DriverArg::names(),
        "most_pixels": MAX_PIXELS, "most_side": MAX_SIDE,
    })
    .to_string()
}

/// Returns the message that says who drives.
pub fn roles(drives: bool, clients: usize) -> String {
    json!({ "is": "roles", "drives": drives, "clients": clients }).to_string()
}

/// Returns the message that says what is under a client's cursor.
pub fn under_cursor(shown: &PublishedFrame, cursor: (f64, f64)) -> Option<String> {
    under(shown, cursor).map(|under| json!({ "is": "under", "under": under }).to_string())
}

/// Returns the message for an error.
pub fn error(text: &str) -> String {
    json!({ "is": "error", "text": text }).to_string()
}

/// Returns the message for the session's state.
pub fn state(state: &State) -> String {
    let (phase, text) = match &state.phase {
        StagePhase::Connecting => ("loading", "connecting to the server"),
        StagePhase::Loading(text) => ("loading", text.as_str()),
        StagePhase::Running => ("running", ""),
        StagePhase::Ended(text) => ("ended", text.as_str()),
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
        "solid": state.is_solid,
        "paused": state.is_paused,
        "focus": state.focus,
        "saving": state.saving,
        "traces": state.traces,
        "view_samples": state.view_samples,
        "gleams": state.gleams,
        "samples": state.samples,
        "samples_per_second": state.samples_per_second.round(),
        "workers": state.workers,
        "driver": state.driver,
        "parts": state.parts.iter().map(part).collect::<Vec<_>>(),
        "light": state.light.as_deref().map(light),
        "memory": memory(),
    })
    .to_string()
}

/// Returns the light that a person can change.
fn light(light: &SceneLight) -> Value {
    let is_of_sky = |(name, _): &&(String, String)| name != "lamp" && name != "luminaire";
    let options: Map<String, Value> = light
        .options
        .iter()
        .filter(is_of_sky)
        .map(|(name, value)| (name.clone(), json!(value)))
        .collect();
    json!({
        "sky": light.has_sky, "options": options, "words": light.words, "lamps": light.lamps,
    })
}

/// Returns the message for the session's constants: sections, the up axis, and the plan.
pub fn facts(state: &State) -> String {
    let sections: Vec<Value> = state.sections.iter().map(section).collect();
    let plan = plan(&state.plan, state.unit);
    json!({
        "is": "facts", "sections": sections, "up": state.up, "unit": state.unit, "plan": plan,
    })
    .to_string()
}

/// Returns a plan. Its lines are rounded to millimetres, four numbers each.
fn plan(plan: &WallPlan, unit: f64) -> Value {
    let digits = 1000.0 * unit;
    let round = |at: f64| (at * digits).round() / digits;
    let lines = |storey: &StoreyWalls| -> Vec<f64> {
        let ends = storey.lines.iter().flatten();
        ends.flat_map(|end| end.to_array()).map(round).collect()
    };
    let storey = |storey: &StoreyWalls| json!({ "height": storey.height, "lines": lines(storey) });
    let storeys: Vec<Value> = plan.storeys.iter().map(storey).collect();
    let [right, ahead] = plan.axes.map(|axis| axis.to_array());
    json!({ "right": right, "ahead": ahead, "base": plan.base.to_array(), "storeys": storeys })
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
/// Returns a part of the driver that can be switched.
fn part(part: &DriverPart) -> Value {
    json!({ "name": part.name, "meaning": part.meaning, "on": part.is_on })
}
