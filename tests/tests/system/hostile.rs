//! Clients that break the rules: each is dropped with a reason, and the others go on.

use std::{
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
};

use holo_net::{Inbox, Message, Outbox};
use holo_proto::{
    PROTOCOL_VERSION,
    bulk::{
        LiveHit, LiveRay, LiveResults, LiveSamples, LiveWanted, MAX_LIVE_RAYS, Packet, RaysWanted,
        RequestedBeam, Results, TracedPacket, ViewRequest, WantedRay, WorkPackets,
    },
    control::Control,
    frame::{self, FrameKind},
    hello::{Answer, Hello, Role},
};
use holo_section::{BeamId, BeamKey, RayCoords, Sample, SampleKind, Viewpoint};
use holo_tests::{LIMIT, Place, Server, analytic::join, beam, patiently, stored, wait_until};
use rustix::process::Signal;

/// Sends bytes, and returns the answer until the server closes the connection.
fn answer(address: SocketAddr, bytes: &[u8]) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    stream.write_all(bytes).unwrap();
    let mut back = Vec::new();
    match stream.read_to_end(&mut back) {
        Ok(_) => back,
        // Unread bytes at the end turn the close into a reset.
        Err(error) if error.kind() == std::io::ErrorKind::ConnectionReset => back,
        Err(error) => panic!("the connection was not closed: {error}"),
    }
}

fn refusal(bytes: &[u8]) -> String {
    match Answer::decode(&bytes[frame::HEADER_BYTES..]).unwrap() {
        Answer::Refused(reason) => reason,
        Answer::Accepted => panic!("it was taken"),
    }
}

/// A server that fills with a worker of its own, which hostile clients must not disturb.
fn busy(place: &Place) -> (Server, holo_tests::Process) {
    place.fill_small("a.holo", "1k");
    // Beams that see nothing are traced too. Otherwise a cheat's samples in such a beam would be
    // the only ones.
    let server = place.server("a.holo", &["--fill", "--json", "--no-skip-unseen"]);
    let worker = place.worker(server.address, &[]);
    server.process.wait_for_error("joined");
    (server, worker)
}

/// Checks that the server still shows, its worker still traces, and every sample is there once.
fn went_on(place: &Place, mut server: Server, mut worker: holo_tests::Process) {
    assert!(server.process.is_running() && worker.is_running(), "{}", server.process.stderr());
    let output = place.text("a.pfm");
    let traced = |seconds: u32| {
        let time = seconds.to_string();
        let words = ["--time", &time, "--size", "32x32", "-o", &output, "--json"];
        let report = place.viewer(server.address, &words).wait().ok().json();
        report["traced"].as_u64().unwrap()
    };
    assert!(patiently(traced, |traced| *traced > 0) > 0, "no sample is traced");
    let ended = server.process.end(Signal::TERM).ok();
    assert!(!ended.stderr.contains("panicked"), "{}", ended.stderr);
    worker.wait().ok();
    let stored = stored(&place.path("a.holo"));
    assert_eq!(ended.json()["samples"], stored.count());
    stored.assert_no_gaps();
}

