//! Connects to a server, and waits for the scene if the driver draws from it.

use std::{
    net::SocketAddr,
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use holo_display::Interrupt;
use holo_net::{Destination, Inbox, Message, NetError, Outbox, Shutdown};
use holo_progress::HumanBytes;
use holo_proto::{
    control::{Control, Welcome},
    hello::Role,
};
use holo_raycast::StoredScenes;
use holo_section::Section;
use tokio::sync::Semaphore;

use super::{
    Ahead, RayDelay, Session, Settling,
    crew::Restarted,
    driver_choice::{DriverChoice, LoadedScene, SceneUse},
    incoming::{Incoming, MAX_WAITING_BYTES, SessionReader},
    motion::MovedObject,
    objects::{CarriedObjects, ObjectFolder, ObjectOrder, SessionObjects},
    scene::SceneLoader,
    waker::Waker,
};

/// Longest wait for the next piece of the scene. After it, the session draws without the scene. If
/// the scene arrives later, the session uses it from then on.
const SCENE_PATIENCE: Duration = Duration::from_secs(10);

/// Interval at which progress of fetching the scene is reported. A scene that arrives sooner is not
/// reported.
const REPORT_EVERY: Duration = Duration::from_secs(1);

/// A connection whose session has not begun.
pub struct Connected {
    welcome: Welcome,
    choice: Box<dyn DriverChoice>,
    sections: Arc<[Section]>,
    outbox: Outbox,
    messages: mpsc::Receiver<Incoming>,
    waker: Waker,
    awaits_scene: bool,
    /// Orders of objects for the beginning of the session.
    orders: Vec<ObjectOrder>,
    /// True if kept objects come back.
    recalls: bool,
    again: Again,
    /// A task that ends with the connection or with the session.
    reader: tokio::task::JoinHandle<()>,
    stopper: tokio::task::JoinHandle<()>,
}

/// Makes the same connection again, to the same server or to another one.
#[derive(Clone)]
pub struct Again {
    server: Destination,
    /// The driver of the next session.
    pub choice: Box<dyn DriverChoice>,
    /// The objects of this session and the next, and where they are kept.
    objects: CarriedObjects,
    folder: Option<ObjectFolder>,
    /// True if a person walks, who may change to a driver that draws from the scene.
    walks: bool,
    shutdown: Shutdown,
    runtime: tokio::runtime::Handle,
}

impl Again {
    /// Connects. Blocks, so call it on a thread that runs no tasks.
    ///
    /// # Errors
    /// The errors of [`Connected::new`].
    pub fn connect(&self, address: SocketAddr) -> Result<Connected> {
        self.choice.forget();
        self.connect_on(address)
    }

    fn connect_on(&self, address: SocketAddr) -> Result<Connected> {
        let Again { choice, walks, shutdown, runtime, .. } = self.clone();
        let connected = runtime.block_on(Connected::new(address, choice, walks, shutdown))?;
        Ok(connected.with_carried(self.objects.clone(), self.folder.clone()))
    }

    /// Connects to a server that was started again, perhaps with another scene. Objects that are
    /// part of that scene are no longer carried. What the driver remembers of the scene follows
    /// the objects that have moved. Blocks as [`connect`](Self::connect) does.
    ///
    /// # Errors
    /// The errors of [`Connected::new`].
    pub fn follow(&self, restarted: &Restarted) -> Result<Connected> {
        self.objects.remove(&restarted.baked);
        let connected = self.connect_on(restarted.address)?;
        let motion = |moved: &MovedObject| moved.motion(&connected.sections);
        let motions: Vec<_> = restarted.moved.iter().filter_map(motion).collect();
        self.choice.go_on(&motions);
        Ok(connected)
    }

    /// Returns the objects of this session and the next.
    pub fn objects(&self) -> &CarriedObjects {
        &self.objects
    }

    /// Connects again to the same server after the connection was lost. Retries for `patience`,
    /// with growing pauses. Returns `None` if the user ends the session meanwhile. Blocks as
    /// [`connect`](Self::connect) does.
    ///
    /// # Errors
    /// The errors of [`Connected::new`], if the server answers and refuses, or `patience` ends.
    pub fn reach(
        &self,
        patience: Duration,
        mut waiting: impl FnMut(&str),
    ) -> Result<Option<Connected>> {
        let Again { server, choice, objects, folder, walks, shutdown, runtime } = self.clone();
        choice.forget();
        runtime.block_on(async {
            let name = name();
            let lost = |_: &NetError, pause: Duration| {
                let seconds = pause.as_secs_f64();
                waiting(&format!("lost the server; trying to reach it again in {seconds} s"));
            };
            let role = Role::Display;
            let reached = holo_net::reach(&server, role, &name, None, patience, lost);
            let connection = tokio::select! {
                reached = reached => reached,
                () = shutdown.wait() => return Ok(None),
            };
            Connected::from_connection(server, connection, choice, walks, shutdown.clone())
                .map(|connected| Some(connected.with_carried(objects, folder)))
        })
    }
}

/// Returns whether a session has ended because the connection broke, or because the server starts
/// again.
pub fn is_lost(error: &anyhow::Error) -> bool {
    error.downcast_ref().is_some_and(NetError::is_lost)
}

/// Returns whether a session has ended because the server starts again.
pub fn starts_again(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(NetError::StartsAgain))
}

