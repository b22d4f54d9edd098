//! A server for tests of sessions, and of what stands on them.

#![allow(dead_code, reason = "the tests of each package use a part")]

use std::time::Duration;

use holo_net::{Inbox, Message, Outbox, accept};
use holo_proto::{
    control::{Control, Welcome},
    hello::Role,
};
use tokio::{net::TcpListener, time::timeout};

/// Longest wait in a test, in real time. Only a hang reaches it.
pub const LIMIT: Duration = Duration::from_secs(60);

/// Returns a welcome with two sections, decoded from the protocol's golden files.
pub fn welcome() -> Welcome {
    let text = include_str!("../../../../../proto/golden/control-welcome.hex");
    let digits = text.lines().filter(|line| !line.starts_with('#')).flat_map(str::split_whitespace);
    let frame: Vec<u8> = digits.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
    match Control::decode(&frame[8..]) {
        Ok(Control::Welcome(mut welcome)) => {
            let view = "-vtv -vp 0 0 0 -vd 1 0.1 0.1 -vu 0 0 1 -vh 60";
            welcome.views = vec![("first".into(), view.into())];
            *welcome
        }
        other => panic!("{other:?}"),
    }
}

/// Accepts a display, and waits until it requests a view.
pub async fn serve(listener: &TcpListener) -> (Inbox, Outbox) {
    let stream = timeout(LIMIT, listener.accept()).await.unwrap().unwrap().0;
    let (mut inbox, outbox, hello, _) = accept(stream).await.unwrap();
    assert_eq!(hello.role, Role::Display);
    holo_net::welcome(&outbox, welcome()).unwrap();
    while !matches!(timeout(LIMIT, inbox.next()).await.unwrap().unwrap(), Message::View(_)) {}
    (inbox, outbox)
}
