//! Peers that know the protocol and mean harm: over real sockets, to a server in this process.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{Peer, Place, in_time, run};
use holo_net::Message;
use holo_proto::{
    bulk::{ViewRequest, WantedBeam},
    control::Control,
    frame::Kind,
    hello::Role,
};
use holo_section::Viewpoint;
use tokio::net::TcpStream;

/// A view of the place's first beams.
fn view(view: u32, beams: u64) -> ViewRequest {
    let wanted = |beam| WantedBeam { key: common::beam(beam), weight: 1.0 };
    let viewpoint = Viewpoint { eye: [0.5; 3], radius: 0.1 };
    ViewRequest { view, viewpoint, beams: (0..beams).map(wanted).collect() }
}

#[test]
fn a_worker_that_answers_pings_and_returns_nothing_hangs_nobody() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        // It says that it has more threads than any machine.
        let mut silent = Peer::join(server.address, Role::Worker).await;
        silent.outbox.control(&Control::Ready { threads: u16::MAX }).unwrap();
        let mut display = Peer::join(server.address, Role::Display).await;
        display.send(Kind::View, &view(1, 500).encode());
        let held = silent.work().await;
        assert!(!held.is_empty());
        // An honest worker joins. All that the other holds is traced by it, or no longer waited for.
        let honest = tokio::spawn(common::work(server.address));
        display.samples(200).await;
        display.outbox.control(&Control::Settle { view: 1 }).unwrap();
        display
            .wait_for(|message| *message == Message::Control(Control::Settled { view: 1 }))
            .await;
        assert!(held.len() <= 1024, "{} packets", held.len());
        server.end().await;
        honest.await.unwrap();
    });
}

#[test]
fn a_display_that_floods_delays_no_other_and_leaves_nothing_behind() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let honest = tokio::spawn(common::work(server.address));
        let flood = Peer::join(server.address, Role::Display).await;
        let frame = |number: u32| view(number, 2000).encode();
        // More than any server would handle in the time of this test, one by one and in order.
        for number in 1..=20_000 {
            flood.send(Kind::View, &frame(number));
        }
        let mut display = Peer::join(server.address, Role::Display).await;
        let before = flood.outbox.queued_bytes();
        display.send(Kind::View, &view(1, 10).encode());
        display.samples(1).await;
        assert!(before > 0, "the flood was over before anybody else came");
        assert!(flood.outbox.queued_bytes() > 0, "it was served before the other's flood was over");
        drop(flood);
        display.send(Kind::View, &view(2, 10).encode());
        display
            .wait_for(|message| *message == Message::Control(Control::StoredSent { view: 2 }))
            .await;
        server.end().await;
        honest.await.unwrap();
    });
}

#[test]
fn strangers_that_say_nothing_lock_nobody_out() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let mut silent = Vec::new();
        for _ in 0..400 {
            silent.push(in_time(TcpStream::connect(server.address)).await.unwrap());
        }
        // Both are taken, though nobody has left.
        let display = Peer::join(server.address, Role::Display).await;
        let worker = Peer::join(server.address, Role::Worker).await;
        drop((silent, display, worker));
        server.end().await;
    });
}
