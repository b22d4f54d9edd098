//! The view that a session shows, and what has arrived for it.

use std::time::{Duration, Instant};

use holo_display::{Age, FramePhase, FrameRequest, Light, Renderer, UsefulBeam, ViewPhases};
use holo_proto::bulk::{LiveSamples, RequestedBeam, SampleSource, ViewSamples};

use super::{live::LiveRays, received::Received, weighing_schedule::WeighingSchedule};

/// A view and what has arrived for it.
pub struct CurrentView {
    pub look: FrameRequest,
    pub phases: ViewPhases,
    /// Beams that the view crosses, with their weights.
    pub wanted: Vec<RequestedBeam>,
    /// Distance of the nearest visible surface, scene units, as well as it is known.
    pub nearest: f64,
    /// True if that distance was taken from the picture.
    pub nearest_is_seen: bool,
    /// Rays through pixels outside all sections, if the server traces.
    pub live: Option<LiveRays>,
    /// When the driver had evaluated the view.
    pub ready: Instant,
    /// The stored samples that have been requested.
    pub asked: RequestedSamples,
    /// True if all stored samples of the beams that the view crosses have arrived.
    pub has_crossed: bool,
    /// True while a thread searches for the next beams.
    pub is_searching: bool,
    /// True if the next request was postponed, for example because the eye moved.
    pub asks_later: bool,
    /// Requested beams that the view does not cross but whose rays may end on what it shows.
    pub also: Vec<UsefulBeam>,
    /// Number of its first request.
    pub first_request: u32,
    pub received: Received,
    pub since: Instant,
    pub counts: ArrivalCounts,
    /// When single rays were last requested. `None` if the driver never wants any.
    pub rays_asked: Option<Instant>,
    /// When its beams are weighed by the error of what is shown.
    pub weighing: WeighingSchedule,
    /// True if a frame was drawn while the eye moved, and no single rays were requested since.
    pub has_new_frame: bool,
}

/// Time after which nobody waits for the first frame of a view any more.
const FIRST_TIME: Duration = Duration::from_millis(400);

/// Number of samples that have arrived for a view.
#[derive(Clone, Default)]
pub struct ArrivalCounts {
    /// From the file.
    pub stored: u64,
    /// From workers.
    pub traced: u64,
    /// From the file, in parts that no view requested.
    pub parts: u64,
    /// Requested for an earlier view.
    pub late: u64,
    /// Seconds until the first samples arrived.
    pub first_samples: Option<f64>,
}

/// The stored samples of a view that have been requested.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum RequestedSamples {
    /// Those of the beams that the view crosses.
    Crossed,
    /// Also those of most beams that end on what the view shows.
    Best,
    /// Also those of all beams that end on what the view shows.
    Surfaces,
    /// All that exist.
    All,
}

impl CurrentView {
    /// Returns the phase of the next frame that is displayed.
    pub fn phase(&self) -> FramePhase {
        self.phases.next(self.ready.elapsed() >= FIRST_TIME)
    }

    /// Returns when nobody waits for the first frame any more.
    pub fn is_late_at(&self) -> Instant {
        self.ready + FIRST_TIME
    }

    /// Passes samples to the driver's light, except those that it already has.
    pub fn insert(&mut self, light: &mut dyn Light, message: &ViewSamples) {
        let is_late = message.view < self.first_request;
        if !is_late && !matches!(message.source, SampleSource::Part | SampleSource::Earlier) {
            let seconds = self.since.elapsed().as_secs_f64();
            self.counts.first_samples.get_or_insert(seconds);
        }
        for (run, samples) in message.iter() {
            if message.source == SampleSource::Earlier {
                let present = self.received.count(run.key);
                self.counts.stored += self.received.earlier.insert(light, run, samples, present);
                continue;
            }
            for fresh in self.received.add(run) {
                let count = fresh.len() as u64;
                light.insert(Age::Present, run.key, run.paths, &samples[fresh]);
                self.received.earlier.note(run.key, count);
                match message.source {
                    SampleSource::Part | SampleSource::Earlier => self.counts.parts += count,
                    SampleSource::Traced | SampleSource::Stored if is_late => {
                        self.counts.late += count
                    }
                    SampleSource::Traced => self.counts.traced += count,
                    SampleSource::Stored => self.counts.stored += count,
                }
            }
        }
    }

    /// Takes the samples of an earlier generation out of the driver that no longer count.
    pub fn fade(&mut self, light: &mut dyn Light) {
        let mut earlier = std::mem::take(&mut self.received.earlier);
        earlier.fade(light, |key| self.received.count(key));
        self.received.earlier = earlier;
    }

    /// Passes live rays to the renderer, if they were requested for this view.
    pub fn insert_live(&mut self, renderer: &mut dyn Renderer, message: &LiveSamples) {
        if message.view == self.first_request
            && let Some(live) = &mut self.live
        {
            let fresh = live.take(&message.samples);
            if !fresh.is_empty() {
                renderer.insert_live(live.paths(), &fresh);
            }
        }
    }
}
