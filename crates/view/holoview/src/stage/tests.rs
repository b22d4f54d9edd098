//! Tests of a stage whose server disconnects and comes back.

use std::time::Duration;

use holo_net::{Inbox, Message, Outbox, Shutdown, accept};
use holo_proto::{
    control::{Control, Farewell, Welcome},
    hello::Role,
};
use tokio::{net::TcpListener, time::timeout};

use super::{Wishes, stage};
use crate::{DriverArg, DriverArgs, PointArgs, ViewArgs, session::Connected};

/// Longest wait in a test, in real time. Only a hang reaches it.
pub(crate) const LIMIT: Duration = Duration::from_secs(60);

/// Returns a welcome with two sections, decoded from the protocol's golden files.
pub(crate) fn welcome() -> Welcome {
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
pub(crate) async fn serve(listener: &TcpListener) -> (Inbox, Outbox) {
    let stream = timeout(LIMIT, listener.accept()).await.unwrap().unwrap().0;
    let (mut inbox, outbox, hello, _) = accept(stream).await.unwrap();
    assert_eq!(hello.role, Role::Display);
    holo_net::welcome(&outbox, welcome()).unwrap();
    while !matches!(timeout(LIMIT, inbox.next()).await.unwrap().unwrap(), Message::View(_)) {}
    (inbox, outbox)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_lost_or_starts_again_is_reached_and_asked_for_the_view() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let shutdown = Shutdown::new();
    let driver = DriverArgs { driver: DriverArg::Quadtree, walks: true, ..DriverArgs::default() };
    let points = PointArgs::default();
    let connecting = Connected::new(address, driver, points, shutdown.clone());
    let playing = tokio::spawn(async move {
        let connected = connecting.await.unwrap();
        let view = ViewArgs { size: Some((32, 24)), ..ViewArgs::default() };
        let (stage, _front) = stage(connected, Wishes { view, record: None, crew: None });
        tokio::task::spawn_blocking(move || stage.run()).await.unwrap()
    });
    for _ in 0..2 {
        // The server closes the connection without a message, as if it had been killed.
        drop(serve(&listener).await);
        let (_inbox, outbox) = serve(&listener).await;
        outbox.control(&Control::Bye(Farewell::StartsAgain)).unwrap();
        outbox.drained().await;
    }
    shutdown.trigger();
    drop(listener);
    timeout(LIMIT, playing).await.unwrap().unwrap().unwrap();
}
