//! Encrypted connections between machines, for holders of a token only.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::{SOON, listener, welcome};
use holo_net::{
    Destination, HANDSHAKE_TIME, Identity, Invitation, Message, NetError, Rights, Token,
    accept_secure, connect,
};
use holo_proto::{
    bulk::BlobChunk,
    control::Control,
    frame::{self, FrameKind},
    hello::{Answer, Hello, Role},
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::timeout,
};

struct Server {
    identity: Identity,
    folder: tempfile::TempDir,
}

impl Server {
    fn new() -> Server {
        let folder = tempfile::tempdir().unwrap();
        Server { identity: Identity::open(folder.path()).unwrap(), folder }
    }

    fn admin(&self) -> Token {
        self.identity.tokens().unwrap()[0].0
    }

    /// Connects a peer with a token that trusts this fingerprint. Returns the results of both
    /// sides.
    async fn join(
        &self,
        token: Token,
        fingerprint: [u8; 32],
        role: Role,
    ) -> (Result<Rights, NetError>, Result<(), NetError>) {
        let (listener, address) = listener().await;
        let (address, token_name) = (address.to_string(), token.name());
        let invitation = Invitation { address, fingerprint, token };
        let server = async {
            let stream = listener.accept().await.unwrap().0;
            let (_inbox, outbox, hello, access) = accept_secure(stream, &self.identity).await?;
            assert_eq!(hello, Hello::new(role, "tester"));
            holo_net::welcome(&outbox, welcome())?;
            outbox.drained().await;
            assert_eq!(access.token, Some(token_name));
            assert_eq!(access.machine.is_some(), role == Role::Worker);
            Ok(access.rights)
        };
        // The invitation goes through its text, as between people.
        let destination = Destination::parse(&invitation.to_string()).unwrap();
        let (server, client) = tokio::join!(server, connect(destination, role, "tester"));
        (server, client.map(|(_, _, told)| assert_eq!(told, welcome())))
    }
}

