//! Workers and displays that die, hang or vanish: the others go on, and the work is done again.

use std::net::SocketAddr;

use holo_net::Message;
use holo_proto::{
    control::{Control, Status},
    hello::Role,
};
use holo_tests::{Place, Server, analytic::join, patiently, stored, wait_until};
use rustix::process::Signal;

/// A display that only listens to the server's status.
struct Watcher {
    runtime: tokio::runtime::Runtime,
    inbox: holo_net::Inbox,
    outbox: holo_net::Outbox,
}

impl Watcher {
    fn new(address: SocketAddr) -> Watcher {
        let runtime = tokio::runtime::Runtime::new().unwrap();
        let (inbox, outbox, _) = runtime.block_on(join(address, Role::Display));
        Watcher { runtime, inbox, outbox }
    }

    /// The next status that satisfies `wanted`.
    #[track_caller]
    fn wait(&mut self, what: &str, wanted: impl Fn(&Status) -> bool) -> Status {
        let Watcher { runtime, inbox, outbox } = self;
        wait_until(what, || {
            let message = runtime
                .block_on(async { tokio::time::timeout(holo_tests::LIMIT, inbox.next()).await });
            match message.expect("the server speaks twice a second").expect("the server lives") {
                Message::Control(Control::Ping(number)) => {
                    outbox.control(&Control::Pong(number)).unwrap()
                }
                Message::Control(Control::Status(status)) if wanted(&status) => {
                    return Some(status);
                }
                _ => {}
            }
            None
        })
    }
}

/// Waits for the server's end, and checks that its file holds the reported samples, each number
/// once and none left out.
#[track_caller]
fn ends_complete(place: &Place, server: Server, at_least: u64) {
    let summary = server.process.wait().ok().json();
    assert!(summary["added"].as_u64().unwrap() >= at_least, "{summary}");
    let stored = stored(&place.path("a.holo"));
    assert_eq!(summary["samples"], stored.count());
    stored.assert_no_gaps();
}

#[test]
fn a_worker_killed_and_one_that_only_takes_work_lose_nothing() {
    let place = Place::new();
    // Many paths a sample: some seconds of work, and not so many samples.
    place.fill_small_with("a.holo", "1k", &["--paths-per-sample", "32"]);
    let server = place.server("a.holo", &["--fill", "--samples", "200k", "--json"]);
    let first = place.worker(server.address, &[]);
    let _second = place.worker(server.address, &[]);
    let mut watcher = Watcher::new(server.address);
    watcher.wait("both workers", |status| status.workers == 2);
    // This worker takes packets, does nothing with them, and goes. These are certainly lost and
    // dealt again.
    let idle = tokio::runtime::Runtime::new().unwrap();
    let (mut inbox, outbox, _) = idle.block_on(join(server.address, Role::Worker));
    outbox.control(&Control::Ready { threads: 4 }).unwrap();
    let taken = idle.block_on(async {
        loop {
            if let Message::Work(work) = inbox.next().await.unwrap() {
                return work.packets.len();
            }
        }
    });
    assert!(taken > 10, "{taken} packets");
    drop((inbox, outbox));
    idle.shutdown_background();
    let ended = first.end(Signal::KILL);
    assert_eq!(ended.signal(), Some(9));
    server.process.wait_for_error("left: it closed its connection");
    let after = watcher.wait("the dead to be noticed", |status| status.workers == 1);
    watcher.wait("the other to go on", |status| status.samples > after.samples);
    // Another worker comes when the work is half done.
    let _third = place.worker(server.address, &[]);
    watcher.wait("a third", |status| status.workers == 2);
    drop(watcher);
    ends_complete(&place, server, 200_000);
}

