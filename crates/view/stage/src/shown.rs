//! What a stage publishes: frames and its state.

use std::{sync::Arc, time::Instant};

use holo_display::{Certainty, DriverPart, Frame};
use holo_picture::View;
use holo_section::SectionSpec;
use holo_session::StatedOptions;
use tokio::sync::watch;

use crate::{input::Inputs, wall_plan::WallPlan};

/// A front end's access to a stage.
#[derive(Clone)]
pub struct Front {
    /// Takes inputs.
    pub inputs: Inputs,
    /// The latest frame.
    pub frames: Arc<watch::Sender<Option<Arc<PublishedFrame>>>>,
    /// The state.
    pub state: Arc<watch::Sender<Arc<State>>>,
}

/// A published frame with its view.
#[derive(Debug)]
pub struct PublishedFrame {
    /// Its number. Numbers increase.
    pub number: u64,
    /// The last input that it shows: the sender, and the sender's number for the input.
    pub input: (u32, u64),
    /// The view.
    pub view: View,
    /// The view in Radiance's options.
    pub options: String,
    /// Radiance and depth. While the eye moves, the frame has fewer pixels.
    pub frame: Arc<Frame>,
    /// True if the eye rests and the frame has all its pixels.
    pub is_at_rest: bool,
    /// Time that the session took to evaluate the view, and the driver to draw it, seconds. While
    /// the eye moves, the time to project earlier frames, and 0.
    pub took: [f64; 2],
    /// When it was ready.
    pub done: Instant,
}

impl PublishedFrame {
    /// Returns radiance and distance at a place in the picture, in shares from its left and top.
    pub fn radiance_at(&self, x: f64, y: f64) -> Option<([f32; 3], f32)> {
        let at = self.pixel_at(x, y)?;
        Some((*self.frame.picture.pixels.get(at)?, *self.frame.depth.get(at)?))
    }

    /// Returns the certainty at that place, if the driver knows it.
    pub fn certainty_at(&self, x: f64, y: f64) -> Option<Certainty> {
        self.frame.certainty.get(self.pixel_at(x, y)?).copied()
    }

    fn pixel_at(&self, x: f64, y: f64) -> Option<usize> {
        let size = self.frame.picture.size();
        let (column, row) = View::pixel_at(size, x, 1.0 - y)?;
        Some(row as usize * size.0 as usize + column as usize)
    }
}

/// The phase of a stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum StagePhase {
    /// It waits for the server.
    #[default]
    Connecting,
    /// It waits for the server or the scene, with a text about progress.
    Loading(String),
    /// It shows views.
    Running,
    /// It has ended, for this reason.
    Ended(String),
}

/// The light of a scene, as far as a person can change it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneLight {
    /// The options that state it, by their names.
    pub options: Vec<(String, String)>,
    /// What was made of them, for people.
    pub words: Vec<String>,
    /// True if the scene has a sky or a sun.
    pub has_sky: bool,
    /// Groups of lamps with their factors.
    pub lamps: Vec<(String, f32)>,
}

impl SceneLight {
    /// Returns the light of a scene with these groups of lamps, for which `stated` was stated.
    pub fn new(groups: &[String], stated: &StatedOptions) -> SceneLight {
        let StatedOptions { options, words, .. } = stated.clone();
        let factors: Vec<(&str, f32)> = options
            .iter()
            .filter(|(name, _)| name == "lamp")
            .filter_map(|(_, value)| value.rsplit_once('='))
            .filter_map(|(name, factor)| Some((name, factor.parse().ok()?)))
            .collect();
        let is_group = |name: &str| groups.iter().any(|group| group == name);
        // A lamp that is off gives no light, and so is no group of the scene.
        let off = factors.iter().filter(|(name, _)| !is_group(name));
        let mut lamps: Vec<(String, f32)> =
            groups.iter().map(|group| (group.clone(), 1.0)).collect();
        lamps.extend(off.map(|(name, _)| ((*name).to_owned(), 1.0)));
        for (name, factor) in &mut lamps {
            let stated = factors.iter().find(|(other, _)| other == name);
            *factor = stated.map_or(1.0, |(_, factor)| *factor);
        }
        let is_sky = |name: &str| name == "sky" || name == "sun";
        // Skies and suns stand last, as in the list of groups.
        lamps.sort_by_key(|(name, _)| is_sky(name));
        let has_sky = lamps.iter().any(|(name, _)| is_sky(name))
            || options.iter().any(|(name, _)| name == "sky" || name == "at");
        SceneLight { options, words, has_sky, lamps }
    }
}

