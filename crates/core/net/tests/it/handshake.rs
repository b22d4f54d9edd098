//! Peers that a server accepts, refuses with a reason, or drops.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::time::Duration;

use crate::common::{SOON, listener, pair, raw};
use holo_net::{HANDSHAKE_TIME, MachineKey, NetError, accept, connect, connect_as, refuse};
use holo_proto::{
    PROTOCOL_VERSION, ProtoError,
    frame::{self, FrameKind},
    hello::{Answer, Hello, Role},
    proof::MachineProof,
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    time::{Instant, timeout},
};

/// Returns the server's answer to a client that sends these bytes and then waits.
async fn said_to(bytes: &[u8]) -> (NetError, Vec<u8>) {
    let (mut client, server) = raw().await;
    client.write_all(bytes).await.unwrap();
    let error = accept(server).await.map(|(_, _, hello, _)| hello).unwrap_err();
    let mut said = Vec::new();
    // The server's side is dropped, so the connection ends after its answer, if any.
    timeout(SOON, client.read_to_end(&mut said)).await.expect("the connection ends").unwrap();
    (error, said)
}

fn reason(said: &[u8]) -> String {
    match Answer::decode(&said[frame::HEADER_BYTES..]) {
        Ok(Answer::Refused(reason)) => reason,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn a_worker_is_taken_and_welcomed() {
    pair().await;
}

#[tokio::test]
async fn refused_peers_receive_the_reason() {
    let (listener, address) = listener().await;
    let server = async {
        let (_inbox, outbox, hello, _) = accept(listener.accept().await.unwrap().0).await.unwrap();
        assert_eq!((hello.role, hello.name.as_str()), (Role::Display, "viewer"));
        refuse(&outbox, "no room");
    };
    let ((), client) = tokio::join!(server, connect(address, Role::Display, "viewer"));
    match client {
        Err(NetError::Refused(reason)) => assert_eq!(reason, "no room"),
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn a_worker_proves_its_machine_and_nobody_can_take_a_machine_that_is_not_theirs() {
    let key = MachineKey::new().unwrap();
    for (role, proven) in [(Role::Worker, Some(key.id())), (Role::Display, None)] {
        let (listener, address) = listener().await;
        let server = async {
            let (_inbox, outbox, _, access) =
                accept(listener.accept().await.unwrap().0).await.unwrap();
            refuse(&outbox, "seen");
            access.machine
        };
        let (machine, client) = tokio::join!(server, connect_as(address, role, "w", Some(&key)));
        assert_eq!(machine, proven);
        assert!(matches!(client, Err(NetError::Refused(reason)) if reason == "seen"));
    }
    // Another peer sends the key, and a signature of its own making.
    let mut bytes =
        frame::encode(FrameKind::Hello, &Hello::new(Role::Worker, "w").encode()).unwrap();
    let proof = MachineProof { key: key.id().0, signature: [7; 64] };
    bytes.extend(frame::encode(FrameKind::MachineProof, &proof.encode()).unwrap());
    let (error, said) = said_to(&bytes).await;
    assert!(matches!(error, NetError::Refused(_)), "{error}");
    // The challenge comes before the answer.
    let answer = said[frame::HEADER_BYTES + 32..].to_vec();
    assert!(reason(&answer).contains("which machine"), "{}", reason(&answer));
}

#[tokio::test]
async fn other_versions_receive_both_numbers_even_if_their_hello_has_grown() {
    for version in [0, PROTOCOL_VERSION + 1, u16::MAX] {
        let mut hello = Hello { version, role: Role::Worker, name: "later".into() }.encode();
        hello.extend([7; 100]);
        let (error, said) = said_to(&frame::encode(FrameKind::Hello, &hello).unwrap()).await;
        assert!(
            matches!(error, NetError::Proto(ProtoError::Version { theirs, .. }) if theirs == version)
        );
        let reason = reason(&said);
        assert!(
            reason.contains(&version.to_string()) && reason.contains(&PROTOCOL_VERSION.to_string()),
            "{reason}"
        );
    }
}

#[tokio::test]
async fn an_unknown_role_is_refused_with_that_reason() {
    let mut hello = Hello::new(Role::Worker, "w").encode();
    hello[10] = 9;
    let (error, said) = said_to(&frame::encode(FrameKind::Hello, &hello).unwrap()).await;
    assert!(matches!(error, NetError::Proto(ProtoError::Role(9))), "{error}");
    assert!(reason(&said).contains('9'));
}

#[tokio::test]
async fn a_browser_is_dropped_without_an_answer() {
    let (error, said) = said_to(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n").await;
    assert!(matches!(error, NetError::Proto(ProtoError::NotHolodeck)), "{error}");
    assert_eq!(said, b"");
}

#[tokio::test]
async fn nothing_but_a_short_hello_is_read_from_a_stranger() {
    let bulk = frame::FrameHeader { kind: FrameKind::Samples, length: 16 << 20 }.to_bytes();
    let (error, _) = said_to(&bulk).await;
    assert!(matches!(error, NetError::Proto(ProtoError::NotHolodeck)), "{error}");
    let long = frame::FrameHeader { kind: FrameKind::Hello, length: 4097 }.to_bytes();
    let (error, _) = said_to(&long).await;
    assert!(
        matches!(error, NetError::Proto(ProtoError::TooLong { length: 4097, limit: 4096, .. })),
        "{error}"
    );
}

#[tokio::test]
async fn a_server_that_is_none_is_named_as_such() {
    let (listener, address) = listener().await;
    let server = async {
        let (mut stream, _) = listener.accept().await.unwrap();
        stream.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n").await.unwrap();
        stream
    };
    let (_stream, client) = tokio::join!(server, connect(address, Role::Worker, "w"));
    assert!(matches!(client, Err(NetError::Proto(ProtoError::NotHolodeck))), "{client:?}");
}

#[tokio::test]
async fn a_client_that_says_nothing_is_dropped_in_time() {
    let (mut client, server) = raw().await;
    tokio::time::pause();
    let start = Instant::now();
    let error = accept(server).await.map(|(_, _, hello, _)| hello).unwrap_err();
    let waited = start.elapsed();
    tokio::time::resume();
    assert!(matches!(error, NetError::Handshake), "{error}");
    assert!(
        waited >= HANDSHAKE_TIME && waited < HANDSHAKE_TIME + Duration::from_millis(100),
        "{waited:?}"
    );
    let mut said = Vec::new();
    timeout(SOON, client.read_to_end(&mut said)).await.expect("dropped").unwrap();
    assert_eq!(said, b"");
}

#[tokio::test]
async fn a_client_that_dribbles_gets_no_more_time() {
    let (mut client, server) = raw().await;
    tokio::time::pause();
    let start = Instant::now();
    let dribble = tokio::spawn(async move {
        // Each byte is a sign of life, but a hello may not take this long.
        for byte in
            frame::encode(FrameKind::Hello, &Hello::new(Role::Worker, "slow").encode()).unwrap()
        {
            tokio::time::sleep(Duration::from_secs(1)).await;
            if client.write_all(&[byte]).await.is_err() {
                return;
            }
        }
    });
    let error = accept(server).await.map(|(_, _, hello, _)| hello).unwrap_err();
    assert!(matches!(error, NetError::Handshake), "{error}");
    // The clock jumps from one timer to the next, so times are multiples of one byte's time.
    assert!(start.elapsed() <= HANDSHAKE_TIME + Duration::from_secs(1), "{:?}", start.elapsed());
    dribble.abort();
}

#[tokio::test]
async fn a_server_that_says_nothing_is_given_up_in_time() {
    let (listener, address) = listener().await;
    let client = tokio::spawn(async move { connect(address, Role::Worker, "w").await.map(|_| ()) });
    let (_stream, _) = listener.accept().await.unwrap();
    tokio::time::pause();
    let error = client.await.unwrap().unwrap_err();
    assert!(matches!(error, NetError::Handshake), "{error}");
}
