//! Follows a script: shows its views, and writes its pictures when their time has come.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use holo_display::{Frame, FrameRequest};
use holo_options::{LookArgs, ViewArgs};
use holo_picture::{Picture, ViewSpec, luminance};
use holo_progress::Meter;
use holo_session::{
    Again, Connected, Crew, EyeVelocity, FrameSchedule, FrameSize, ObjectOrder, RETURN_TIME,
    SceneChange, Session, StageTime, Waited, starts_again,
};
use serde_json::json;
use tokio::sync::oneshot;

use super::{
    Script, ScriptStep,
    parse::{Command, Next},
    report::PictureReport,
};

/// Time after which a picture of a view may take seconds longer. Earlier pictures show what is
/// known at their moment.
const PATIENT: Duration = Duration::from_secs(5);

/// Views that follow each other faster are a motion, as of a person who walks.
const MOTION: Duration = Duration::from_millis(150);

/// Interval at which a typed script is checked for new lines.
const TYPED_TICK: Duration = Duration::from_millis(20);

/// Options of a session that follows a script.
#[derive(Clone, Debug)]
pub struct ScriptOptions {
    /// The view before the script changes it, and the size of pictures.
    pub view: ViewArgs,
    /// How .png pictures look.
    pub look: LookArgs,
    /// The file of the last picture.
    pub output: Option<PathBuf>,
    /// Report every picture as a line of JSON.
    pub json: bool,
    /// Print less.
    pub quiet: bool,
    /// The crew that started server and workers, if it takes orders.
    pub crew: Option<Crew>,
}

/// Follows `script` to its end, starting when `ready` signals. Blocks, so call it on a thread of
/// its own.
///
/// # Errors
/// If the server is lost, a view cannot be shown, or a picture cannot be written.
pub fn play(
    connected: Connected,
    options: ScriptOptions,
    script: Script,
    ready: oneshot::Receiver<()>,
) -> Result<()> {
    let meter = Meter::new(options.quiet || options.json);
    let again = connected.again();
    let Some(mut session) = connected.begin(|text| meter.say(text))? else { return Ok(()) };
    if ready.blocking_recv().is_err() {
        return Ok(());
    }
    let since = Instant::now();
    session.start_clock(since);
    let duration = script.duration();
    let eye = ScriptEye::new(since);
    Player { session, again, eye, since, options, meter, duration }.follow(script)
}

struct Player {
    session: Session,
    again: Again,
    eye: ScriptEye,
    /// The start of the script's seconds: when the view was first shown.
    since: Instant,
    options: ScriptOptions,
    meter: Meter,
    /// Seconds that the script takes; 0 if unknown.
    duration: f64,
}

/// The eye that a script moves.
struct ScriptEye {
    schedule: FrameSchedule,
    /// The view that is shown.
    shown: Option<ViewSpec>,
    /// When it was shown.
    moved: Instant,
    /// True if it moves.
    is_moving: bool,
    /// How it moves: from the last view to this one.
    velocity: EyeVelocity,
    /// Number of views that did not follow from a motion.
    jumps: u64,
    /// What the session was last asked to show.
    looked: Option<FrameRequest>,
}

impl ScriptEye {
    fn new(now: Instant) -> ScriptEye {
        let schedule = FrameSchedule::new(now);
        ScriptEye {
            schedule,
            shown: None,
            moved: now,
            is_moving: false,
            velocity: EyeVelocity::default(),
            jumps: 0,
            looked: None,
        }
    }

    /// Moves to a view.
    fn show(&mut self, spec: &ViewSpec, now: Instant) {
        let before = self.shown.replace(*spec);
        let since = now.saturating_duration_since(self.moved);
        self.is_moving = before.is_some() && since < MOTION;
        let place = |spec: &ViewSpec| Some([spec.vp?, spec.vd?.try_normalize()?]);
        let places = before.as_ref().and_then(place).zip(place(spec)).filter(|_| self.is_moving);
        self.velocity = places.map_or(EyeVelocity::default(), |(before, now)| {
            EyeVelocity::between(before, now, since.as_secs_f64())
        });
        self.jumps += u64::from(!self.is_moving);
        self.moved = now;
    }

