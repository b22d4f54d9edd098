//! The painter: a thread that owns the session and draws frames of the requested views.
//!
//! All slow work happens here: searching for beams, placing samples, drawing. The hand
//! ([`super::hand`]) puts requests into an exchange and takes
//! frames from it. Neither waits for the other.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::Result;
use holo_display::{DriverPart, Frame, FrameRequest, Interrupt};
use holo_picture::{View, ViewSpec};
use holo_raycast::Raycaster;
use holo_session::{
    DriverArg, EyeVelocity, FrameSchedule, ObjectOrder, Session, Uncovered, Waited, Waker, is_lost,
    is_of_connection,
};
use parking_lot::{Mutex, MutexGuard};

use super::{
    FrameAudience,
    picture_job::{PictureJob, Progress, STORED_PATIENCE, WHOLE_PIXELS},
    picture_order::{BegunPicture, PictureNews, PictureOrder},
    signal::ThreadSignal,
};

/// Interval at which the painter checks for news from the server while it rests.
const NEWS: Duration = Duration::from_millis(100);

/// A view that the hand requests.
#[derive(Clone, Debug, PartialEq)]
pub struct StageView {
    /// The view; [`View::resolve`](holo_picture::View) has accepted it.
    pub spec: ViewSpec,
    /// Most columns and rows.
    pub size: (u32, u32),
    /// True if the eye moves, so that another view follows soon.
    pub is_moving: bool,
    /// How the eye moves; 0 if it rests or its motion is not known.
    pub velocity: EyeVelocity,
    /// Number of jumps of the eye so far.
    pub jumps: u64,
    /// The part of the picture that is traced first: left, top, right and bottom, in shares of the
    /// picture.
    pub focus: Option<[f64; 4]>,
}

/// An order to the session, besides views.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Pauses tracing, or resumes it.
    Pause(bool),
    /// Draws with another driver.
    Driver(DriverArg),
    /// Switches parts of the driver's method on or off.
    Switch(Vec<String>, bool),
    /// Carries an object into the scene, or changes one.
    Object(ObjectOrder),
    /// Stores a named view in the holodeck; removes it if the options are empty.
    KeepView(String, String),
    /// Draws a picture of this view and size beside the walk.
    Render(Box<View>, (u32, u32), PictureOrder),
    /// Waits until everything under way is stored, and ends.
    Quit,
    /// Ends without waiting, because all samples are to be forgotten.
    Leave,
}

/// A frame of the driver.
#[derive(Clone, Debug)]
pub struct Painted {
    /// The request that it answers.
    pub wanted: StageView,
    /// Its view.
    pub view: View,
    /// Its frame.
    pub frame: Arc<Frame>,
    /// Time that the session took to evaluate the view, and the driver to draw it.
    pub took: [Duration; 2],
    /// True if it has fewer pixels than requested.
    pub has_few: bool,
}

/// The session's state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct News {
    /// True if no section covers any part of the requested view.
    pub is_uncovered: bool,
    /// Another reason why the requested view is not shown.
    pub trouble: Option<String>,
    /// The holodeck's named views, with Radiance's options.
    pub views: Arc<Vec<(String, String)>>,
    /// Samples that have arrived for the view.
    pub view_samples: u64,
    /// Share of the picture's pixels whose gleams are a guess, percent.
    pub gleams: u32,
    /// Samples in the holodeck.
    pub samples: u64,
    /// Samples traced per second.
    pub samples_per_second: f64,
    /// Number of connected workers, if the server has reported it.
    pub workers: Option<u32>,
    /// The driver's name.
    pub driver: &'static str,
    /// The parts of its method that can be switched.
    pub parts: Arc<Vec<DriverPart>>,
    /// Whether tracing is paused.
    pub is_paused: bool,
    /// The share that is drawn of the picture that is being saved, in steps of 1/1000.
    pub saving: Option<f32>,
}

/// State shared by hand and painter.
#[derive(Default)]
struct FrameExchange {
    wanted: Option<StageView>,
    orders: Vec<Order>,
    /// True if the painter was woken and has not looked yet.
    is_woken: bool,
    painted: Option<Painted>,
    /// Why the last order was refused.
    refusal: Option<String>,
    news: News,
    /// The scene, if it is known.
    scene: Option<Arc<Raycaster>>,
    /// The share of each side that frames have while the eye moves.
    moving_share: Option<f64>,
    is_over: bool,
}

