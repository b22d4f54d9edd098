//! Requests of a session to the server. First the beams of a view, then other beams with samples of
//! what it shows, single rays, and rays outside all sections.

use std::{
    collections::HashSet,
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use glam::DVec3;
use holo_display::{
    FrameRequest, Search, SelectOptions, Selection, UsefulBeam, ViewPhases, select_beams, viewpoint,
};
use holo_proto::{
    LEAST_TRACED_WEIGHT,
    bulk::{LiveWanted, RaysWanted, RequestedBeam, ViewRequest, WantedRay},
    control::{Control, Engine},
    frame::FrameKind,
};
use holo_section::{BeamId, BeamKey, Section};

use super::{
    EyeVelocity, Session, Waker,
    current_view::{ArrivalCounts, CurrentView, RequestedSamples},
    focus::concentrate,
    incoming::Incoming,
    live::LiveRays,
    received::Received,
    weighing_schedule::WeighingSchedule,
};

/// Assumed distance of the nearest visible surface before anything is known of the scene, as a
/// share of the shortest section's diagonal. If it is too small, the rays are only less useful to
/// other views.
const GUESSED_DISTANCE: f64 = 0.05;

/// Delay from the request of a view until the nearest visible surface is taken from the picture.
const NEAREST_AFTER: Duration = Duration::from_millis(300);

/// Share of pixels that may be nearer than the "nearest" surface, so that the edge of a lamp does
/// not decide for the whole room.
const NEARER_PIXELS: f64 = 0.01;

/// Largest weight of beams whose stored samples are wanted, but no new ones.
const STORED_ONLY: f32 = 0.5 * LEAST_TRACED_WEIGHT;

/// Least interval between requests while the eye moves, for drivers that keep samples or take late
/// ones: samples of one view serve the next. A request replaces the one before, so faster requests
/// would never receive any samples.
const MOVING_EVERY: Duration = Duration::from_millis(150);

/// Longest time for which a moving eye waits for the stored samples of one request before the next.
/// The server does not know what is under way, and would send it again.
const MOVING_PATIENCE: Duration = Duration::from_secs(1);

/// Time for which a person must have looked at a view before the session searches for beams that
/// end on what it shows.
pub(super) const SEARCH_AFTER: Duration = Duration::from_millis(400);

/// Time after which a view is at rest. Until then, a person may move on at once.
const AT_REST: Duration = Duration::from_millis(150);

/// Interval between requests of single rays, for drivers that request them.
const RAYS_EVERY: Duration = Duration::from_millis(50);

/// Most beams of which the stored samples are requested for a view of captured rays: those of a
/// section with the usual grid, and more.
const EVERY_BEAM: u64 = 250_000;

/// The error that no section covers any part of a view.
#[derive(Debug)]
pub struct Uncovered(String);

impl std::fmt::Display for Uncovered {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "no section of the holodeck covers anything of this view ({})", self.0)
    }
}

impl std::error::Error for Uncovered {}

impl Session {
    /// Shows the current view again with another driver. Its seconds continue.
    pub(super) fn show_again(&mut self) -> Result<()> {
        let Some(CurrentView { look, since, .. }) = self.current else { return Ok(()) };
        self.look_anew(look)?;
        self.current.iter_mut().for_each(|current| current.since = since);
        Ok(())
    }

    /// Shows the current view at another size. What was requested stays requested, and samples that
    /// have arrived count as before.
    fn resize(&mut self, look: FrameRequest) -> Result<()> {
        let sections = &self.sections;
        let options = SelectOptions::default();
        let Selection { beams, .. } = select_beams(sections, &look.view, look.size, &options);
        self.driver.renderer.look(&look)?;
        let uncovered = self.uncovered();
        let paths = self.welcome.settings.paths_per_sample;
        let Some(current) = &mut self.current else { return Ok(()) };
        current.phases = ViewPhases::after(Some(&current.phases), look.is_moving);
        if current.asked == RequestedSamples::All {
            current.phases.settle();
            self.driver.renderer.settle();
        }
        (current.look, current.ready) = (look, Instant::now());
        current.live = LiveRays::new(uncovered, look.view, look.size, paths);
        let has_more = beams.len() > current.wanted.len();
        if has_more {
            current.wanted = beams.iter().map(requested).collect();
            return self.ask_for_all();
        }
        Ok(())
    }