    /// Returns when the motion ends, if the eye moves.
    fn rests_at(&self) -> Option<Instant> {
        self.is_moving.then(|| self.moved + MOTION)
    }
}

impl Player {
    fn follow(&mut self, mut script: Script) -> Result<()> {
        let said = self.options.view.spec(self.session.named_views())?;
        let mut spec = self.session.first_view()?.overridden_by(&said);
        let mut next = script.next_step()?;
        // If the script begins with a view, the view of the options is never shown.
        if !begins_with_view(&next) {
            self.show(&spec)?;
        }
        loop {
            let step = match next {
                Next::Step(step) => step,
                Next::End => break,
                Next::NotYet => {
                    if self.wait(Instant::now() + TYPED_TICK)? == Waited::Stop {
                        return Ok(());
                    }
                    next = script.next_step()?;
                    continue;
                }
            };
            if let Some(seconds) = step.seconds
                && self.wait(self.since + Duration::from_secs_f64(seconds))? == Waited::Stop
            {
                break;
            }
            match step.command {
                Command::View(change) => {
                    spec = spec.overridden_by(&change);
                    self.show(&spec)?;
                }
                Command::Picture(path) => {
                    let can_wait = self.since.elapsed() >= PATIENT;
                    self.picture(&path, can_wait)?;
                }
                Command::Probe(column, row) => self.probe(column, row)?,
                Command::Object(order) => {
                    if !self.object(order)? {
                        return Ok(());
                    }
                }
                Command::Light(change) => {
                    if !self.change_scene(change.into())? {
                        return Ok(());
                    }
                }
                Command::Switch { parts, on } => {
                    parts.iter().try_for_each(|part| self.session.switch(part, on))?;
                }
                Command::Quit => break,
            }
            next = script.next_step()?;
        }
        self.end()
    }

    fn show(&mut self, spec: &ViewSpec) -> Result<()> {
        let now = Instant::now();
        self.eye.show(spec, now);
        self.since = now;
        self.look(now).map(drop)
    }

    /// Shows the view to the session as the schedule wants it now. Returns the size of its frames.
    fn look(&mut self, now: Instant) -> Result<Option<FrameSize>> {
        let Player { session, eye, options, .. } = self;
        let Some(spec) = eye.shown else { return Ok(None) };
        let (view, full) = spec.resolve(options.view.size())?;
        eye.is_moving &= eye.rests_at().is_some_and(|at| now < at);
        let is_moving = eye.is_moving;
        eye.schedule.request(&spec, eye.jumps, now);
        let (keeps_pixels, samples) = (session.keeps_pixels(), session.samples_per_pixel(full));
        let size = eye.schedule.size(full, is_moving, keeps_pixels, samples, now);
        session.set_motion(is_moving.then_some(eye.velocity));
        let look = FrameRequest { view, size: size.size, is_moving };
        if eye.looked != Some(look) {
            session.look(look)?;
            eye.looked = Some(look);
        }
        Ok(Some(size))
    }

    /// Shows all pixels of the view to the session, whatever the schedule wants. Returns the size
    /// of its frames.
    fn look_in_full(&mut self) -> Result<Option<FrameSize>> {
        let Player { session, eye, options, .. } = self;
        let Some(spec) = eye.shown else { return Ok(None) };
        let (view, full) = spec.resolve(options.view.size())?;
        session.set_motion(None);
        let look = FrameRequest { view, size: full, is_moving: false };
        if eye.looked != Some(look) {
            session.look(look)?;
            eye.looked = Some(look);
        }
        Ok(Some(FrameSize { size: full, full, is_moving: false, is_sketch: false }))
    }