/// The hand's side of the exchange.
pub struct FrameRequests {
    exchange: Arc<Mutex<FrameExchange>>,
    waker: Waker,
    /// Ends the drawing of a frame at rest, which a request makes useless.
    interrupt: Interrupt,
}

/// The painter's results since the hand last looked.
pub struct Done {
    /// The latest frame.
    pub painted: Option<Painted>,
    /// Why an order was refused.
    pub refusal: Option<String>,
    /// The session's state.
    pub news: News,
    /// The scene, if it is known.
    pub scene: Option<Arc<Raycaster>>,
    /// The share of each side that frames have while the eye moves.
    pub moving_share: Option<f64>,
    /// Whether the painter has ended.
    pub is_over: bool,
}

impl FrameRequests {
    /// Requests a view.
    pub fn want(&self, wanted: StageView) {
        let mut exchange = self.exchange.lock();
        if exchange.wanted.as_ref() != Some(&wanted) {
            exchange.wanted = Some(wanted);
            self.wake(exchange);
        }
    }

    /// Gives an order.
    pub fn order(&self, order: Order) {
        let mut exchange = self.exchange.lock();
        exchange.orders.push(order);
        self.wake(exchange);
    }

    fn wake(&self, mut exchange: MutexGuard<'_, FrameExchange>) {
        self.interrupt.set();
        if !std::mem::replace(&mut exchange.is_woken, true) {
            self.waker.wake();
        }
    }

    /// Takes the painter's results.
    pub fn take(&self) -> Done {
        let mut exchange = self.exchange.lock();
        Done {
            painted: exchange.painted.take(),
            refusal: exchange.refusal.take(),
            news: exchange.news.clone(),
            scene: exchange.scene.clone(),
            moving_share: exchange.moving_share,
            is_over: exchange.is_over,
        }
    }
}

/// Draws the requested views.
pub struct Painter {
    session: Session,
    waker: Waker,
    exchange: Arc<Mutex<FrameExchange>>,
    /// Set when a request wakes the painter.
    interrupt: Interrupt,
    signal: Arc<ThreadSignal>,
    watched: FrameAudience,
    schedule: FrameSchedule,
    /// The view that the session currently shows.
    looked: Option<FrameRequest>,
    /// The last request that was drawn, and whether it could be shown.
    drawn: Option<(StageView, bool)>,
    /// True if it must be drawn again, because the driver draws in another way now.
    is_outdated: bool,
    /// True if an object has changed since it was drawn.
    is_moved: bool,
    /// The picture that is being saved.
    job: Option<Box<PictureJob>>,
    news: News,
}

/// Why a picture is not drawn to its end.
const ENDED: &str = "the scene has changed meanwhile: save the picture again";

/// Marks the end of the painter's work, however it ends.
struct AtEnd(Arc<Mutex<FrameExchange>>, Arc<ThreadSignal>);

impl Drop for AtEnd {
    fn drop(&mut self) {
        self.0.lock().is_over = true;
        self.1.raise();
    }
}

impl Painter {
    /// Returns a painter and the hand's side. The painter raises `signal` when it has something for
    /// the hand.
    pub fn new(
        session: Session,
        waker: Waker,
        signal: Arc<ThreadSignal>,
        watched: FrameAudience,
    ) -> (Painter, FrameRequests) {
        let exchange = Arc::<Mutex<FrameExchange>>::default();
        let interrupt = session.interrupt();
        let requests = FrameRequests {
            exchange: Arc::clone(&exchange),
            waker: waker.clone(),
            interrupt: interrupt.clone(),
        };
        let painter = Painter {
            session,
            waker,
            exchange,
            interrupt,
            signal,
            watched,
            schedule: FrameSchedule::new(Instant::now()),
            looked: None,
            drawn: None,
            is_outdated: false,
            is_moved: false,
            job: None,
            news: News::default(),
        };
        (painter, requests)
    }

