//! Measures a server and its peers over TCP, with workers that take no time or a stated one.
//!
//! `cargo run --release -p holo-server --example network [SECONDS] [CHANGES]`
//!
//! It prints one JSON object:
//! - `ingest` and `ingest_secure`: samples per second that one worker returns at once and the
//!   server stores, without and with encryption. Each is the median of three runs. The file has 32
//!   samples of each beam already.
//! - `first_second`: samples stored in the first second of an empty file, whose first packets hold
//!   4 rays.
//! - `recall_ms` and `recall_secure_ms`: milliseconds from a view to the last of its 250,000 stored
//!   samples in a display's memory. Each is the median of nine, after one that is not counted.
//! - `efficiency`: samples stored with 1, 8 and 64 workers of 20 µs a ray, as a share of those that
//!   the workers could trace. The file has 32 samples of each beam already.
//! - `first_ms`: milliseconds from a new view to its first newly traced samples, with 64 workers of
//!   0.5 ms a ray. It gives the median and the 99th percentile.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../tests/it/common/mod.rs"]
mod common;

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use common::{Peer, Place, Server, beam, results, work};
use holo_beamfile::Maker;
use holo_net::{Destination, Message};
use holo_proto::{
    bulk::{Packet, RequestedBeam, SampleSource, ViewRequest},
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_section::{NumberRun, SampleKind, Viewpoint};
use holo_server::Holodeck;
use serde_json::json;

/// Beams of a view, and the samples that each has in the file.
const BEAMS: u64 = 2500;
const SAMPLES_PER_BEAM: u32 = 100;

const WORKERS: usize = 64;
const SLOW_RAY: Duration = Duration::from_micros(500);

/// Beams of the holodeck.
const ALL_BEAMS: u64 = 30 * 64 * 64;

/// Numbers of workers of [`RAY`] that share a fill.
const CREWS: [usize; 3] = [1, 8, 64];
const RAY: Duration = Duration::from_micros(20);

/// Time for which a worker gathers results before it sends them, as `rtworker` does.
const GATHER: Duration = Duration::from_millis(2);

fn main() {
    let mut words = std::env::args().skip(1);
    let seconds: f64 = words.next().map_or(5.0, |word| word.parse().expect("a number of seconds"));
    let changes: u32 = words.next().map_or(200, |word| word.parse().expect("a number of views"));
    let runtime = tokio::runtime::Builder::new_multi_thread();
    let runtime = { runtime }.worker_threads(2).enable_all().build().unwrap();
    let figures = runtime.block_on(runtime.spawn(async move {
        // In turns, so that whatever else the machine does slows both.
        let (mut plain, mut secure) = (Vec::new(), Vec::new());
        for _ in 0..3 {
            plain.push(ingest(seconds / 2.0, false).await);
            secure.push(ingest(seconds / 2.0, true).await);
        }
        let ingests = [median(&mut plain), median(&mut secure)];
        let recalls = [recall(false).await, recall(true).await];
        let mut efficiency = Vec::new();
        for crew in CREWS {
            efficiency.push(json!([crew, share_of(crew, seconds).await]));
        }
        let first = first_samples(changes).await;
        json!({
            "ingest": ingests[0],
            "ingest_secure": ingests[1],
            "first_second": first_second().await,
            "recall_ms": recalls[0],
            "recall_secure_ms": recalls[1],
            "efficiency": efficiency,
            "first_ms": { "half": first[0], "of_100_99": first[1] },
        })
    }));
    println!("{}", figures.unwrap());
    runtime.shutdown_background();
}

/// Starts a server. Returns it, and where its peers connect.
async fn serve(place: &Place, is_secure: bool, is_filling: bool) -> (Server, Destination) {
    let identity = place.file().with_file_name("identity");
    let server = place
        .serve(|config| {
            (config.fill, config.secure, config.identity) = (is_filling, is_secure, Some(identity));
        })
        .await;
    let there = match &server.invitation {
        Some(invitation) => Destination::Invited(Box::new(invitation.clone())),
        None => Destination::Loopback(server.address),
    };
    (server, there)
}

/// Returns the samples per second that a worker returns at once and the server stores.
async fn ingest(seconds: f64, is_secure: bool) -> f64 {
    let place = full_enough();
    let (server, there) = serve(&place, is_secure, true).await;
    let worker = tokio::spawn(work(there));
    let rate = rate(&server, seconds).await;
    server.end().await;
    worker.await.unwrap();
    rate
}

/// Returns the stored share of the samples that a crew of simulated workers could trace.
async fn share_of(crew: usize, seconds: f64) -> f64 {
    let place = full_enough();
    let (server, there) = serve(&place, false, true).await;
    let workers: Vec<_> =
        (0..crew).map(|_| tokio::spawn(simulated_worker(there.clone(), RAY))).collect();
    let rate = rate(&server, seconds).await;
    server.end().await;
    for worker in workers {
        worker.await.unwrap();
    }
    rate * RAY.as_secs_f64() / crew as f64
}

/// Returns a holodeck that gets full packets. Those of an empty one hold few rays, so that all
/// beams get some at once.
fn full_enough() -> Place {
    let place = Place::new();
    store(&place, ALL_BEAMS, 32);
    place
}

/// Returns the samples that a server with an empty file stores in the first second, from a worker
/// that returns them at once.
async fn first_second() -> u64 {
    let place = Place::new();
    let (server, there) = serve(&place, false, true).await;
    let mut admin = Peer::join(server.address, Role::Admin).await;
    let worker = tokio::spawn(work(there));
    while traced(&mut admin).await == 0 {}
    tokio::time::sleep(Duration::from_secs(1)).await;
    let stored = traced(&mut admin).await;
    server.end().await;
    worker.await.unwrap();
    stored
}

/// Returns the samples per second of a server, once its workers' pace is learnt.
async fn rate(server: &Server, seconds: f64) -> f64 {
    tokio::time::sleep(Duration::from_secs_f64(0.2 * seconds)).await;
    let mut admin = Peer::join(server.address, Role::Admin).await;
    let (before, start) = (traced(&mut admin).await, Instant::now());
    tokio::time::sleep(Duration::from_secs_f64(seconds)).await;
    (traced(&mut admin).await - before) as f64 / start.elapsed().as_secs_f64()
}

async fn traced(admin: &mut Peer) -> u64 {
    admin.outbox.control(&Control::ReportWanted).unwrap();
    let is_report = |message: &Message| matches!(message, Message::Control(Control::Report(_)));
    match admin.wait_for(is_report).await {
        Message::Control(Control::Report(report)) => report.traced,
        other => panic!("{other:?}"),
    }
}

fn view(number: u32, first: u64, beams: u64) -> Vec<u8> {
    let wanted =
        |number| RequestedBeam { key: beam(number), weight: 1.0, held: 0, has_earlier: false };
    let viewpoint = Viewpoint { eye: [0.5; 3], radius: 0.1 };
    let beams = (first..first + beams).map(wanted).collect();
    ViewRequest { view: number, viewpoint, beams }.encode()
}

/// Stores so many samples in each of the first beams.
fn store(place: &Place, beams: u64, count: u32) {
    let holodeck = Holodeck::open(&place.file(), 0).unwrap();
    let samples = vec![common::sample(true); count as usize];
    for number in 0..beams {
        let (key, kind) = (beam(number), SampleKind::Uniform);
        let run = NumberRun { key, kind, first: 0, count, paths: 1 };
        holodeck.file.append(run, Maker::UNKNOWN, &samples).unwrap();
    }
    holodeck.file.flush().unwrap();
}

/// Returns the milliseconds from a view to the last of its stored samples.
async fn recall(is_secure: bool) -> f64 {
    let place = Place::new();
    store(&place, BEAMS, SAMPLES_PER_BEAM);
    let (server, there) = serve(&place, is_secure, false).await;
    let mut display = Peer::join(there, Role::Display).await;
    let mut times = Vec::new();
    for number in 1..=10 {
        let start = Instant::now();
        display.send(FrameKind::View, &view(number, 0, BEAMS));
        let mut have = 0;
        loop {
            match display.inbox.next().await.unwrap() {
                Message::Samples(samples) => have += samples.samples.len(),
                Message::Control(Control::StoredSent { view }) if view == number => break,
                _ => {}
            }
        }
        assert_eq!(have, BEAMS as usize * SAMPLES_PER_BEAM as usize);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    server.end().await;
    median(&mut times[1..])
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Returns the milliseconds from a new view to its first newly traced samples: the median and the
/// 99th percentile.
async fn first_samples(changes: u32) -> [f64; 2] {
    let place = Place::new();
    // No beam of a view is in the one before, so nothing that is under way serves it.
    let (server, there) = serve(&place, false, false).await;
    let workers: Vec<_> =
        (0..WORKERS).map(|_| tokio::spawn(simulated_worker(there.clone(), SLOW_RAY))).collect();
    let mut display = Peer::join(there, Role::Display).await;
    let mut times = Vec::new();
    for number in 1..=changes {
        // By now every worker has packets of the view before.
        tokio::time::sleep(Duration::from_millis(300)).await;
        let start = Instant::now();
        display.send(FrameKind::View, &view(number, u64::from(number % 90) * 1000, 1000));
        display
            .wait_for(|message| {
                matches!(message, Message::Samples(samples)
                    if samples.view == number && samples.source == SampleSource::Traced)
            })
            .await;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    server.end().await;
    for worker in workers {
        worker.await.unwrap();
    }
    times.sort_by(f64::total_cmp);
    [times[times.len() / 2], times[times.len() * 99 / 100]]
}

/// A worker of one thread that takes `ray` for a ray. Like a real one, it traces packets in order
/// of arrival, and gathers results for a moment before it sends them.
async fn simulated_worker(server: Destination, ray: Duration) {
    let Peer { mut inbox, outbox, .. } = Peer::join(server, Role::Worker).await;
    outbox.control(&Control::Ready { threads: 1 }).unwrap();
    let took = |packet: &Packet| ray * u32::from(packet.count);
    let mut queue: VecDeque<Packet> = VecDeque::new();
    // When the packets before the queue's first one are done.
    let mut free_at = Instant::now();
    loop {
        let wakes_at = queue.front().map(|packet| free_at + took(packet).max(GATHER));
        tokio::select! {
            message = inbox.next() => match message {
                Ok(Message::Work(work)) => {
                    if queue.is_empty() {
                        free_at = Instant::now();
                    }
                    queue.extend(work.packets);
                }
                Ok(Message::Control(Control::Bye(_))) | Err(_) => return,
                Ok(_) => {}
            },
            () = tokio::time::sleep_until(wakes_at.unwrap_or(free_at).into()), if wakes_at.is_some() => {
                let now = Instant::now();
                let mut done = Vec::new();
                while let Some(packet) = queue.front().copied()
                    && free_at + took(&packet) <= now
                {
                    queue.pop_front();
                    free_at += took(&packet);
                    done.push(packet);
                }
                let mut message = results(&done, true);
                for (traced, packet) in message.packets.iter_mut().zip(&done) {
                    traced.nanoseconds = took(packet).as_nanos() as u32;
                }
                outbox.send(FrameKind::Results, &message.encode()).unwrap();
            }
        }
    }
}