fn refusal(client: Result<(), NetError>) -> String {
    match client {
        Err(NetError::Refused(reason)) => reason,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn holders_of_a_token_are_accepted_in_the_roles_that_it_permits() {
    let server = Server::new();
    let fingerprint = server.identity.fingerprint();
    let mut tokens = vec![(server.admin(), Rights::Admin)];
    for rights in [Rights::Member, Rights::Worker, Rights::Display, Rights::ReadOnly] {
        tokens.push((server.identity.add_token(rights).unwrap(), rights));
    }
    for (token, rights) in tokens {
        for role in [Role::Worker, Role::Display, Role::Admin] {
            let (taken, client) = server.join(token, fingerprint, role).await;
            if rights.permits(role) {
                assert_eq!(taken.unwrap(), rights);
                client.unwrap();
            } else {
                assert!(matches!(taken, Err(NetError::Refused(_))));
                assert!(refusal(client).contains("does not permit that role"));
            }
        }
    }
}

#[tokio::test]
async fn a_token_that_was_revoked_or_guessed_opens_nothing() {
    let server = Server::new();
    let fingerprint = server.identity.fingerprint();
    let revoked = server.identity.add_token(Rights::Worker).unwrap();
    server.join(revoked, fingerprint, Role::Worker).await.1.unwrap();
    assert!(server.identity.revoke_token(&revoked.name()).unwrap());
    // The right name with another secret, and a token of another server.
    let mut guessed = server.admin().to_string();
    // Only the first two bits of the last letter count.
    let last = if guessed.ends_with('A') { "Q" } else { "A" };
    guessed.replace_range(guessed.len() - 1.., last);
    let guessed: Token = guessed.parse().unwrap();
    assert_eq!(guessed.name(), server.admin().name());
    for token in [revoked, guessed, Server::new().admin()] {
        let (taken, client) = server.join(token, fingerprint, Role::Worker).await;
        assert!(matches!(taken, Err(NetError::Refused(_))));
        assert!(refusal(client).contains("not one of this server's"));
    }
    assert!(server.folder.path().join("tokens").exists());
}

#[tokio::test]
async fn a_server_with_another_certificate_receives_no_token() {
    let (server, other) = (Server::new(), Server::new());
    let (taken, client) =
        server.join(server.admin(), other.identity.fingerprint(), Role::Display).await;
    assert!(matches!(client, Err(NetError::Fingerprint)), "{client:?}");
    assert!(taken.is_err());
}

#[tokio::test]
async fn a_peer_without_encryption_learns_how_to_join_and_nothing_else() {
    let server = Server::new();
    let (listener, address) = listener().await;
    let hello = frame::encode(FrameKind::Hello, &Hello::new(Role::Worker, "w").encode()).unwrap();
    let client = async {
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream.write_all(&hello).await.unwrap();
        let mut said = Vec::new();
        let _ = timeout(SOON, stream.read_to_end(&mut said)).await.expect("the connection ends");
        said
    };
    let taken = async {
        accept_secure(listener.accept().await.unwrap().0, &server.identity).await.map(|_| ())
    };
    let (said, taken) = tokio::join!(client, taken);
    assert!(matches!(taken, Err(NetError::Refused(_))), "{taken:?}");
    let (header, answer) = said.split_first_chunk().unwrap();
    let header = frame::FrameHeader::parse(*header).unwrap();
    assert_eq!((header.kind, header.length as usize), (FrameKind::Answer, answer.len()));
    match Answer::decode(answer) {
        Ok(Answer::Refused(reason)) => assert!(reason.contains("holodeck://"), "{reason}"),
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn a_stranger_that_begins_to_encrypt_and_stops_is_dropped_in_time() {
    let server = Server::new();
    let (listener, address) = listener().await;
    let (mut client, stream) = tokio::join!(TcpStream::connect(address), listener.accept());
    client.as_mut().unwrap().write_all(&[22, 3, 1]).await.unwrap();
    tokio::time::pause();
    let start = tokio::time::Instant::now();
    let taken = accept_secure(stream.unwrap().0, &server.identity).await.map(|_| ());
    assert!(matches!(taken, Err(NetError::Handshake)));
    assert!(start.elapsed() < HANDSHAKE_TIME * 2);
}

#[tokio::test]
async fn messages_arrive_whole_and_in_order_and_the_end_is_seen() {
    let server = Server::new();
    let (listener, address) = listener().await;
    let invitation = Invitation {
        address: address.to_string(),
        fingerprint: server.identity.fingerprint(),
        token: server.admin(),
    };
    let taken = async {
        let stream = listener.accept().await.unwrap().0;
        let (inbox, outbox, ..) = accept_secure(stream, &server.identity).await.unwrap();
        holo_net::welcome(&outbox, welcome()).unwrap();
        (inbox, outbox)
    };
    let destination = Destination::Invited(Box::new(invitation));
    let (ours, theirs) = tokio::join!(taken, connect(destination, Role::Worker, "w"));
    let ((mut inbox, outbox), (mut theirs_in, theirs_out, _)) = (ours, theirs.unwrap());
    let piece = |offset| BlobChunk { offset, bytes: vec![offset as u8; 1 << 20] };
    for offset in 0..20 {
        outbox.send(FrameKind::BlobChunk, &piece(offset).encode()).unwrap();
        theirs_out.control(&Control::Ping(offset + 1)).unwrap();
    }
    for offset in 0..20 {
        let message = timeout(SOON, theirs_in.next()).await.unwrap().unwrap();
        assert!(message == Message::BlobChunk(piece(offset)), "piece {offset}");
        let ping = timeout(SOON, inbox.next()).await.unwrap().unwrap();
        assert_eq!(ping, Message::Control(Control::Ping(offset + 1)));
    }
    drop((theirs_in, theirs_out));
    assert!(matches!(timeout(SOON, inbox.next()).await.unwrap(), Err(NetError::Closed)));
}
