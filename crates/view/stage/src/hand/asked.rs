//! Follows people's inputs: motion, views, orders, pictures.

use std::{path::PathBuf, sync::Arc, thread, time::Instant};

use anyhow::{Context, anyhow};
use glam::DVec3;
use holo_picture::ViewSpec;
use holo_session::{Crew, ObjectOrder, SceneChange};
use holo_walk::Walker;
use tokio::sync::oneshot;

use super::{ANSWER, Hand, HandEnding, Question, REST};
use crate::{
    input::{Input, Named},
    painter::Order,
    picture_file::write_picture,
    picture_order::PictureOrder,
};

/// Most pixels of a picture: four times those of a usual screen.
const MOST_PIXELS: u64 = 1 << 23;

const NO_CREW: &str = "this program has not started the server and the workers: whoever has can";

impl Hand {
    /// Follows an input.
    pub(super) fn take(&mut self, input: Input) {
        let (under, towards) = self.under_cursor();
        let walker = &mut self.walker;
        match input {
            Input::Hold(controls) => {
                let now = Instant::now();
                if walker.controls.moves() && !controls.moves() {
                    // The motion has ended, so the eye is at rest at once.
                    self.times.moved = now.checked_sub(REST).unwrap_or(now);
                } else if !walker.controls.moves() {
                    // The motion begins now, not at the last step.
                    self.times.advanced = now;
                }
                walker.controls = controls;
            }
            Input::Cursor(at) => self.cursor = at,
            Input::Turn(right, up) => _ = walker.turn(right, up),
            Input::Orbit(right, up) => _ = walker.orbit(right, up, under, towards),
            Input::Wheel(steps) => _ = walker.wheel(steps, under, towards),
            Input::Slide(right, up) => self.slide(right, up, under),
            Input::View(change) => self.look(&change),
            Input::Recall(named) => self.recall(&named),
            Input::GoTo(eye) => self.jump(|walker| walker.go_to(eye)),
            Input::Home => self.jump(Walker::go_home),
            Input::Back => self.jump(Walker::back),
            Input::Forward => self.jump(Walker::forward),
            Input::LockHeight(lock) => walker.height_is_locked = lock,
            Input::Solid(is_solid) => walker.is_solid = is_solid,
            Input::Leave => (walker.may_leave, self.question) = (true, None),
            Input::Pause(pause) => self.order(Order::Pause(pause)),
            Input::Driver(driver) => {
                self.driver = Some(driver);
                self.order(Order::Driver(driver));
            }
            Input::Switch(parts, on) => self.order(Order::Switch(parts, on)),
            Input::Object(order) => self.follow(order),
            Input::Drop(path, at) => self.drop_model(path, at),
            Input::Light(change) => self.change_scene(change.into()),
            Input::Size(width, height) => self.resize((width, height)),
            Input::KillWorkers => self.order_crew(Crew::kill_workers),
            Input::RestartWorkers => self.order_crew(Crew::restart_workers),
            Input::StartOver => self.ask(Question::StartOver),
            Input::Restart => self.ask(Question::Restart),
            Input::Cancel => {
                (self.question, self.refusal, self.focus) = (None, None, None);
            }
            Input::Picture(path, size) => self.save(path, size),
            Input::Render(order) => self.render(order),
            Input::Keep(name) => {
                let options = holo_walk::options(self.walker.view());
                self.order(Order::KeepView(name, options));
            }
            Input::Forget(name) => {
                let removed = self.news.views.iter().find(|(other, _)| *other == name);
                self.removed_view = removed.cloned().or(self.removed_view.take());
                self.order(Order::KeepView(name, String::new()));
            }
            Input::RestoreView => match self.removed_view.take() {
                Some((name, options)) => self.order(Order::KeepView(name, options)),
                None => self.refuse("no view was removed".to_owned()),
            },
            Input::Quit => self.ending = Some(HandEnding::Quit),
            Input::Focus(part) => self.focus = part,
        }
    }

    /// Shows for a while why an input was refused.
    pub fn refuse(&mut self, reason: String) {
        self.refusal = Some((reason, Instant::now()));
    }

    fn order_crew(&mut self, order: impl FnOnce(&Crew)) {
        match &self.crew {
            Some(crew) => order(crew),
            None => self.refuse(NO_CREW.to_owned()),
        }
    }

    /// Asks a question. If that question is open, does what it is about.
    fn ask(&mut self, question: Question) {
        let Some(crew) = &self.crew else { return self.refuse(NO_CREW.to_owned()) };
        let is_answer =
            |(asked, since): (Question, Instant)| asked == question && since.elapsed() < ANSWER;
        if !self.question.take().is_some_and(is_answer) {
            self.question = Some((question, Instant::now()));
        } else if question == Question::StartOver {
            self.ending = Some(HandEnding::StartOver);
        } else if self.scene_read.is_none() {
            self.scene_read = Some(crew.read_scene(SceneChange::default()));
        }
    }

    /// Follows an order about an object, or has the scene read again if it changes the scene.
    pub(super) fn follow(&mut self, order: ObjectOrder) {
        let of_scene = self.crew.as_ref().map(Crew::stated);
        let change = of_scene.map(|stated| self.objects.scene_change(&order, &stated.objects));
        match change {
            Some(Ok(Some(change))) => self.change_scene(change),
            Some(Err(error)) => self.refuse(format!("{error:#}")),
            Some(Ok(None)) | None => self.order(Order::Object(order)),
        }
    }

