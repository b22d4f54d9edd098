//! A session under siege: hostile peers of every kind at once, and one honest walker.
//!
//! The siege lasts ten seconds. If `HOLO_SIEGE_SECONDS` names another time, the test also walks
//! without the hostile peers, prints how long the walker waited and how much memory was in use in
//! both sessions, and compares them.

use std::{
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    panic::{AssertUnwindSafe, catch_unwind},
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use holo_net::{Inbox, Message, Outbox};
use holo_proto::{
    bulk::{Results, TracedPacket, WorkPackets},
    control::Control,
    frame::{self, FrameHeader, FrameKind},
    hello::{Hello, Role},
};
use holo_section::{RayCoords, Sample};
use holo_tests::{LIMIT, Place, Process, stored};
use rustix::process::Signal;
use serde_json::{Value, json};
use tokio::runtime::Runtime;
use tokio_tungstenite::tungstenite::{self, WebSocket, client, client::IntoClientRequest};

/// How long the siege lasts if nothing else is said.
const SHORT: Duration = Duration::from_secs(10);

/// Most memory of a process of the session, and most above the session without hostile peers, KiB.
const MOST_MEMORY: u64 = 1 << 20;

/// Longest wait of the walker for the frame of its input in a long siege.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// Connections that a hostile peer holds at a time.
const HELD: usize = 100;

/// Pause of a hostile peer between two attacks.
const PAUSE: Duration = Duration::from_millis(20);

/// Where hostile peers find the session.
#[derive(Clone, Copy)]
struct Targets<'a> {
    server: SocketAddr,
    page: SocketAddr,
    is_over: &'a AtomicBool,
}

/// What a session was like.
#[derive(Debug)]
struct Walk {
    frames: u32,
    longest_wait: Duration,
    /// Peaks of the server's and of the viewer's memory, KiB.
    memory: [u64; 2],
    /// How often each kind of hostile peer reached the session.
    attacks: Vec<u32>,
}

/// Attacks a session, and returns how often that reached it.
type Attack = fn(Targets) -> u32;

impl Targets<'_> {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::SeqCst)
    }

    /// Attacks until the siege is over. `attack` returns whether it reached the session.
    fn attack(self, mut attack: impl FnMut() -> bool) -> u32 {
        let mut reached = 0;
        while !self.is_over() {
            reached += u32::from(attack());
            std::thread::sleep(PAUSE);
        }
        reached
    }
}

/// Connects and sends bytes. Later reads end after a short time.
fn send(address: SocketAddr, bytes: &[u8]) -> Option<TcpStream> {
    let mut stream = TcpStream::connect(address).ok()?;
    stream.set_read_timeout(Some(Duration::from_secs(1))).ok()?;
    stream.write_all(bytes).ok()?;
    Some(stream)
}

/// Sends what is no protocol, to server and page.
fn noise(at: Targets) -> u32 {
    at.attack(|| {
        let sent = [at.server, at.page].map(|address| send(address, &[0xd7; 4096]));
        sent.into_iter().all(|stream| stream.is_some_and(|mut s| s.read(&mut [0; 64]).is_ok()))
    })
}

/// Holds connections that never say all of what they begin to say: a hello, a view, a request.
fn half_sent(at: Targets) -> u32 {
    let hello = Hello::new(Role::Display, "a sleeper").encode();
    let hello = frame::encode(FrameKind::Hello, &hello).unwrap();
    let header = FrameHeader { kind: FrameKind::View, length: 8 << 20 }.to_bytes();
    let view = [&hello[..], &header, &vec![0; 4 << 20]].concat();
    let request: &[u8] = b"GET / HTTP/1.1\r\nHost: ";
    let mut held = std::collections::VecDeque::new();
    at.attack(|| {
        let sent = [(at.server, &hello[..20]), (at.server, &view), (at.page, request)]
            .map(|(address, bytes)| send(address, bytes));
        let is_sent = sent.iter().all(Option::is_some);
        held.extend(sent.into_iter().flatten());
        while held.len() > HELD {
            held.pop_front();
        }
        is_sent
    })
}

/// Asks for large pictures as a foreign page does.
fn foreign_pictures(at: Targets) -> u32 {
    let host = at.page;
    at.attack(|| {
        ["Sec-Fetch-Site: cross-site", "Origin: https://evil.example"].into_iter().all(|header| {
            let request = format!(
                "GET /picture.png?size=8192x8192 HTTP/1.1\r\nHost: {host}\r\n{header}\r\n\r\n"
            );
            let mut start = [0; 12];
            let answer = send(host, request.as_bytes()).map(|mut s| s.read_exact(&mut start));
            let is_answered = answer.is_some_and(|read| read.is_ok());
            assert!(!is_answered || &start == b"HTTP/1.1 403", "{start:?}");
            is_answered
        })
    })
}

