//! A server in this process, and peers for it.
// Helpers are tests, too, and each test file uses some of them.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{future::Future, net::SocketAddr, path::PathBuf, time::Duration};

use holo_net::{Destination, Inbox, Invitation, MachineKey, Message, NetError, Outbox, Shutdown};
use holo_proto::{
    bulk::{Packet, RequestedBeam, Results, TracedPacket, ViewRequest, WorkPackets},
    control::{Control, Farewell, RenderSettings, Welcome},
    frame::FrameKind,
    hello::Role,
};
use holo_section::{BeamId, BeamKey, RayCoords, Sample, SectionSpec, ViewClass, Viewpoint};
use holo_server::{Config, Holodeck, HolodeckDescription, RadianceLimits, Ready, Summary};
use tokio::{sync::oneshot, task::JoinHandle, time::timeout};

/// Longest wait in a test, in real time.
pub const LIMIT: Duration = Duration::from_secs(120);

/// Runs a test. If it fails, its server is not waited for, because it would never end.
pub fn run(test: impl Future<Output = ()> + Send + 'static) {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let result = runtime.block_on(runtime.spawn(test));
    runtime.shutdown_background();
    result.unwrap();
}

/// Waits for something that must happen.
pub async fn in_time<T>(what: impl Future<Output = T>) -> T {
    timeout(LIMIT, what).await.expect("in time")
}

/// A request for a view of the first beams.
pub fn view(view: u32, beams: u64) -> Vec<u8> {
    let wanted =
        |number| RequestedBeam { key: beam(number), weight: 1.0, held: 0, has_earlier: false };
    let viewpoint = Viewpoint { eye: [0.5; 3], radius: 0.1 };
    ViewRequest { view, viewpoint, beams: (0..beams).map(wanted).collect() }.encode()
}

/// A beam of the only section.
pub fn beam(beam: u64) -> BeamKey {
    BeamKey { section: 0, beam: BeamId(beam) }
}

/// A folder with a holodeck of one section.
pub struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    pub fn new() -> Place {
        Place::of_scene(b"a scene")
    }

    pub fn of_scene(scene: &[u8]) -> Place {
        Place::of(scene, [8; 3])
    }

    /// Makes a holodeck whose section has this grid.
    pub fn of(scene: &[u8], grid: [u32; 3]) -> Place {
        let folder = tempfile::tempdir().unwrap();
        let spec = SectionSpec {
            origin: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            grid,
            class: ViewClass::Interior,
            obstructions: true,
        };
        let settings = RenderSettings::default();
        let place = Place { folder };
        let mut about = HolodeckDescription::new(vec![spec], settings, scene, "a test".into());
        about.limits = Some(RadianceLimits { low: [0.0; 3], high: [1.0; 3], brightest: 1.0 });
        Holodeck::create(&place.file(), about, scene, 1 << 20).unwrap();
        place
    }

    pub fn file(&self) -> PathBuf {
        self.folder.path().join("a.holo")
    }

    /// Starts a server, after `change` of its options.
    pub async fn serve(&self, change: impl FnOnce(&mut Config)) -> Server {
        let mut config = Config::new(self.file());
        change(&mut config);
        let shutdown = Shutdown::new();
        let (sender, ready) = oneshot::channel();
        let run = holo_server::run(config, shutdown.clone(), move |ready| {
            sender.send(ready).unwrap();
        });
        let task = tokio::spawn(run);
        let Ready { address, outside } = in_time(ready).await.unwrap();
        let invitation = outside.map(|outside| outside.invitation);
        Server { address, invitation, shutdown, task }
    }
}

/// A running server.
pub struct Server {
    pub address: SocketAddr,
    pub invitation: Option<Invitation>,
    pub shutdown: Shutdown,
    task: JoinHandle<anyhow::Result<Summary>>,
}

impl Server {
    /// Ends it.
    pub async fn end(self) -> Summary {
        self.shutdown.trigger();
        self.ended().await
    }

    /// Waits until it has ended by itself.
    pub async fn ended(self) -> Summary {
        in_time(self.task).await.unwrap().unwrap()
    }
}

impl Server {
    /// Waits until it has ended by an error, and returns the error's text.
    pub async fn failed(self) -> String {
        format!("{:#}", in_time(self.task).await.unwrap().unwrap_err())
    }
}

/// One connected peer.
pub struct Peer {
    pub inbox: Inbox,
    pub outbox: Outbox,
    pub welcome: Welcome,
}

impl Peer {
    pub async fn join(server: impl Into<Destination>, role: Role) -> Peer {
        let joined = in_time(holo_net::connect(server, role, "a test")).await;
        let (inbox, outbox, welcome) = joined.expect("the server takes us");
        Peer { inbox, outbox, welcome }
    }

