//! Connections: taken or refused, and then a source of mail for the coordinator.

use std::{collections::BTreeMap, future::pending, pin::pin, sync::Arc, time::Duration};

use holo_net::{Access, Identity, Inbox, NetError, Outbox};
use holo_proto::hello::{Hello, Role};
use parking_lot::Mutex;
use tokio::{
    net::{TcpListener, TcpStream},
    sync::mpsc::UnboundedSender,
    time::timeout,
};

use crate::{
    events::{ConnectionId, ServerEvent},
    guard::Guard,
    handshakes::Handshakes,
    holodeck::Holodeck,
    mailbox::{Mail, Mailbox, Put},
};

/// Connections at a time that have said who they are: a render farm's workers and a room of
/// displays. Each costs at most the memory of a few bulk messages.
const MAX_CONNECTIONS: usize = 512;

/// Connections at a time by one token, or without one. Peers with other tokens still find room.
const MAX_OF_TOKEN: usize = 448;

/// Administrators at a time, besides the other connections: they must be able to look when a server
/// is full.
const MAX_ADMINS: usize = 16;

/// Time that a peer has for reading why its connection was ended.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// Why a connection ends with its token.
const REVOKED: &str = "its token was revoked";

/// What every connection needs.
#[derive(Clone)]
pub struct ListenContext {
    holodeck: Arc<Holodeck>,
    events: UnboundedSender<ServerEvent>,
    places: Arc<Mutex<ConnectionSlots>>,
}

/// The connections that are served.
#[derive(Default)]
struct ConnectionSlots {
    /// Workers and displays, by token.
    peers: BTreeMap<Option<String>, usize>,
    admins: usize,
}

/// A connection's place. It is free again when this is dropped.
struct ConnectionSlot {
    places: Arc<Mutex<ConnectionSlots>>,
    role: Role,
    token: Option<String>,
}

impl ConnectionSlots {
    /// Returns whether there is a place for a peer.
    fn has_room(&self, role: Role, token: &Option<String>) -> bool {
        if role == Role::Admin {
            return self.admins < MAX_ADMINS;
        }
        let of_token = self.peers.get(token).copied().unwrap_or(0);
        self.peers.values().sum::<usize>() < MAX_CONNECTIONS && of_token < MAX_OF_TOKEN
    }

    fn count(&mut self, role: Role, token: &Option<String>) -> &mut usize {
        match role {
            Role::Admin => &mut self.admins,
            Role::Worker | Role::Display => self.peers.entry(token.clone()).or_default(),
        }
    }
}

impl ConnectionSlot {
    /// Takes a place for a peer; `None` if there is none.
    fn take(
        places: &Arc<Mutex<ConnectionSlots>>,
        role: Role,
        token: Option<String>,
    ) -> Option<ConnectionSlot> {
        let mut known = places.lock();
        if !known.has_room(role, &token) {
            return None;
        }
        *known.count(role, &token) += 1;
        drop(known);
        Some(ConnectionSlot { places: Arc::clone(places), role, token })
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        let mut places = self.places.lock();
        let count = places.count(self.role, &self.token);
        *count = count.saturating_sub(1);
        places.peers.retain(|_, count| *count > 0);
    }
}

impl ListenContext {
    /// Returns what connections to this holodeck need.
    pub fn new(holodeck: Arc<Holodeck>, events: UnboundedSender<ServerEvent>) -> ListenContext {
        ListenContext { holodeck, events, places: Arc::default() }
    }
}