/// Opens the page's socket as the page does.
fn open_page(page: SocketAddr) -> Option<WebSocket<TcpStream>> {
    let mut request = format!("ws://{page}/session").into_client_request().ok()?;
    request.headers_mut().insert("origin", format!("http://{page}").parse().ok()?);
    let stream = TcpStream::connect(page).ok()?;
    stream.set_read_timeout(Some(LIMIT)).ok()?;
    Some(client(request, stream).ok()?.0)
}

/// Looks on without reading, and says what a page never says.
fn deaf_pages(at: Targets) -> u32 {
    let mut held = std::collections::VecDeque::new();
    at.attack(|| {
        if let Some(mut page) = open_page(at.page) {
            for text in ["{", r#"{"n":1,"say":{"do":"wheel","steps":1e300}}"#] {
                page.send(tungstenite::Message::Text(text.into())).ok();
            }
        }
        let deaf = open_page(at.page);
        let is_open = deaf.is_some();
        held.extend(deaf);
        while held.len() > HELD {
            held.pop_front();
        }
        is_open
    })
}

/// Waits for what a server says until it is of use, and answers its pings.
async fn listen<T>(
    inbox: &mut Inbox,
    outbox: &Outbox,
    mut is_of_use: impl FnMut(Message) -> Option<T>,
) -> Option<T> {
    let heard = async {
        loop {
            match inbox.next().await.ok()? {
                Message::Control(Control::Ping(number)) => {
                    outbox.control(&Control::Pong(number)).ok()?;
                }
                message => match is_of_use(message) {
                    Some(found) => return Some(found),
                    None => continue,
                },
            }
        }
    };
    tokio::time::timeout(Duration::from_secs(5), heard).await.ok()?
}

/// Joins, if the server takes one more.
async fn join(server: SocketAddr, role: Role) -> Option<(Inbox, Outbox)> {
    let joined = holo_net::connect(server, role, "a guest");
    let (inbox, outbox, _) = tokio::time::timeout(LIMIT, joined).await.ok()?.ok()?;
    Some((inbox, outbox))
}

async fn work(inbox: &mut Inbox, outbox: &Outbox) -> Option<WorkPackets> {
    outbox.control(&Control::Ready { threads: 1 }).ok()?;
    let is_work = |message| match message {
        Message::Work(work) if !work.packets.is_empty() => Some(work),
        _ => None,
    };
    listen(inbox, outbox, is_work).await
}

/// Works as nobody should: light that no lamp gives, and other numbers of samples than requested.
fn cheats(at: Targets) -> u32 {
    let runtime = Runtime::new().unwrap();
    let mut is_short = false;
    at.attack(|| {
        is_short = !is_short;
        runtime.block_on(async {
            let Some((mut inbox, outbox)) = join(at.server, Role::Worker).await else {
                return false;
            };
            let Some(work) = work(&mut inbox, &outbox).await else { return false };
            let sample = Sample::from_codes(RayCoords([0; 4]), [200, 200, 200, 200], 7);
            let packet = work.packets[0];
            let count = u32::from(packet.count) + u32::from(is_short);
            let results = Results {
                packets: vec![TracedPacket { id: packet.id, count, nanoseconds: 1000 }],
                samples: vec![sample; count as usize],
                unseen: Vec::new(),
            };
            outbox.send(FrameKind::Results, &results.encode()).ok();
            listen(&mut inbox, &outbox, |_| None::<()>).await;
            true
        })
    })
}

/// Has views kept without end, and asks for all light again and again.
fn greedy_displays(at: Targets) -> u32 {
    let runtime = Runtime::new().unwrap();
    let mut number = 0;
    at.attack(|| {
        runtime.block_on(async {
            let Some((mut inbox, outbox)) = join(at.server, Role::Display).await else {
                return false;
            };
            for _ in 0..100 {
                number += 1;
                let (name, options) = (format!("view {number}"), "x".repeat(1000));
                outbox.control(&Control::KeepView { name, options }).ok();
                outbox.control(&Control::Settle { view: number }).ok();
            }
            listen(&mut inbox, &outbox, |message| {
                matches!(message, Message::Control(Control::Bye(_))).then_some(())
            })
            .await;
            true
        })
    })
}

/// Time after which a session that answers no input hangs.
const ANSWERED: Duration = Duration::from_secs(60);