    /// Draws until it is ordered to quit, and then waits until everything under way is stored.
    ///
    /// # Errors
    /// If the server is lost.
    pub fn run(mut self) -> Result<()> {
        let _end = AtEnd(Arc::clone(&self.exchange), Arc::clone(&self.signal));
        loop {
            if self.session.wait(self.next_due())? == Waited::Stop {
                return self.end();
            }
            let (wanted, orders) = {
                let mut exchange = self.exchange.lock();
                exchange.is_woken = false;
                // Whatever is requested from now on interrupts again.
                self.interrupt.clear();
                (exchange.wanted.clone(), std::mem::take(&mut exchange.orders))
            };
            for order in orders {
                match order {
                    Order::Quit => return self.end(),
                    Order::Leave => {
                        if let Some(job) = self.job.take() {
                            job.order.refuse(ENDED.to_owned());
                        }
                        return Ok(());
                    }
                    order => self.follow(order)?,
                }
            }
            // Once for all orders: a person who drags gives many.
            if std::mem::take(&mut self.is_moved) {
                self.repaint_objects();
            }
            // Even while the eye moves.
            self.job.take_if(|job| !job.order.is_wanted());
            if let Some(wanted) = wanted
                && self.is_due(&wanted)
            {
                self.paint(wanted)?;
            } else if self.refines_objects() {
                self.repaint_objects();
            } else {
                self.work_on_picture()?;
            }
            self.report();
        }
    }

    /// Ends the session once what was requested is stored.
    fn end(&mut self) -> Result<()> {
        match self.session.settle(false) {
            // A server that ends first leaves nothing to wait for. If it failed, it says so itself.
            Err(error) if is_lost(&error) => Ok(()),
            ended => ended,
        }
    }

    fn follow(&mut self, order: Order) -> Result<()> {
        match order {
            Order::Pause(pause) => {
                self.session.pause(pause)?;
                self.news.is_paused = pause;
            }
            Order::Driver(driver) => {
                (self.looked, self.drawn) = (None, None);
                self.schedule.restart();
                if let Some(job) = self.job.take() {
                    job.order.refuse("another driver was chosen meanwhile".to_owned());
                }
                if let Err(error) = self.session.change_driver(driver) {
                    self.refuse(error)?;
                }
            }
            Order::Switch(parts, on) => {
                self.is_outdated = true;
                let switched = parts.iter().try_for_each(|part| self.session.switch(part, on));
                if let Err(error) = switched {
                    self.refuse(error)?;
                }
            }
            Order::Object(order) => match self.session.object(order) {
                Ok(None) => self.is_moved = true,
                Ok(answer) => self.exchange.lock().refusal = answer,
                Err(error) => self.refuse(error)?,
            },
            Order::KeepView(name, options) => {
                if let Err(error) = self.session.keep_view(&name, &options) {
                    self.refuse(error)?;
                }
            }
            Order::Render(view, size, order) => self.begin_picture(*view, size, order)?,
            Order::Quit | Order::Leave => {}
        }
        Ok(())
    }

    /// Returns whether a new frame of the requested view is due.
    fn is_due(&mut self, wanted: &StageView) -> bool {
        match &self.drawn {
            Some((drawn, is_shown)) if drawn == wanted => {
                let (arrived, refines) = (self.session.arrived_samples(), self.session.refines());
                *is_shown
                    && !wanted.is_moving
                    && self.watched.is_watched()
                    && (self.is_outdated || self.schedule.is_due(arrived, refines, Instant::now()))
            }
            _ => true,
        }
    }

    /// Returns when the painter must act next, unless the hand wakes it before.
    fn next_due(&self) -> Instant {
        let now = Instant::now();
        let is_other = self
            .exchange
            .lock()
            .wanted
            .as_ref()
            .is_some_and(|wanted| self.drawn.as_ref().is_none_or(|(drawn, _)| drawn != wanted));
        let has_work =
            || self.job.as_ref().is_some_and(|job| self.rests() && job.is_due(&self.session, now));
        let has_objects = || self.refines_objects() && !self.interrupt.is_set();
        if is_other || has_work() || has_objects() { now } else { now + NEWS }
    }