/// Takes connections until the task is dropped. With an identity, they are encrypted, and whoever
/// connects must prove that it holds a token.
pub async fn listen(listener: TcpListener, identity: Option<Identity>, shared: ListenContext) {
    let guard = identity.map(|identity| Arc::new(Guard::new(identity)));
    let handshakes = Handshakes::default();
    loop {
        let Ok((stream, from)) = listener.accept().await else {
            // For example, all file descriptors are in use, which passes when a peer leaves.
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        handshakes.begin(from.ip(), |number| {
            let (shared, handshakes) = (shared.clone(), handshakes.clone());
            let guard = guard.clone();
            let task = async move {
                let accepted = accept(stream, guard.as_deref()).await;
                handshakes.finish(number);
                if let Ok((inbox, outbox, hello, access)) = accepted {
                    let revoked = revoked(guard.as_deref(), access.token.clone());
                    serve(inbox, outbox, hello, access, revoked, &shared).await;
                }
            };
            tokio::spawn(task).abort_handle()
        });
    }
}

/// Receives a peer's hello, and determines what the peer may do.
async fn accept(
    stream: TcpStream,
    guard: Option<&Guard>,
) -> Result<(Inbox, Outbox, Hello, Access), NetError> {
    match guard {
        Some(guard) => holo_net::accept_secure(stream, &guard.identity).await,
        None => holo_net::accept(stream).await,
    }
}

/// Waits until a peer's token is revoked. Connections on this machine have no token.
async fn revoked(guard: Option<&Guard>, token: Option<String>) {
    match guard.zip(token) {
        Some((guard, token)) => guard.revoked(&token).await,
        None => pending().await,
    }
}

/// Serves one connection, until it ends or is `revoked`.
pub async fn serve(
    inbox: Inbox,
    outbox: Outbox,
    hello: Hello,
    access: Access,
    revoked: impl Future<Output = ()>,
    shared: &ListenContext,
) {
    let ListenContext { holodeck, events, places } = shared;
    let place = ConnectionSlot::take(places, hello.role, access.token.clone());
    if let Some(reason) = refusal(holodeck, hello.role, place.is_none()) {
        holo_net::refuse(&outbox, &reason);
        outbox.drained().await;
        return;
    }
    if holo_net::welcome(&outbox, holodeck.welcome()).is_err() {
        return;
    }
    let id = ConnectionId::next();
    let mailbox = Arc::new(Mailbox::new(hello.role));
    let joined = ServerEvent::Joined { id, hello, access, outbox, mailbox: Arc::clone(&mailbox) };
    if events.send(joined).is_ok() {
        deliver(id, inbox, revoked, &mailbox, events).await;
    }
}

/// Puts what a peer sends into its mailbox, until the connection ends or is `revoked`.
async fn deliver(
    id: ConnectionId,
    mut inbox: Inbox,
    revoked: impl Future<Output = ()>,
    mailbox: &Arc<Mailbox>,
    events: &UnboundedSender<ServerEvent>,
) {
    let mut revoked = pin!(revoked);
    loop {
        let next = tokio::select! {
            next = inbox.next() => Some(next),
            () = &mut revoked => None,
        };
        let goes_on = matches!(next, Some(Ok(_)));
        let put = match next {
            Some(Ok(message)) => mailbox.put(message).await,
            Some(Err(NetError::Closed)) => mailbox.end(Mail::Left(None)),
            Some(Err(NetError::Proto(error))) => mailbox.end(Mail::Broke(error.to_string())),
            Some(Err(error)) => mailbox.end(Mail::Left(Some(error.to_string()))),
            None => mailbox.end(Mail::Broke(REVOKED.to_owned())),
        };
        if put == Put::Announce
            && events.send(ServerEvent::Mail { id, mailbox: Arc::clone(mailbox) }).is_err()
        {
            return;
        }
        if put == Put::Closed || !goes_on {
            // If the peer's further messages were left unread, the system would drop the reason
            // that is being sent.
            let _ = timeout(LAST_WORDS, async { while inbox.next().await.is_ok() {} }).await;
            return;
        }
    }
}

/// Returns why a peer is refused, if it is.
fn refusal(holodeck: &Holodeck, role: Role, is_full: bool) -> Option<String> {
    if is_full {
        return Some(match role {
            Role::Admin => format!("{MAX_ADMINS} administrators are connected already"),
            _ => format!(
                "{MAX_CONNECTIONS} processes are connected already, or {MAX_OF_TOKEN} by one token"
            ),
        });
    }
    (role == Role::Worker && !holodeck.writable)
        .then(|| "this server only shows its holodeck; nothing is traced".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_token_leaves_room_for_others_and_administrators_always_find_some() {
        let places = Arc::default();
        let take = |role, token: &str| ConnectionSlot::take(&places, role, Some(token.to_owned()));
        let many = |token| (0..1000).map_while(move |_| take(Role::Display, token)).collect();
        let first: Vec<ConnectionSlot> = many("a");
        let second: Vec<ConnectionSlot> = many("b");
        assert_eq!((first.len(), second.len()), (MAX_OF_TOKEN, MAX_CONNECTIONS - MAX_OF_TOKEN));
        assert!(take(Role::Worker, "c").is_none());
        let admins: Vec<ConnectionSlot> = (0..100).map_while(|_| take(Role::Admin, "a")).collect();
        assert_eq!(admins.len(), MAX_ADMINS);
        drop((first, admins));
        assert!(take(Role::Worker, "a").is_some() && take(Role::Admin, "b").is_some());
        drop(second);
        assert!(places.lock().peers.is_empty());
    }
}
