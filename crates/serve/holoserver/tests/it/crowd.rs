//! A render farm: hundreds of workers and tens of displays, each a TCP connection of its own.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{net::SocketAddr, time::Duration};

use crate::common::{self, Peer, Place, beam, in_time, results, run};
use holo_net::{Destination, Message, NetError};
use holo_proto::{
    bulk::{RequestedBeam, ViewRequest},
    control::{Control, Farewell},
    frame::FrameKind,
    hello::Role,
};
use holo_section::Viewpoint;
use holo_server::Holodeck;
use tokio::task::JoinHandle;

const WORKERS: usize = 256;
const DISPLAYS: usize = 32;

/// Beams of one view. The views of neighbours overlap by half.
const BEAMS: u64 = 400;

/// Time that a simulated worker takes for a ray.
const RAY: Duration = Duration::from_micros(20);

/// Joins as real programs do: they try again if so many come at once that the server ends some
/// handshakes.
async fn join(server: SocketAddr, role: Role) -> Peer {
    let server = Destination::Loopback(server);
    let joined = holo_net::reach(&server, role, "a test", None, common::LIMIT, |_, _| {}).await;
    let (inbox, outbox, welcome) = joined.expect("the server takes us");
    Peer { inbox, outbox, welcome }
}

/// A worker with one thread. It disappears without a message after so many packets.
fn worker(server: SocketAddr, packets: usize) -> JoinHandle<()> {
    tokio::spawn(async move {
        let Peer { mut inbox, outbox, .. } = join(server, Role::Worker).await;
        outbox.control(&Control::Ready { threads: 1 }).unwrap();
        let mut left = packets;
        while left > 0 {
            match inbox.next().await {
                Ok(Message::Work(work)) => {
                    let rays: u32 = work.packets.iter().map(|packet| u32::from(packet.count)).sum();
                    tokio::time::sleep(RAY * rays).await;
                    let done = left.min(work.packets.len());
                    left -= done;
                    let results = results(&work.packets[..done], true);
                    outbox.send(FrameKind::Results, &results.encode()).unwrap();
                }
                Ok(Message::Control(Control::Bye(farewell))) => {
                    assert_eq!(farewell, Farewell::SessionOver);
                    return;
                }
                Ok(_) => {}
                Err(NetError::Closed | NetError::Io(_)) => return,
                Err(error) => panic!("{error}"),
            }
        }
    })
}

fn view_of(display: usize, view: u32) -> Vec<u8> {
    let first = display as u64 * BEAMS / 2 + u64::from(view) * 20_000;
    let wanted =
        |number| RequestedBeam { key: beam(number), weight: 1.0, held: 0, has_earlier: false };
    let viewpoint = Viewpoint { eye: [0.5; 3], radius: 0.1 };
    let beams = (first..first + BEAMS).map(wanted).collect();
    ViewRequest { view, viewpoint, beams }.encode()
}

/// A display that looks at two views until some samples of each have come, and settles.
fn display(server: SocketAddr, number: usize) -> JoinHandle<()> {
    tokio::spawn(async move {
        let mut display = join(server, Role::Display).await;
        for view in 1..=2 {
            display.send(FrameKind::View, &view_of(number, view));
            let mut have = 0;
            while have < 500 {
                let samples = |message: &Message| matches!(message, Message::Samples(_));
                if let Message::Samples(samples) = display.wait_for(samples).await {
                    have += samples.samples.len() * usize::from(samples.view == view);
                }
            }
        }
        display.outbox.control(&Control::Settle { view: 2 }).unwrap();
        let settled = Message::Control(Control::Settled { view: 2 });
        display.wait_for(|message| *message == settled).await;
    })
}

#[test]
fn hundreds_of_workers_half_of_which_vanish_serve_tens_of_displays() {
    run(async {
        let place = Place::new();
        let server = place.serve(|config| config.fill = true).await;
        // Every second one goes after some packets, with others in its hands.
        let packets =
            |number: usize| if number.is_multiple_of(2) { usize::MAX } else { 10 + number };
        let workers: Vec<_> =
            (0..WORKERS).map(|number| worker(server.address, packets(number))).collect();
        let displays: Vec<_> =
            (0..DISPLAYS).map(|number| display(server.address, number)).collect();
        for display in displays {
            in_time(display).await.unwrap();
        }
        let summary = server.end().await;
        for worker in workers {
            in_time(worker).await.unwrap();
        }
        let holodeck = Holodeck::open_read_only(&place.file(), 0).unwrap();
        // Each number counts once here, so nothing was stored twice.
        let stored = holodeck.file.stats();
        assert_eq!((stored.samples, stored.superseded), (summary.added, 0));
        assert!(stored.samples > 32 * 500, "{}", stored.samples);
    });
}