    /// Returns whether objects are to be drawn better, and somebody sees it.
    fn refines_objects(&self) -> bool {
        self.rests() && self.watched.is_watched() && self.session.refines_objects()
    }

    /// Draws a frame of the requested view.
    fn paint(&mut self, wanted: StageView) -> Result<()> {
        let begin = Instant::now();
        let (view, full) = wanted.spec.resolve(wanted.size)?;
        let is_moving = wanted.is_moving;
        self.schedule.request(&wanted.spec, wanted.jumps, begin);
        let (keeps_pixels, samples) =
            (self.session.keeps_pixels(), self.session.samples_per_pixel(full));
        let size = self.schedule.size(full, is_moving, keeps_pixels, samples, begin);
        self.session.set_motion(is_moving.then_some(wanted.velocity));
        self.session.set_focus(wanted.focus)?;
        let look = FrameRequest { view, size: size.size, is_moving };
        let was_shown = self.drawn.as_ref().is_some_and(|(_, is_shown)| *is_shown);
        let is_shown = (self.looked == Some(look) && was_shown) || self.look(look)?;
        self.drawn = Some((wanted.clone(), is_shown));
        if !is_shown {
            return Ok(());
        }
        let looked = Instant::now();
        let arrived = self.session.arrived_samples();
        // If the frame was interrupted and the view stays, the frame is still due.
        let (Some(mut frame), _) = self.session.draw() else { return Ok(()) };
        self.is_outdated = false;
        if frame.samples_used == 0 {
            // Without any sample, all pixels are guessed, and a guess does not count as known
            // light.
            frame.empty_pixels = frame.depth.len() as u64;
        }
        let pixels = frame.depth.len().max(1) as u64;
        self.news.gleams = (100 * frame.gleam_pixels / pixels) as u32;
        let end = Instant::now();
        let took = [looked - begin, end - looked];
        self.schedule.note_frame(size, [begin, end], arrived, frame.samples_used > 0);
        let has_few = size.has_few();
        let painted = Painted { wanted, view, frame: Arc::new(frame), took, has_few };
        self.publish(painted);
        Ok(())
    }

    /// Hands a frame over.
    fn publish(&mut self, painted: Painted) {
        let mut exchange = self.exchange.lock();
        exchange.painted = Some(painted);
        exchange.moving_share = Some(self.schedule.moving_share());
        drop(exchange);
        self.signal.raise();
    }

    /// Draws the objects again over the last frame of the driver. The next frame of the driver
    /// shows them too.
    fn repaint_objects(&mut self) {
        let begin = Instant::now();
        let (Some((wanted, true)), Some(look)) = (&self.drawn, self.looked) else { return };
        let wanted = wanted.clone();
        let Some(frame) = self.session.redraw_objects() else {
            self.is_outdated = true;
            return;
        };
        let full = wanted.spec.resolve(wanted.size).map_or(look.size, |(_, full)| full);
        let has_few = look.size != full;
        let took = [Duration::ZERO, begin.elapsed()];
        let frame = Arc::new(frame);
        self.publish(Painted { wanted, view: look.view, frame, took, has_few });
    }

    /// Shows a view to the session. Returns whether it can be shown.
    fn look(&mut self, look: FrameRequest) -> Result<bool> {
        (self.news.is_uncovered, self.news.trouble) = (false, None);
        self.looked = Some(look);
        match self.session.look(look) {
            Ok(()) => Ok(true),
            Err(error) => self.note(error).map(|()| false),
        }
    }

    /// Begins to draw a picture beside the walk.
    fn begin_picture(&mut self, view: View, size: (u32, u32), order: PictureOrder) -> Result<()> {
        if self.job.as_ref().is_some_and(|job| job.order.is_wanted()) {
            order.refuse(
                "another picture is being saved: wait until it is there, or cancel it".to_owned(),
            );
            return Ok(());
        }
        let job = PictureJob::new(order, view, size);
        self.session.ask_beside(&[job.look])?;
        self.job = Some(Box::new(job));
        Ok(())
    }

    /// Returns whether the eye rests and its view has a frame.
    fn rests(&self) -> bool {
        self.drawn.as_ref().is_some_and(|(wanted, is_shown)| !wanted.is_moving || !is_shown)
    }

