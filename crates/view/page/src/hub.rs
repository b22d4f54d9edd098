//! Everyone who looks at one session: who drives, and what each client sees.

use std::{
    collections::BTreeMap,
    sync::Arc,
    time::{Duration, Instant},
};

use holo_net::{Secret, Shutdown};
use holo_picture::{Image, Look};
use holo_stage::{Front, Input, PublishedFrame};
use holo_walk::Controls;
use parking_lot::Mutex;
use tokio::sync::{Notify, Semaphore, watch};

use super::{dropped::DroppedFiles, eyes::AllEyes, together::FrameRounds};

/// Most clients. Each one costs the memory of a picture.
const MOST_CLIENTS: usize = 64;

/// Most pictures of a stated size that are encoded and sent at once.
const MOST_ENCODERS: usize = 4;

/// A client that has answered no ping for so long gives way to a further one.
const SILENT: Duration = Duration::from_secs(6);

/// Time that clients may take to leave after the session's end.
const LEAVING: Duration = Duration::from_secs(2);

/// Everyone who looks at one session.
pub struct Hub {
    /// The stage.
    pub front: Front,
    roles: watch::Sender<Roles>,
    next_client: Mutex<u32>,
    /// A name of this session that no other one has.
    pub session: String,
    /// The eyes of all clients, by look.
    pub eyes: AllEyes,
    /// Permits to encode a picture while it is drawn and sent. A client that takes nothing keeps
    /// one.
    pub encoders: Arc<Semaphore>,
    /// Names of the screens of a wall; none without one.
    pub screens: Vec<String>,
    /// The frame that all of them show.
    pub rounds: FrameRounds,
    /// Files that clients have dropped on the page.
    pub dropped: DroppedFiles,
    /// The frame that each client sees, by the client's number.
    seen: Mutex<BTreeMap<u32, ClientFrame>>,
    /// When each client was last heard of, and the signal that it must give way.
    heard: Mutex<BTreeMap<u32, (Instant, Arc<Notify>)>>,
    /// What proves that a request comes from a client. Only the client is told.
    keys: Mutex<BTreeMap<u32, Secret>>,
}

/// A frame as a client sees it.
#[derive(Clone)]
pub struct ClientFrame {
    /// The frame's number.
    pub frame: u64,
    /// Its colours.
    pub image: Arc<Image>,
    /// The look that made them.
    pub look: Look,
}

/// Who is there, in order of arrival, and who drives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Roles {
    /// The number of each client.
    pub clients: Vec<u32>,
    /// The one whose inputs count.
    pub driver: Option<u32>,
}

/// A client that has entered. It leaves when this is dropped.
pub struct Guest {
    /// Its number, from 1.
    pub number: u32,
    /// What proves that a request comes from it.
    pub key: String,
    hub: Arc<Hub>,
    gives_way: Arc<Notify>,
}

impl Hub {
    /// Returns a hub without clients. `screens` are the names of a wall's screens.
    pub fn new(front: Front, screens: Vec<String>) -> Hub {
        Hub {
            front,
            screens,
            rounds: FrameRounds::default(),
            roles: watch::Sender::default(),
            next_client: Mutex::new(1),
            session: name_of_session(),
            eyes: AllEyes::default(),
            encoders: Arc::new(Semaphore::new(MOST_ENCODERS)),
            dropped: DroppedFiles::default(),
            seen: Mutex::default(),
            heard: Mutex::default(),
            keys: Mutex::default(),
        }
    }

    /// Admits a client; `None` if there are too many, or if the system gives no random numbers. The
    /// first one drives. A client that answers nothing gives way.
    pub fn enter(self: &Arc<Self>) -> Option<Guest> {
        let key = Secret::new().ok()?;
        let number = {
            let mut next = self.next_client.lock();
            *next += 1;
            *next - 1
        };
        let gives_way = Arc::new(Notify::new());
        self.make_room();
        let has_entered = self.roles.send_if_modified(|roles| {
            let has_room = roles.clients.len() < MOST_CLIENTS;
            if has_room {
                roles.clients.push(number);
                roles.driver = roles.driver.or(Some(number));
            }
            has_room
        });
        has_entered.then(|| {
            self.heard.lock().insert(number, (Instant::now(), Arc::clone(&gives_way)));
            let guest = Guest { number, key: key.to_string(), hub: Arc::clone(self), gives_way };
            self.keys.lock().insert(number, key);
            guest
        })
    }