#[test]
fn who_does_not_speak_the_protocol_is_dropped() {
    let place = Place::new();
    let (server, worker) = busy(&place);
    let address = server.address;
    assert_eq!(answer(address, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"), b"", "a browser");
    assert_eq!(answer(address, &[0xff; 4096]), b"", "noise");
    // A hello that claims to be longer than allowed is refused by its header, before its bytes are
    // read or kept.
    assert_eq!(answer(address, &[0xff, 0xff, 0xff, 0x7f, FrameKind::Hello as u8, 0, 0, 0]), b"");
    // The first frame is not a hello, but otherwise correct.
    assert_eq!(
        answer(address, &frame::encode(FrameKind::Work, &WorkPackets::default().encode()).unwrap()),
        b""
    );
    let mut hello = Hello::new(Role::Display, "a visitor");
    hello.version += 7;
    let reason =
        refusal(&answer(address, &frame::encode(FrameKind::Hello, &hello.encode()).unwrap()));
    let said = format!("version {}, this program speaks {PROTOCOL_VERSION}", hello.version);
    assert!(reason.contains(&said), "{reason}");
    let mut bytes = Hello::new(Role::Display, "a visitor").encode();
    bytes[10] = 9;
    let reason = refusal(&answer(address, &frame::encode(FrameKind::Hello, &bytes).unwrap()));
    assert!(reason.contains("role 9"), "{reason}");
    // The server does not wait long for a silent client, and meanwhile serves others.
    let silent = TcpStream::connect(address).unwrap();
    silent.set_read_timeout(Some(LIMIT)).unwrap();
    let closed = std::thread::spawn(move || (&silent).read(&mut [0]).unwrap());
    went_on_while(&place, address);
    assert_eq!(closed.join().unwrap(), 0, "the silent one's connection is closed");
    went_on(&place, server, worker);
}

fn went_on_while(place: &Place, address: SocketAddr) {
    let output = place.text("meanwhile.pfm");
    place.viewer(address, &["--time", "0.1", "--size", "16x16", "-o", &output]).wait().ok();
}

/// Waits until the server ends a connection, and gives the reason it gave, if any.
async fn dropped((mut inbox, outbox): (Inbox, Outbox)) -> Option<String> {
    let mut reason = None;
    loop {
        match tokio::time::timeout(LIMIT, inbox.next()).await.expect("the connection is ended") {
            Ok(Message::Control(Control::Bye(said))) => reason = Some(said.to_string()),
            Ok(Message::Control(Control::Ping(number))) => {
                outbox.control(&Control::Pong(number)).unwrap()
            }
            Ok(_) => {}
            Err(_) => return reason,
        }
    }
}

async fn next_work(inbox: &mut Inbox) -> WorkPackets {
    loop {
        if let Message::Work(work) =
            tokio::time::timeout(LIMIT, inbox.next()).await.unwrap().unwrap()
        {
            return work;
        }
    }
}

#[test]
fn displays_that_break_the_rules_are_dropped() {
    let place = Place::new();
    let (server, worker) = busy(&place);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let viewpoint = Viewpoint { eye: [2.0, 2.0, -1.0], radius: 0.01 };
        let view = |section, beam, weight| {
            ViewRequest {
                view: 1,
                viewpoint,
                beams: vec![RequestedBeam {
                    key: BeamKey { section, beam: BeamId(beam) },
                    weight,
                    held: 0,
                    has_earlier: false,
                }],
            }
            .encode()
        };
        let coords = RayCoords::default();
        let rays =
            RaysWanted { view: 1, rays: vec![WantedRay { key: beam(7_680), coords }] }.encode();
        let live = |direction: [f64; 3], count: usize| {
            let rays = vec![LiveRay { origin: [0.0; 3], direction, number: 1 }; count];
            LiveWanted { view: 1, pixels: 1, rays }.encode()
        };
        let samples = LiveSamples { view: 1, samples: Vec::new() }.encode();
        let bad = [
            (FrameKind::LiveWanted, live([1.0, 1.0, 0.0], 1), "a ray's direction"),
            (
                FrameKind::LiveWanted,
                live([1.0, 0.0, 0.0], MAX_LIVE_RAYS + 1),
                "live rays, more than the 16384 allowed",
            ),
            (FrameKind::LiveSamples, samples, "not for a server"),
            (FrameKind::LiveResults, LiveResults::default().encode(), "not for a server"),
            (FrameKind::Rays, rays.clone(), "rays of beams that do not exist"),
            (FrameKind::Rays, rays[..20].to_vec(), "ray list"),
            (FrameKind::View, view(0, 7_680, 1.0), "beams that do not exist"),
            (FrameKind::View, view(1, 0, 1.0), "beams that do not exist"),
            (FrameKind::View, view(0, u64::MAX, 1.0), "beams that do not exist"),
            (FrameKind::View, view(0, 0, f32::NAN), "weight"),
            (FrameKind::View, view(0, 0, 1.0)[..45].to_vec(), "beam list"),
            (FrameKind::Results, Results::default().encode(), "not for a server"),
            (
                FrameKind::Control,
                Control::Ready { threads: 3 }.encode().unwrap(),
                "not for a server",
            ),
            (FrameKind::Control, vec![0xee; 40], "malformed control message"),
        ];
        for (kind, payload, reason) in bad {
            let (inbox, outbox, _) = join(server.address, Role::Display).await;
            outbox.send(kind, &payload).unwrap();
            let said = dropped((inbox, outbox)).await;
            assert!(
                said.as_ref().is_some_and(|said| said.contains(reason)),
                "`{reason}`: {said:?}"
            );
            server.process.wait_for_error(reason);
        }
    });
    went_on(&place, server, worker);
}