#[test]
fn a_killed_display_harms_no_other_process() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let mut server = place.server("a.holo", &["--json"]);
    let mut worker = place.worker(server.address, &[]);
    let display = place.viewer(server.address, &["--time", "60", "--size", "64x64"]);
    let mut watcher = Watcher::new(server.address);
    let looking = watcher
        .wait("the display to get samples", |status| status.displays == 2 && status.samples > 5000);
    assert_eq!(display.end(Signal::KILL).signal(), Some(9));
    let alone = watcher.wait("the display to be gone", |status| status.displays == 1);
    assert!(alone.samples >= looking.samples);
    assert!(server.process.is_running() && worker.is_running());
    let output = place.text("a.pfm");
    let again = |seconds: u32| {
        let time = seconds.to_string();
        let words = ["--time", &time, "--size", "64x64", "-o", &output, "--json"];
        let report = place.viewer(server.address, &words).wait().ok().json();
        // Samples traced for the dead display are stored.
        assert!(report["stored"].as_u64().unwrap() > 1000, "{report}");
        report["traced"].as_u64().unwrap()
    };
    assert!(patiently(again, |traced| *traced > 0) > 0, "no sample is traced");
    drop(watcher);
    server.process.signal(Signal::TERM);
    ends_complete_after_views(&place, server);
    worker.wait().ok();
}

/// After a display's death packets of its view are forgotten, which leaves gaps in the numbers;
/// nothing is there twice.
#[track_caller]
fn ends_complete_after_views(place: &Place, server: Server) {
    let summary = server.process.wait().ok().json();
    assert_eq!(summary["samples"], stored(&place.path("a.holo")).count());
}

#[test]
fn a_hanging_worker_is_given_up_and_its_packets_are_traced_again() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let mut server = place.server("a.holo", &["--fill", "--json"]);
    let hanging = place.worker(server.address, &[]);
    let mut watcher = Watcher::new(server.address);
    watcher
        .wait("the first worker to work", |status| status.workers == 1 && status.samples > 20_000);
    hanging.signal(Signal::STOP);
    // The hanging worker has packets at any time, and no other worker can trace them before it is
    // given up.
    let _other = place.worker(server.address, &[]);
    let then = watcher.wait("the second worker", |status| status.workers == 2);
    watcher.wait("the second worker to go on alone", |status| status.samples > then.samples + 1000);
    watcher.wait("the hanging worker to be given up", |status| status.workers == 1);
    server.process.wait_for_error("silent for 15 seconds");
    drop(watcher);
    wait_until("the packets of the hanging worker to be traced", || {
        assert!(server.process.is_running());
        stored(&place.path("a.holo")).gap().is_none().then_some(())
    });
    server.process.signal(Signal::TERM);
    ends_complete(&place, server, 20_000);
}

#[test]
fn a_killed_server_loses_only_its_last_samples_and_the_others_say_so() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &["--fill"]);
    let worker = place.worker(server.address, &["--retry", "1"]);
    let display = place.viewer(server.address, &["--time", "60", "--size", "64x64"]);
    let mut watcher = Watcher::new(server.address);
    let status = watcher.wait("samples", |status| status.samples > 50_000);
    // A status counts what the server has in memory too. Whatever a reader finds is on the disk.
    let on_disk = || stored(&place.path("a.holo")).count();
    wait_until("the samples to be on the disk", || (on_disk() >= status.samples).then_some(()));
    assert_eq!(server.process.end(Signal::KILL).signal(), Some(9));
    let stored = stored(&place.path("a.holo"));
    assert!(stored.count() >= status.samples, "{} of {}", stored.count(), status.samples);
    worker.wait().failed(1, &["lost the server", "no holoserver answers"]);
    display.wait().failed(1, &["lost the server"]);
    // If the end is torn, it is left out, and the file is filled further.
    place.fill_small("a.holo", "20k");
    let after = holo_tests::stored(&place.path("a.holo"));
    after.assert_contains(&stored);
    assert!(after.count() >= stored.count() + 20_000);
}

#[test]
fn a_worker_finds_a_server_that_was_started_again() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &["--fill"]);
    let address = server.address.to_string();
    let worker = place.worker(server.address, &[]);
    let mut watcher = Watcher::new(server.address);
    watcher.wait("samples", |status| status.samples > 10_000);
    server.process.end(Signal::KILL);
    worker.wait_for_error("trying to reach it again");
    let file = place.text("a.holo");
    let words = [
        "holoserver",
        &file,
        "--listen",
        &address,
        "--with-parent",
        "--fill",
        "--samples",
        "30k",
        "--json",
    ];
    let summary = place.run(&words).ok().json();
    assert!(summary["added"].as_u64().unwrap() >= 30_000, "{summary}");
    worker.wait().ok();
}
