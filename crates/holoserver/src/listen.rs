//! Connections: taken or refused, and then a source of events for the coordinator.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
    mpsc::Sender,
};

use holo_net::NetError;
use holo_proto::hello::Role;
use tokio::net::{TcpListener, TcpStream};

use crate::{
    events::{ConnectionId, Event},
    holodeck::Holodeck,
};

/// Connections at a time: a render farm's workers and a few displays. Each costs at most the memory
/// of one bulk message.
const MAX_CONNECTIONS: usize = 256;

/// Takes connections until the task is dropped.
pub async fn listen(listener: TcpListener, holodeck: Arc<Holodeck>, events: Sender<Event>) {
    let open = Arc::new(AtomicUsize::new(0));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // For example, no file descriptor is left: that passes when somebody leaves.
            tokio::time::sleep(std::time::Duration::from_millis(50)).await;
            continue;
        };
        let (holodeck, events, open) = (Arc::clone(&holodeck), events.clone(), Arc::clone(&open));
        tokio::spawn(async move {
            let others = open.fetch_add(1, Ordering::Relaxed);
            serve(stream, &holodeck, &events, others).await;
            open.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

async fn serve(stream: TcpStream, holodeck: &Holodeck, events: &Sender<Event>, others: usize) {
    let Ok((mut inbox, outbox, hello)) = holo_net::accept(stream).await else { return };
    if let Some(reason) = refusal(holodeck, hello.role, others) {
        holo_net::refuse(&outbox, &reason);
        outbox.drained().await;
        return;
    }
    if holo_net::welcome(&outbox, holodeck.welcome()).is_err() {
        return;
    }
    let id = ConnectionId::next();
    let joined = Event::Joined { id, role: hello.role, name: hello.name, outbox };
    if events.send(joined).is_err() {
        return;
    }
    let reason = loop {
        match inbox.next().await {
            Ok(message) => {
                if events.send(Event::Message { id, message }).is_err() {
                    return;
                }
            }
            Err(NetError::Closed) => break None,
            Err(NetError::Proto(error)) => {
                // If the coordinator is gone, so is the process.
                let _ = events.send(Event::Broke { id, reason: error.to_string() });
                return;
            }
            Err(error) => break Some(error.to_string()),
        }
    };
    // If the coordinator is gone, so is the process.
    let _ = events.send(Event::Left { id, reason });
}

/// Returns why somebody is not taken.
fn refusal(holodeck: &Holodeck, role: Role, others: usize) -> Option<String> {
    if others >= MAX_CONNECTIONS {
        return Some(format!("{MAX_CONNECTIONS} processes are connected already"));
    }
    (role == Role::Worker && !holodeck.writable)
        .then(|| "this server only shows its holodeck; nothing is traced".to_owned())
}