#[test]
fn frames_that_are_too_long_are_not_even_read() {
    let place = Place::new();
    let (server, worker) = busy(&place);
    let mut bytes =
        frame::encode(FrameKind::Hello, &Hello::new(Role::Display, "a giant").encode()).unwrap();
    bytes.extend([0xff, 0xff, 0xff, 0xff, FrameKind::View as u8, 0, 0, 0]);
    // The answer, the welcome, and then the end instead of a wait for four gigabytes.
    assert!(!answer(server.address, &bytes).is_empty());
    server.process.wait_for_error("more than the 16777216 allowed");
    went_on(&place, server, worker);
}

/// Returns a number of rays that a packet may have, but not the requested one. It differs by
/// `change`, or by as much in the other direction.
fn more_or_less(asked: u8, change: i32) -> u32 {
    let asked = i32::from(asked);
    let changed =
        if (1..=21).contains(&(asked + change)) { asked + change } else { asked - change };
    u32::try_from(changed).unwrap()
}

#[test]
fn workers_that_cheat_are_dropped_and_their_packets_traced_by_others() {
    let place = Place::new();
    let (server, worker) = busy(&place);
    let sample = Sample::from_codes(RayCoords([0; 4]), [200, 200, 200, 200], 7);
    let mut given: Vec<Packet> = Vec::new();
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        type Cheat = fn(&WorkPackets) -> (u64, u32);
        let cheats: [(Cheat, &str); 3] = [
            (|_| (u64::MAX, 1), "a packet that it was not given"),
            (
                |work| (work.packets[0].id, more_or_less(work.packets[0].count, 1)),
                "samples for a packet of",
            ),
            (
                |work| (work.packets[1].id, more_or_less(work.packets[1].count, -1)),
                "samples for a packet of",
            ),
        ];
        for (cheat, reason) in cheats {
            let (mut inbox, outbox, _) = join(server.address, Role::Worker).await;
            outbox.control(&Control::Ready { threads: 1 }).unwrap();
            let work = next_work(&mut inbox).await;
            given.extend(&work.packets);
            let (id, count) = cheat(&work);
            let results = Results {
                packets: vec![TracedPacket { id, count, nanoseconds: 1000 }],
                samples: vec![sample; count as usize],
                unseen: Vec::new(),
            };
            outbox.send(FrameKind::Results, &results.encode()).unwrap();
            let said = dropped((inbox, outbox)).await;
            assert!(
                said.as_ref().is_some_and(|said| said.contains(reason)),
                "`{reason}`: {said:?}"
            );
            server.process.wait_for_error(reason);
        }
        // Live rays that it was not given.
        let (inbox, outbox, _) = join(server.address, Role::Worker).await;
        let results = LiveResults {
            packets: vec![TracedPacket { id: 1, count: 0, nanoseconds: 1 }],
            hits: Vec::new(),
        };
        outbox.send(FrameKind::LiveResults, &results.encode()).unwrap();
        assert!(
            dropped((inbox, outbox)).await.is_some_and(|said| said.contains("a packet of 0 rays"))
        );
        let (inbox, outbox, _) = join(server.address, Role::Worker).await;
        let hit = LiveHit { radiance: [1.0; 3], distance: 1.0 };
        let results = LiveResults {
            packets: vec![TracedPacket { id: 1, count: 1, nanoseconds: 1 }],
            hits: vec![hit],
        };
        outbox.send(FrameKind::LiveResults, &results.encode()).unwrap();
        assert!(
            dropped((inbox, outbox))
                .await
                .is_some_and(|said| said.contains("a packet that it was not given"))
        );
        // The same packet twice; the first time it is accepted.
        let (mut inbox, outbox, _) = join(server.address, Role::Worker).await;
        outbox.control(&Control::Ready { threads: 1 }).unwrap();
        let work = next_work(&mut inbox).await;
        given.extend(&work.packets);
        let packet = work.packets[0];
        let count = u32::from(packet.count);
        let traced = TracedPacket { id: packet.id, count, nanoseconds: 1000 };
        let results = Results {
            packets: vec![traced],
            samples: vec![sample; count as usize],
            unseen: vec![],
        }
        .encode();
        outbox.send(FrameKind::Results, &results).unwrap();
        outbox.send(FrameKind::Results, &results).unwrap();
        let said = dropped((inbox, outbox)).await;
        assert!(said.is_some_and(|said| said.contains("a packet that it was not given")));
    });
    wait_until("the cheats' packets to be traced by the other worker", || {
        let stored = stored(&place.path("a.holo"));
        let is_stored = |packet: &Packet| {
            let key = packet.key;
            let mut numbers = packet.first..packet.first + u32::from(packet.count);
            numbers.all(|number| stored.has(key, SampleKind::Uniform, number))
        };
        given.iter().all(is_stored).then_some(())
    });
    went_on(&place, server, worker);
}
