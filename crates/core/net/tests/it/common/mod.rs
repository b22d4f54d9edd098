//! Connections for tests, on loopback.
// Helpers are not tests for clippy, and each test file uses some of them.
#![allow(dead_code, clippy::unwrap_used, clippy::panic)]

use std::net::SocketAddr;
use std::time::Duration;

use holo_net::{Inbox, NetError, Outbox, accept, connect};
use holo_proto::{
    control::{Control, Welcome},
    frame::FrameKind,
    hello::{Hello, Role},
};
use tokio::net::{TcpListener, TcpStream};

/// The limit of waits in real time. Only a hang reaches it.
pub const SOON: Duration = Duration::from_secs(120);

/// Waits until `condition` holds.
///
/// # Panics
/// After [`SOON`].
pub async fn until(condition: impl Fn() -> bool) {
    let holds = async {
        while !condition() {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    };
    tokio::time::timeout(SOON, holds).await.unwrap();
}

/// A welcome with two sections, from its bytes in the protocol's golden files.
pub fn welcome() -> Welcome {
    let text = include_str!("../../../../../../proto/golden/control-welcome.hex");
    let digits = text.lines().filter(|line| !line.starts_with('#')).flat_map(str::split_whitespace);
    let frame: Vec<u8> = digits.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
    match Control::decode(&frame[8..]) {
        Ok(Control::Welcome(welcome)) => *welcome,
        other => panic!("{other:?}"),
    }
}

pub async fn listener() -> (TcpListener, SocketAddr) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    (listener, address)
}

/// A raw connection: the client's stream, and the stream to pass to `accept`.
pub async fn raw() -> (TcpStream, TcpStream) {
    let (listener, address) = listener().await;
    let (client, server) = tokio::join!(TcpStream::connect(address), listener.accept());
    (client.unwrap(), server.unwrap().0)
}

pub type Side = (Inbox, Outbox);

/// A client and the server's side of its connection, after the handshake.
pub async fn pair() -> (Side, Side) {
    let (listener, address) = listener().await;
    let server = async {
        let (inbox, outbox, hello, _) = accept(listener.accept().await.unwrap().0).await?;
        assert_eq!(hello, Hello::new(Role::Worker, "tester"));
        holo_net::welcome(&outbox, welcome())?;
        Ok::<_, NetError>((inbox, outbox))
    };
    let (server, client) = tokio::join!(server, connect(address, Role::Worker, "tester"));
    let (inbox, outbox, told) = client.unwrap();
    assert_eq!(told, welcome());
    ((inbox, outbox), server.unwrap())
}

/// A client that writes bytes as it likes to an accepted connection, and the server's side.
pub async fn raw_client() -> (TcpStream, Side) {
    use tokio::io::AsyncWriteExt;
    let (mut client, server) = raw().await;
    let hello =
        holo_proto::frame::encode(FrameKind::Hello, &Hello::new(Role::Display, "raw").encode())
            .unwrap();
    client.write_all(&hello).await.unwrap();
    let (inbox, outbox, ..) = accept(server).await.unwrap();
    (client, (inbox, outbox))
}