    /// Shows a view.
    ///
    /// # Errors
    /// If the driver cannot show the view, or no section covers any of it.
    pub fn look(&mut self, look: FrameRequest) -> Result<()> {
        // Live rays of the other size must not be taken for those of this one.
        let is_same = |current: &CurrentView| {
            let is_at_rest = !look.is_moving && !current.look.is_moving;
            is_at_rest && current.look.view == look.view && current.live.is_none()
        };
        if self.keeps_samples() && self.current.as_ref().is_some_and(is_same) {
            return self.resize(look);
        }
        self.look_anew(look)
    }

    /// Shows a view, also if it was shown before.
    fn look_anew(&mut self, look: FrameRequest) -> Result<()> {
        let serves_next = self.keeps_samples() || self.driver.takes_late;
        if self.is_moving() && serves_next && self.requested_just_now() {
            return self.look_on(look);
        }
        let since = Instant::now();
        let sections = &self.sections;
        let is_inside = sections.iter().any(|section| section.contains(look.view.vp));
        let stops =
            !self.is_moving() && self.current.as_ref().is_some_and(|view| view.look.is_moving);
        let has_light = self.has_whole_file() || (stops && self.keeps_samples());
        if is_inside && has_light && self.current.is_some() {
            // Most light is already here, so the view is shown before anything is requested.
            self.look_on(look)?;
            self.current.iter_mut().for_each(|current| current.since = since);
            self.is_unasked = true;
            return Ok(());
        }
        self.look_and_ask(look, since, false)
    }

    /// Shows a view to the driver, unless `has_looked`, and requests the samples that it needs.
    fn look_and_ask(&mut self, look: FrameRequest, since: Instant, has_looked: bool) -> Result<()> {
        let FrameRequest { view, size, .. } = look;
        let sections = &self.sections;
        let Selection { beams, covered } =
            select_beams(sections, &view, size, &SelectOptions::default());
        if covered.covered_rays == 0 {
            bail!(Uncovered(view.to_vf_options()));
        }
        let diagonal = sections.iter().map(Section::diagonal).fold(f64::INFINITY, f64::min);
        let nearest = GUESSED_DISTANCE * diagonal;
        let beams = self.driver.renderer.wishes().weigh(&look, beams)?;
        let wanted: Vec<RequestedBeam> = beams.iter().map(requested).collect();
        self.request_number += 1;
        let before = self.current.take();
        let had_live = before.as_ref().is_some_and(|before| before.live.is_some());
        let phases = match &before {
            Some(before) if has_looked => before.phases,
            before => {
                ViewPhases::after(before.as_ref().map(|before| &before.phases), look.is_moving)
            }
        };
        let received = before.filter(|_| self.keeps_samples()).map(|before| before.received);
        let received = received.unwrap_or_default();
        // The request goes first: samples are under way while the driver evaluates the view.
        let radius = self.driver.renderer.wishes().viewpoint_radius(&look, nearest);
        self.request(&look, radius, wanted.clone(), &received)?;
        if had_live {
            // Cancels the live rays of the view before.
            let none = LiveWanted { view: self.request_number, pixels: 0, rays: Vec::new() };
            self.outbox.send(FrameKind::LiveWanted, &none.encode())?;
        }
        if !has_looked {
            self.driver.renderer.look(&look)?;
        }
        let paths = self.welcome.settings.paths_per_sample;
        let uncovered = self.uncovered();
        self.current = Some(CurrentView {
            look,
            phases,
            wanted,
            nearest,
            nearest_is_seen: false,
            live: LiveRays::new(uncovered, view, size, paths),
            ready: Instant::now(),
            asked: RequestedSamples::Crossed,
            has_crossed: false,
            is_searching: false,
            asks_later: false,
            also: Vec::new(),
            first_request: self.request_number,
            received,
            since,
            counts: ArrivalCounts::default(),
            rays_asked: Some(since),
            weighing: WeighingSchedule::new(since),
            has_new_frame: false,
        });
        self.ask_rays()?;
        if self.driver.knows_surfaces {
            self.see_nearest()?;
            if self.keeps_samples() {
                // Such a driver chooses beams without waiting for samples.
                self.ask_on(false)?;
            }
        }
        Ok(())
    }