    /// Draws the view as the schedule wants it now, or for a file. Frames of fewer pixels are
    /// enlarged to the size of the picture.
    fn draw(&mut self, for_file: bool) -> Result<(Frame, Vec<StageTime>)> {
        let begin = Instant::now();
        let size = if for_file { self.look_in_full()? } else { self.look(begin)? };
        let arrived = self.session.arrived_samples();
        let (frame, stages) =
            if for_file { self.session.draw_for_file() } else { self.session.draw() };
        let (Some(mut frame), Some(size)) = (frame, size) else { bail!("there is no view") };
        let is_lit = frame.samples_used > 0;
        self.eye.schedule.note_frame(size, [begin, Instant::now()], arrived, is_lit);
        if size.size != size.full {
            frame = frame.enlarged(size.full);
            if let Some(view) = frame.picture.view {
                frame.blank_corners(&view);
            }
        }
        Ok((frame, stages))
    }

    /// Goes on with a server that starts again, where another one would be an error. Returns
    /// whether there is a session; there is none if the user ends the wait.
    fn reach_again(&mut self, ended: anyhow::Error) -> Result<bool> {
        if !starts_again(&ended) {
            return Err(ended);
        }
        let Player { again, meter, session, .. } = self;
        meter.say("the server starts again; trying to reach it");
        // Parts that the script has switched off stay off.
        again.choice = session.choice();
        match again.reach(RETURN_TIME, |text| meter.say(text))? {
            Some(connected) => self.go_on(connected),
            None => Ok(false),
        }
    }

    /// Goes on with a changed scene. Returns whether there is a session; there is none if the user
    /// ends the wait.
    fn change_scene(&mut self, change: SceneChange) -> Result<bool> {
        let Player { again, session, options, .. } = self;
        let crew = options.crew.as_ref().context(
            "this session has not started its server, so it cannot change the scene: use `holodeck \
             view`",
        )?;
        crew.read_scene(change).blocking_recv().context("nobody reads the scene")??;
        again.choice = session.choice();
        // What the scene looks odd in was printed.
        let connected = again.follow(&crew.restart()?)?;
        self.go_on(connected)
    }

    /// Goes on with another connection. Returns whether there is a session.
    fn go_on(&mut self, connected: Connected) -> Result<bool> {
        let Player { meter, session, since, eye, .. } = self;
        let (start, since) = (session.start(), *since);
        let Some(begun) = connected.begin(|text| meter.say(text))? else { return Ok(false) };
        *session = begun;
        session.start_clock(start);
        (eye.looked, eye.is_moving) = (None, false);
        self.look(Instant::now())?;
        // The script's seconds continue.
        self.since = since;
        Ok(true)
    }

    /// Waits until `deadline` and shows progress.
    fn wait(&mut self, deadline: Instant) -> Result<Waited> {
        /// Interval at which progress is shown, and the schedule is followed.
        const TICK: Duration = Duration::from_millis(200);
        loop {
            self.look(Instant::now())?;
            let next = deadline.min(Instant::now() + TICK);
            let next = self.eye.rests_at().map_or(next, |rests| next.min(rests));
            let waited = match self.session.wait(next) {
                Ok(waited) => waited,
                Err(error) => match self.reach_again(error)? {
                    true => Waited::TimeUp,
                    false => Waited::Stop,
                },
            };
            match waited {
                Waited::TimeUp if Instant::now() < deadline => {}
                waited => return Ok(waited),
            }
            if let Some(status) = self.session.status().filter(|_| self.duration > 0.0) {
                let share = self.session.start().elapsed().as_secs_f64() / self.duration;
                self.meter.show(share, &status.words());
            }
        }
    }

    /// Writes the current view with the samples that have arrived.
    fn picture(&mut self, path: &Path, can_wait: bool) -> Result<()> {
        if !self.session.has_view() {
            bail!("there is no view to take a picture of");
        }
        let (frame, stages) = self.draw(can_wait)?;
        let look = &self.options.look;
        let report =
            write_picture(&self.session, self.since, path.to_owned(), look, (frame, stages))?;
        if self.options.json {
            holo_progress::print_line!("{}", serde_json::to_string(&report)?);
        } else {
            self.meter.say(&report.to_string());
        }
        Ok(())
    }

