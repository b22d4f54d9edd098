//! Servers that start late, and servers that never start.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::time::Duration;

use crate::common::{listener, welcome};
use holo_net::{NetError, accept, reach, refuse};
use holo_proto::hello::Role;
use tokio::net::TcpListener;

#[tokio::test(start_paused = true)]
async fn pauses_grow_and_patience_ends() {
    let (listener, address) = listener().await;
    drop(listener);
    let mut pauses = Vec::new();
    let patience = Duration::from_secs(40);
    let start = tokio::time::Instant::now();
    let destination = address.into();
    let reached = reach(&destination, Role::Worker, "w", None, patience, |_, pause| {
        pauses.push(pause.as_millis());
    });
    assert!(matches!(reached.await, Err(NetError::Io(_))));
    assert_eq!(pauses[..6], [250, 500, 1000, 2000, 4000, 8000]);
    assert!(pauses[6..].iter().all(|&pause| pause <= 8000));
    assert!(start.elapsed() >= patience && start.elapsed() < patience * 2, "{:?}", start.elapsed());
}

#[tokio::test]
async fn a_server_that_comes_late_is_reached() {
    let (first, address) = listener().await;
    drop(first);
    let (sender, mut attempts) = tokio::sync::mpsc::unbounded_channel();
    let client = tokio::spawn(async move {
        let forever = Duration::MAX;
        reach(&address.into(), Role::Worker, "w", None, forever, |_, _| sender.send(()).unwrap())
            .await
    });
    attempts.recv().await.unwrap();
    let listener = TcpListener::bind(address).await.unwrap();
    let (_inbox, outbox, ..) = accept(listener.accept().await.unwrap().0).await.unwrap();
    holo_net::welcome(&outbox, welcome()).unwrap();
    client.await.unwrap().unwrap();
}

#[tokio::test]
async fn a_server_that_refuses_is_not_asked_again() {
    let (listener, address) = listener().await;
    let server = async {
        let (_inbox, outbox, ..) = accept(listener.accept().await.unwrap().0).await.unwrap();
        refuse(&outbox, "no room");
    };
    let destination = address.into();
    let client = reach(&destination, Role::Worker, "w", None, Duration::MAX, |error, _| {
        panic!("it waits: {error}");
    });
    let ((), client) = tokio::join!(server, client);
    assert!(matches!(client, Err(NetError::Refused(_))));
}