    /// Joins as [`join`](Self::join) does. Names are of one machine if they are the same up to
    /// ` #`.
    pub async fn named(server: impl Into<Destination>, role: Role, name: &str) -> Peer {
        let machine = machine(name);
        let joined = in_time(holo_net::connect_as(server, role, name, Some(&machine))).await;
        let (inbox, outbox, welcome) = joined.expect("the server takes us");
        Peer { inbox, outbox, welcome }
    }

    pub fn send(&self, kind: FrameKind, payload: &[u8]) {
        self.outbox.send(kind, payload).unwrap();
    }

    /// Waits for a message. Others that come meanwhile do not make the wait longer.
    pub async fn wait_for(&mut self, wanted: impl Fn(&Message) -> bool) -> Message {
        in_time(async {
            loop {
                let message = self.inbox.next().await.expect("the server lives");
                if wanted(&message) {
                    return message;
                }
            }
        })
        .await
    }

    /// Waits for packets.
    pub async fn work(&mut self) -> Vec<Packet> {
        match self.wait_for(|message| matches!(message, Message::Work(_))).await {
            Message::Work(work) => work.packets,
            other => panic!("{other:?}"),
        }
    }

    /// Waits until so many samples have come.
    pub async fn samples(&mut self, count: usize) {
        let mut have = 0;
        while have < count {
            let message = self.wait_for(|message| matches!(message, Message::Samples(_))).await;
            if let Message::Samples(samples) = message {
                have += samples.samples.len();
            }
        }
    }

    /// Waits for the end, and returns the reason that was given.
    pub async fn expelled(&mut self) -> Option<String> {
        in_time(async {
            let mut said = None;
            loop {
                match self.inbox.next().await {
                    Ok(Message::Control(Control::Bye(farewell))) => {
                        said = Some(farewell.to_string());
                    }
                    Ok(_) => {}
                    Err(_) => return said,
                }
            }
        })
        .await
    }
}

/// Returns the key of the machine of a name.
pub fn machine(name: &str) -> MachineKey {
    let name = name.split(" #").next().unwrap().as_bytes();
    let mut secret = [0; 32];
    secret[..name.len()].copy_from_slice(name);
    MachineKey::of_secret(&secret).unwrap()
}

/// Returns the sample of a ray that hits something, or nothing.
pub fn sample(hits: bool) -> Sample {
    let (colour, distance) = if hits { ([128, 64, 32, 128], 77) } else { ([0; 4], u16::MAX) };
    Sample::from_codes(RayCoords::default(), colour, distance)
}

/// Returns the results of packets whose rays hit something or nothing.
pub fn results<'a>(packets: impl IntoIterator<Item = &'a Packet>, hits: bool) -> Results {
    let mut results = Results::default();
    for packet in packets {
        let count = u32::from(packet.count);
        results.packets.push(TracedPacket { id: packet.id, count, nanoseconds: 1000 });
        results.samples.extend(std::iter::repeat_n(sample(hits), count as usize));
    }
    results
}

/// Joins as a worker whose rays all hit something, until the server says goodbye or goes.
pub async fn work(server: impl Into<Destination>) {
    work_as(server, |work| results(&work.packets, true)).await;
}

/// As [`work`], under a name.
pub async fn work_named(server: impl Into<Destination>, name: &str) {
    work_as_named(server, name, |work| results(&work.packets, true)).await;
}

/// Joins as a worker of a new machine that answers as `answer` says. Returns why the server ended
/// the session.
pub async fn work_as(
    server: impl Into<Destination>,
    answer: impl Fn(&WorkPackets) -> Results,
) -> Option<Farewell> {
    answer_work(Peer::join(server, Role::Worker).await, answer).await
}

/// As [`work_as`], of the machine with this name.
pub async fn work_as_named(
    server: impl Into<Destination>,
    name: &str,
    answer: impl Fn(&WorkPackets) -> Results,
) -> Option<Farewell> {
    answer_work(Peer::named(server, Role::Worker, name).await, answer).await
}

async fn answer_work(worker: Peer, answer: impl Fn(&WorkPackets) -> Results) -> Option<Farewell> {
    let Peer { mut inbox, outbox, .. } = worker;
    outbox.control(&Control::Ready { threads: 1 }).unwrap();
    loop {
        match inbox.next().await {
            Ok(Message::Work(work)) => {
                outbox.send(FrameKind::Results, &answer(&work).encode()).unwrap();
            }
            Ok(Message::Control(Control::Bye(farewell))) => return Some(farewell),
            Ok(_) => {}
            Err(NetError::Closed | NetError::Io(_)) => return None,
            Err(error) => panic!("{error}"),
        }
    }
}