    /// Follows an order about objects, and waits for the model. Returns whether there is a session.
    fn object(&mut self, order: ObjectOrder) -> Result<bool> {
        if let Some(crew) = &self.options.crew
            && let Some(change) =
                self.again.objects().scene_change(&order, &crew.stated().objects)?
        {
            return self.change_scene(change);
        }
        if let Some(answer) = self.session.object(order)? {
            holo_progress::print_line!("{answer}");
        }
        self.session.wait_for_objects()?;
        Ok(true)
    }

    /// Prints what a pixel shows to standard output.
    fn probe(&mut self, column: u32, row: u32) -> Result<()> {
        let (frame, _) = self.draw(false)?;
        let Some(radiance) = frame.picture.get(column, row) else {
            bail!("pixel {column} {row} lies outside the picture");
        };
        let distance = frame.depth.get((row * frame.picture.width + column) as usize).copied();
        let distance = distance.filter(|distance| *distance > 0.0);
        let triangle = self.session.triangle_at(column, row);
        let luminance = luminance(radiance);
        if self.options.json {
            let line = json!({
                "probe": [column, row],
                "radiance": radiance,
                "luminance": luminance,
                "distance": distance.filter(|distance| distance.is_finite()),
                "triangle": triangle,
            });
            holo_progress::print_line!("{line}");
        } else {
            let [red, green, blue] = radiance;
            let distance = match distance {
                Some(distance) if distance.is_finite() => format!("{distance} scene units away"),
                Some(_) => "nothing hit".to_owned(),
                None => "nothing known".to_owned(),
            };
            holo_progress::print_line!(
                "{column} {row}: radiance {red} {green} {blue} W/sr/m², luminance {luminance} \
                 cd/m², {distance}"
            );
        }
        Ok(())
    }

    /// Waits until everything under way has arrived and is stored, and writes the last picture.
    fn end(&mut self) -> Result<()> {
        loop {
            self.look_in_full()?;
            let Err(error) = self.session.settle(true) else { break };
            if !self.reach_again(error)? {
                return Ok(());
            }
        }
        self.meter.finish();
        match self.options.output.clone() {
            Some(path) if self.session.has_view() => self.picture(&path, true),
            _ => Ok(()),
        }
    }
}

fn begins_with_view(next: &Next) -> bool {
    matches!(next, Next::Step(ScriptStep { command: Command::View(_), seconds })
        if seconds.unwrap_or(0.0) == 0.0)
}

/// Writes a frame of the session's view to `path`, and returns the report.
fn write_picture(
    session: &Session,
    since: Instant,
    path: PathBuf,
    look: &LookArgs,
    (frame, stages): (Frame, Vec<StageTime>),
) -> Result<PictureReport> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    }
    let exposure = look.write(&frame.picture, &path)?;
    Ok(PictureReport { picture: path, exposure, ..report(session, since, &frame, stages) })
}

/// Returns the report on a frame of the session's view, which was shown at `since`, without a file.
fn report(
    session: &Session,
    since: Instant,
    frame: &Frame,
    stages: Vec<StageTime>,
) -> PictureReport {
    let counts = session.counts();
    PictureReport {
        picture: PathBuf::new(),
        seconds: since.elapsed().as_secs_f64(),
        samples: frame.samples_used,
        stored: counts.stored + counts.parts,
        traced: counts.traced,
        live: session.live_rays(),
        beams: session.beams(),
        uncovered_pixels: frame.uncovered_pixels,
        empty_pixels: frame.empty_pixels,
        unseen_pixels: frame.unseen_pixels,
        guessed_pixels: frame.guessed_pixels,
        gleam_pixels: frame.gleam_pixels,
        driver: session.driver_name(),
        first_samples: counts.first_samples,
        exposure: None,
        stages,
    }
}

