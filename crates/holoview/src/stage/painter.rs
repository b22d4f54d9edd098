//! The painter: a thread that owns the session and draws frames of the views that are wanted.
//!
//! Whatever takes long happens here: searching for beams, placing samples, drawing. The hand
//! ([`super::hand`]) writes what it wants on a desk and takes frames from it. Neither waits for the
//! other.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use anyhow::Result;
use holo_display::{Frame, Look, Resolution};
use holo_net::NetError;
use holo_picture::{View, ViewSpec};

use super::{Watched, bell::Bell, detail::Detail};
use crate::{
    args::DriverArg,
    session::{Session, Uncovered, Waited, Waker},
};

/// Least time between two frames of a view at rest.
const REDRAW: Duration = Duration::from_millis(100);

/// Longest time between two frames of a view at rest for which samples come.
const LATEST_REDRAW: Duration = Duration::from_secs(2);

/// Pause between frames at rest, as a share of the time since the eye moved. The longer one looks,
/// the less a moment's samples change.
const REDRAW_SHARE: f64 = 0.1;

/// Frames at rest take at most one part in so many of the time: the rest is for tracing.
const DRAWING_PART: u32 = 4;

/// How often the painter looks for news of the server while it rests.
const NEWS: Duration = Duration::from_millis(100);

/// The view that is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// The view; [`View::resolve`](holo_picture::View) has accepted it.
    pub spec: ViewSpec,
    /// Pixels at the most.
    pub size: (u32, u32),
    /// Whether it is soon left.
    pub is_moving: bool,
    /// How often the eye has gone somewhere without walking there.
    pub jumps: u64,
}

/// Something besides views that the session does.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Pauses tracing, or resumes it.
    Pause(bool),
    /// Draws with another driver.
    Driver(DriverArg),
    /// Ends.
    Quit,
}

/// A frame of the driver.
#[derive(Clone, Debug)]
pub struct Painted {
    /// What was wanted.
    pub wanted: Wanted,
    /// Its view.
    pub view: View,
    /// Its frame.
    pub frame: Arc<Frame>,
    /// How long the session took to look at the view, and the driver to draw it.
    pub took: [Duration; 2],
}

/// How the session is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct News {
    /// Whether no section covers anything of the wanted view.
    pub is_uncovered: bool,
    /// Why the wanted view is not shown otherwise, or an order not followed.
    pub trouble: Option<String>,
    /// Samples that have arrived for the view.
    pub view_samples: u64,
    /// Samples in the holodeck.
    pub samples: u64,
    /// Samples traced per second.
    pub samples_per_second: f64,
    /// Workers connected, if the server has said.
    pub workers: Option<u32>,
    /// The driver's name.
    pub driver: &'static str,
    /// Whether tracing is paused.
    pub is_paused: bool,
}

/// What hand and painter share.
#[derive(Default)]
struct Papers {
    wanted: Option<Wanted>,
    orders: Vec<Order>,
    /// Whether the painter was woken, and has not looked yet.
    is_woken: bool,
    painted: Option<Painted>,
    news: News,
    /// The size of frames while the eye moves.
    moving_size: Option<(u32, u32)>,
    is_over: bool,
}

/// The hand's side of the desk.
pub struct Desk {
    papers: Arc<Mutex<Papers>>,
    waker: Waker,
}

/// What the painter has done since the hand last looked.
pub struct Done {
    /// The latest frame.
    pub painted: Option<Painted>,
    /// How the session is.
    pub news: News,
    /// The size of frames while the eye moves.
    pub moving_size: Option<(u32, u32)>,
    /// Whether the painter has ended.
    pub is_over: bool,
}

impl Desk {
    /// Says which view is wanted from now on.
    pub fn want(&self, wanted: Wanted) {
        let mut papers = lock(&self.papers);
        if papers.wanted.as_ref() != Some(&wanted) {
            papers.wanted = Some(wanted);
            self.wake(papers);
        }
    }

