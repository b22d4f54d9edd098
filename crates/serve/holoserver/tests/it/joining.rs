//! Peers from other machines: by the string that the server prints, in the role of their token.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::{self, Peer, Place, Server, in_time, run, view};
use holo_net::{Destination, Identity, Invitation, Message, NetError, Rights};
use holo_proto::{
    bulk::{SampleSource, ViewSamples},
    control::Control,
    frame::FrameKind,
    hello::Role,
};

/// A server that takes invited peers, and its identity.
async fn secure(place: &Place) -> (Server, Identity) {
    let folder = place.file().with_file_name("identity");
    let identity = Identity::open(&folder).unwrap();
    let server = place
        .serve(|config| {
            config.secure = true;
            config.identity = Some(folder);
        })
        .await;
    (server, identity)
}

/// Returns the destination in the printed string, with another token.
fn with_token(server: &Server, identity: &Identity, rights: Rights) -> Destination {
    let invitation = server.invitation.clone().expect("it prints one");
    let token = identity.add_token(rights).unwrap();
    Destination::Invited(Box::new(Invitation { token, ..invitation }))
}

#[test]
fn by_the_printed_string_a_worker_traces_and_a_display_looks() {
    run(async {
        let place = Place::new();
        let (server, _) = secure(&place).await;
        let printed = server.invitation.as_ref().expect("it prints one").to_string();
        let invited = || Destination::parse(&printed).unwrap();
        let worker = tokio::spawn(common::work(invited()));
        let mut display = Peer::join(invited(), Role::Display).await;
        display.send(FrameKind::View, &view(1, 50));
        display.samples(100).await;
        let admin = in_time(holo_net::connect(invited(), Role::Admin, "a test")).await;
        assert!(matches!(admin, Err(NetError::Refused(_))), "it permits no more than that");
        // A peer that was started with the server needs no string.
        let local = Peer::join(server.address, Role::Display).await;
        drop((display, local));
        server.end().await;
        worker.await.unwrap();
    });
}

#[test]
fn without_a_token_nobody_from_outside_is_served() {
    run(async {
        let place = Place::new();
        let (server, _) = secure(&place).await;
        let invitation = server.invitation.clone().unwrap();
        let address: std::net::SocketAddr = invitation.address.parse().unwrap();
        let bare = in_time(holo_net::connect(address, Role::Worker, "a test")).await;
        assert!(bare.is_err(), "not even by a connection from this machine");
        let stranger = Identity::open(&place.file().with_file_name("stranger")).unwrap();
        let token = stranger.tokens().unwrap()[0].0;
        let guessed = Destination::Invited(Box::new(Invitation { token, ..invitation }));
        let refused = in_time(holo_net::connect(guessed, Role::Worker, "a test")).await;
        assert!(matches!(refused, Err(NetError::Refused(_))));
        server.end().await;
    });
}

#[test]
fn for_a_read_only_display_nothing_is_traced_and_it_changes_nothing() {
    run(async {
        let place = Place::new();
        let (server, identity) = secure(&place).await;
        let worker = tokio::spawn(common::work(with_token(&server, &identity, Rights::Worker)));
        let reader = with_token(&server, &identity, Rights::ReadOnly);
        let mut reader = Peer::join(reader, Role::Display).await;
        reader.send(FrameKind::View, &view(1, 50));
        let keep = Control::KeepView { name: "mine".into(), options: "-vp 0 0 0".into() };
        reader.outbox.control(&keep).unwrap();
        let refused =
            |message: &Message| matches!(message, Message::Control(Control::Refused { .. }));
        let stored =
            |message: &Message| *message == Message::Control(Control::StoredSent { view: 1 });
        let mut heard = [false; 2];
        while heard != [true; 2] {
            let message = reader.wait_for(|message| {
                assert!(!matches!(message, Message::Samples(_)), "nobody else looks");
                refused(message) || stored(message)
            });
            let message = message.await;
            heard[usize::from(stored(&message))] = true;
        }
        // A display with more rights looks. Samples traced for it are shown to both.
        let other = with_token(&server, &identity, Rights::Display);
        let other = Peer::join(other, Role::Display).await;
        other.send(FrameKind::View, &view(1, 50));
        let traced = reader.wait_for(|message| matches!(message, Message::Samples(_))).await;
        assert!(matches!(
            traced,
            Message::Samples(ViewSamples { source: SampleSource::Traced, .. })
        ));
        drop(other);
        server.end().await;
        worker.await.unwrap();
    });
}

#[test]
fn whoever_is_connected_by_a_token_is_cut_off_with_a_reason_when_it_is_revoked() {
    run(async {
        let place = Place::new();
        let (server, identity) = secure(&place).await;
        let [kept, revoked] = [(); 2].map(|()| with_token(&server, &identity, Rights::Admin));
        let mut peers = Vec::new();
        for (token, role) in [
            (&revoked, Role::Worker),
            (&revoked, Role::Display),
            (&revoked, Role::Admin),
            (&kept, Role::Display),
        ] {
            peers.push(Peer::join(token.clone(), role).await);
        }
        let mut local = Peer::join(server.address, Role::Display).await;
        let Destination::Invited(invitation) = revoked else { panic!("it is invited") };
        assert!(identity.revoke_token(&invitation.token.name()).unwrap());
        let mut kept = peers.pop().unwrap();
        for mut peer in peers {
            assert_eq!(peer.expelled().await.as_deref(), Some("its token was revoked"));
        }
        for peer in [&mut kept, &mut local] {
            peer.outbox.control(&Control::Ping(7)).unwrap();
            peer.wait_for(|message| *message == Message::Control(Control::Pong(7))).await;
        }
        server.end().await;
    });
}
