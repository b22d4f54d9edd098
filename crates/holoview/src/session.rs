//! One session: a view, the samples that arrive for it, and pictures when the script says so.

use std::{
    net::SocketAddr,
    path::PathBuf,
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use glam::DVec3;
use holo_display::{Resolution, SelectOptions, Selection, select_beams};
use holo_net::{Message, Outbox, Shutdown};
use holo_picture::{View, ViewSpec};
use holo_progress::Meter;
use holo_proto::{
    LEAST_TRACED_WEIGHT,
    bulk::{LiveWanted, RaysWanted, ViewRequest, WantedBeam, WantedRay},
    control::{Control, Welcome},
    frame::Kind,
    hello::Role,
};
use holo_section::{BeamId, BeamKey, Section};

use crate::{
    Config,
    canvas::{AT_REST, Pace, Painter},
    default_view,
    incoming::{self, Incoming},
    lights::Lights,
    live::Live,
    received::Received,
    script::{Command, Next, Script, Step},
    shown::{Asked, Shown},
};

/// The nearest visible surface, as a share of the section's diagonal, before anything is known of the scene. Too near
/// costs nothing but rays that are of less use to neighbouring views.
const GUESSED_DISTANCE: f64 = 0.05;

/// When the nearest visible surface is looked up in the picture, after the view was asked for.
const REFINE_AFTER: Duration = Duration::from_millis(300);

/// Share of the pixels that may be nearer than the "nearest" surface: a lamp's edge must not decide for the room.
const NEARER_PIXELS: f64 = 0.01;

/// Weight of beams that are wanted for what is stored of them, not to be traced.
const STORED_ONLY: f32 = 0.5 * LEAST_TRACED_WEIGHT;

/// How often single rays are asked for, of drivers that can say which.
const RAYS_EVERY: Duration = Duration::from_millis(50);

/// How often a typed script is looked at.
const TYPED_TICK: Duration = Duration::from_millis(20);

/// How long messages that have arrived are taken after the time for a picture has come.
const LATE: Duration = Duration::from_millis(20);

/// How long the server may take to settle: it gives hanging workers up after some seconds.
const SETTLE_TIME: Duration = Duration::from_secs(60);

/// Connects and follows the script; see [`crate::run`].
pub async fn run(
    config: Config,
    address: SocketAddr,
    script: Script,
    shutdown: Shutdown,
) -> Result<()> {
    let name = format!("holoview {}", std::process::id());
    let connection = holo_net::connect(address, Role::Display, &name).await;
    let (mut inbox, outbox, welcome) =
        connection.with_context(|| format!("connecting to the holoserver at {address}"))?;
    let sections =
        welcome.sections.iter().cloned().map(Section::new).collect::<Result<Arc<[_]>, _>>();
    let sections = sections.context("the server's sections")?;
    let painter =
        Painter::new(config.driver, &config.points, &sections, &mut inbox, &outbox, &welcome)
            .await?;
    let lights = Lights::new(painter.records()).context("starting a thread")?;
    let (sender, messages) = mpsc::channel();
    let reader =
        tokio::spawn(incoming::read(inbox, outbox.clone(), sender.clone(), lights.clone()));
    let ended = tokio::spawn(async move {
        shutdown.wait().await;
        // If the session is over there is no one to tell.
        let _ = sender.send(Incoming::Stop);
    });
    // Drawing takes the processor for a while; sockets must not wait for it.
    let session = tokio::task::spawn_blocking(move || {
        let meter = Meter::new(config.quiet || config.json);
        let mut session = Session {
            config,
            welcome,
            sections,
            painter,
            lights,
            outbox,
            messages,
            shown: None,
            view_number: 0,
            pace: Pace::default(),
            workers: 0,
            meter,
            start: Instant::now(),
            duration: script.duration(),
        };
        session.follow(script)
    });
    let result = session.await?;
    reader.abort();
    ended.abort();
    result
}

struct Session {
    config: Config,
    welcome: Welcome,
    sections: Arc<[Section]>,
    painter: Painter,
    lights: Lights,
    outbox: Outbox,
    messages: mpsc::Receiver<Incoming>,
    shown: Option<Shown>,
    view_number: u32,
    pace: Pace,
    /// Workers that the server has, by what it said last.
    workers: u32,
    meter: Meter,
    start: Instant,
    duration: f64,
}

/// What made a wait end.
#[derive(PartialEq)]
enum Waited {
    TimeUp,
    Settled,
    Stop,
}

impl Session {
    fn follow(&mut self, mut script: Script) -> Result<()> {
        let named = self.welcome.views.clone();
        let mut base =
            ViewSpec { vu: Some(DVec3::from_array(self.welcome.up)), ..ViewSpec::default() };
        if let Some((_, first)) = named.first() {
            base.apply_line(first).context("the holodeck's own view")?;
        } else if let Some(section) = self.sections.first() {
            base = default_view(section, DVec3::from_array(self.welcome.up));
        }
        let said = self.config.view.spec(&named)?;
        let mut spec = base.overridden_by(&said);
        // A script's first view stands for the options' one: nothing is asked for that nobody looks at.
        let mut pending = script.next_step()?;
        if !matches!(&pending, Next::Step(Step { command: Command::View(_), seconds }) if seconds.unwrap_or(0.0) == 0.0)
        {
            self.show(spec)?;
        }
        loop {
            let step = match pending {
                Next::Step(step) => step,
                Next::End => break,
                Next::NotYet => {
                    if self.wait(Instant::now() + TYPED_TICK, false)? == Waited::Stop {
                        return Ok(());
                    }
                    pending = script.next_step()?;
                    continue;
                }
            };
            let since = self.shown.as_ref().map_or(self.start, |shown| shown.since);
            if let Some(seconds) = step.seconds
                && self.wait(since + Duration::from_secs_f64(seconds), false)? == Waited::Stop
            {
                break;
            }
            match step.command {
                Command::View(change) => {
                    spec = spec.overridden_by(&change);
                    self.show(spec)?;
                }
                Command::Picture(path) => self.picture(path)?,
                Command::Switch { parts, on } => self.painter.switch(&parts, on)?,
                Command::Quit => break,
            }
            pending = script.next_step()?;
        }
        self.end()
    }

    /// Asks for a view.
    fn show(&mut self, spec: ViewSpec) -> Result<()> {
        let (view, size) = spec.resolve(self.config.view.size)?;
        let resolution = self.pace.next();
        self.look(view, size, resolution)
    }

    /// Shows a view again that was asked for while moving, now at full resolution. Its seconds go on.
    fn rest(&mut self) -> Result<()> {
        let Some(Shown { view, size, since, .. }) = self.shown else { return Ok(()) };
        let resolution = self.pace.rest();
        self.look(view, size, resolution)?;
        self.shown.iter_mut().for_each(|shown| shown.since = since);
        Ok(())
    }

    fn look(&mut self, view: View, size: (u32, u32), resolution: Resolution) -> Result<()> {
        let Selection { beams, covered } =
            select_beams(&self.sections, &view, size, &SelectOptions::default());
        if covered.covered_rays == 0 {
            bail!(
                "no section of the holodeck covers anything of this view ({})",
                view.to_vf_options()
            );
        }
        let wanted: Vec<WantedBeam> = (self.painter.weigh(view, size, beams)?)
            .iter()
            .map(|beam| WantedBeam {
                key: BeamKey { section: beam.section, beam: beam.beam },
                weight: beam.weight,
            })
            .collect();
        self.view_number += 1;
        let since = Instant::now();
        let diagonal = self.sections.iter().map(Section::diagonal).fold(f64::INFINITY, f64::min);
        let nearest = GUESSED_DISTANCE * diagonal;
        // Asked first: samples are under way while the driver looks at the scene.
        self.request(&view, size, nearest, wanted.clone())?;
        if self.shown.as_ref().is_some_and(|shown| shown.live.is_some()) {
            // Those of the view before are of no use any more.
            let none = LiveWanted { view: self.view_number, pixels: 0, rays: Vec::new() };
            self.outbox.send(Kind::LiveWanted, &none.encode())?;
        }
        let canvas = self.painter.canvas(
            Arc::clone(&self.sections),
            view,
            size,
            self.welcome.sky,
            resolution,
        );
        let paths = self.welcome.settings.paths_per_sample;
        let live = Live::new(&canvas, view, size, self.welcome.sky, paths)
            .filter(|_| self.welcome.tracing);
        self.shown = Some(Shown {
            view,
            size,
            wanted,
            nearest,
            canvas,
            live,
            asked: Asked::Crossed,
            also: Vec::new(),
            first_request: self.view_number,
            received: Received::default(),
            since,
            stored: 0,
            stored_of: vec![0; self.sections.len()],
            traced: 0,
            first_samples: None,
            refined: false,
            rays_asked: self.painter.wants_rays().then_some(since),
        });
        self.ask_rays()?;
        if let Some(shown) = &mut self.shown {
            shown.canvas.set_nearest(nearest);
        }
        if matches!(self.painter, Painter::Voronoi(..)) { self.refine() } else { Ok(()) }
    }

    /// Once all stored samples of the beams asked for have been sent: asks for what else is of use.
    ///
    /// The view's own beams come first, then those that hold most of what is seen, then all whose rays may end on it. Those are for what is stored: when it
    /// has been sent, workers turn back to the view's own, unless the session ends.
    fn ask_on(&mut self, ending: bool) -> Result<()> {
        let Some(shown) = &mut self.shown else { return Ok(()) };
        match shown.asked {
            Asked::Crossed => {
                let held = shown.samples_of_beam();
                let held = |section: u16| held.get(usize::from(section)).copied().unwrap_or(1.0);
                shown.also = shown.canvas.best_surface_beams(held);
                shown.asked = Asked::Best;
                if shown.also.is_empty() { self.ask_on(ending) } else { self.ask_for_all() }
            }
            Asked::Best => {
                shown.also = shown.canvas.surface_beams();
                shown.asked = if shown.also.is_empty() { Asked::All } else { Asked::Surfaces };
                if shown.asked == Asked::Surfaces { self.ask_for_all() } else { Ok(()) }
            }
            Asked::Surfaces => {
                shown.asked = Asked::All;
                let wanted = shown.wanted.clone();
                if self.welcome.tracing && !ending { self.ask_anew(wanted) } else { Ok(()) }
            }
            Asked::All => Ok(()),
        }
    }

    /// Asks for everything stored that is of use to the view.
    fn ask_for_all(&mut self) -> Result<()> {
        let Some(shown) = &self.shown else { return Ok(()) };
        let also = |&(section, beam): &(u16, BeamId)| WantedBeam {
            key: BeamKey { section, beam },
            weight: STORED_ONLY,
        };
        let mut wanted = shown.wanted.clone();
        wanted.extend(shown.also.iter().map(also));
        // A stable sort: the view's own weight stands before the other's, which goes.
        wanted.sort_by_key(|wanted| wanted.key);
        wanted.dedup_by_key(|wanted| wanted.key);
        self.ask_anew(wanted)
    }

    /// A request under a new number: what is stored of these beams is sent from the beginning.
    fn ask_anew(&mut self, wanted: Vec<WantedBeam>) -> Result<()> {
        self.view_number += 1;
        self.request_shown(wanted)
    }

    fn request_shown(&self, wanted: Vec<WantedBeam>) -> Result<()> {
        self.shown
            .as_ref()
            .map_or(Ok(()), |shown| self.request(&shown.view, shown.size, shown.nearest, wanted))
    }

    /// Sends a view, with a viewpoint for the nearest visible surface at `nearest`.
    fn request(
        &self,
        view: &View,
        size: (u32, u32),
        nearest: f64,
        beams: Vec<WantedBeam>,
    ) -> Result<()> {
        let radius = self.painter.radius(view, size, nearest);
        let viewpoint = holo_display::viewpoint(&self.sections, view, radius);
        let request = ViewRequest { view: self.view_number, viewpoint, beams };
        Ok(self.outbox.send(Kind::View, &request.encode())?)
    }

    /// Takes samples until `deadline`, or until the server has settled if that is waited for.
    ///
    /// What has arrived by then is taken, as far as [`LATE`] allows: a server that never pauses makes nobody wait.
    fn wait(&mut self, deadline: Instant, for_settled: bool) -> Result<Waited> {
        // Drawing the picture before may have taken until after the deadline.
        let last = deadline.max(Instant::now()) + LATE;
        loop {
            if Instant::now() >= last {
                return Ok(Waited::TimeUp);
            }
            let refine = self
                .shown
                .as_ref()
                .filter(|shown| !shown.refined)
                .map(|shown| shown.since + REFINE_AFTER);
            let asked =
                self.shown.as_ref().and_then(|shown| shown.rays_asked).filter(|_| !for_settled);
            let mut rays = asked.map(|asked| asked + RAYS_EVERY);
            if rays.is_some_and(|rays| Instant::now() >= rays) {
                self.ask_rays()?;
                rays = Some(Instant::now() + RAYS_EVERY);
            }
            let rest = self
                .shown
                .as_ref()
                .map(|shown| shown.since + AT_REST)
                .filter(|rest| *rest > Instant::now());
            if rest.is_none() && self.shown.as_ref().is_some_and(|shown| shown.canvas.is_moving()) {
                self.rest()?;
                continue;
            }
            // Who moves on at once has no use for them, and they take time from what is stored.
            if rest.is_none() && !for_settled {
                self.ask_live()?;
            }
            let until = [refine, rays, rest].into_iter().flatten().fold(deadline, Instant::min);
            let left = until.saturating_duration_since(Instant::now());
            match self.messages.recv_timeout(left) {
                Ok(Incoming::Message(Message::Samples(samples))) => {
                    self.shown_as(samples.view)
                        .into_iter()
                        .for_each(|shown| shown.insert(&samples));
                }
                Ok(Incoming::Message(Message::Unseen(unseen))) => {
                    self.shown_as(unseen.view)
                        .into_iter()
                        .for_each(|shown| shown.insert_unseen(&unseen));
                }
                Ok(Incoming::Message(Message::LiveSamples(samples))) => {
                    self.shown.iter_mut().for_each(|shown| shown.insert_live(&samples));
                }
                Ok(Incoming::Message(Message::Control(Control::Settled { view })))
                    if for_settled && view == self.view_number =>
                {
                    return Ok(Waited::Settled);
                }
                Ok(Incoming::Message(Message::Control(Control::Bye { reason }))) => {
                    bail!("the server ended the session: {reason}")
                }
                Ok(Incoming::Message(Message::Control(Control::Status(status)))) => {
                    self.workers = status.workers;
                    if self.duration > 0.0 {
                        let share = self.start.elapsed().as_secs_f64() / self.duration;
                        self.meter.show(share, &status.words());
                    }
                }
                Ok(Incoming::Message(Message::Control(Control::StoredSent { view })))
                    if view == self.view_number =>
                {
                    let before = self.asked();
                    self.ask_on(for_settled)?;
                    if for_settled && before != Asked::All {
                        self.settle()?;
                    }
                }
                Ok(Incoming::Message(Message::Control(_))) => {}
                Ok(Incoming::Message(_)) => {
                    bail!("the server sent a message that is not for a display")
                }
                Ok(Incoming::Lost(error)) => return Err(error).context("lost the server"),
                Ok(Incoming::Stop) => return Ok(Waited::Stop),
                Err(mpsc::RecvTimeoutError::Timeout) if Instant::now() >= deadline => {
                    return Ok(Waited::TimeUp);
                }
                Err(mpsc::RecvTimeoutError::Timeout)
                    if refine.is_some_and(|at| Instant::now() >= at) =>
                {
                    self.refine()?
                }
                // Time for rays.
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => bail!("lost the server"),
            }
        }
    }

    /// Puts the viewpoint's radius right, once there is a picture to see the nearest surface in.
    fn refine(&mut self) -> Result<()> {
        let Some(shown) = &mut self.shown else { return Ok(()) };
        shown.refined = true;
        let mut depths = shown.canvas.depth();
        depths.retain(|&depth| depth > 0.0 && depth.is_finite());
        if depths.is_empty() {
            return Ok(());
        }
        let at = (depths.len() as f64 * NEARER_PIXELS) as usize;
        let (_, &mut nearest, _) = depths.select_nth_unstable_by(at, f32::total_cmp);
        shown.nearest = f64::from(nearest);
        shown.canvas.set_nearest(shown.nearest);
        let wanted = shown.wanted.clone();
        self.request_shown(wanted)
    }

    /// Asks for the single rays that the driver wants most.
    fn ask_rays(&mut self) -> Result<()> {
        let Some(shown) =
            self.shown.as_mut().filter(|shown| shown.rays_asked.is_some() && self.welcome.tracing)
        else {
            return Ok(());
        };
        let rays = shown.canvas.wanted_rays().into_iter();
        let rays = rays
            .map(|(section, beam, coords)| WantedRay { key: BeamKey { section, beam }, coords });
        let request = RaysWanted { view: self.view_number, rays: rays.collect() };
        shown.rays_asked = Some(Instant::now());
        if request.rays.is_empty() {
            // For now every pixel has enough.
            return Ok(());
        }
        Ok(self.outbox.send(Kind::Rays, &request.encode())?)
    }

    /// Asks for rays that no section covers, if somebody traces.
    fn ask_live(&mut self) -> Result<()> {
        let Some(shown) = self.shown.as_mut().filter(|_| self.workers > 0) else { return Ok(()) };
        let Some(live) = &mut shown.live else { return Ok(()) };
        let rays = live.wanted();
        if rays.is_empty() {
            return Ok(());
        }
        let request = LiveWanted { view: shown.first_request, pixels: live.pixels(), rays };
        Ok(self.outbox.send(Kind::LiveWanted, &request.encode())?)
    }

    /// The view, if it is the one that samples were sent for under this number.
    fn shown_as(&mut self, number: u32) -> Option<&mut Shown> {
        self.shown
            .as_mut()
            .filter(|shown| (shown.first_request..=self.view_number).contains(&number))
    }

    fn picture(&self, path: PathBuf) -> Result<()> {
        let Some(shown) = &self.shown else { bail!("there is no view to take a picture of") };
        let report = shown.write(path)?;
        if self.config.json {
            println!("{}", serde_json::to_string(&report)?);
        } else {
            self.meter.say(&report.to_string());
        }
        Ok(())
    }

    fn asked(&self) -> Asked {
        self.shown.as_ref().map_or(Asked::All, |shown| shown.asked)
    }

    /// Asks the server to settle, unless something is still to be asked for: then once that is.
    fn settle(&mut self) -> Result<()> {
        if self.asked() == Asked::All {
            self.outbox.control(&Control::Settle { view: self.view_number })?;
        }
        Ok(())
    }

    /// Lets everything under way arrive and be stored, and writes the last picture: a replay gives the same.
    fn end(&mut self) -> Result<()> {
        if self.shown.is_none() {
            return Ok(());
        }
        if self.welcome.tracing && self.shown.as_ref().is_some_and(|shown| !shown.also.is_empty()) {
            // Samples of beams that the view does not cross may have been stored without being sent.
            self.ask_for_all()?;
        }
        self.settle()?;
        if self.wait(Instant::now() + SETTLE_TIME, true)? == Waited::TimeUp {
            bail!("the server has not settled for {} seconds", SETTLE_TIME.as_secs());
        }
        self.lights.wait(SETTLE_TIME);
        self.meter.finish();
        self.config.output.clone().map_or(Ok(()), |path| self.picture(path))
    }
}
