//! The report on a written picture.

use std::path::PathBuf;

use holo_session::StageTime;
use serde::Serialize;

/// The report on a written picture: `Display` for people, JSON for programs.
#[derive(Clone, Debug, Serialize)]
pub struct PictureReport {
    /// The file.
    pub picture: PathBuf,
    /// Seconds from the request of the view until the picture was written.
    pub seconds: f64,
    /// Samples in the picture.
    pub samples: u64,
    /// Samples received for the view that the server read from its file.
    pub stored: u64,
    /// Samples received for the view that were traced for it.
    pub traced: u64,
    /// Rays outside all sections, traced for this view only.
    pub live: u64,
    /// Beams that the view crosses.
    pub beams: usize,
    /// Pixels whose view rays cross no section.
    pub uncovered_pixels: u64,
    /// Covered pixels filled from their neighbours.
    pub empty_pixels: u64,
    /// Pixels that show the sky because no ray of their beam can hit anything.
    pub unseen_pixels: u64,
    /// Pixels on surfaces without known light. They show the brightness of the surfaces that have
    /// some.
    pub guessed_pixels: u64,
    /// Pixels on glossy surfaces whose gleams are a guess, because few samples leave there towards
    /// the eye.
    pub gleam_pixels: u64,
    /// The driver that made it.
    pub driver: &'static str,
    /// Seconds until the first samples arrived; absent if none arrived.
    pub first_samples: Option<f64>,
    /// The factor from radiance to display light of a `.png`, if its tone has one.
    pub exposure: Option<f32>,
    /// Durations of the picture's stages; empty for drivers without stages.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<StageTime>,
}

/// If at most one in this many received samples is visible, something stands between the section's
/// walls and what the view shows.
const LEAST_SAMPLES_PER_VISIBLE_ONE: u64 = 10_000;

impl std::fmt::Display for PictureReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: {:.1} s, {} samples ({} stored, {} traced)",
            self.picture.display(),
            self.seconds,
            self.samples,
            self.stored,
            self.traced
        )?;
        let came = self.stored + self.traced;
        if came >= LEAST_SAMPLES_PER_VISIBLE_ONE
            && self.samples <= came / LEAST_SAMPLES_PER_VISIBLE_ONE
        {
            write!(
                f,
                ": none of what the view shows is seen from the walls of its section, something stands between; give a section \
                 within the room, such as --section=\"X,Y,Z 10,0,0 0,8,0 0,0,3\""
            )?;
        }
        if self.uncovered_pixels > 0 {
            write!(f, ", {} pixels that no section covers", self.uncovered_pixels)?;
        }
        if self.live > 0 {
            write!(f, " (by {} rays traced for this view alone)", self.live)?;
        }
        if self.guessed_pixels > 0 {
            write!(f, ", {} pixels without light known, guessed", self.guessed_pixels)?;
        }
        if self.gleam_pixels > 0 {
            write!(f, ", {} glossy pixels whose gleams are guessed", self.gleam_pixels)?;
        }
        if !self.stages.is_empty() {
            let milliseconds: f64 = self.stages.iter().map(|stage| stage.milliseconds).sum();
            write!(f, ", made in {milliseconds:.1} ms")?;
        }
        if let Some(factor) = self.exposure {
            write!(f, ", radiance times {factor:.4}")?;
        }
        Ok(())
    }
}