    /// Gives an order.
    pub fn order(&self, order: Order) {
        let mut papers = lock(&self.papers);
        papers.orders.push(order);
        self.wake(papers);
    }

    fn wake(&self, mut papers: MutexGuard<'_, Papers>) {
        if !std::mem::replace(&mut papers.is_woken, true) {
            self.waker.wake();
        }
    }

    /// Takes what the painter has done.
    pub fn take(&self) -> Done {
        let mut papers = lock(&self.papers);
        Done {
            painted: papers.painted.take(),
            news: papers.news.clone(),
            moving_size: papers.moving_size,
            is_over: papers.is_over,
        }
    }
}

/// Draws what is wanted.
pub struct Painter {
    session: Session,
    papers: Arc<Mutex<Papers>>,
    bell: Arc<Bell>,
    watched: Watched,
    detail: Detail,
    /// What the session looks at.
    looked: Option<Look>,
    /// What was drawn last, and whether it could be shown.
    drawn: Option<(Wanted, bool)>,
    times: Times,
    /// Samples in the last frame's view when it was drawn.
    drawn_samples: u64,
    news: News,
}

/// When things happened last.
struct Times {
    /// When another view was wanted.
    moved: Instant,
    /// When the last frame was done.
    frame: Instant,
    /// How long it took.
    drawn_in: Duration,
}

/// Marks the end of the painter's work, however it ends.
struct AtEnd(Arc<Mutex<Papers>>, Arc<Bell>);

impl Drop for AtEnd {
    fn drop(&mut self) {
        lock(&self.0).is_over = true;
        self.1.ring();
    }
}

impl Painter {
    /// Returns a painter and its desk. It rings `bell` when there is something to take.
    pub fn new(
        session: Session,
        waker: Waker,
        bell: Arc<Bell>,
        watched: Watched,
    ) -> (Painter, Desk) {
        let papers = Arc::<Mutex<Papers>>::default();
        let desk = Desk { papers: Arc::clone(&papers), waker };
        let now = Instant::now();
        let times = Times { moved: now, frame: now, drawn_in: Duration::ZERO };
        let painter = Painter {
            session,
            papers,
            bell,
            watched,
            detail: Detail::default(),
            looked: None,
            drawn: None,
            times,
            drawn_samples: 0,
            news: News::default(),
        };
        (painter, desk)
    }

    /// Draws until it is ordered to quit, then lets everything under way be stored.
    ///
    /// # Errors
    /// If the server is lost.
    pub fn run(mut self) -> Result<()> {
        let _end = AtEnd(Arc::clone(&self.papers), Arc::clone(&self.bell));
        loop {
            if self.session.wait(self.next_due())? == Waited::Stop {
                break;
            }
            let (wanted, orders) = {
                let mut papers = lock(&self.papers);
                papers.is_woken = false;
                (papers.wanted.clone(), std::mem::take(&mut papers.orders))
            };
            if orders.contains(&Order::Quit) {
                break;
            }
            for order in orders {
                self.follow(order)?;
            }
            if let Some(wanted) = wanted
                && self.is_due(&wanted)
            {
                self.paint(wanted)?;
            }
            self.tell();
        }
        self.session.settle()
    }

    fn follow(&mut self, order: Order) -> Result<()> {
        match order {
            Order::Pause(pause) => {
                self.session.pause(pause)?;
                self.news.is_paused = pause;
            }
            Order::Driver(_) | Order::Quit => {}
        }
        Ok(())
    }

    /// Returns whether a frame of the wanted view is due.
    fn is_due(&mut self, wanted: &Wanted) -> bool {
        match &self.drawn {
            Some((drawn, is_shown)) if drawn == wanted => {
                let is_new = self.samples() != self.drawn_samples || self.session.refines();
                *is_shown
                    && !wanted.is_moving
                    && is_new
                    && self.watched.is_watched()
                    && Instant::now() >= self.next_redraw()
            }
            _ => true,
        }
    }

