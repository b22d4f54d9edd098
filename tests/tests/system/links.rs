//! A whole session over links that are far, lose packets, hang and are cut: server, workers and
//! displays, encrypted.

use std::{net::SocketAddr, time::Duration};

use holo_tests::{
    Link, Place, Process, Quality, State, Stored, listen_address, stored, wait_until,
};
use rustix::process::Signal;

/// A hundred milliseconds there and back, and every hundredth piece is lost.
const FAR: Quality =
    Quality { rate: 0, delay: Duration::from_millis(50), lost: 1, state: State::Open };

/// A server that asks for a token, and the string to join it.
struct Server {
    place: Place,
    process: Process,
    join: String,
    local: String,
}

impl Server {
    fn new(words: &[&str]) -> Server {
        let place = Place::new();
        place.fill_small("a.holo", "1k");
        let file = place.text("a.holo");
        let all = ["holoserver", &file, "--listen", "127.0.0.1:0", "--secure", "--with-parent"];
        let identity = ["--identity", "{}/identity", "--json"];
        let mut process = place.start(&[&all[..], &identity, words].concat());
        let join = process.wait_for_line("join with ");
        let local = listen_address(&mut process).to_string();
        Server { place, process, join, local }
    }

    /// Returns a link of this quality to the server, and the string to join through it.
    fn link(&self, quality: Quality) -> (Link, String) {
        let server = self.join.split('/').nth(2).unwrap();
        let link = Link::new(server.parse::<SocketAddr>().unwrap());
        link.set(quality);
        let join = self.join.replace(server, &link.address().to_string());
        (link, join)
    }

    fn worker(&self, join: &str) -> Process {
        let words = ["rtworker", "--join", join, "--threads", "1", "--retry", "120"];
        self.place.start(&[&words[..], &["--with-parent"]].concat())
    }

    fn status(&self) -> serde_json::Value {
        self.place.run(&["status", "--connect", &self.local, "--json"]).ok().json()
    }

    /// Waits until so many workers are there, and each has traced.
    fn wait_for_workers(&self, count: usize) {
        wait_until("workers that trace", || {
            let status = self.status();
            let workers = status["workers"].as_array().unwrap();
            let traces = |worker: &serde_json::Value| worker["rays"].as_u64() > Some(0);
            (workers.len() == count && workers.iter().all(traces)).then_some(())
        });
    }

    fn traced(&self) -> u64 {
        self.status()["traced"].as_u64().unwrap()
    }

    /// Ends the server, and checks that its file holds each sample once. Returns what it holds.
    fn end(self) -> Stored {
        let summary = self.process.end(Signal::TERM).ok().json();
        let stored = stored(&self.place.path("a.holo"));
        assert_eq!(summary["samples"], stored.count());
        self.place.run(&["verify", "{}/a.holo"]).ok();
        stored
    }
}

#[test]
fn a_session_goes_on_over_far_links_that_lose_packets_and_are_cut() {
    let server = Server::new(&["--fill"]);
    let (first, to_first) = server.link(FAR);
    let (_second, to_second) = server.link(FAR);
    let (_third, to_third) = server.link(FAR);
    let workers = [server.worker(&to_first), server.worker(&to_second)];
    server.wait_for_workers(2);
    let words = ["view", "--join", &to_third, "--headless", "--time", "3", "--size", "64x64"];
    let output = server.place.text("a.pfm");
    let viewer = server.place.start(&[&words[..], &["-o", &output, "--json"]].concat());
    let report = viewer.wait().ok().json();
    assert!(report["stored"].as_u64() > Some(0) && report["traced"].as_u64() > Some(0), "{report}");

    first.set(Quality { state: State::Cut, ..FAR });
    workers[0].wait_for_error("trying to reach it again");
    server.wait_for_workers(1);
    let before = server.traced();
    wait_until("the other worker to go on", || (server.traced() > before + 1000).then_some(()));
    first.set(FAR);
    server.wait_for_workers(2);
    server.end();
    for worker in workers {
        worker.wait().ok();
    }
}

#[test]
fn a_link_that_hangs_takes_no_packets_with_it() {
    let server = Server::new(&["--fill"]);
    let (hanging, to_hanging) = server.link(FAR);
    let (_sound, to_sound) = server.link(FAR);
    let workers = [server.worker(&to_hanging), server.worker(&to_sound)];
    server.wait_for_workers(2);
    // The link hangs too briefly for the worker to count as silent: the server takes its packets
    // because they are overdue.
    hanging.set(Quality { state: State::Hangs, ..FAR });
    server.process.wait_for_error("has not returned");
    assert!(!server.process.stderr().contains("left"), "{}", server.process.stderr());
    let before = server.traced();
    wait_until("the other worker to go on", || (server.traced() > before + 1000).then_some(()));
    // Late results count only if no other worker has traced the packet.
    hanging.set(FAR);
    let then = server.traced();
    wait_until("both to go on", || (server.traced() > then + 1000).then_some(()));
    server.wait_for_workers(2);
    // The remaining worker traces the other one's packets.
    let [last, other] = workers;
    other.end(Signal::TERM).ok();
    let file = server.place.path("a.holo");
    wait_until("all numbers", || stored(&file).gap().is_none().then_some(()));
    server.end().assert_no_gaps();
    last.wait().ok();
}