/// Returns whether an error is of the connection.
pub fn is_of_connection(error: &anyhow::Error) -> bool {
    error.is::<NetError>()
}

/// Returns the name under which servers know this process.
fn name() -> String {
    format!("holoview {}", std::process::id())
}

impl Connected {
    /// Connects to a server. The session ends when `shutdown` is triggered. `walks` is true if a
    /// person walks, who may change to a driver that draws from the scene.
    ///
    /// # Errors
    /// If the server cannot be reached or refuses.
    pub async fn new(
        server: impl Into<Destination>,
        choice: Box<dyn DriverChoice>,
        walks: bool,
        shutdown: Shutdown,
    ) -> Result<Connected> {
        let server = server.into();
        let connection = holo_net::connect(server.clone(), Role::Display, &name()).await;
        Connected::from_connection(server, connection, choice, walks, shutdown)
    }

    /// Continues with the result of connecting. Must be called within a tokio runtime.
    fn from_connection(
        server: Destination,
        connection: Result<(Inbox, Outbox, Welcome), NetError>,
        choice: Box<dyn DriverChoice>,
        walks: bool,
        shutdown: Shutdown,
    ) -> Result<Connected> {
        let (inbox, outbox, welcome) =
            connection.with_context(|| format!("connecting to the holoserver at {server}"))?;
        let sections = welcome.sections.iter().cloned().map(Section::new);
        let sections: Arc<[Section]> =
            sections.collect::<Result<_, _>>().context("the server's sections")?;
        let again = Again {
            server,
            choice: choice.clone(),
            objects: CarriedObjects::default(),
            folder: None,
            walks,
            shutdown: shutdown.clone(),
            runtime: tokio::runtime::Handle::current(),
        };
        let uses_scene = choice.scene_use() != SceneUse::None || welcome.sky_varies;
        let stored = StoredScenes::new(None);
        // A person who walks may change to a driver that draws from the scene.
        let loader = match uses_scene || walks {
            true => SceneLoader::ask(welcome.scene, &outbox, stored.clone())?,
            false => None,
        };
        let awaits_scene = uses_scene && loader.is_some();
        let (sender, messages) = mpsc::channel();
        let reader = SessionReader {
            inbox,
            outbox: outbox.clone(),
            messages: sender.clone(),
            loader,
            stored,
            room: Arc::new(Semaphore::new(MAX_WAITING_BYTES)),
        };
        let reader = tokio::spawn(reader.run());
        let waker = Waker(sender.clone());
        let stopper = tokio::spawn(async move {
            shutdown.wait().await;
            // If the session is over, the message has no effect.
            let _ = sender.send(Incoming::Stop);
        });
        Ok(Connected {
            welcome,
            choice,
            sections,
            outbox,
            messages,
            waker,
            awaits_scene,
            orders: Vec::new(),
            recalls: false,
            again,
            reader,
            stopper,
        })
    }