    /// If there are too many clients, ends the one that has been silent the longest, if it is.
    fn make_room(&self) {
        if self.roles.borrow().clients.len() < MOST_CLIENTS {
            return;
        }
        let silent = {
            let heard = self.heard.lock();
            let silent = heard.iter().min_by_key(|(_, (at, _))| *at);
            let silent = silent.filter(|(_, (at, _))| at.elapsed() >= SILENT);
            silent.map(|(&number, (_, gives_way))| (number, Arc::clone(gives_way)))
        };
        if let Some((number, gives_way)) = silent {
            self.remove(number);
            gives_way.notify_one();
        }
    }

    /// Removes a client. If it drove, the first one drives.
    fn remove(&self, number: u32) {
        self.rounds.leave(number);
        self.seen.lock().remove(&number);
        self.heard.lock().remove(&number);
        self.keys.lock().remove(&number);
        if self.drives(number) {
            self.let_go();
        }
        self.roles.send_modify(|roles| {
            roles.clients.retain(|&client| client != number);
            if roles.driver == Some(number) {
                roles.driver = roles.clients.first().copied();
            }
        });
    }

    /// Makes a client the driver.
    pub fn take_over(&self, client: u32) {
        self.let_go();
        self.roles.send_modify(|roles| roles.driver = Some(client));
    }

    /// Sends an input if it is the driver's. Nobody takes over meanwhile, so no input of an earlier
    /// driver comes after one of the next. Returns false if there was no room for it.
    pub fn drive(&self, client: u32, number: u64, input: Input) -> bool {
        let roles = self.roles.borrow();
        roles.driver != Some(client) || self.front.inputs.send(client, number, input)
    }

    /// Releases the controls that the driver holds down, because no other client can.
    fn let_go(&self) {
        self.front.inputs.send(0, 0, Input::Hold(Controls::default()));
        self.front.inputs.send(0, 0, Input::Cursor(None));
    }

    /// Returns a receiver that follows who is there and who drives.
    pub fn roles(&self) -> watch::Receiver<Roles> {
        self.roles.subscribe()
    }

    /// Returns whether a client drives.
    pub fn drives(&self, client: u32) -> bool {
        self.roles.borrow().driver == Some(client)
    }

    /// Returns whether a request with this key comes from a client.
    pub fn is_key_of(&self, client: u32, key: &str) -> bool {
        self.keys.lock().get(&client).is_some_and(|known| known.is(key))
    }

    /// Returns the frame that a client shows next, if the stage's latest one is `latest`.
    pub fn frame_for(&self, client: u32, latest: Arc<PublishedFrame>) -> Arc<PublishedFrame> {
        if self.screens.is_empty() { latest } else { self.rounds.frame(client, latest) }
    }

    /// Returns the latest frame.
    pub fn latest(&self) -> Option<Arc<PublishedFrame>> {
        self.front.frames.borrow().clone()
    }

    /// Waits until `ending` is triggered, and then until every client has left, but at most
    /// [`LEAVING`] longer.
    pub async fn everyone_has_left(&self, ending: &Shutdown) {
        ending.wait().await;
        let mut roles = self.roles();
        let nobody = roles.wait_for(|roles| roles.clients.is_empty());
        // A client that does not leave in time is disconnected.
        let _ = tokio::time::timeout(LEAVING, nobody).await;
    }

    /// Returns what a client sees, if it has seen anything.
    pub fn seen(&self, client: u32) -> Option<ClientFrame> {
        self.seen.lock().get(&client).cloned()
    }
}

impl Guest {
    /// Records what the client sees from now on.
    pub fn sees(&self, seen: ClientFrame) {
        self.hub.seen.lock().insert(self.number, seen);
    }

    /// Records that something has come from the client.
    pub fn is_heard(&self) {
        if let Some((at, _)) = self.hub.heard.lock().get_mut(&self.number) {
            *at = Instant::now();
        }
    }

    /// Returns for how long nothing has come from the client.
    pub fn silence(&self) -> Duration {
        let heard = self.hub.heard.lock();
        heard.get(&self.number).map_or(Duration::ZERO, |(at, _)| at.elapsed())
    }

    /// Waits until the client must give way to another one.
    pub async fn gives_way(&self) {
        self.gives_way.notified().await;
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        self.hub.remove(self.number);
    }
}

/// Returns a name that another process or another time does not give.
fn name_of_session() -> String {
    let since = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    format!("{}-{}", std::process::id(), since.as_nanos())
}
