//! What a front end asks a session besides views: facts of the holodeck, and to pause tracing.

use anyhow::Result;
use glam::DVec3;
use holo_section::Section;

use super::Session;

impl Session {
    /// Returns the holodeck's sections.
    pub fn sections(&self) -> &[Section] {
        &self.choice.sections
    }

    /// Returns the scene's up axis.
    pub fn up(&self) -> DVec3 {
        DVec3::from_array(self.welcome.up)
    }

    /// Returns whether the server traces, or only shows what is stored.
    pub fn traces(&self) -> bool {
        self.welcome.tracing
    }

    /// Notes that somebody walks, and whether the eye moves. Whatever takes long and serves only the
    /// current view then waits until the eye has rested for a while.
    pub fn set_moving(&mut self, is_moving: bool) {
        self.is_walked = true;
        self.is_moving = is_moving;
    }

    /// Pauses tracing for this display, or resumes it. Stored samples are asked for all the same.
    ///
    /// # Errors
    /// If the server is lost.
    pub fn pause(&mut self, pause: bool) -> Result<()> {
        if self.is_paused == pause {
            return Ok(());
        }
        self.is_paused = pause;
        let Some(current) = &self.current else { return Ok(()) };
        // A request of the same number would change the viewpoint alone.
        self.ask_anew(current.wanted.clone())
    }
}