/// Walks for a time, looks at the session with `look`, and ends it. Returns the number of frames,
/// the longest wait for one, and what `look` returned.
fn walk<T>(page: SocketAddr, time: Duration, look: impl FnOnce() -> T) -> (u32, Duration, T) {
    let mut socket = open_page(page).expect("the page takes an honest walker");
    let mut number = 0;
    let mut say = |socket: &mut WebSocket<TcpStream>, say: Value| {
        number += 1;
        let text = json!({ "n": number, "say": say }).to_string();
        socket.send(tungstenite::Message::Text(text.into())).expect("the walker is heard");
        number
    };
    say(&mut socket, json!({ "do": "take_over" }));
    let (start, mut frames, mut longest) = (Instant::now(), 0, Duration::ZERO);
    while start.elapsed() < time {
        let asked = Instant::now();
        let right = if frames % 20 < 10 { 0.05 } else { -0.05 };
        let input = say(&mut socket, json!({ "do": "turn", "right": right, "up": 0.0 }));
        loop {
            assert!(asked.elapsed() < ANSWERED, "the session answers no input: {frames} frames");
            let tungstenite::Message::Binary(bytes) = socket.read().expect("the session goes on")
            else {
                continue;
            };
            let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
            let header: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
            say(&mut socket, json!({ "do": "shown", "update": header["update"] }));
            if header["input"].as_u64() >= Some(input) {
                break;
            }
        }
        longest = longest.max(asked.elapsed());
        frames += 1;
        std::thread::sleep(PAUSE);
    }
    let seen = look();
    say(&mut socket, json!({ "do": "command", "line": "quit" }));
    // A socket that is closed with bytes to read takes back what it has sent.
    while socket.read().is_ok() {}
    (frames, longest, seen)
}

/// Returns the most memory that a process has had, KiB.
fn peak(process: &Process) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

/// Walks in a session on a new file, with hostile peers or without. Checks what the file has then.
fn session(time: Duration, attacks: &[Attack]) -> Walk {
    let place = Place::new();
    place.fill_small_with("a.holo", "200k", &["--bounces", "0"]);
    let mut server = place.server("a.holo", &["--fill", "--json"]);
    let worker = place.worker(server.address, &[]);
    let view = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60"];
    let join = server.address.to_string();
    let words = ["view", "--join", &join, "--no-open"];
    let mut viewer = place.start(&[&words[..], &view].concat());
    let page = viewer.wait_for_line("http://").trim_end_matches('/').parse().unwrap();

    let is_over = AtomicBool::new(false);
    let targets = Targets { server: server.address, page, is_over: &is_over };
    let walk = std::thread::scope(|scope| {
        let attacks: Vec<_> =
            attacks.iter().map(|attack| scope.spawn(move || attack(targets))).collect();
        let memory = || [&server.process, &viewer].map(peak);
        let walked = catch_unwind(AssertUnwindSafe(|| walk(page, time, memory)));
        is_over.store(true, Ordering::SeqCst);
        let (frames, longest_wait, memory) = walked.unwrap();
        let attacks = attacks.into_iter().map(|attack| attack.join().unwrap()).collect();
        Walk { frames, longest_wait, memory, attacks }
    });
    viewer.wait().ok();
    assert!(server.process.is_running(), "{}", server.process.stderr());
    let ended = server.process.end(Signal::TERM).ok();
    assert!(!ended.stderr.contains("panicked"), "{}", ended.stderr);
    worker.wait().ok();

    // Every sample is there once, and shows the room. What hostile workers held at the end is
    // missing.
    let stored = stored(&place.path("a.holo"));
    assert_eq!(ended.json()["samples"], stored.count());
    let (missing, count) = (stored.missing(), stored.count());
    assert!(missing * 100 < count, "{missing} of {count} samples are missing");
    place.run(&["verify", "{}/a.holo"]).ok();
    let size = ["--size", "64x64", "-o"];
    let truth = ["render", "{}/cornell.obj", "--bounces", "0", "--spp", "64", "--quiet"];
    place.run(&[&truth[..], &view, &size, &["{}/truth.pfm"]].concat()).ok();
    let picture = ["picture", "{}/a.holo", "--denoise", "off"];
    place.run(&[&picture[..], &view, &size, &["{}/a.pfm"]].concat()).ok();
    let found = place.run(&["compare", "{}/a.pfm", "{}/truth.pfm", "--json"]).ok().json();
    assert!(found["bias"].as_f64().unwrap().abs() < 0.02, "{found}");
    walk
}

#[test]
fn a_session_under_siege_loses_nothing_and_goes_on() {
    let attacks = [noise, half_sent, foreign_pictures, deaf_pages, cheats, greedy_displays];
    let seconds = std::env::var("HOLO_SIEGE_SECONDS").ok();
    let long = seconds.map(|seconds| Duration::from_secs(seconds.parse().expect("seconds")));
    let walk = session(long.unwrap_or(SHORT), &attacks);
    println!("under siege: {walk:?}");
    assert!(walk.attacks.iter().all(|&count| count > 0) && walk.frames > 0, "{walk:?}");
    // A session that lasts keeps more light, with hostile peers or without.
    let quiet = match long {
        Some(time) => {
            let quiet = session(time, &[]);
            println!("quiet: {quiet:?}");
            quiet.memory
        }
        // As much as the light of a session may take.
        None => [MOST_MEMORY; 2],
    };
    for (peak, quiet) in walk.memory.into_iter().zip(quiet) {
        assert!(peak < quiet + MOST_MEMORY, "{peak} KiB, {quiet} KiB when it is quiet");
    }
    if long.is_some() {
        assert!(walk.longest_wait < LONGEST_WAIT, "{:?}", walk.longest_wait);
    }
}
