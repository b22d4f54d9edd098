//! Everyone who looks at one session: who drives, and what each client sees.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use holo_net::Shutdown;
use holo_picture::{Image, Look};
use holo_walk::Controls;
use tokio::sync::{Semaphore, watch};

use super::eyes::AllEyes;
use crate::stage::{Front, Input, Shown};

/// Most clients. Each one costs the memory of a picture.
const MOST_CLIENTS: usize = 64;

/// Most pictures of a stated size that are encoded and sent at once.
const MOST_ENCODERS: usize = 4;

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
    /// The frame that each client sees, by the client's number.
    seen: Mutex<BTreeMap<u32, Seen>>,
}

/// A frame as a client sees it.
#[derive(Clone)]
pub struct Seen {
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
    hub: Arc<Hub>,
}

impl Hub {
    /// Returns a hub without clients.
    pub fn new(front: Front) -> Hub {
        Hub {
            front,
            roles: watch::Sender::default(),
            next_client: Mutex::new(1),
            session: name_of_session(),
            eyes: AllEyes::default(),
            encoders: Arc::new(Semaphore::new(MOST_ENCODERS)),
            seen: Mutex::default(),
        }
    }

    /// Admits a client; `None` if there are too many. The first one drives.
    pub fn enter(self: &Arc<Self>) -> Option<Guest> {
        let number = {
            let mut next = lock(&self.next_client);
            *next += 1;
            *next - 1
        };
        let has_entered = self.roles.send_if_modified(|roles| {
            let has_room = roles.clients.len() < MOST_CLIENTS;
            if has_room {
                roles.clients.push(number);
                roles.driver = roles.driver.or(Some(number));
            }
            has_room
        });
        has_entered.then(|| Guest { number, hub: Arc::clone(self) })
    }

    /// Makes a client the driver.
    pub fn take_over(&self, client: u32) {
        self.let_go();
        self.roles.send_modify(|roles| roles.driver = Some(client));
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

    /// Returns the latest frame.
    pub fn latest(&self) -> Option<Arc<Shown>> {
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
    pub fn seen(&self, client: u32) -> Option<Seen> {
        lock(&self.seen).get(&client).cloned()
    }
}

impl Guest {
    /// Records what the client sees from now on.
    pub fn sees(&self, seen: Seen) {
        lock(&self.hub.seen).insert(self.number, seen);
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        lock(&self.hub.seen).remove(&self.number);
        if self.hub.drives(self.number) {
            self.hub.let_go();
        }
        self.hub.roles.send_modify(|roles| {
            roles.clients.retain(|&client| client != self.number);
            if roles.driver == Some(self.number) {
                roles.driver = roles.clients.first().copied();
            }
        });
    }
}

/// Returns a name that another process or another time does not give.
fn name_of_session() -> String {
    let since = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    format!("{}-{}", std::process::id(), since.as_nanos())
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Every change leaves the value consistent, so a panic elsewhere does no harm.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