    /// Draws a part of the picture that is being saved, while the walk needs nothing.
    fn work_on_picture(&mut self) -> Result<()> {
        if !self.rests() || self.interrupt.is_set() {
            return Ok(());
        }
        let Some(job) = &mut self.job else { return Ok(()) };
        match job.work(&mut self.session) {
            Progress::Goes | Progress::Waits => {}
            Progress::Over => self.job = None,
            Progress::Whole => {
                if let Some(job) = self.job.take() {
                    self.draw_whole(&job)?;
                }
            }
        }
        Ok(())
    }

    /// Draws a picture with a driver that cannot draw parts. The walk waits for it.
    fn draw_whole(&mut self, job: &PictureJob) -> Result<()> {
        let PictureJob { order, look, .. } = job;
        let FrameRequest { view, size, .. } = *look;
        if u64::from(size.0) * u64::from(size.1) > WHOLE_PIXELS {
            order.refuse(format!(
                "driver {} draws pictures of at most {} million pixels: choose the driver \
                 surfaces, or a smaller size",
                self.session.driver_name(),
                WHOLE_PIXELS / 1_000_000
            ));
            return Ok(());
        }
        self.drawn = None;
        self.schedule.restart();
        self.session.set_motion(None);
        if self.look(*look)? {
            let end = Instant::now() + STORED_PATIENCE;
            while !self.session.has_stored() && Instant::now() < end && order.is_wanted() {
                let waited = self.session.wait(end.min(Instant::now() + NEWS))?;
                let mut exchange = self.exchange.lock();
                if waited == Waited::Stop {
                    exchange.orders.push(Order::Quit);
                }
                if !exchange.orders.is_empty() {
                    break;
                }
            }
            self.session.finish_view();
            if let (Some(Frame { picture, .. }), _) = self.session.draw_for_file() {
                let pixels = picture.pixels.clone();
                let begun = Box::new(BegunPicture { view, size, preview: picture });
                // The mailbox has room for both. If nobody wants the picture any more, it is
                // dropped.
                let _ = order.news.try_send(PictureNews::Begun(begun));
                let _ = order.news.try_send(PictureNews::Band(pixels));
            }
        } else {
            order.refuse("the view cannot be shown".to_owned());
        }
        // A wake may have been taken, so the orders are looked at again.
        self.waker.wake();
        self.looked = None;
        Ok(())
    }

    /// Records why an order is refused. Only a lost server is an error.
    fn refuse(&mut self, error: anyhow::Error) -> Result<()> {
        if is_of_connection(&error) {
            return Err(error);
        }
        self.exchange.lock().refusal = Some(format!("{error:#}"));
        Ok(())
    }

    /// Records why a view is not shown. Only a lost server is an error.
    fn note(&mut self, error: anyhow::Error) -> Result<()> {
        if is_of_connection(&error) {
            return Err(error);
        }
        if error.is::<Uncovered>() {
            self.news.is_uncovered = true;
        } else {
            self.news.trouble = Some(format!("{error:#}"));
        }
        Ok(())
    }

    /// Reports the session's state to the hand.
    fn report(&mut self) {
        let status = self.session.status().copied();
        if let Some(refusal) = self.session.take_refusal() {
            self.exchange.lock().refusal = Some(refusal);
        }
        if *self.news.views != self.session.named_views() {
            self.news.views = Arc::new(self.session.named_views().to_vec());
        }
        if *self.news.parts != self.session.parts() {
            self.news.parts = Arc::new(self.session.parts().to_vec());
        }
        self.news = News {
            view_samples: self.session.view_samples(),
            samples: status.map_or(0, |status| status.samples),
            samples_per_second: status.map_or(0.0, |status| status.samples_per_second),
            workers: status.map(|status| status.workers),
            driver: self.session.driver_name(),
            saving: self.job.as_ref().map(|job| (1e3 * job.share()).floor() / 1e3),
            ..std::mem::take(&mut self.news)
        };
        let scene = self.session.scene();
        let mut exchange = self.exchange.lock();
        exchange.scene = scene;
        if exchange.news != self.news {
            exchange.news = self.news.clone();
        }
    }
}