    /// Requests the stored samples of the beams that other views cross and the current one does
    /// not. The current view stays.
    ///
    /// # Errors
    /// If the server is lost.
    pub fn ask_beside(&mut self, looks: &[FrameRequest]) -> Result<()> {
        if self.has_whole_file() {
            return Ok(());
        }
        let (sections, options) = (&self.sections, SelectOptions::default());
        let beams = looks
            .iter()
            .flat_map(|look| select_beams(sections, &look.view, look.size, &options).beams);
        let beams: Vec<_> = beams.collect();
        let Some(current) = &mut self.current else { return Ok(()) };
        let known: HashSet<BeamKey> = current.wanted.iter().map(|beam| beam.key).collect();
        let others = beams.into_iter().filter(|beam| !known.contains(&beam.key));
        let others: Vec<UsefulBeam> = others.map(|beam| (beam.key, 1.0)).collect();
        if others.is_empty() {
            return Ok(());
        }
        current.also.extend(others);
        self.awaits_beside = true;
        self.ask_for_all()
    }

    /// Returns the pixels of the current view that live rays can improve, if the server traces.
    fn uncovered(&mut self) -> Vec<u32> {
        match self.welcome.tracing {
            true => self.driver.renderer.wishes().uncovered(),
            false => Vec::new(),
        }
    }

    /// Returns whether the last request is too recent to be replaced while the eye moves.
    fn requested_just_now(&self) -> bool {
        let has_crossed = self.current.as_ref().is_none_or(|current| current.has_crossed);
        self.since().elapsed() < if has_crossed { MOVING_EVERY } else { MOVING_PATIENCE }
    }

    /// Shows a view while samples for the view before still arrive.
    fn look_on(&mut self, look: FrameRequest) -> Result<()> {
        let Some(current) = &mut self.current else { return Ok(()) };
        self.driver.renderer.look(&look)?;
        current.phases = ViewPhases::after(Some(&current.phases), look.is_moving);
        (current.look, current.ready) = (look, Instant::now());
        // The live rays belonged to another view.
        current.live = None;
        Ok(())
    }

    /// Requests the samples of the current view, if nothing was requested for it yet.
    pub(super) fn ask_if_unasked(&mut self) -> Result<()> {
        match self.current {
            Some(CurrentView { look, since, .. }) if std::mem::take(&mut self.is_unasked) => {
                self.look_and_ask(look, since, true)
            }
            _ => Ok(()),
        }
    }

    /// Sends all requests that are due. Returns when the next one is due.
    pub(super) fn ask_for_what_is_due(
        &mut self,
        now: Instant,
        ending: bool,
    ) -> Result<Option<Instant>> {
        self.keep_objects_if_due();
        self.ask_if_unasked()?;
        self.ask_for_lights()?;
        let Some(current) = &self.current else { return Ok(None) };
        let rests = current.since + AT_REST;
        let nearest = (!current.nearest_is_seen).then(|| current.since + NEAREST_AFTER);
        let next_rays = |asked| if current.has_new_frame { now } else { asked + RAYS_EVERY };
        let rays = current.rays_asked.filter(|_| !ending).map(next_rays);
        let search = current.since + SEARCH_AFTER;
        let searches = current.asks_later && !self.is_moving();
        let late = current.is_late_at();
        if nearest.is_some_and(|at| now >= at) {
            self.see_nearest()?;
        }
        if searches && now >= search {
            self.current.iter_mut().for_each(|current| current.asks_later = false);
            self.ask_on(ending)?;
        }
        let asks_rays = rays.is_some_and(|at| now >= at);
        if asks_rays {
            self.ask_rays()?;
        }
        // A person who moves on at once does not need live rays, and they delay stored samples.
        if !ending && now >= rests {
            self.ask_live()?;
        }
        let rays = if asks_rays { Some(now + RAYS_EVERY) } else { rays };
        let ahead = if ending { None } else { self.ask_ahead(now)? };
        let weighing = if ending { None } else { self.weigh_if_due(now)? };
        let search = searches.then_some(search);
        let due = [Some(rests), Some(late), search, nearest, rays, ahead, weighing];
        Ok(due.into_iter().flatten().filter(|at| *at > now).min())
    }