/// Shows a view until everything requested for it has arrived, and returns the picture, and the
/// report on it without a file. `None` if the session is ended before. Blocks, so call it on a
/// thread of its own.
///
/// # Errors
/// If the server is lost, or the view cannot be shown.
pub fn picture(
    connected: Connected,
    view: &ViewArgs,
    quiet: bool,
) -> Result<Option<(Picture, PictureReport)>> {
    let meter = Meter::new(quiet);
    let Some(mut session) = connected.begin(|text| meter.say(text))? else { return Ok(None) };
    let since = Instant::now();
    let said = view.spec(session.named_views())?;
    let spec = session.first_view()?.overridden_by(&said);
    let (view, size) = spec.resolve(view.size())?;
    session.look(FrameRequest { view, size, is_moving: false })?;
    session.settle(true)?;
    meter.finish();
    let (frame, stages) = session.draw_for_file();
    let Some(frame) = frame else { bail!("there is no frame of the view") };
    let report = report(&session, since, &frame, stages);
    Ok(Some((frame.picture, report)))
}

#[cfg(test)]
mod tests {
    use holo_drivers::{DriverArgs, DriverOptions};
    use holo_net::Shutdown;
    use holo_proto::control::{Control, Farewell};
    use holo_session::DriverArg;
    use tokio::{net::TcpListener, time::timeout};

    use super::*;
    use crate::server::{LIMIT, serve};

    #[test]
    fn views_in_quick_succession_are_a_motion_and_others_are_jumps() {
        let start = Instant::now();
        let mut eye = ScriptEye::new(start);
        let spec = ViewSpec::default();
        eye.show(&spec, start);
        assert!(!eye.is_moving && eye.jumps == 1);
        eye.show(&spec, start + MOTION / 2);
        assert!(eye.is_moving && eye.jumps == 1);
        assert_eq!(eye.rests_at(), Some(start + MOTION / 2 + MOTION));
        eye.show(&spec, start + 3 * MOTION);
        assert!(!eye.is_moving && eye.jumps == 2 && eye.rests_at().is_none());
    }

    /// Draws, and returns whether the prefilter ran.
    fn filters(player: &mut Player) -> bool {
        // If nothing has changed, the driver computes nothing.
        for on in [false, true] {
            player.session.switch("depth-cull", on).unwrap();
        }
        player.session.draw().1.iter().any(|time| time.stage == "Prefilter")
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn parts_that_are_off_and_the_script_s_seconds_outlast_a_server_that_starts_again() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let options = ScriptOptions {
            view: ViewArgs { size: Some((32, 24)), ..ViewArgs::default() },
            look: LookArgs::default(),
            output: None,
            json: false,
            quiet: true,
            crew: None,
        };
        let args = DriverArgs { driver: DriverArg::Pointimage, ..DriverArgs::default() };
        let choice = Box::new(DriverOptions { args, ..DriverOptions::default() });
        let shutdown = Shutdown::new();
        let connecting = Connected::new(address, choice, false, shutdown.clone());
        let playing = tokio::spawn(async move {
            let connected = connecting.await.unwrap();
            tokio::task::spawn_blocking(move || {
                let again = connected.again();
                let session = connected.begin(|_| {}).unwrap().unwrap();
                let view = session.first_view().unwrap();
                let (since, meter) = (Instant::now(), Meter::new(true));
                let eye = ScriptEye::new(since);
                let mut player =
                    Player { session, again, eye, since, options, meter, duration: 0.0 };
                player.show(&view).unwrap();
                assert!(filters(&mut player));
                player.session.switch("prefilter", false).unwrap();
                let since = player.since;
                assert_eq!(player.wait(Instant::now() + LIMIT).unwrap(), Waited::Stop);
                assert!(!filters(&mut player));
                player.session.switch("prefilter", true).unwrap();
                assert!(filters(&mut player));
                assert!(player.since == since && player.session.since() > since);
            })
            .await
            .unwrap();
        });
        let (_inbox, outbox) = serve(&listener).await;
        outbox.control(&Control::Bye(Farewell::StartsAgain)).unwrap();
        outbox.drained().await;
        let _again = serve(&listener).await;
        shutdown.trigger();
        timeout(LIMIT, playing).await.unwrap().unwrap();
    }
}
