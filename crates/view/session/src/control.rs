//! Requests of a front end to a session, besides views: facts about the holodeck, pausing, and
//! changes of driver.

use std::sync::Arc;

use anyhow::{Result, bail};
use glam::DVec3;
use holo_proto::control::Control;
use holo_raycast::Raycaster;
use holo_section::Section;

use super::{
    EyeVelocity, Session,
    current_view::RequestedSamples,
    driver_choice::{DriverArg, SceneUse},
};

impl Session {
    /// Returns the holodeck's sections.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// Returns the scene's up axis.
    pub fn up(&self) -> DVec3 {
        DVec3::from_array(self.welcome.up)
    }

    /// Returns the length of a scene unit, metres.
    pub fn unit(&self) -> f64 {
        self.welcome.unit
    }

    /// Returns the scene, if it has arrived.
    pub fn scene(&self) -> Option<Arc<Raycaster>> {
        self.scene.as_ref().map(|scene| Arc::clone(&scene.raycaster))
    }

    /// Returns whether the server traces, or only shows what is stored.
    pub fn traces(&self) -> bool {
        self.welcome.tracing
    }

    /// Records how the eye moves; `None` if it rests. While it moves, slow work that serves only
    /// the current view waits, and single rays are requested for where the motion leads.
    pub fn set_motion(&mut self, velocity: Option<EyeVelocity>) {
        self.velocity = velocity;
    }

    /// Returns whether the eye moves.
    pub(super) fn is_moving(&self) -> bool {
        self.velocity.is_some()
    }

    /// Returns whether all stored samples for the current view have arrived.
    pub fn has_stored(&self) -> bool {
        self.current.as_ref().is_some_and(|current| current.asked == RequestedSamples::All)
    }

    /// Returns whether all stored samples have also arrived that [`Session::ask_beside`] requested.
    pub fn has_stored_beside(&self) -> bool {
        self.has_stored() && !self.awaits_beside
    }

    /// Pauses tracing for this display, or resumes it. Stored samples are requested in any case.
    ///
    /// # Errors
    /// If the server is lost.
    pub fn pause(&mut self, pause: bool) -> Result<()> {
        if self.is_paused == pause {
            return Ok(());
        }
        self.is_paused = pause;
        let Some(current) = &self.current else { return Ok(()) };
        // A request under the same number would change only the viewpoint.
        self.ask_anew(current.wanted.clone())
    }

    /// Concentrates tracing on a part of the picture, given as left, top, right and bottom in
    /// shares of it.
    ///
    /// # Errors
    /// If the server is lost.
    pub fn set_focus(&mut self, part: Option<[f64; 4]>) -> Result<()> {
        if self.focus == part {
            return Ok(());
        }
        self.focus = part;
        let Some(current) = &self.current else { return Ok(()) };
        self.ask_anew(current.wanted.clone())
    }

    /// Stores a named view in the holodeck, given by Radiance's options. Without options, removes
    /// the view of this name.
    ///
    /// # Errors
    /// If the holodeck is opened only for reading, or the server is lost.
    pub fn keep_view(&self, name: &str, options: &str) -> Result<()> {
        if !self.welcome.tracing {
            bail!(
                "a replay only reads the holodeck: no view can be kept or removed. \
                 `holodeck view FILE.holo` can"
            );
        }
        let (name, options) = (name.to_owned(), options.to_owned());
        Ok(self.outbox.control(&Control::KeepView { name, options })?)
    }

    /// Returns the server's last refusal with its reason, once.
    pub fn take_refusal(&mut self) -> Option<String> {
        self.refusal.take()
    }

    /// Changes to another driver.
    ///
    /// # Errors
    /// If the driver requires the scene and it is not here, or the driver cannot show the view.
    pub fn change_driver(&mut self, driver: DriverArg) -> Result<()> {
        let mut choice = self.choice.clone();
        choice.choose(driver);
        if choice.scene_use() == SceneUse::Required && self.scene.is_none() {
            bail!("driver {} draws from the scene, which is not here", driver.name());
        }
        self.choice = choice;
        self.make_driver()
    }
}
