//! Connections: taken or refused, and then a source of mail for the coordinator.

use std::{future::pending, pin::pin, sync::Arc, time::Duration};

use holo_net::{Access, Identity, Inbox, NetError, Outbox, Rights};
use holo_proto::hello::{Hello, Role};
use tokio::{
    net::{TcpListener, TcpStream},
    sync::{Semaphore, mpsc::UnboundedSender},
    time::timeout,
};

use crate::{
    events::{ConnectionId, Event},
    guard::Guard,
    handshakes::Handshakes,
    holodeck::Holodeck,
    mailbox::{Mail, Mailbox, Put},
};

/// Connections at a time that have said who they are: a render farm's workers and a room of
/// displays. Each costs at most the memory of a few bulk messages.
const MAX_CONNECTIONS: usize = 512;

/// Time that a peer has for reading why its connection was ended.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// Why a connection ends with its token.
const REVOKED: &str = "its token was revoked";

/// What every connection needs.
#[derive(Clone)]
pub struct Shared {
    holodeck: Arc<Holodeck>,
    events: UnboundedSender<Event>,
    room: Arc<Semaphore>,
}

impl Shared {
    /// Returns what connections to this holodeck need.
    pub fn new(holodeck: Arc<Holodeck>, events: UnboundedSender<Event>) -> Shared {
        Shared { holodeck, events, room: Arc::new(Semaphore::new(MAX_CONNECTIONS)) }
    }
}

/// Takes connections until the task is dropped. With an identity, they are encrypted, and whoever
/// connects must prove that it holds a token.
pub async fn listen(listener: TcpListener, identity: Option<Identity>, shared: Shared) {
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
        None => {
            let (inbox, outbox, hello) = holo_net::accept(stream).await?;
            Ok((inbox, outbox, hello, Access { rights: Rights::Admin, token: None }))
        }
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
    shared: &Shared,
) {
    let Shared { holodeck, events, room } = shared;
    let place = room.try_acquire();
    if let Some(reason) = refusal(holodeck, hello.role, place.is_err()) {
        holo_net::refuse(&outbox, &reason);
        outbox.drained().await;
        return;
    }
    if holo_net::welcome(&outbox, holodeck.welcome()).is_err() {
        return;
    }
    let id = ConnectionId::next();
    let mailbox = Arc::new(Mailbox::new(hello.role));
    let joined = Event::Joined { id, hello, access, outbox, mailbox: Arc::clone(&mailbox) };
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
    events: &UnboundedSender<Event>,
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
            && events.send(Event::Mail { id, mailbox: Arc::clone(mailbox) }).is_err()
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
        return Some(format!("{MAX_CONNECTIONS} processes are connected already"));
    }
    (role == Role::Worker && !holodeck.writable)
        .then(|| "this server only shows its holodeck; nothing is traced".to_owned())
}
