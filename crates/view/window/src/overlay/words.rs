//! Texts of the window.

use std::time::Instant;

use holo_picture::luminance;
use holo_stage::{StagePhase, State};

use super::{
    super::{pace::WindowPace, seen::DisplayedFrame},
    space::Lost,
};

/// A part of the status line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// The value.
    pub value: String,
    /// Its unit.
    pub unit: &'static str,
    /// True if it is trouble.
    pub is_bad: bool,
}

/// Returns the status line.
pub fn status(
    state: &State,
    seen: Option<&DisplayedFrame>,
    pace: &WindowPace,
    now: Instant,
) -> Vec<Field> {
    let field = |value: String, unit| Field { value, unit, is_bad: false };
    let mut fields = Vec::new();
    if let Some(frames) = pace.frames_per_second(now) {
        fields.push(field(frames.to_string(), "frames/s"));
    }
    if let Some(latency) = pace.latency() {
        fields.push(field(latency.as_millis().to_string(), "ms from hand to eye"));
    }
    if let Some(seen) = seen {
        let (width, height) = seen.shown.frame.picture.size();
        fields.push(field(format!("{width}×{height}"), ""));
    }
    if state.phase != StagePhase::Running {
        return fields;
    }
    if state.view_samples > 0 {
        fields.push(field(short(state.view_samples as f64), "samples of this view"));
    }
    if state.gleams > 0 {
        fields.push(field(format!("{} %", state.gleams), "of pixels with guessed gleams"));
    }
    if state.height_is_locked {
        fields.push(field("eye height locked".into(), ""));
    }
    if !state.traces {
        fields.push(field("stored rays only".into(), ""));
        return fields;
    }
    if state.is_paused {
        fields.push(field("paused".into(), ""));
    } else {
        fields.push(field(format!("{}/s", short(state.samples_per_second)), "traced"));
    }
    match state.workers {
        Some(0) => fields.push(Field {
            value: "no worker".into(),
            unit: "traces: it is starting, or has died",
            is_bad: true,
        }),
        Some(1) => fields.push(field("1".into(), "worker")),
        Some(workers) => fields.push(field(workers.to_string(), "workers")),
        None => {}
    }
    fields
}

/// Returns names and values for the point under the cursor, or in the middle of the picture.
pub fn under_cursor(
    seen: Option<&DisplayedFrame>,
    cursor: Option<(f64, f64)>,
) -> [(&'static str, String); 4] {
    let (x, y) = cursor.unwrap_or((0.5, 0.5));
    let shown = seen.map(|seen| &seen.shown);
    let known = shown.and_then(|shown| shown.radiance_at(x, y));
    let certainty = shown.and_then(|shown| shown.certainty_at(x, y));
    // The error is a radiance, converted to luminance as a grey light.
    let error = certainty.map(|certainty| luminance([certainty.error; 3]));
    let error = error.filter(|error| error.is_finite());
    let error = error.map_or_else(String::new, |error| format!(" ± {}", precise(error, 2)));
    let samples = match certainty {
        Some(certainty) => certainty.samples.to_string(),
        None => "not said".to_owned(),
    };
    let unknown = || "-".to_owned();
    let light = known.map(|(radiance, _)| precise(luminance(radiance), 4));
    let parts = known.map(|(radiance, _)| radiance.map(|part| precise(part, 4)).join(" "));
    let distance = known.map(|(_, distance)| match distance {
        distance if distance.is_infinite() => "nothing hit".to_owned(),
        distance if distance > 0.0 => precise(distance, 4),
        _ => "not known".to_owned(),
    });
    [
        ("Luminance", light.map_or_else(unknown, |light| format!("{light}{error} cd/m²"))),
        ("Samples", samples),
        ("Radiance", parts.unwrap_or_else(unknown)),
        ("Distance", distance.unwrap_or_else(unknown)),
    ]
}

/// Returns what the stage waits for, or why it has ended; `None` while it runs.
pub fn loading(state: &State, has_picture: bool) -> Option<String> {
    match &state.phase {
        StagePhase::Connecting => Some("Connecting to the server …".to_owned()),
        StagePhase::Loading(text) => {
            let mut signs = text.chars();
            let first = signs.next().map(|first| first.to_uppercase().to_string());
            Some(format!("{}{} …", first.unwrap_or_default(), signs.as_str()))
        }
        StagePhase::Running if !has_picture => Some("The first picture comes …".to_owned()),
        StagePhase::Running | StagePhase::Ended(_) => None,
    }
}

/// Describes the way back to the sections.
pub fn lost(lost: &Lost) -> String {
    let distance = number(lost.distance, 4);
    let way = match lost {
        Lost { turn: None, .. } => format!("the next one is ahead, {distance} away"),
        Lost { is_behind: true, .. } => format!("the next one is behind you, {distance} away"),
        _ => format!("turn to the next one, {distance} away"),
    };
    format!("Outside the known rooms: {way}. H goes home")
}

/// Formats a count with three digits.
fn short(count: f64) -> String {
    for (unit, size) in [("G", 1e9), ("M", 1e6), ("k", 1e3)] {
        if count >= size {
            return format!("{} {unit}", digits(count / size, 3));
        }
    }
    format!("{count:.0}")
}

fn precise(value: f32, count: i32) -> String {
    number(f64::from(value), count)
}

/// Formats a quantity with this many digits.
fn number(value: f64, count: i32) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e5).contains(&size) {
        digits(value, count)
    } else {
        format!("{value:.2e}")
    }
}