/// The state of a stage, besides the frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// The phase.
    pub phase: StagePhase,
    /// True if no section covers any part of the requested view.
    pub is_uncovered: bool,
    /// Another reason why that view is not shown.
    pub trouble: Option<String>,
    /// A question that the user confirms by repeating the input.
    pub question: Option<String>,
    /// The line that confirms it.
    pub answer: Option<&'static str>,
    /// True if this program started server and workers and can end them.
    pub has_crew: bool,
    /// The current view in Radiance's options, even if it cannot be shown.
    pub options: String,
    /// Eye, direction and up of that view.
    pub pose: [[f64; 3]; 3],
    /// True if the eye's height is locked.
    pub height_is_locked: bool,
    /// True if walls and furniture stop the eye, and floors carry it.
    pub is_solid: bool,
    /// The part of the picture that is traced first: left, top, right and bottom, in shares of the
    /// picture.
    pub focus: Option<[f64; 4]>,
    /// True if tracing is paused.
    pub is_paused: bool,
    /// True if the server traces; false if it only shows what is stored.
    pub traces: bool,
    /// The share that is drawn of the picture that is being saved, if any.
    pub saving: Option<f32>,
    /// Samples that have arrived for the current view.
    pub view_samples: u64,
    /// Share of the picture's pixels on glossy surfaces whose gleams are a guess, percent.
    pub gleams: u32,
    /// Samples in the holodeck.
    pub samples: u64,
    /// Samples traced per second.
    pub samples_per_second: f64,
    /// Number of connected workers, if the server has reported it.
    pub workers: Option<u32>,
    /// The driver's name.
    pub driver: &'static str,
    /// The parts of its method that can be switched.
    pub parts: Arc<Vec<DriverPart>>,
    /// Named views of the holodeck: name and options.
    pub views: Arc<Vec<(String, String)>>,
    /// The scene's light, if this program can change it.
    pub light: Option<Arc<SceneLight>>,
    /// The holodeck's sections.
    pub sections: Arc<Vec<SectionSpec>>,
    /// The scene's walls, as a plan shows them.
    pub plan: Arc<WallPlan>,
    /// The scene's up axis.
    pub up: [f64; 3],
    /// The length of a scene unit, metres.
    pub unit: f64,
}

/// Knows whether any front end receives frames.
#[derive(Clone)]
pub struct FrameAudience(pub Arc<watch::Sender<Option<Arc<PublishedFrame>>>>);

impl FrameAudience {
    /// Returns whether any front end receives frames.
    pub fn is_watched(&self) -> bool {
        self.0.receiver_count() > 0
    }
}

/// Publishes frames and states.
pub struct Publisher {
    front: Front,
    number: u64,
}

impl Publisher {
    /// Publishes to `front`.
    pub fn new(front: Front) -> Publisher {
        Publisher { front, number: 0 }
    }

    /// Publishes the state, if it has changed.
    pub fn state(&self, state: State) {
        self.front.state.send_if_modified(|before| {
            let is_new = **before != state;
            if is_new {
                *before = Arc::new(state);
            }
            is_new
        });
    }

    /// Publishes a frame.
    pub fn frame(&mut self, mut shown: PublishedFrame) -> Arc<PublishedFrame> {
        self.number += 1;
        shown.number = self.number;
        let shown = Arc::new(shown);
        self.front.frames.send_replace(Some(Arc::clone(&shown)));
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_that_are_off_stay_in_the_list_and_factors_are_those_stated() {
        let owned = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect();
        let groups: Vec<String> = owned(&["ceiling", "sky"]);
        let lamp = |value: &str| ("lamp".to_owned(), value.to_owned());
        let options = vec![lamp("desk=0"), lamp("sky=2"), lamp("sun=0")];
        let words = owned(&["dim"]);
        let stated = StatedOptions { options, words, objects: Vec::new() };
        let light = SceneLight::new(&groups, &stated);
        let lamps: Vec<_> = light.lamps.iter().map(|(name, at)| (name.as_str(), *at)).collect();
        assert_eq!(lamps, [("ceiling", 1.0), ("desk", 0.0), ("sky", 2.0), ("sun", 0.0)]);
        assert!(light.has_sky && light.words == ["dim"]);
        assert!(!SceneLight::new(&owned(&["lamp"]), &StatedOptions::default()).has_sky);
    }
}