    fn next_redraw(&self) -> Instant {
        let looked = self.times.frame.saturating_duration_since(self.times.moved);
        let pause = looked.mul_f64(REDRAW_SHARE).clamp(REDRAW, LATEST_REDRAW);
        self.times.frame + pause.max(self.times.drawn_in * DRAWING_PART)
    }

    /// Returns until when the painter waits for the server, unless the hand wants something.
    fn next_due(&self) -> Instant {
        let now = Instant::now();
        let is_other = lock(&self.papers)
            .wanted
            .as_ref()
            .is_some_and(|wanted| self.drawn.as_ref().is_none_or(|(drawn, _)| drawn != wanted));
        if is_other { now } else { self.next_redraw().clamp(now + NEWS, now + 2 * NEWS) }
    }

    /// Samples that have arrived for the current view.
    fn samples(&self) -> u64 {
        let counts = self.session.counts();
        counts.stored + counts.traced + self.session.live_rays()
    }

    /// Draws a frame of the wanted view.
    fn paint(&mut self, wanted: Wanted) -> Result<()> {
        let begin = Instant::now();
        let (view, full) = wanted.spec.resolve(wanted.size)?;
        let is_moving = wanted.is_moving;
        let size = if is_moving { self.detail.size(full) } else { full };
        let is_same = |(drawn, _): &(Wanted, bool)| {
            (&drawn.spec, drawn.jumps) == (&wanted.spec, wanted.jumps)
        };
        if !self.drawn.as_ref().is_some_and(is_same) {
            self.times.moved = begin;
        }
        self.session.set_moving(is_moving);
        let resolution = if is_moving { Resolution::Moving } else { Resolution::Full };
        let look = Look { view, size, resolution };
        let was_shown = self.drawn.as_ref().is_some_and(|(_, is_shown)| *is_shown);
        let is_shown = (self.looked == Some(look) && was_shown) || self.look(look)?;
        self.drawn = Some((wanted.clone(), is_shown));
        if !is_shown {
            return Ok(());
        }
        let looked = Instant::now();
        self.drawn_samples = self.samples();
        let (frame, _) = self.session.draw();
        let end = Instant::now();
        let took = [looked - begin, end - looked];
        (self.times.frame, self.times.drawn_in) = (end, end - begin);
        if is_moving {
            self.detail.note(size, full, self.times.drawn_in.as_secs_f64());
        }
        let painted = Painted { wanted, view, frame: Arc::new(frame), took };
        let mut papers = lock(&self.papers);
        papers.painted = Some(painted);
        papers.moving_size = Some(self.detail.size(full));
        drop(papers);
        self.bell.ring();
        Ok(())
    }

    /// Has the session look at a view. Returns whether it can be shown.
    fn look(&mut self, look: Look) -> Result<bool> {
        (self.news.is_uncovered, self.news.trouble) = (false, None);
        self.looked = Some(look);
        match self.session.look(look) {
            Ok(()) => return Ok(true),
            Err(error) if error.is::<NetError>() => return Err(error),
            Err(error) if error.is::<Uncovered>() => self.news.is_uncovered = true,
            Err(error) => self.news.trouble = Some(format!("{error:#}")),
        }
        Ok(false)
    }

    /// Says how the session is.
    fn tell(&mut self) {
        let status = self.session.status().copied();
        self.news = News {
            view_samples: self.samples(),
            samples: status.map_or(0, |status| status.samples),
            samples_per_second: status.map_or(0.0, |status| status.samples_per_second),
            workers: status.map(|status| status.workers),
            driver: self.session.driver_name(),
            ..std::mem::take(&mut self.news)
        };
        let mut papers = lock(&self.papers);
        if papers.news != self.news {
            papers.news = self.news.clone();
        }
    }
}

fn lock(papers: &Mutex<Papers>) -> MutexGuard<'_, Papers> {
    // What it protects is whole between any two of its changes.
    papers.lock().unwrap_or_else(PoisonError::into_inner)
}