    /// Requests further stored samples from beams whose rays may end on what the view shows: first
    /// most of these beams, then all. A thread searches for these beams.
    ///
    /// When the samples have been sent, workers return to the view's own beams, unless the session
    /// ends.
    pub(super) fn ask_on(&mut self, ending: bool) -> Result<()> {
        if self.has_whole_file() {
            return self.has_all(ending);
        }
        let Some(current) = &mut self.current else { return Ok(()) };
        let is_fresh = current.since.elapsed() < SEARCH_AFTER;
        if (self.velocity.is_some() || is_fresh) && !ending {
            // The search takes threads from drawing, and a person who only pauses must not wait for
            // it.
            current.asks_later = true;
            return Ok(());
        }
        let asks_all = current.asked == RequestedSamples::Crossed
            && self.welcome.settings.engine == Engine::Captured;
        if asks_all {
            let also = every_beam(&self.sections, current.look.view.vp);
            (current.asked, current.also) = (RequestedSamples::Surfaces, also);
            return self.ask_for_all();
        }
        let search = match current.asked {
            _ if current.is_searching => return Ok(()),
            RequestedSamples::Crossed => Search::Quick,
            RequestedSamples::Best => Search::Thorough,
            RequestedSamples::Surfaces => {
                let wanted = current.wanted.clone();
                if self.welcome.tracing && !ending {
                    self.ask_anew(wanted)?;
                }
                return self.has_all(ending);
            }
            RequestedSamples::All => return Ok(()),
        };
        let Some(search) = self.driver.renderer.wishes().surface_beams(search) else {
            return self.has_all(ending);
        };
        let first_request = current.first_request;
        current.is_searching = true;
        let Waker(messages) = self.waker.clone();
        let search = move || {
            // If the session is over, the beams have no use.
            let _ = messages.send(Incoming::Found { first_request, beams: search() });
        };
        thread::Builder::new().name("beams".into()).spawn(search).context("a search")?;
        Ok(())
    }

    /// Requests the stored samples of the beams that a search found. The search was for the view
    /// whose first request was `first_request`.
    pub(super) fn ask_for_found(
        &mut self,
        first_request: u32,
        beams: Vec<UsefulBeam>,
        ending: bool,
    ) -> Result<()> {
        let is_of = |current: &&mut CurrentView| current.first_request == first_request;
        let Some(current) = self.current.as_mut().filter(is_of) else { return Ok(()) };
        current.is_searching = false;
        if current.asked == RequestedSamples::All {
            return Ok(());
        }
        if self.velocity.is_some() && !ending {
            // The beams were found for an earlier position of the eye.
            current.asks_later = true;
            return Ok(());
        }
        if beams.is_empty() {
            return self.has_all(ending);
        }
        let next = if current.asked == RequestedSamples::Crossed {
            RequestedSamples::Best
        } else {
            RequestedSamples::Surfaces
        };
        (current.asked, current.also) = (next, beams);
        self.ask_for_all()
    }

    /// Records that all stored samples for the view have arrived.
    fn has_all(&mut self, ending: bool) -> Result<()> {
        self.current.iter_mut().for_each(|current| current.asked = RequestedSamples::All);
        self.settle_view();
        if ending { self.ask_to_settle() } else { Ok(()) }
    }

    /// Asks the server to settle, if no further request of stored samples is pending. Otherwise the
    /// last request asks for it.
    pub(super) fn ask_to_settle(&mut self) -> Result<()> {
        if self.current.as_ref().is_none_or(|current| current.asked == RequestedSamples::All) {
            self.outbox.control(&Control::Settle { view: self.request_number })?;
        }
        Ok(())
    }

    /// Requests all stored samples that are useful to the view.
    pub(super) fn ask_for_all(&mut self) -> Result<()> {
        let Some(current) = &self.current else { return Ok(()) };
        let also = |&(key, useful): &UsefulBeam| RequestedBeam {
            key,
            weight: STORED_ONLY * useful,
            held: 0,
            has_earlier: false,
        };
        let mut wanted = current.wanted.clone();
        wanted.extend(current.also.iter().map(also));
        // The sort is stable, so `dedup` keeps the view's own weight of a beam.
        wanted.sort_by_key(|wanted| wanted.key);
        wanted.dedup_by_key(|wanted| wanted.key);
        self.ask_anew(wanted)
    }

    /// Sends a request under a new number, so that the server sends all stored samples that are not
    /// here yet.
    pub(super) fn ask_anew(&mut self, wanted: Vec<RequestedBeam>) -> Result<()> {
        self.request_number += 1;
        self.request_current(wanted)
    }

    fn request_current(&mut self, wanted: Vec<RequestedBeam>) -> Result<()> {
        let Some(current) = &self.current else { return Ok(()) };
        let (look, nearest) = (current.look, current.nearest);
        let radius = self.driver.renderer.wishes().viewpoint_radius(&look, nearest);
        self.request(&look, radius, wanted, &current.received)
    }

