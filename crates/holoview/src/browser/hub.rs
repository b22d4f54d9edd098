//! Everyone who looks at one session: who drives, and what is encoded once for all.

use std::{
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
    time::Duration,
};

use anyhow::Result;
use holo_net::Shutdown;
use holo_walk::Controls;
use tokio::sync::watch;

use super::encode::{Coding, Colours, Rect};
use crate::{
    screen::Display,
    stage::{Front, Input, Shown},
};

/// Clients at the most. Each costs a picture of memory.
const MOST_CLIENTS: usize = 64;

/// Encoded things that are kept for others who want the same.
const MOST_KEPT: usize = 16;

/// Time that clients have to leave after the session's end.
const LEAVING: Duration = Duration::from_secs(2);

/// What is encoded: the number of a frame, how it looks, and which part of it.
type PartKey = (u64, Display, Rect, Coding);

/// Everyone who looks at one session.
pub struct Hub {
    /// The stage.
    pub front: Front,
    roles: watch::Sender<Roles>,
    next_client: Mutex<u32>,
    colours: Shared<(u64, Display), Vec<u8>>,
    parts: Shared<PartKey, Vec<u8>>,
}

/// Who is there, in order of arrival, and who drives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Roles {
    /// Everyone's number.
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
    /// Returns a hub where nobody is yet.
    pub fn new(front: Front) -> Hub {
        Hub {
            front,
            roles: watch::Sender::default(),
            next_client: Mutex::new(1),
            colours: Shared::default(),
            parts: Shared::default(),
        }
    }

    /// Lets a client enter; `None` if there are too many. The first one drives.
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

    /// Has a client drive.
    pub fn take_over(&self, client: u32) {
        self.let_go();
        self.roles.send_modify(|roles| roles.driver = Some(client));
    }

    /// Ends what the one who drives holds down: nobody else could.
    fn let_go(&self) {
        self.front.inputs.send(0, 0, Input::Hold(Controls::default()));
        self.front.inputs.send(0, 0, Input::Cursor(None));
    }

    /// Returns who is there from now on.
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

    /// Ends some time after `ending` was triggered: when everyone has left, or need not be waited
    /// for any more.
    pub async fn everyone_has_left(&self, ending: &Shutdown) {
        ending.wait().await;
        let mut roles = self.roles();
        let nobody = roles.wait_for(|roles| roles.clients.is_empty());
        // Whoever does not leave in time is cut off.
        let _ = tokio::time::timeout(LEAVING, nobody).await;
    }

    /// Returns a frame's colours, made once for all who want the same. Takes a moment.
    pub fn colours(&self, shown: &Shown, display: Display) -> Arc<Vec<u8>> {
        self.colours.get((shown.number, display), || display.colours(shown))
    }

    /// Returns a part of a frame as encoded bytes, made once for all who want the same. Takes a
    /// moment.
    ///
    /// # Errors
    /// If the part cannot be encoded.
    pub fn part(
        &self,
        (frame, display): (u64, Display),
        colours: Colours,
        rect: Rect,
        coding: Coding,
    ) -> Result<Arc<Vec<u8>>> {
        let mut failure = None;
        let part = self.parts.get((frame, display, rect, coding), || {
            colours.encode(rect, coding).unwrap_or_else(|error| {
                failure = Some(error);
                Vec::new()
            })
        });
        failure.map_or(Ok(part), Err)
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
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

/// The last few results of something that several want.
struct Shared<K, V>(Mutex<Vec<(K, Awaited<V>)>>);

/// A result that one makes and others wait for.
type Awaited<V> = Arc<OnceLock<Arc<V>>>;

impl<K, V> Default for Shared<K, V> {
    fn default() -> Self {
        Shared(Mutex::default())
    }
}

impl<K: PartialEq, V> Shared<K, V> {
    /// Returns what `make` returns, or what it returned for the same key a moment ago.
    fn get(&self, key: K, make: impl FnOnce() -> V) -> Arc<V> {
        let cell = {
            let mut kept = lock(&self.0);
            let known = kept.iter().find(|(other, _)| *other == key).map(|(_, cell)| cell);
            known.map(Arc::clone).unwrap_or_else(|| {
                if kept.len() == MOST_KEPT {
                    kept.remove(0);
                }
                let cell = Awaited::<V>::default();
                kept.push((key, Arc::clone(&cell)));
                cell
            })
        };
        Arc::clone(cell.get_or_init(|| Arc::new(make())))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What it protects is whole between any two of its changes.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_several_want_is_made_once_and_not_kept_for_ever() {
        let shared = Shared::<u32, u32>::default();
        let mut made = 0;
        for _ in 0..3 {
            assert_eq!(
                *shared.get(7, || {
                    made += 1;
                    49
                }),
                49
            );
        }
        assert_eq!(made, 1);
        (100..200).for_each(|key| {
            shared.get(key, || key);
        });
        assert_eq!(lock(&shared.0).len(), MOST_KEPT);
    }
}
