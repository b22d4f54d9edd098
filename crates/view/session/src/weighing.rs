//! Later requests of a view at rest: its beams again, weighed by the error of what is shown.
//!
//! Early in a view, all pixels need samples. Later, those whose error a person would notice most
//! need more. The intervals between such requests grow, because errors change ever more slowly.

use std::{thread, time::Instant};

use anyhow::{Context, Result};
use holo_display::{SelectOptions, WantedBeam, select_weighted_beams};

use super::{
    Session, Waker,
    current_view::{CurrentView, RequestedSamples},
    demand::requested,
    incoming::Incoming,
};

impl Session {
    /// Weighs the beams of a view at rest in a thread, if it is time to. Returns when it is, if
    /// workers trace.
    pub(super) fn weigh_if_due(&mut self, now: Instant) -> Result<Option<Instant>> {
        let has_workers = self.status.as_ref().is_some_and(|status| status.workers > 0);
        let traces = self.welcome.tracing && has_workers && !self.is_paused && !self.is_moving();
        let Some(current) = self.current.as_mut().filter(|_| traces) else { return Ok(None) };
        if current.asked != RequestedSamples::All || current.look.is_moving {
            return Ok(None);
        }
        if now < current.weighing.due() {
            return Ok(Some(current.weighing.due()));
        }
        current.weighing.advance(now);
        let Some(weights) = self.driver.renderer.wishes().pixel_weights() else {
            return Ok(Some(current.weighing.due()));
        };
        let (first_request, look) = (current.first_request, current.look);
        let (sections, Waker(messages)) = (self.sections.clone(), self.waker.clone());
        let weigh = move || {
            let options = SelectOptions::default();
            let beams = select_weighted_beams(&sections, &look.view, look.size, &options, &weights);
            // If the session is over, the beams have no use.
            let _ = messages.send(Incoming::Weighed { first_request, beams });
        };
        thread::Builder::new().name("weights".into()).spawn(weigh).context("weighing beams")?;
        Ok(Some(current.weighing.due()))
    }

    /// Requests the beams of the current view with other weights, if they belong to it.
    pub(super) fn ask_for_weighed(
        &mut self,
        first_request: u32,
        beams: &[WantedBeam],
    ) -> Result<()> {
        let is_of = |current: &&mut CurrentView| {
            current.first_request == first_request && current.asked == RequestedSamples::All
        };
        if self.is_moving() {
            return Ok(());
        }
        let Some(current) = self.current.as_mut().filter(is_of) else { return Ok(()) };
        current.wanted = beams.iter().map(requested).collect();
        let wanted = current.wanted.clone();
        self.ask_anew(wanted)
    }
}