    /// Has the scene read again with a change. Changes that come meanwhile are made together.
    fn change_scene(&mut self, change: SceneChange) {
        let Some(crew) = &self.crew else { return self.refuse(NO_CREW.to_owned()) };
        self.refusal = None;
        self.scene_change.add(change);
        self.scene_read = Some(crew.read_scene(self.scene_change.clone()));
    }

    /// Has the scene read again if an object that becomes part of it was moved or removed since.
    fn read_moved_scene(&mut self) {
        let Some(crew) = &self.crew else { return };
        let Some(change) = self.objects.moved_since(&self.scene_change) else { return };
        self.scene_read = if change.is_empty() {
            crew.forget_scene();
            None
        } else {
            Some(crew.read_scene(change.clone()))
        };
        self.scene_change = change;
    }

    /// Waits until the scene that was read has its objects where they are now. Blocks, and no
    /// painter moves an object meanwhile. If that is impossible, the scene stays as it is.
    pub fn settle_scene(&mut self) {
        self.read_moved_scene();
        if let Some(answer) = self.scene_read.take() {
            let read = answer.blocking_recv().context("nobody reads the scene").flatten();
            if let Err(error) = read {
                self.refuse(format!("{error:#}"));
            }
        }
        self.scene_change = SceneChange::default();
    }

    /// Ends to go on with a scene that was read again, or says why it cannot be used.
    pub(super) fn take_scene(&mut self) {
        let Some(answer) = &mut self.scene_read else { return };
        let read = match answer.try_recv() {
            Err(oneshot::error::TryRecvError::Empty) => return,
            Err(oneshot::error::TryRecvError::Closed) => Err(anyhow!("nobody reads the scene")),
            Ok(read) => read,
        };
        self.scene_read = None;
        match read {
            Ok(()) => {
                let was_something = !self.scene_change.is_empty();
                self.read_moved_scene();
                // Without an object that is still there, nothing may be left of the change.
                let is_nothing = was_something && self.scene_change.is_empty();
                if self.scene_read.is_none() && !is_nothing {
                    self.ending = Some(HandEnding::Restart);
                }
            }
            Err(error) => {
                self.scene_change = SceneChange::default();
                self.refuse(format!("{error:#}"));
            }
        }
    }

    /// Writes a picture of the current view to a file, beside the walk.
    fn save(&mut self, path: PathBuf, size: Option<(u32, u32)>) {
        let (order, news, wish) = PictureOrder::new(size.unwrap_or(self.size));
        let writing = thread::Builder::new().name("picture".into());
        let writing = writing.spawn(move || match write_picture(&path, news, wish) {
            Ok(()) => eprintln!("wrote {}", path.display()),
            Err(error) => eprintln!("{}: {error:#}", path.display()),
        });
        match writing {
            Ok(_) => self.render(order),
            Err(error) => self.refuse(format!("starting a thread: {error}")),
        }
    }

    fn render(&mut self, order: PictureOrder) {
        match self.spec().resolve(order.size) {
            Ok((view, size)) => self.order(Order::Render(Box::new(view), size, order)),
            Err(error) => order.refuse(error.to_string()),
        }
    }

    /// Goes to another view at once.
    fn jump(&mut self, go: impl FnOnce(&mut Walker) -> bool) {
        if go(&mut self.walker) {
            self.jumps += 1;
            self.awaits_jump = true;
            self.times.jumped = Instant::now();
            self.sources.clear();
            self.held_back = None;
            self.trail.clear();
        }
    }

    /// Goes to a view, or reports why that is impossible.
    fn look(&mut self, change: &ViewSpec) {
        let view = self.walker.view().overridden_by(change);
        match view.resolve(self.size) {
            Ok(_) => {
                self.jump(|walker| walker.look(change));
                self.refusal = None;
            }
            Err(error) => self.refuse(error.to_string()),
        }
    }

    /// Goes to a named view of the holodeck.
    fn recall(&mut self, named: &Named) {
        let views = Arc::clone(&self.news.views);
        let found = match named {
            Named::Number(number) => number.checked_sub(1).and_then(|at| views.get(at)),
            Named::Name(name) => views.iter().find(|(other, _)| other == name),
        };
        let mut change = ViewSpec::default();
        match found.map(|(_, options)| change.apply_line(options)) {
            Some(Ok(())) => self.look(&change),
            Some(Err(error)) => self.refuse(error.to_string()),
            None => self.refuse("the holodeck has no view of this name".to_owned()),
        }
    }

    fn slide(&mut self, right: f64, up: f64, under: Option<DVec3>) {
        let Some(last) = &self.last else { return };
        let (across, along) = last.view.extent();
        let distance = under.map_or(1.0, |point| (point - last.view.eye()).dot(last.view.vd));
        let distance = if last.view.kind.has_eye() { distance.max(0.0) } else { 1.0 };
        self.walker.shift(0.0, right * across * distance, up * along * distance);
    }

    fn resize(&mut self, size: (u32, u32)) {
        let is_sound = size.0 > 0
            && size.1 > 0
            && u64::from(size.0) * u64::from(size.1) <= MOST_PIXELS
            && self.walker.view().resolve(size).is_ok();
        if is_sound {
            self.size = size;
        }
    }
}
