//! What a stage publishes: frames, and how things are.

use std::{sync::Arc, time::Instant};

use holo_display::{Certainty, Frame};
use holo_picture::View;
use holo_section::SectionSpec;
use tokio::sync::watch;

use super::Front;

/// A frame, and what it shows.
#[derive(Debug)]
pub struct Shown {
    /// Its number: later frames have larger ones.
    pub number: u64,
    /// Who sent the last input that it shows, and that one's number of it.
    pub input: (u32, u64),
    /// The view.
    pub view: View,
    /// The view in Radiance's options.
    pub options: String,
    /// Radiance and depth; fewer pixels than asked for while moving.
    pub frame: Arc<Frame>,
    /// Whether the eye rests, so that the frame has every pixel.
    pub is_at_rest: bool,
    /// How long the session took to look at the view, and the driver to draw it, seconds. While the
    /// eye moves, how long it took to show earlier frames from here, and 0.
    pub took: [f64; 2],
    /// When it was done.
    pub done: Instant,
}

impl Shown {
    /// Returns radiance and distance at shares of the picture from its left and from its top.
    pub fn radiance_at(&self, x: f64, y: f64) -> Option<([f32; 3], f32)> {
        let at = self.pixel_at(x, y)?;
        Some((*self.frame.picture.pixels.get(at)?, *self.frame.depth.get(at)?))
    }

    /// Returns how exact that is, if the driver says.
    pub fn certainty_at(&self, x: f64, y: f64) -> Option<Certainty> {
        self.frame.certainty.get(self.pixel_at(x, y)?).copied()
    }

    fn pixel_at(&self, x: f64, y: f64) -> Option<usize> {
        let size = self.frame.picture.size();
        let (column, row) = View::pixel_at(size, x, 1.0 - y)?;
        Some(row as usize * size.0 as usize + column as usize)
    }
}

/// How a stage is.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Phase {
    /// It waits for the server or the scene: what for.
    #[default]
    Connecting,
    /// As [`Connecting`](Self::Connecting), with a word about it.
    Loading(String),
    /// It shows views.
    Running,
    /// It has ended: why.
    Ended(String),
}

/// How things are, besides the frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// What the stage does.
    pub phase: Phase,
    /// Whether no section covers anything of the view that one went to.
    pub is_uncovered: bool,
    /// Why that view is not shown otherwise, or is none.
    pub trouble: Option<String>,
    /// What somebody has to confirm by doing it once more.
    pub question: Option<String>,
    /// The line that confirms it.
    pub answer: Option<&'static str>,
    /// Whether this program has started server and workers, and can end them.
    pub has_crew: bool,
    /// The current view in Radiance's options, even if it cannot be shown.
    pub options: String,
    /// Eye, direction and up of that view.
    pub pose: [[f64; 3]; 3],
    /// Whether the eye's height is locked.
    pub height_is_locked: bool,
    /// The part of the picture that is traced first: shares from its left and top to its right and
    /// bottom.
    pub focus: Option<[f64; 4]>,
    /// Whether tracing is paused.
    pub is_paused: bool,
    /// Whether the server traces, or only shows what is stored.
    pub traces: bool,
    /// Samples that have arrived for the current view.
    pub view_samples: u64,
    /// Samples in the holodeck.
    pub samples: u64,
    /// Samples traced per second.
    pub samples_per_second: f64,
    /// Workers connected, if the server has said.
    pub workers: Option<u32>,
    /// The driver's name.
    pub driver: &'static str,
    /// Named views of the holodeck: name and options.
    pub views: Arc<Vec<(String, String)>>,
    /// The holodeck's sections.
    pub sections: Arc<Vec<SectionSpec>>,
    /// The scene's up axis.
    pub up: [f64; 3],
}

/// Knows whether anybody takes frames.
#[derive(Clone)]
pub struct Watched(pub Arc<watch::Sender<Option<Arc<Shown>>>>);

impl Watched {
    /// Returns whether anybody takes frames.
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

    /// Publishes how things are, if that has changed.
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
    pub fn frame(&mut self, mut shown: Shown) -> Arc<Shown> {
        self.number += 1;
        shown.number = self.number;
        let shown = Arc::new(shown);
        self.front.frames.send_replace(Some(Arc::clone(&shown)));
        shown
    }
}