    /// Carries objects into the scene before the session begins: those that a folder keeps, and
    /// those of `orders`.
    #[must_use]
    pub fn with_objects(
        mut self,
        folder: Option<ObjectFolder>,
        orders: Vec<ObjectOrder>,
    ) -> Connected {
        self.recalls = folder.is_some();
        self.again.folder = folder;
        Connected { orders, ..self }
    }

    /// Begins with the objects of the session before.
    fn with_carried(mut self, objects: CarriedObjects, folder: Option<ObjectFolder>) -> Connected {
        (self.again.objects, self.again.folder) = (objects, folder);
        self
    }

    /// Returns a handle that ends the session's waits.
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }

    /// Returns what is needed to make the same connection again.
    pub fn again(&self) -> Again {
        self.again.clone()
    }

    /// Begins the session. If the driver wants the scene, waits for it first. Returns `None` if the
    /// user ended the wait. Blocks, so call it on a thread of its own. Calls `progress` while the
    /// scene arrives.
    ///
    /// # Errors
    /// If the connection is lost, the driver requires the scene and there is none or it cannot be
    /// used, or an object cannot be used.
    pub fn begin(self, mut progress: impl FnMut(&str)) -> Result<Option<Session>> {
        if self.choice.scene_use() == SceneUse::Required && self.welcome.scene.bytes == 0 {
            bail!("this holodeck has no scene, which the driver draws from: choose another driver");
        }
        let mut scene = None;
        if self.awaits_scene {
            let is_required = self.choice.scene_use() == SceneUse::Required;
            match await_scene(&self.messages, is_required, SCENE_PATIENCE, &mut progress)? {
                Arrived::Scene(loaded) => scene = Some(loaded),
                Arrived::Nothing(reason) => {
                    progress(&format!("drawing by samples alone: {reason}"));
                }
                Arrived::Stop => return Ok(None),
            }
        }
        let sky = super::driver_choice::sky_of(&self.welcome, scene.as_deref());
        let unit = self.welcome.unit;
        let driver = self.choice.make(&self.sections, sky, unit, scene.as_deref());
        let interrupt = Interrupt::default();
        let sections = self.sections.len();
        let mut session = Session {
            driver,
            interrupt,
            scene,
            objects: SessionObjects::new(self.again.objects, self.again.folder),
            welcome: self.welcome,
            choice: self.choice,
            sections: self.sections,
            outbox: self.outbox,
            messages: self.messages,
            waker: self.waker,
            ahead: Ahead::new(sections),
            is_unasked: false,
            settling: Settling::View,
            last_stored: Instant::now(),
            current: None,
            awaits_beside: false,
            request_number: 0,
            drawing: Duration::ZERO,
            velocity: None,
            ray_delay: RayDelay::default(),
            is_paused: false,
            focus: None,
            status: None,
            refusal: None,
            start: Instant::now(),
            tasks: [self.reader, self.stopper],
        };
        if self.recalls {
            session.recall_objects();
        }
        for order in self.orders {
            progress("reading a model");
            session.object(order)?;
            session.wait_for_objects()?;
        }
        Ok(Some(session))
    }
}

