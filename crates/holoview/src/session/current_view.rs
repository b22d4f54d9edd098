//! The view that a session shows, and what has arrived for it.

use std::time::Instant;

use holo_display::{Driver, Look, UsefulBeam};
use holo_proto::bulk::{LiveSamples, Samples, Source, WantedBeam};

use super::{live::LiveRays, received::Received};

/// A view and what has arrived for it.
pub struct CurrentView {
    pub look: Look,
    /// Beams that the view crosses, and how much each is wanted.
    pub wanted: Vec<WantedBeam>,
    /// Distance of the nearest visible surface, scene units, as far as it is known.
    pub nearest: f64,
    /// Whether that distance was looked up in the picture.
    pub nearest_is_seen: bool,
    /// Rays that no section covers, if something traces.
    pub live: Option<LiveRays>,
    /// Until when only every other column and row is looked at. `None` if all pixels are.
    pub glance_until: Option<Instant>,
    /// How far its stored samples have been asked for.
    pub asked: Asked,
    /// Whether a thread searches for the next ones.
    pub is_searching: bool,
    /// Whether it would have asked on, if the eye had not moved.
    pub asks_later: bool,
    /// Beams that it does not cross but whose rays may end on what it sees, once asked for.
    pub also: Vec<UsefulBeam>,
    /// Number of its first request: samples of earlier requests are dropped.
    pub first_request: u32,
    pub received: Received,
    pub since: Instant,
    pub counts: Counts,
    /// When single rays were last asked for.
    pub rays_asked: Instant,
}

/// How many samples have arrived for a view.
#[derive(Clone, Default)]
pub struct Counts {
    /// From the file.
    pub stored: u64,
    /// From workers.
    pub traced: u64,
    /// From the file, of parts that no view asked for.
    pub parts: u64,
    /// Seconds until the first ones were here.
    pub first_samples: Option<f64>,
}

/// Which stored samples of a view have been asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// Those of the beams that it crosses.
    Crossed,
    /// And of most beams that end on what it sees.
    Best,
    /// And of all beams that end on what it sees.
    Surfaces,
    /// All that there are.
    All,
}

impl CurrentView {
    /// Hands samples to the driver, except those that it has.
    pub fn insert(&mut self, driver: &mut dyn Driver, message: &Samples) {
        if !matches!(message.source, Source::Part | Source::Earlier) {
            let seconds = self.since.elapsed().as_secs_f64();
            self.counts.first_samples.get_or_insert(seconds);
        }
        for (run, samples) in message.iter() {
            if message.source == Source::Earlier {
                let present = self.received.count(run.key);
                self.counts.stored += self.received.earlier.insert(driver, run, samples, present);
                continue;
            }
            for fresh in self.received.add(run) {
                let count = fresh.len() as u64;
                driver.insert(run.key, run.paths, &samples[fresh]);
                self.received.earlier.note(run.key, count);
                match message.source {
                    Source::Traced => self.counts.traced += count,
                    Source::Stored => self.counts.stored += count,
                    Source::Part | Source::Earlier => self.counts.parts += count,
                }
            }
        }
    }

    /// Takes the samples of an earlier generation out of the driver that no longer count.
    pub fn fade(&mut self, driver: &mut dyn Driver) {
        let mut earlier = std::mem::take(&mut self.received.earlier);
        earlier.fade(driver, |key| self.received.count(key));
        self.received.earlier = earlier;
    }

    /// Hands live rays to the driver, if they are the view's own.
    pub fn insert_live(&mut self, driver: &mut dyn Driver, message: &LiveSamples) {
        if message.view == self.first_request
            && let Some(live) = &mut self.live
        {
            let fresh = live.take(&message.samples);
            if !fresh.is_empty() {
                driver.insert_live(live.paths(), &fresh);
            }
        }
    }
}