fn digits(value: f64, count: i32) -> String {
    let whole = value.abs().max(1e-300).log10().floor() as i32 + 1;
    let decimals = usize::try_from(count - whole).unwrap_or(0);
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use holo_display::{Certainty, Frame};
    use holo_picture::Look;

    use super::*;
    use crate::tests::shown;

    fn text(fields: &[Field]) -> String {
        let words: Vec<String> =
            fields.iter().map(|field| format!("{} {}", field.value, field.unit)).collect();
        words.join("; ").replace(" ;", ";")
    }

    fn running() -> State {
        State { phase: StagePhase::Running, traces: true, ..State::default() }
    }

    #[test]
    fn the_status_says_what_is_known_and_what_is_wrong() {
        let say =
            |state: &State| text(&status(state, None, &WindowPace::default(), Instant::now()));
        assert_eq!(say(&State::default()), "");
        let (view_samples, samples_per_second) = (1_234_567, 12_345.0);
        let busy = State { view_samples, samples_per_second, workers: Some(1), ..running() };
        assert_eq!(say(&busy), "1.23 M samples of this view; 12.3 k/s traced; 1 worker");
        let glossy = State { view_samples: 7, gleams: 12, is_paused: true, ..running() };
        let words = "7 samples of this view; 12 % of pixels with guessed gleams; paused ";
        assert_eq!(say(&glossy), words);
        let paused = State { is_paused: true, workers: Some(2), ..running() };
        assert_eq!(say(&paused), "paused; 2 workers");
        let dead = State { workers: Some(0), ..running() };
        let fields = status(&dead, None, &WindowPace::default(), Instant::now());
        assert!(fields.iter().any(|field| field.is_bad && field.value == "no worker"));
        let locked = State { traces: false, height_is_locked: true, ..running() };
        assert_eq!(say(&locked), "eye height locked; stored rays only ");
    }

    #[test]
    fn progress_is_shown_until_there_is_a_picture() {
        let phase = |phase| State { phase, ..State::default() };
        let loaded = loading(&phase(StagePhase::Loading("reading the scene".into())), false);
        assert_eq!(loaded.unwrap(), "Reading the scene …");
        assert!(loading(&running(), false).is_some());
        assert_eq!(loading(&running(), true), None);
    }

    #[test]
    fn light_under_the_cursor_is_shown_with_its_error() {
        let say = |seen: &DisplayedFrame| under_cursor(Some(seen), None).map(|(_, value)| value);
        let frame = shown((2, 2), [0.5; 3], 1);
        let look = Look::default();
        let image = look.show(&frame.frame.picture);
        let plain = DisplayedFrame { shown: Arc::new(frame), image: image.clone() };
        assert_eq!(say(&plain), ["89.50 cd/m²", "not said", "0.5000 0.5000 0.5000", "2.000"]);
        let mut frame = shown((2, 2), [0.5; 3], 1);
        let mut own = Frame::clone(&frame.frame);
        own.certainty = vec![Certainty { error: 0.01, samples: 7 }; 4];
        own.depth.fill(f32::INFINITY);
        frame.frame = Arc::new(own);
        let known = DisplayedFrame { shown: Arc::new(frame), image };
        let [light, samples, _, distance] = say(&known);
        let expected = ["89.50 ± 1.8 cd/m²", "7", "nothing hit"];
        assert_eq!([light.as_str(), &samples, &distance], expected);
        assert_eq!(under_cursor(None, None)[0].1, "-");
    }

    #[test]
    fn the_way_back_is_described_in_words() {
        let at = |turn, is_behind| lost(&Lost { turn, is_behind, distance: 12.3456 });
        assert!(at(None, false).contains("ahead, 12.35 away"));
        assert!(at(Some(3.0), true).contains("behind you"));
        assert!(at(Some(1.0), false).contains("turn to"));
    }

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!([999.4, 1000.0, 1.5e9].map(short), ["999", "1.00 k", "1.50 G"]);
        let numbers = [0.0, 12.345_67, 0.012_345, 123_456.0, 1e-9, 99_999.0];
        let texts = ["0", "12.35", "0.01235", "1.23e5", "1.00e-9", "99999"];
        assert_eq!(numbers.map(|value| number(value, 4)), texts);
    }
}