/// Waits for the scene. If the driver does not require the scene, gives up after `patience` without
/// news. Once the whole scene has arrived, always waits until it is prepared.
fn await_scene(
    messages: &mpsc::Receiver<Incoming>,
    is_required: bool,
    patience: Duration,
    progress: &mut dyn FnMut(&str),
) -> Result<Arrived> {
    let mut deadline = (!is_required).then(|| Instant::now() + patience);
    let mut next_report = Instant::now() + REPORT_EVERY;
    loop {
        let incoming = match deadline {
            Some(deadline) => {
                messages.recv_timeout(deadline.saturating_duration_since(Instant::now()))
            }
            None => messages.recv().map_err(|_| mpsc::RecvTimeoutError::Disconnected),
        };
        match incoming {
            Ok(Incoming::SceneFetched { bytes, total }) => {
                deadline = deadline.map(|_| Instant::now() + patience);
                if Instant::now() >= next_report {
                    next_report = Instant::now() + REPORT_EVERY;
                    let (bytes, total) = (HumanBytes(bytes), HumanBytes(total));
                    progress(&format!("fetching the scene: {bytes} of {total}"));
                }
            }
            Ok(Incoming::ScenePreparing) => {
                deadline = None;
                if Instant::now() >= next_report {
                    progress("preparing the scene");
                }
            }
            Ok(Incoming::Scene(Ok(scene))) => return Ok(Arrived::Scene(scene)),
            Ok(Incoming::Scene(Err(error))) if is_required => return Err(error),
            Ok(Incoming::Scene(Err(error))) => return Ok(Arrived::Nothing(format!("{error:#}"))),
            Ok(Incoming::Message { message: Message::Control(Control::Bye(farewell)), .. }) => {
                bail!("the server ended the session: {farewell}")
            }
            // Only the scene has been requested so far, and nothing is shown yet.
            Ok(
                Incoming::Message { .. }
                | Incoming::Found { .. }
                | Incoming::Weighed { .. }
                | Incoming::Object(_)
                | Incoming::Wake,
            ) => {}
            Ok(Incoming::Lost(error)) => return Err(error).context("lost the server"),
            Ok(Incoming::Stop) => return Ok(Arrived::Stop),
            Err(mpsc::RecvTimeoutError::Timeout) => {
                return Ok(Arrived::Nothing("the scene has not come yet".into()));
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => bail!("lost the server"),
        }
    }
}

/// Result of waiting for the scene.
enum Arrived {
    Scene(Box<LoadedScene>),
    /// No scene, and the reason.
    Nothing(String),
    Stop,
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;

    use super::*;

    /// Waits without patience for messages from another thread. Returns the reason why no scene
    /// came.
    fn reason_without_scene(first: Incoming, is_required: bool) -> Result<String> {
        let (sender, messages) = mpsc::channel();
        sender.send(first).unwrap();
        let preparing = std::thread::spawn(move || {
            let _ = sender.send(Incoming::Scene(Err(anyhow!("cannot be used"))));
        });
        let arrived = await_scene(&messages, is_required, Duration::ZERO, &mut |_| {});
        preparing.join().unwrap();
        match arrived? {
            Arrived::Nothing(reason) => Ok(reason),
            Arrived::Scene(_) | Arrived::Stop => panic!("there is no scene, and nobody stops"),
        }
    }

    #[test]
    fn waiting_for_a_scene_that_is_being_prepared_has_no_limit() {
        let reason = reason_without_scene(Incoming::ScenePreparing, false).unwrap();
        assert_eq!(reason, "cannot be used");
    }

    #[test]
    fn a_driver_that_needs_the_scene_waits_for_it_and_ends_if_it_cannot_be_used() {
        let fetched = Incoming::SceneFetched { bytes: 1, total: 2 };
        let error = reason_without_scene(fetched, true).unwrap_err();
        assert_eq!(error.to_string(), "cannot be used");
    }

    #[test]
    fn a_driver_that_does_not_require_the_scene_draws_if_no_news_comes() {
        let (_sender, messages) = mpsc::channel();
        let arrived = await_scene(&messages, false, Duration::ZERO, &mut |_| {}).unwrap();
        assert!(matches!(arrived, Arrived::Nothing(reason) if reason.contains("not come yet")));
    }
}