    /// Sends a request for a view whose rays should pass within `radius` of the eye. Stored samples
    /// of a beam are not sent if all of them are in `received`.
    fn request(
        &self,
        look: &FrameRequest,
        radius: f64,
        mut beams: Vec<RequestedBeam>,
        received: &Received,
    ) -> Result<()> {
        let viewpoint = viewpoint(&self.sections, &look.view, radius);
        for beam in &mut beams {
            beam.held = received.held(beam.key);
            beam.has_earlier = received.earlier.has(beam.key);
        }
        if let Some(part) = self.focus {
            concentrate(&self.sections, look, part, &mut beams);
        }
        if self.is_paused {
            beams.iter_mut().for_each(|beam| beam.weight = beam.weight.min(STORED_ONLY));
        }
        let request = ViewRequest { view: self.request_number, viewpoint, beams };
        Ok(self.outbox.send(FrameKind::View, &request.encode())?)
    }

    /// Takes the distance of the nearest visible surface from the picture, and requests rays that
    /// pass the eye accordingly.
    fn see_nearest(&mut self) -> Result<()> {
        let mut depths = self.driver.renderer.wishes().depths();
        let Some(current) = &mut self.current else { return Ok(()) };
        current.nearest_is_seen = true;
        depths.retain(|&depth| depth > 0.0 && depth.is_finite());
        if depths.is_empty() {
            return Ok(());
        }
        let at = (depths.len() as f64 * NEARER_PIXELS) as usize;
        let (_, &mut nearest, _) = depths.select_nth_unstable_by(at, f32::total_cmp);
        current.nearest = f64::from(nearest);
        let wanted = current.wanted.clone();
        self.request_current(wanted)
    }

    /// Requests the single rays that the driver wants most.
    fn ask_rays(&mut self) -> Result<()> {
        let traces = self.welcome.tracing && !self.is_paused;
        let Some(current) = self.current.as_mut().filter(|_| traces) else { return Ok(()) };
        let now = Instant::now();
        let ahead =
            |velocity: EyeVelocity| velocity.ahead(&current.look.view, self.ray_delay.expected());
        let expected = self.velocity.and_then(ahead);
        let wanted = self.driver.renderer.wishes().rays(expected.as_ref());
        (current.rays_asked, current.has_new_frame) = (wanted.is_some().then_some(now), false);
        let rays = wanted.unwrap_or_default().into_iter();
        rays.as_slice().first().iter().for_each(|first| self.ray_delay.request(**first, now));
        let rays = rays.map(|(key, coords)| WantedRay { key, coords });
        let request = RaysWanted { view: self.request_number, rays: rays.collect() };
        if request.rays.is_empty() {
            // Every pixel has enough rays for now.
            return Ok(());
        }
        Ok(self.outbox.send(FrameKind::Rays, &request.encode())?)
    }

    /// Requests rays outside all sections, if workers trace.
    fn ask_live(&mut self) -> Result<()> {
        let has_workers = self.status.as_ref().is_some_and(|status| status.workers > 0);
        let traces = has_workers && !self.is_paused;
        let Some(current) = self.current.as_mut().filter(|_| traces) else { return Ok(()) };
        let Some(live) = &mut current.live else { return Ok(()) };
        let rays = live.wanted();
        if rays.is_empty() {
            return Ok(());
        }
        let request = LiveWanted { view: current.first_request, pixels: live.pixels(), rays };
        Ok(self.outbox.send(FrameKind::LiveWanted, &request.encode())?)
    }
}

/// Returns the request of a beam, none of whose samples are here.
pub(super) fn requested(beam: &holo_display::WantedBeam) -> RequestedBeam {
    RequestedBeam { key: beam.key, weight: beam.weight, held: 0, has_earlier: false }
}

/// Returns all beams of as many sections as the limit allows, those around the eye first. Captured
/// rays pass few eyes: a view between these may cross none of their beams, and then nothing is
/// known of its surfaces.
fn every_beam(sections: &[Section], eye: DVec3) -> Vec<UsefulBeam> {
    let mut order: Vec<(usize, &Section)> = sections.iter().enumerate().collect();
    order.sort_by_key(|(_, section)| !section.contains(eye));
    let mut all = Vec::new();
    for (index, section) in order {
        let Ok(index) = u16::try_from(index) else { continue };
        if all.len() as u64 + section.beam_count() <= EVERY_BEAM {
            let key = |beam| BeamKey { section: index, beam: BeamId(beam) };
            all.extend((0..section.beam_count()).map(|beam| (key(beam), 1.0)));
        }
    }
    all
}
